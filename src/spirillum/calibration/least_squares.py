"""Weighted nonlinear least squares from several starts: the fast answer, with honest errors.

Residuals are means less predictions over their standard errors. Where the model misses the means by more than the
trials scatter, a standard error alone would make a wrong model look certain. The excess is then estimated as a relative
discrepancy from robot to robot, for each quantity (method of moments), and goes into weights and errors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.experiment import Quantity
from spirillum.calibration.problem import Problem
from spirillum.errors import InputError

__all__ = ["LeastSquares", "least_squares_fit", "sensitivities", "standard_errors", "weighted_residuals"]

_STARTS = 6
_STEP = 1e-4
_BLIND = 1e-8
_LARGEST = 12.0
_BREATH = 1e-2
_LEAST_ERROR = 1e-3
"""Relative error that no mean is known better than: else one quantity that happens to fit would outweigh the others."""


@dataclass(frozen=True)
class LeastSquares:
    """The best fit and what it leaves."""

    z: Samples
    """Coordinates."""
    covariance: Samples
    """Of the coordinates."""
    discrepancy: dict[Quantity, float]
    """Relative misfit from robot to robot beyond the trials' scatter."""
    error: dict[Quantity, float]
    """Relative error of one trial; NaN without repeated trials."""
    chi2: float
    """Sum of squared residuals with the trials' scatter alone; NaN without repeated trials."""
    freedom: int
    """Observed means less free numbers."""
    residuals: dict[Quantity, Samples]
    """Observed over predicted less one, robot by robot."""


def sensitivities(problem: Problem, z: Samples) -> dict[Quantity, Samples]:
    """Relative change of every prediction per unit of each coordinate, (robots, free numbers), by central differences.

    Args:
        problem: the fit.
        z: coordinates, (free numbers,).
    """
    count = z.size
    steps = _STEP * np.eye(count)
    points = np.concatenate([z + steps, z - steps, z[None]])
    found = problem.predicted(points)
    return {
        name: (values[:count] - values[count : 2 * count]).T / (2.0 * _STEP * values[-1][:, None])
        for name, values in found.items()
    }


def standard_errors(
    problem: Problem,
    predicted: dict[Quantity, Samples],
    error: dict[Quantity, float],
    discrepancy: dict[Quantity, float],
) -> dict[Quantity, Samples]:
    """Standard error of each mean against its prediction, in the quantity's unit.

    Args:
        problem: the fit.
        predicted: predictions, to which the discrepancy is relative.
        error: relative error of one trial, by quantity.
        discrepancy: relative misfit from robot to robot, by quantity.
    """
    found: dict[Quantity, Samples] = {}
    for name, values in predicted.items():
        ratio = problem.ratio(name)
        trial = np.nan_to_num(error[name]) * ratio.scale / np.sqrt(np.maximum(ratio.trials, 1.0))
        floor = max(_LEAST_ERROR, problem.interpolation_error) * ratio.scale
        found[name] = np.sqrt(trial**2 + (discrepancy[name] * values) ** 2 + floor**2)
    return found


def least_squares_fit(problem: Problem) -> LeastSquares:
    """Fit the free numbers.

    Raises:
        InputError: if there are fewer means than free numbers, or one on which nothing observed depends.
    """
    _check_count(problem)
    error = {name: problem.ratio(name).pooled_error for name in problem.quantities}
    scattered = {name: bool(np.isfinite(value) and value > 0) for name, value in error.items()}
    # Without scatter all means count alike, by their relative deviation.
    discrepancy = {name: 0.0 if scattered[name] else 1.0 for name in problem.quantities}
    z = _best(problem, problem.start, error, discrepancy, starts=_STARTS)
    _check_blind(problem, z)
    chi2 = float("nan")
    if all(scattered.values()):
        chi2 = float(np.sum(weighted_residuals(problem, z, error, discrepancy) ** 2))
    for _ in range(8):
        found = _discrepancy(problem, z, error)
        change = max(abs(found[name] - discrepancy[name]) for name in found)
        discrepancy = found
        if change < 1e-4:
            break
        z = _best(problem, z, error, discrepancy, starts=1)
    predicted = {name: values[0] for name, values in problem.predicted(z[None]).items()}
    return LeastSquares(
        z=z,
        covariance=_covariance(problem, z, predicted, error, discrepancy),
        discrepancy=discrepancy,
        error=error,
        chi2=chi2,
        freedom=_count(problem) - z.size,
        residuals={name: problem.ratio(name).mean / predicted[name] - 1.0 for name in predicted},
    )


def _count(problem: Problem) -> int:
    return sum(int(np.count_nonzero(problem.ratio(name).seen)) for name in problem.quantities)


