"""Warnings of a fit: misfit, outliers, values far from their prior; and the refusal of an implausible one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.estimate import Estimate
from spirillum.calibration.experiment import Experiment, Quantity
from spirillum.calibration.identifiability import FAR
from spirillum.calibration.least_squares import FEWEST_LEFT, LeastSquares
from spirillum.calibration.likelihood import ERROR_SCALE
from spirillum.calibration.parameters import LogUniform, Uniform
from spirillum.calibration.problem import Problem, UnexplainedError
from spirillum.display import percent
from spirillum.robot.batch import RobotBatch
from spirillum.robust import mad_scale
from spirillum.swimming.reynolds import body_reynolds, check_stokes_flow, reynolds_limits, tail_reynolds

RATES_IN_RADIANS = (
    "a motor that is too weak for most tails is most often a unit: are the rates in Hz, turns a second, and not in "
    "rad/s (6.3 times larger)?"
)
"""Said where most of the robots would need more torque than their motors give."""
CALLED: dict[Quantity, str] = {"advance": "speed", "turning": "body rate", "motor_rate": "motor rate"}
"""Name of each compared quantity in a sentence."""
_LARGE_MISFIT = 0.03
"""Relative misfit from which on a warning states it."""
_BEYOND_TRIALS = 2.0 * ERROR_SCALE
"""Discrepancy larger than any plausible relative error of a trial."""
_IMPLAUSIBLE_FACTOR = 10.0
"""Median misfit, as a factor, beyond which observations and model must differ in robot or units."""
_PRINTED = 0.1
"""Relative difference of the body's rates beyond which a friction reading contradicts the observations."""
_IMPLAUSIBLE_DISTANCE = 5.0
"""Standard deviations from the median of a wide prior beyond which a fit is refused."""
_WIDE = 0.5
"""Smallest logarithmic standard deviation of a prior that is called wide."""
_EDGE, _PILED = 0.05, 0.4
"""Outermost share of a bounded prior, and the share of a posterior in it from which on its end decides the interval."""
_OUTLYING, _LEAST_OUTLYING = 6.0, 0.2
"""Robust standard deviations, and relative deviation, beyond which a robot is named as an outlier."""


def check_plausible(problem: Problem, z: Samples) -> None:
    """Refuse an implausible fit: most often the observations are in other units.

    Raises:
        UnexplainedError: if the median misfit exceeds a factor of ten, or a parameter with a wide prior lies more than
            five standard deviations from its middle.
    """
    source, model = problem.experiment.source, problem.model.name
    for name, values in problem.predicted_at(z).items():
        ratio = problem.ratio(name)
        with np.errstate(divide="ignore", invalid="ignore"):
            off = np.abs(np.log(np.abs(ratio.mean / values)))[ratio.seen]
        if float(np.median(off)) > np.log(_IMPLAUSIBLE_FACTOR):
            factor = float(np.exp(np.median(np.log(np.abs(ratio.mean / values))[ratio.seen])))
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


def prior_warnings(problem: Problem, z: Samples) -> list[str]:
    """Fitted values far out in their prior."""
    values = problem.values_at(z)
    return [
        f"{item.label} = {values[item.label]:.3g} lies {abs(place):.1f} standard deviations from the middle "
        f"of its prior ({item.prior.words(item.parameter.unit)}): the model, a unit or the robot may be wrong"
        for item, place in zip(problem.coordinates, z, strict=True)
        if abs(place) > FAR
    ]


def edge_warnings(problem: Problem, draws: Samples) -> list[str]:
    """Posteriors that pile up at an end of their prior, which then decides their interval.

    Args:
        problem: the fit.
        draws: coordinates of the posterior, (n, coordinates).
    """
    from scipy.special import ndtr

    found = []
    for item, place in zip(problem.coordinates, draws.T, strict=True):
        if not isinstance(item.prior, Uniform | LogUniform):
            continue
        share = ndtr(place)  # of the prior below a draw
        for end, value, near in (
            ("lower", item.prior.low, float(np.mean(share < _EDGE))),
            ("upper", item.prior.high, float(np.mean(share > 1.0 - _EDGE))),
        ):
            if near > _PILED:
                found.append(
                    f"{item.label}: {percent(near)} of the posterior lies in the outermost {percent(_EDGE)} of its "
                    f"prior, at the {end} end of {value:.3g} {item.parameter.unit}".rstrip()
                    + ": that end decides the interval, and the observations ask for a value beyond it, or the model "
                    "lacks something"
                )
    return found


