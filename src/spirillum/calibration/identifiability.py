"""Identifiability of parameters: sensitivities, singular directions, likelihood profiles, and what B_eff rests on.

The Jacobian of all predictions, over their standard errors, maps the coordinates of the fit to what is seen. A singular
value s of it says that the observations know the direction to 1/s standard deviations of the prior. Where s is below 1
they say less than the prior does, and the direction is named: which numbers trade off against each other, and how.

An observed motor rate gives the motor's torque and the fluid's torque on the tail only with these constants. B_eff
follows from the difference of both torques, so that an error of a constant goes straight into it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.least_squares import (
    LARGEST,
    LEAST_ERROR,
    LeastSquares,
    Spread,
    sensitivities,
    weighted_residuals,
    weighted_sensitivities,
)
from spirillum.calibration.parameters import ASSUMABLE, Estimate
from spirillum.calibration.problem import Problem
from spirillum.errors import InputError
from spirillum.fluid.reference_errors import CHECKED, tail_error
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch

_UNKNOWN = 1.0  # singular value below which the prior is more informative than the observations
_POOR = 3.0
FAR = 3.0  #: Standard deviations of the prior beyond which the observations have overruled it.
_COLLINEAR = 1e4
"""Collinearity index (inverse of the least singular value of the Jacobian with normalised columns; Brun et al. 2001)
from which on parameters cannot be distinguished by the observations. Identifiable sets have some tens at most, others
more than 1e7, which is infinity up to rounding.
"""
_INVOLVED = 0.05  # least share of a collinear direction at which a number is named
_MEMBER = 0.25  # least share of a direction, over that of the first, at which a number is named


@dataclass(frozen=True)
class Identifiability:
    """Directions of the free numbers, from the best known to the least."""

    labels: tuple[str, ...]
    sensitivity: Samples  #: Root mean square relative change of all predictions per relative change of each number.
    singular: Samples  #: Singular values: how many times narrower than the prior the observations make each direction.
    directions: Samples  #: (directions, numbers), unit vectors in coordinates of the prior.
    correlation: Samples  #: Between the numbers, from the observations alone.
    warnings: tuple[Note, ...]  #: What is not identifiable, in words.

    @property
    def unknown(self) -> int:
        """Number of directions in which the prior is more informative than the observations."""
        return int(np.count_nonzero(self.singular < _UNKNOWN))


def check_identifiable(problem: Problem, z: Samples) -> None:
    """Refuse free parameters that no observations of these quantities identify, however exact."""
    # A number whose uncertainty is stated is known by that, and left out.
    kept = [n for n, item in enumerate(problem.coordinates) if item.parameter.name not in problem.assumed]
    if len(kept) < 2:
        return
    columns = sensitivities(problem, z)
    jacobian = np.concatenate([column[problem.ratio(name).is_observed] for name, column in columns.items()])[:, kept]
    _, singular, directions = np.linalg.svd(jacobian / np.linalg.norm(jacobian, axis=0), full_matrices=False)
    if singular[-1] * _COLLINEAR > 1.0:
        return
    share = np.abs(directions[-1])
    named = [problem.coordinates[kept[n]] for n in np.argsort(-share).tolist() if share[n] >= _INVOLVED]
    fields = [place for item in named for place, name in ASSUMABLE.items() if name == item.parameter.name]
    stated = f", or the uncertainty of one stated (--assume-uncertainty {fields[0]}=5%)" if fields else ""
    raise InputError(
        f"free = '{', '.join(problem.free)}': {_listed([item.label for item in named])} cannot be distinguished "
        f"by the observations in {problem.experiment.source}, for changed together they leave every prediction as it "
        f"is; allowed: without one of them{stated}"
    )


def identified(problem: Problem, fit: LeastSquares) -> Identifiability:
    """Find the directions in which a fit is not determined, at its optimum."""
    error = {name: max(np.nan_to_num(value), LEAST_ERROR) for name, value in fit.error.items()}
    jacobian = np.concatenate(list(weighted_sensitivities(problem, fit.z, Spread(error, fit.discrepancy)).values()))
    columns = sensitivities(problem, fit.z)
    relative = np.concatenate([column[problem.ratio(name).is_observed] for name, column in columns.items()])
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    labels = tuple(item.label for item in problem.coordinates)
    slope = _slopes(problem, fit.z)
    information = jacobian.T @ jacobian
    covariance = np.linalg.pinv(information, rcond=1e-14)
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    said = [_words(problem, fit.z, s, d) for s, d in zip(singular, directions, strict=True) if s < _POOR]
    return Identifiability(
        labels=labels,
        sensitivity=np.sqrt(np.mean(relative**2, axis=0)) / np.maximum(np.abs(slope), 1e-12),
        singular=singular,
        directions=directions,
        correlation=covariance / np.outer(size, size),
        warnings=tuple(words for words in said if words),
    )


def _slopes(problem: Problem, z: Samples) -> Samples:
    """D log(value)/dz of each number."""
    step = 1e-5
    up, down, at = (problem.values_at(place) for place in (z + step, z - step, z))
    return np.array([(up[name] - down[name]) / (2.0 * step * max(abs(at[name]), 1e-300)) for name in at])


def _words(problem: Problem, z: Samples, singular: float, direction: Samples) -> Note | None:
    """A note on a poorly known direction; none for a number that the observations took far from its prior."""
    # By the change of the numbers themselves, and of their coordinates: a wide prior makes a large change small there.
    relative = np.abs(direction * _slopes(problem, z))
    share = np.maximum(np.abs(direction), relative / max(float(relative.max()), 1e-300))
    named = [int(place) for place in np.argsort(-relative) if share[place] >= _MEMBER]
    labels = [problem.coordinates[place].label for place in named]
    known = "less than the prior" if singular < _UNKNOWN else "little more than the prior"
    if len(named) == 1:
        if abs(z[named[0]]) > FAR:  # `prior_warnings` reports it
            return None
        return Note.named("hardly-known", label=labels[0], known=known, fields=labels)
    moved = z + 0.5 * direction * np.sign(direction[named[0]])
    before, after = problem.values_at(z), problem.values_at(moved)
    changes = [f"{label} by {100 * (after[label] / before[label] - 1.0):+.2g} %" for label in labels]
    effect = f"{0.5 * singular:.1g}" if singular > 2e-3 else "less than 0.001"
    return Note.named("trade-off", changes=_listed(changes), effect=effect, known=known, fields=labels)


def _listed(items: Sequence[str]) -> str:
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"


@dataclass(frozen=True)
class LikelihoodProfile:
    """Least misfit with one number held."""

    label: str
    values: Samples  #: Held values.
    misfit: Samples  #: Sum of squared residuals above its least; 3.84 is the limit of the 95 % interval.


def profiles(problem: Problem, fit: LeastSquares, count: int = 13) -> list[LikelihoodProfile]:
    """Likelihood profile of every free parameter: the others are fitted again at each of its values."""

    def residuals(z: Samples) -> Samples:
        return weighted_residuals(problem, z, Spread(fit.error, fit.discrepancy))

    spread = np.clip(np.sqrt(np.diag(fit.covariance)), 1e-6, 2.0)
    least = float(np.sum(residuals(fit.z) ** 2))
    found = []
    for place, item in enumerate(problem.coordinates):
        held = fit.z[place] + spread[place] * np.linspace(-3.0, 3.0, count)
        misfit = np.empty(count)
        middle = count // 2
        for side in (range(middle, count), range(middle, -1, -1)):
            start = fit.z
            for n in side:
                start, misfit[n] = _others_fitted(residuals, start, place, float(held[n]))
        found.append(LikelihoodProfile(item.label, item.prior.value(held), np.maximum(misfit - least, 0.0)))
    return found


def _others_fitted(
    residuals: Callable[[Samples], Samples], start: Samples, place: int, held: float
) -> tuple[Samples, float]:
    """Fit all coordinates but one that is held; the coordinates, and the sum of squares."""
    from scipy.optimize import least_squares

    others = np.arange(start.size) != place

    def whole(rest: Samples) -> Samples:
        z = np.empty(start.size)
        z[others], z[place] = rest, held
        return z

    if start.size == 1:
        return whole(start[others]), float(np.sum(residuals(whole(start[others])) ** 2))
    inside = np.clip(start[others], 0.1 - LARGEST, LARGEST - 0.1)  # where the bounds leave room for a first step
    solved = least_squares(lambda rest: residuals(whole(rest)), inside, bounds=(-LARGEST, LARGEST), max_nfev=60)
    return whole(solved.x), 2.0 * float(solved.cost)


_STEP = 1e-4


def friction_sensitivity(problem: Problem, z: Samples, reading: str) -> dict[str, Samples]:
    """Change of B_eff of every robot per relative change of each constant, N m s/rad, (robots,), by its field."""
    if "friction" not in problem.free:
        return {}
    rates = problem.experiment.motor_rate.mean[None]
    found = {}
    for field, name in ASSUMABLE.items():
        up, down = (
            problem.friction(z[None], rates, reading, {name: np.full((1, 1), 1.0 + step)})[0]
            for step in (_STEP, -_STEP)
        )
        found[field] = (up - down) / (2.0 * _STEP)
    return found


def torque_error(problem: Problem) -> float | None:
    """Return half of the relative 95 % interval of the model's torque on the tails: the largest error that is known."""
    # That of the wire, as against resolved wires, and of the table. None for a model that leaves the walls of the
    # robots' tubes out: no observation determines what these do to the torque.
    if not problem.model.placed:
        return None
    robots = problem.experiment.robots
    wire = max(abs(tail_error(RobotBatch.of(robot), CHECKED["slender"]).torque) for robot in robots)
    return 0.01 * wire + problem.interpolation_error


