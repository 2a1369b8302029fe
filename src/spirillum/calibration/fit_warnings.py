"""Warnings of a fit: misfit, outliers, values far from their prior; and the refusal of an implausible one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.experiment import Experiment, Quantity
from spirillum.calibration.identifiability import FAR
from spirillum.calibration.least_squares import FEWEST_LEFT, LeastSquares
from spirillum.calibration.likelihood import ERROR_SCALE
from spirillum.calibration.parameters import Estimate, Uniform
from spirillum.calibration.problem import Problem, UnexplainedError
from spirillum.display import percent
from spirillum.errors import InputError
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import (
    BEYOND_STOKES,
    body_reynolds,
    reynolds_limits,
    reynolds_warnings,
    stokes_flow_problem,
    tail_reynolds,
)
from spirillum.robust import mad_scale

RATES_IN_RADIANS = Note.named("rates-in-radians")  #: Where most robots need more torque than their motors give.
CALLED: dict[Quantity, str] = {"advance": "speed", "turning": "body rate", "motor_rate": "motor rate"}
"""Name of each compared quantity in a sentence."""
_LARGE_MISFIT = 0.03  # relative misfit from which on a warning states it
_BEYOND_TRIALS = 2.0 * ERROR_SCALE  # discrepancy larger than any plausible relative error of a trial
_IMPLAUSIBLE_FACTOR = 10.0  # median misfit, as a factor, beyond which observations and model differ in robot or units
_PRINTED = 0.1  # relative difference of the body's rates beyond which a friction model contradicts the observations
_IMPLAUSIBLE_DISTANCE = 5.0  # standard deviations from the median of a wide prior beyond which a fit is refused
_WIDE = 0.5  # smallest logarithmic standard deviation of a prior that is called wide
_EDGE, _PILED = 0.05, 0.4
"""Outermost share of a bounded prior, and the share of a posterior in it from which on its end decides the interval."""
_OUTLYING, _LEAST_OUTLYING = 6.0, 0.2  # robust standard deviations, and relative deviation, of an outlying robot


def check_plausible(problem: Problem, z: Samples) -> None:
    """Raise `UnexplainedError` for an implausible fit: most often the observations are in other units."""
    source, model = problem.experiment.source, problem.model.name
    for name, values in problem.predicted_at(z).items():
        ratio = problem.ratio(name)
        with np.errstate(divide="ignore", invalid="ignore"):
            off = np.abs(np.log(np.abs(ratio.mean / values)))[ratio.is_observed]
        if float(np.median(off)) > np.log(_IMPLAUSIBLE_FACTOR):
            factor = float(np.exp(np.median(np.log(np.abs(ratio.mean / values))[ratio.is_observed])))
            raise UnexplainedError(
                f"{source}: the observed {CALLED[name]} is typically {factor:.3g} times what model '{model}' can "
                "explain; allowed: within a factor of ten (are the columns in mm, mm/s and Hz?)"
            )
    for item, place in zip(problem.coordinates, z, strict=True):
        if abs(place) > _IMPLAUSIBLE_DISTANCE and getattr(item.prior, "spread", 0.0) >= _WIDE:
            value = problem.values_at(z)[item.label]
            raise UnexplainedError(
                f"{source}: {item.label} comes out as {value:.3g}; allowed: observations that a number nearer to its "
                f"prior explains ({item.prior.words(item.parameter.unit)}; are the columns in mm, mm/s and Hz?)"
            )


def prior_warnings(problem: Problem, z: Samples) -> list[Note]:
    """Fitted values far out in their prior."""
    values = problem.values_at(z)
    found = []
    for item, place in zip(problem.coordinates, z, strict=True):
        if abs(place) > FAR:
            prior, said = item.prior.words(item.parameter.unit), {"label": item.label, "value": values[item.label]}
            found.append(Note.named("far-from-prior", off=abs(place), prior=prior, fields=(item.label,), **said))
    return found


def edge_warnings(problem: Problem, draws: Samples) -> list[Note]:
    """Posteriors that pile up at an end of their prior, which then decides their interval."""
    from scipy.special import ndtr

    found = []
    for item, place in zip(problem.coordinates, draws.T, strict=True):
        if not isinstance(item.prior, Uniform):
            continue
        share = ndtr(place)  # of the prior below a draw
        for end, value, near in (
            ("lower", item.prior.low, float(np.mean(share < _EDGE))),
            ("upper", item.prior.high, float(np.mean(share > 1.0 - _EDGE))),
        ):
            if near > _PILED:
                said = {"label": item.label, "share": percent(near), "end": end, "fields": (item.label,)}
                found.append(Note.named("at-end-of-prior", value=f"{value:.3g} {item.parameter.unit}".rstrip(), **said))
    return found


def outlier_warnings(problem: Problem, z: Samples) -> list[Note]:
    """Outliers: rows whose trial, or whose robot, deviates from all others."""
    experiment = problem.experiment
    found = list(experiment.outliers)
    for name, values in problem.predicted_at(z).items():
        ratio = problem.ratio(name)
        relative = np.where(ratio.is_observed, ratio.mean / values - 1.0, np.nan)
        if np.count_nonzero(ratio.is_observed) < 5:
            continue
        off = np.abs(relative - np.nanmedian(relative))
        limit = max(_OUTLYING * float(mad_scale(off)), _LEAST_OUTLYING)
        for place in np.flatnonzero(np.nan_to_num(off) > limit).tolist():
            rows = ", ".join(str(row) for row in experiment.rows[place])
            said = {"rows": rows, "called": CALLED[name], "robot": experiment.labels()[place], "fields": (name,)}
            found.append(Note.named("outlying-tail", off=percent(float(relative[place])), **said))
    return found


def misfit_warnings(problem: Problem, discrepancy: Mapping[Quantity, Estimate], fit: LeastSquares) -> list[Note]:
    """State the model's discrepancy, so that a wrong model does not look certain."""
    found, left = [], _misfits(problem, fit.z)
    for name, size in discrepancy.items():
        words = {"model": problem.model.name, "called": CALLED[name], "fields": (name,)}
        misfit = min(size.value, fit.discrepancy[name])  # by the residuals, and not the prior alone
        few, one = fit.left[name] < FEWEST_LEFT, np.count_nonzero(problem.ratio(name).is_observed) == 1
        if (few or one) and left[name] > _BEYOND_TRIALS:
            share, tails = percent(left[name]), "one tail" if one else "so few"
            found.append(Note.named("factors-miss", share=share, tails=tails, **words))
        beyond = ""
        if few or one:
            found.append(Note.named("misfit-of-no-rest" if few else "misfit-of-one-tail", **words))
        elif not problem.ratio(name).freedom.sum() > 0:
            once = not np.any(problem.ratio(name).trials > 1)
            why = "was observed once a tail" if once else "has means without scatter"
            found.append(Note.named("trials-without-scatter", why=why, **words))
            beyond = "more than trials err" if size.value > _BEYOND_TRIALS else ""
        elif misfit > _LARGE_MISFIT:
            beyond = "beyond the scatter of trials"
        if beyond:
            found.append(Note.named("tails-missed", size=percent(size.value), beyond=beyond, **words))
    return found