def outlier_warnings(problem: Problem, z: Samples) -> list[str]:
    """Outliers: rows whose trial, or whose robot, deviates from all others."""
    experiment = problem.experiment
    found = list(experiment.outliers)
    for name, values in problem.predicted_at(z).items():
        ratio = problem.ratio(name)
        relative = np.where(ratio.seen, ratio.mean / values - 1.0, np.nan)
        if np.count_nonzero(ratio.seen) < 5:
            continue
        off = np.abs(relative - np.nanmedian(relative))
        limit = max(_OUTLYING * float(mad_scale(off)), _LEAST_OUTLYING)
        for place in np.flatnonzero(np.nan_to_num(off) > limit).tolist():
            rows = ", ".join(str(row) for row in experiment.rows[place])
            found.append(
                f"row {rows}: the {CALLED[name]} of {experiment.labels()[place]} is {percent(float(relative[place]))} "
                "off the fit, far more than that of other tails: an outlier?"
            )
    return found


def misfit_warnings(problem: Problem, discrepancy: Mapping[Quantity, Estimate], fit: LeastSquares) -> list[str]:
    """State the model's discrepancy, so that a wrong model does not look certain.

    Args:
        problem: the fit.
        discrepancy: relative misfit by quantity.
        fit: its best fit, with the degrees of freedom that are left and what the residuals say of the misfit.
    """
    found = []
    for name, size in discrepancy.items():
        if fit.left[name] < FEWEST_LEFT:
            found.append(
                f"the fit has as many free numbers as the {CALLED[name]} has means: nothing is left to tell by how "
                f"much model '{problem.model.name}' misses, and the intervals take what models of this kind miss by"
            )
        elif np.count_nonzero(problem.ratio(name).seen) == 1:
            found.append(
                f"the {CALLED[name]} of one tail does not tell by how much model '{problem.model.name}' misses that of "
                "others: the intervals take what models of this kind miss by"
            )
        elif not problem.ratio(name).freedom.sum() > 0:
            once = not np.any(problem.ratio(name).trials > 1)
            why = "was observed once for each tail" if once else "has means without the scatter of their trials"
            found.append(
                f"the {CALLED[name]} {why}: the errors of trials and of the model cannot be told apart, and the "
                "discrepancy holds both"
            )
            if size.value > _BEYOND_TRIALS:
                found.append(
                    f"the discrepancy of the {CALLED[name]}, {percent(size.value)}, is more than trials are off by: "
                    f"model '{problem.model.name}' misses the {CALLED[name]} from tail to tail, its fitted numbers "
                    "stand for what it lacks, and hold for these tails"
                )
        elif min(size.value, fit.discrepancy[name]) > _LARGE_MISFIT:  # the residuals say so, and not the prior alone
            found.append(
                f"model '{problem.model.name}' misses the {CALLED[name]} by {percent(size.value)} from tail to tail, "
                "beyond the scatter of the trials: its fitted numbers stand for what the model lacks, and hold for "
                "these tails"
            )
    return found


def factor_misfit_warnings(problem: Problem, z: Samples) -> list[str]:
    """Root mean square misfit of a fit without an error model."""
    found = []
    for name, values in problem.predicted_at(z).items():
        ratio = problem.ratio(name)
        size = float(np.sqrt(np.mean((ratio.mean / values - 1.0)[ratio.seen] ** 2)))
        if size > _LARGE_MISFIT:
            found.append(
                f"model '{problem.model.name}' with these factors misses the {CALLED[name]} by {percent(size)} (root "
                "mean square over the tails), errors of the trials included"
            )
    return found