def friction_statement(problem: Problem, friction: Sequence[Estimate], sensitivity: Mapping[str, Samples]) -> str:
    """Constants that the intervals of B_eff take as exact, with its sensitivity to each; empty without B_eff."""
    middle = np.array([item.value for item in friction])
    middle = np.abs(middle[np.isfinite(middle)])
    if middle.size == 0 or not np.median(middle) > 0:
        return ""
    moves = ", ".join(
        f"{np.nanmedian(change) / np.median(middle):+.2g} % ({field})" for field, change in sensitivity.items()
    )
    known = problem.assumed
    stated = [f"{field} ({100 * known[name]:g} %)" for field, name in ASSUMABLE.items() if name in known]
    exact = [field for field, name in ASSUMABLE.items() if name not in known]
    said = [f"hold the stated uncertainty of {_listed(stated)}"] if stated else []
    said += [f"take {_listed(exact)} as exact"] if exact else []
    subject, verbs, advice = "intervals of B_eff", " and ".join(said), ""
    if not any(np.isfinite(item.low) for item in friction):
        subject, verbs = "B_eff", verbs.replace("take ", "takes ", 1)
    elif exact:
        advice = f"; --assume-uncertainty {exact[0]}=5% would put 5 % into them"
    rests = f"{verbs}: one per cent more of it moves B_eff by {moves}, medians of the tails{advice}"
    model, off = f"model '{problem.model.name}'", torque_error(problem)
    if off is not None:
        return f"{subject} {rests}; an error of {100 * off:.2g} % of the torque by {model} is in them"
    missed = f"B_eff also holds what {model} misses of the torque, walls above all, so that it is given no interval"
    if subject == "B_eff":
        return f"{subject} {rests}; {missed}"
    half = float(np.nanmedian([0.5 * (item.high - item.low) for item in friction]) / np.median(middle))
    return f"were the model exact, {subject} would reach {100 * half:.2g} % to either side and {rests}; {missed}"