def _misfits(problem: Problem, z: Samples) -> dict[Quantity, float]:
    """Root mean square residual of each quantity over the tails, relative to what is predicted."""
    found = {}
    for name, values in problem.predicted_at(z).items():
        ratio = problem.ratio(name)
        found[name] = float(np.sqrt(np.mean((ratio.mean / values - 1.0)[ratio.is_observed] ** 2)))
    return found


def factor_misfit_warnings(problem: Problem, z: Samples) -> list[Note]:
    """Root mean square misfit of a fit without an error model."""
    found = []
    for name, size in _misfits(problem, z).items():
        if size > _LARGE_MISFIT:
            words = {"model": problem.model.name, "called": CALLED[name], "fields": (name,)}
            found.append(Note.named("factors-leave", size=percent(size), **words))
    return found


def friction_warnings(problem: Problem, z: Samples, reading: str) -> list[Note]:
    """Assumptions of a fit about the friction."""
    unset = all(robot.friction.effective is None for robot in problem.experiment.robots)
    if problem.by_motor_rate and unset and "shared_friction" not in problem.free:
        others = ", ".join(name for name in problem.free if name != "friction")
        return [Note.named("friction-into-others", others=others)]
    if reading != "paper" or "friction" not in problem.free:
        return []
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = problem.printed_turning(z[None])[0] / problem.experiment.turning.mean
    known = ratio[np.isfinite(ratio)]
    if known.size == 0 or np.all(np.abs(known - 1.0) < _PRINTED):
        return []
    return [Note.named("printed-body-rate", median=np.median(known), least=known.min(), most=known.max())]