def friction_warnings(problem: Problem, z: Samples, reading: str) -> list[str]:
    """Assumptions of a fit about the friction.

    Args:
        problem: the fit.
        z: coordinates of the best fit.
        reading: reading of the friction under which B_eff follows from (18).
    """
    unset = all(robot.friction.effective is None for robot in problem.experiment.robots)
    if problem.by_motor_rate and unset and "shared_friction" not in problem.free:
        return [
            "the motor rate is predicted with the rotor's own B_m alone, for friction.effective is unset: what the "
            f"joint rubs more goes into {', '.join(name for name in problem.free if name != 'friction')}; allowed: "
            "shared_friction free too"
        ]
    if reading != "paper" or "friction" not in problem.free:
        return []
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = problem.printed_turning(z[None])[0] / problem.experiment.turning.mean
    known = ratio[np.isfinite(ratio)]
    if known.size == 0 or np.all(np.abs(known - 1.0) < _PRINTED):
        return []
    return [
        f"friction reading 'paper': with (19) as printed the body turns at {np.median(known):.2g} times its observed "
        f"rate (median of the tails, {known.min():.2g} to {known.max():.2g}) where the motor turns as observed: B_eff "
        "of this reading does not give the observed rates back, for the factors follow from (15) without (19)"
    ]


def friction_interval_warnings(problem: Problem) -> list[str]:
    """What the intervals of B_eff leave out without repeated trials: how trials differ, or all of the rate's error."""
    rate = problem.experiment.motor_rate
    if "friction" not in problem.free or not rate.seen.any() or rate.freedom.sum() > 0:
        return []
    if rate.explained:
        return ["one trial for each tail: the intervals of B_eff hold its stated errors, and not how trials differ"]
    return [
        "the motor rate has no repeated trials and states no error (columns tail_rate_Hz_ci95 and body_rate_Hz_ci95), "
        "so that its error is not in the intervals of B_eff, which are too narrow"
    ]


def narrow_channel_warnings(problem: Problem, values: Mapping[str, Estimate]) -> list[str]:
    """A narrower channel whose wall seems to hold the body back less than that of a wider one."""
    drag = [(problem.experiment.channels[item.channel], item.label) for item in problem.coordinates
            if item.parameter.name == "body_drag" and item.channel is not None]  # fmt: skip
    found = []
    for (_, narrow), (_, wide) in pairwise(sorted(drag)):
        less, more = values[narrow], values[wide]
        if less.value >= more.value:
            continue
        overlap = " (their intervals overlap)" if less.high >= more.low else ""
        found.append(
            f"{narrow} = {less.value:.3g} is less than {wide} = {more.value:.3g}{overlap}, though a narrower channel "
            "holds a body back more: channels may be mixed up, or the factors stand for something else"
        )
    return found


def synthetic_warning(source: str) -> str:
    """The warning of every answer from synthetic observations."""
    return f"{source} says that its numbers are synthetic: nothing here is measured"


def inertia_warnings(experiment: Experiment) -> list[str]:
    """Return warnings of observations at Reynolds numbers at which Stokes flow is not accurate."""
    batch = RobotBatch.of(experiment.robots)
    rate = np.where(experiment.by_motor, experiment.motor_rate.mean, experiment.tail_rate)
    limits = reynolds_limits(
        batch, body_reynolds(batch, experiment.advance.mean * rate), tail_reynolds(batch, experiment.tail_rate)
    )
    return list(check_stokes_flow(batch, limits).values())


def common_warnings(problem: Problem, friction: Sequence[Estimate]) -> list[str]:
    """Warnings common to all methods."""
    experiment = problem.experiment
    found = [*experiment.doubts, *inertia_warnings(experiment)]
    if experiment.synthetic:
        found.append(synthetic_warning(experiment.source))
    if "gap" in problem.free and "pitch" not in problem.free:
        found.append(
            "the robots are taken to be level, as the pitch is not free (--free gap,pitch): another pitch changes "
            "speeds, and the fitted gap with them; `predict` with this fit has no band over either"
        )
    negative = [n for n, item in enumerate(friction) if item.value < 0]
    if negative:
        found.append(
            f"B_eff comes out negative for {len(negative)} of {len(friction)} robots, the first: "
            f"{experiment.labels()[negative[0]]}: the model's torque exceeds what the motor gives; a prediction of "
            "these tails takes zero"
        )
        if 2 * len(negative) > len(friction):
            found.append(RATES_IN_RADIANS)
    if problem.interpolation_error > 0:
        where = "at places that were not used for them" if problem.model.placed else "at one wire between their points"
        found.append(
            f"resistances are interpolated: {percent(problem.interpolation_error)} largest error of a prediction, "
            f"checked {where}"
        )
    return found