def _check_count(problem: Problem) -> None:
    if not problem.coordinates:
        raise InputError(
            f"free = '{', '.join(problem.free)}': nothing to fit; allowed: also body_drag or another parameter, "
            "or method "
            "'paper'"
        )
    count = _count(problem)
    if count < len(problem.coordinates):
        raise InputError(
            f"{problem.experiment.source} has {count} means of {problem.experiment.size} robots, fewer than the "
            f"{len(problem.coordinates)} free numbers ({', '.join(c.label for c in problem.coordinates)}); "
            "allowed: more "
            "observations, or fewer free parameters"
        )


def _check_blind(problem: Problem, z: Samples) -> None:
    """Refuse a free number on which nothing that was observed depends."""
    columns = sensitivities(problem, z)
    for place, item in enumerate(problem.coordinates):
        felt = max(float(np.max(np.abs(s[problem.ratio(n).seen, place]))) for n, s in columns.items())
        if felt < _BLIND:
            need = "rotation rates of body and tail" if item.parameter.name == "body_rotation" else "other quantities"
            raise InputError(
                f"free = '{item.label}': nothing observed in {problem.experiment.source} depends on it; allowed: "
                f"observations of {need}, or without it"
            )


def weighted_residuals(
    problem: Problem, z: Samples, error: dict[Quantity, float], discrepancy: dict[Quantity, float]
) -> Samples:
    """What least squares make small: means less predictions over their standard errors, and a breath of the prior.

    Args:
        problem: the fit.
        z: coordinates, (free numbers,).
        error: relative error of one trial, by quantity.
        discrepancy: relative misfit from robot to robot, by quantity.
    """
    predicted = {name: values[0] for name, values in problem.predicted(z[None]).items()}
    # A discrepancy is relative to the size of the mean here: else a large prediction would excuse itself.
    sized = {name: problem.ratio(name).scale for name in predicted}
    errors = standard_errors(problem, sized, error, discrepancy)
    parts = []
    for name, values in predicted.items():
        ratio = problem.ratio(name)
        parts.append(((ratio.mean - values) / errors[name])[ratio.seen])
    # A breath of the prior, which decides only where the observations say nothing at all.
    found: Samples = np.nan_to_num(np.concatenate([*parts, _BREATH * z]), nan=1e6, posinf=1e6, neginf=-1e6)
    return found


def _best(
    problem: Problem,
    start: Samples,
    error: dict[Quantity, float],
    discrepancy: dict[Quantity, float],
    *,
    starts: int,
) -> Samples:
    """The best of several local fits; the first starts where it is told, the others are spread over the prior."""
    from scipy.optimize import least_squares

    spread = np.random.default_rng(20120624).normal(size=(starts - 1, start.size))
    best, cost = start, np.inf
    for first in (start, *spread):
        found = least_squares(
            lambda z: weighted_residuals(problem, z, error, discrepancy),
            np.clip(first, -3.0, 3.0) if first is not start else first,
            bounds=(-_LARGEST, _LARGEST),
            xtol=1e-13,
            ftol=1e-13,
            gtol=1e-13,
            max_nfev=200,
        )
        if found.cost < cost * (1.0 - 1e-9):
            best, cost = found.x, found.cost
    return np.asarray(best, dtype=float)


def _discrepancy(problem: Problem, z: Samples, error: dict[Quantity, float]) -> dict[Quantity, float]:
    """Relative misfit from robot to robot beyond the scatter of the trials, by quantity."""
    predicted = problem.predicted(z[None])
    total = _count(problem)
    share = 1.0 - min(len(problem.coordinates) / total, 0.99)
    found: dict[Quantity, float] = {}
    for name, values in predicted.items():
        ratio = problem.ratio(name)
        seen = ratio.seen
        relative = (ratio.mean[seen] - values[0][seen]) / values[0][seen]
        trial = np.nan_to_num(error[name]) * ratio.scale[seen] / values[0][seen]
        expected = np.mean(trial**2 / ratio.trials[seen])
        found[name] = float(np.sqrt(max(np.mean(relative**2) / share - expected, 0.0)))
        if found[name] < 1e-9:
            found[name] = 0.0
    return found


def _covariance(
    problem: Problem,
    z: Samples,
    predicted: dict[Quantity, Samples],
    error: dict[Quantity, float],
    discrepancy: dict[Quantity, float],
) -> Samples:
    """Inverse of the information of the means; along directions that they do not see, that of the prior."""
    errors = standard_errors(problem, predicted, error, discrepancy)
    rows = []
    for name, column in sensitivities(problem, z).items():
        ratio = problem.ratio(name)
        sized = np.maximum(errors[name], 1e-12 * ratio.scale)
        rows.append((column * (predicted[name] / sized)[:, None])[ratio.seen])
    jacobian = np.concatenate(rows)
    information, directions = np.linalg.eigh(jacobian.T @ jacobian)
    covariance: Samples = (directions / np.maximum(information, 1.0)) @ directions.T
    return covariance