def friction_interval_warnings(problem: Problem) -> list[Note]:
    """What the intervals of B_eff leave out without repeated trials: how trials differ, or all of the rate's error."""
    rate = problem.experiment.motor_rate
    if "friction" not in problem.free or not rate.is_observed.any() or rate.freedom.sum() > 0:
        return []
    return [Note.named("one-trial-a-tail" if rate.explained else "rate-without-error")]


def narrow_channel_warnings(problem: Problem, values: Mapping[str, Estimate]) -> list[Note]:
    """A narrower channel whose wall seems to hold the body back less than that of a wider one."""
    drag = [(problem.experiment.channels[item.channel], item.label) for item in problem.coordinates
            if item.parameter.name == "body_drag" and item.channel is not None]  # fmt: skip
    found = []
    for (_, narrow), (_, wide) in pairwise(sorted(drag)):
        less, more = values[narrow], values[wide]
        if less.value >= more.value:
            continue
        overlap = " (their intervals overlap)" if less.high >= more.low else ""
        said = {"narrow": narrow, "less": less.value, "wide": wide, "more": more.value, "fields": (narrow, wide)}
        found.append(Note.named("narrower-drags-less", overlap=overlap, **said))
    return found


def synthetic_warning(source: str) -> Note:
    """The note of every answer from synthetic observations."""
    return Note.named("synthetic-observations", source=source)


def inertia_warnings(experiment: Experiment) -> list[Note]:
    """Return warnings of observations where Stokes flow is not accurate; refuse those where inertia dominates."""
    seen = [(place, item) for place, group in enumerate(experiment.observed) for item in group]
    speed, tail, body, motor = np.array(
        [(item.forward_velocity, item.tail_rate, item.body_rate, item.motor_rate) for _, item in seen]
    ).T
    batch = RobotBatch.of(experiment.robots).taken([place for place, _ in seen])
    rate = np.where(np.isnan(tail), motor + body, tail)
    limits = reynolds_limits(batch, body_reynolds(batch, speed), tail_reynolds(batch, rate))
    for limit, column in zip(limits[1:], ("forward_velocity_mm_s", "tail_rate_Hz"), strict=True):
        if problem := stokes_flow_problem(batch, [limit]):
            item = seen[int(np.argmax(limit.value > BEYOND_STOKES))][1]
            named = "motor_rate_Hz" if limit is limits[2] and np.isnan(item.tail_rate) else column
            raise InputError(f"{experiment.source}, row {item.row}, column {named}: {problem}")
    return list(reynolds_warnings(limits).values())


def common_warnings(problem: Problem, friction: Sequence[Estimate]) -> list[Note]:
    """Warnings common to all methods."""
    experiment = problem.experiment
    found = [*experiment.doubts, *inertia_warnings(experiment)]
    if experiment.synthetic:
        found.append(synthetic_warning(experiment.source))
    if "gap" in problem.free and "pitch" not in problem.free:
        found.append(Note.named("pitch-assumed"))
    negative = [n for n, item in enumerate(friction) if item.value < 0]
    if negative:
        first = experiment.labels()[negative[0]]
        found.append(Note.named("torque-beyond-motor", count=len(negative), robots=len(friction), first=first))
        if 2 * len(negative) > len(friction):
            found.append(RATES_IN_RADIANS)
    open_below = [n for n, item in enumerate(friction) if item.low < 0 <= item.value]
    if open_below:
        more = ", ..." if len(open_below) > 1 else ""
        found.append(Note.named("friction-open-below", first=experiment.labels()[open_below[0]], more=more))
    if problem.interpolation_error > 0:
        where = "at poses between the nodes" if problem.model.placed else "at one wire between the nodes"
        found.append(Note.named("interpolated-resistances", error=percent(problem.interpolation_error), where=where))
    return found
