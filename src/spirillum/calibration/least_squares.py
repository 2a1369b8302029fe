"""Point estimates: weighted nonlinear least squares from several starts, and the paper's own procedure.

Residuals are means less predictions over their standard errors. Where the model misses the means by more than the
trials scatter, a standard error alone would make a wrong model look certain. The excess is then estimated as a relative
discrepancy from robot to robot, for each quantity (method of moments), and goes into weights and errors. It is known no
better than the residuals that are left tell: intervals are over draws of it, and where a fit leaves no residual, over
its prior alone. The prior of the numbers is a residual too, so that what the observations do not see stays there.

The paper's procedure inverts the kinematics (15), then (18), tail by tail. The rows of (15) are
linear in the factors. With advance u = U/omega and turning o = Omega/omega observed, the force on
the whole gives the factor on D_x and the torque on the whole that on E_x:

    f_D = 1 - (F_U u + F_b o + F_r)/(D_x u)        f_E = 1 - (T_U u + T_b o + T_r)/(E_x o)

with the rows F and T of the uncalibrated balance. Each robot has its own pair; a channel's factor is the one that
leaves the least squares of the force (torque) of all its robots at the same tail rate: their mean, weighted with
(D_x u)^2 and (E_x o)^2. As in Table III, resistive force theory keeps E_x as it is, since its friction explains the
rates, and the drag factor is one for each channel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.experiment import Quantity
from spirillum.calibration.likelihood import DISCREPANCY_SCALE
from spirillum.calibration.problem import Problem, UnexplainedError
from spirillum.errors import InputError
from spirillum.units import display_unit, in_unit

_STARTS = 6
_STEP = 1e-4  # step of the central differences, in standard deviations of the prior
_SMALL_STEP = float(np.sqrt(np.finfo(float).eps))  # of forward differences, relative to coordinates above one
_BLIND = 1e-8  # relative change of a prediction by one standard deviation of a prior that is none but rounding
LARGEST = 12.0  #: Standard deviations of the prior to either side within which a fit looks.
_BREATH = 1e-2  # weight of the prior in the first fit: it holds a number that nothing observed holds, and no other
FEWEST_LEFT = 0.5  #: Degrees of freedom below which a fit leaves no residual to judge the model by.
PRIOR_DISCREPANCY = 0.6745 * DISCREPANCY_SCALE  #: Median of the half-normal prior of a model's discrepancy.
_SHARP = 0.01  # relative error assumed of all observations to count the parameters that a quantity constrains
LEAST_ERROR = 1e-3  #: Relative error that no mean is known better than: else one would outweigh all others.


class Spread(NamedTuple):
    """By how much means differ from predictions, relative, by quantity."""

    error: dict[Quantity, float]  #: Of one trial; NaN without repeated trials.
    discrepancy: dict[Quantity, float]  #: From robot to robot, beyond the scatter of trials.


@dataclass(frozen=True)
class LeastSquares:
    """The best fit and what it leaves."""

    z: Samples
    covariance: Samples
    discrepancy: dict[Quantity, float]  #: Relative misfit from robot to robot beyond the trials' scatter.
    error: dict[Quantity, float]  #: Relative error of one trial; NaN without repeated trials.
    chi2: float
    """Sum of squared residuals of the fit without discrepancy, over the errors of trials and their floor; NaN where
    trials' errors are neither seen nor stated."""
    freedom: int  #: Observed means less free numbers.
    left: dict[Quantity, float]  #: Degrees of freedom that the fit leaves each quantity.


def sensitivities(problem: Problem, z: Samples) -> dict[Quantity, Samples]:
    """Return relative changes of predictions per coordinate, (robots, free numbers), by central differences."""
    count = z.size
    steps = _STEP * np.eye(count)
    points = np.concatenate([z + steps, z - steps, z[None]])
    found = problem.predicted(points)
    return {
        name: (values[:count] - values[count : 2 * count]).T / (2.0 * _STEP * values[-1][:, None])
        for name, values in found.items()
    }


def standard_errors(problem: Problem, predicted: dict[Quantity, Samples], spread: Spread) -> dict[Quantity, Samples]:
    """Standard error of each mean against its prediction, in the quantity's unit."""
    return {
        name: np.sqrt(_noise(problem, name, spread.error[name]) + (spread.discrepancy[name] * values) ** 2)
        for name, values in predicted.items()
    }


def _noise(problem: Problem, name: Quantity, error: float) -> Samples:
    """Variance of each mean: that of its trials, and the floor `LEAST_ERROR`."""
    ratio = problem.ratio(name)
    floor = max(LEAST_ERROR, problem.interpolation_error) * ratio.scale
    return ratio.error_of_mean(error) ** 2 + floor**2


def least_squares_fit(problem: Problem) -> LeastSquares:
    """Fit the free numbers."""
    _check_count(problem)
    error = {name: problem.ratio(name).pooled_error for name in problem.quantities}
    scattered = {name: bool(error[name] > 0) or problem.ratio(name).explained for name in error}
    # Without known errors all means count alike, by their relative deviation.
    spread = Spread(error, {name: 0.0 if scattered[name] else 1.0 for name in problem.quantities})
    z = _best(problem, problem.start, spread, starts=_STARTS, prior=_BREATH)
    _check_blind(problem, z)
    chi2 = float("nan")
    if all(scattered.values()):
        chi2 = float(np.sum(weighted_residuals(problem, z, spread, prior=0.0) ** 2))
    left = _degrees_of_freedom(problem, z, spread)
    for turn in range(8):
        found = _discrepancy(problem, z, error, left)
        change = max(abs(found[name] - spread.discrepancy[name]) for name in found)
        spread = Spread(error, found)
        if change < 1e-4 and turn:
            break
        z = _best(problem, z, spread, starts=1, prior=1.0)
        left = _degrees_of_freedom(problem, z, spread)
    jacobian = np.concatenate(list(weighted_sensitivities(problem, z, spread).values()))
    return LeastSquares(
        z=z,
        covariance=np.linalg.inv(jacobian.T @ jacobian + np.eye(z.size)),  # with the prior's information
        discrepancy=spread.discrepancy,
        error=error,
        chi2=chi2,
        freedom=_count(problem) - z.size,
        left=left,
    )


def _count(problem: Problem) -> int:
    return sum(int(np.count_nonzero(problem.ratio(name).is_observed)) for name in problem.quantities)


def _check_count(problem: Problem) -> None:
    if not problem.coordinates:
        raise InputError(
            f"free = '{', '.join(problem.free)}': nothing to fit; allowed: also body_drag or another parameter, "
            "or method 'paper'"
        )
    count = _count(problem)
    if count < len(problem.coordinates):
        raise InputError(
            f"{problem.experiment.source} has {count} means of {problem.experiment.size} robots, fewer than the "
            f"{len(problem.coordinates)} free numbers ({', '.join(c.label for c in problem.coordinates)}); "
            "allowed: more observations, or fewer free parameters"
        )


def _check_blind(problem: Problem, z: Samples) -> None:
    """Refuse a free number on which nothing that was observed depends, at all or where the fit drives it to."""
    blind = np.flatnonzero(_felt(problem, z) < _BLIND)
    if not blind.size:
        return
    item, source = problem.coordinates[blind[0]], problem.experiment.source
    if _felt(problem, problem.start)[blind[0]] < _BLIND:
        need = "rotation rates of body and tail" if item.parameter.name == "body_rotation" else "other quantities"
        raise InputError(
            f"free = '{item.label}': nothing observed in {source} depends on it; allowed: observations of {need}, or "
            "without it"
        )
    value = problem.values_at(z)[item.label]
    unit = display_unit(value, item.parameter.unit)
    end = f"{in_unit(value, item.parameter.unit, unit)} {unit}".rstrip()
    raise UnexplainedError(
        f"free = '{item.label}': the fit drives it to the end of its range, {end}, and no value of it explains "
        f"{source}; allowed: another model, or other free parameters"
    )


def _felt(problem: Problem, z: Samples) -> Samples:
    """Largest relative change of what was observed per unit of each coordinate, (free numbers,)."""
    seen = [np.abs(s[problem.ratio(name).is_observed]).max(axis=0) for name, s in sensitivities(problem, z).items()]
    return np.asarray(np.max(seen, axis=0))


def weighted_residuals(problem: Problem, z: Samples, spread: Spread, *, prior: float = 1.0) -> Samples:
    """Residuals of least squares: means less predictions over their standard errors, and the prior's share."""
    found: Samples = _residuals(problem, z[None], spread, prior)[0]
    return found


def _residuals(problem: Problem, z: Samples, spread: Spread, prior: float) -> Samples:
    """`weighted_residuals` at many coordinates, (draws, free numbers), at once: (draws, residuals)."""
    predicted = problem.predicted(z)
    # A discrepancy is relative to the size of the mean here: else a large prediction would excuse itself.
    sized = {name: problem.ratio(name).scale for name in predicted}
    errors = standard_errors(problem, sized, spread)
    parts = []
    for name, values in predicted.items():
        ratio = problem.ratio(name)
        parts.append(((ratio.mean - values) / errors[name])[:, ratio.is_observed])
    found: Samples = np.nan_to_num(np.concatenate([*parts, prior * z], axis=1), nan=1e6, posinf=1e6, neginf=-1e6)
    return found


def _best(problem: Problem, start: Samples, spread: Spread, *, starts: int, prior: float) -> Samples:
    """The best of several local fits; the first starts at the given point, the others are spread over the prior."""
    from scipy.optimize import least_squares

    def jacobian(z: Samples) -> Samples:
        """Forward differences, all from one call: most of its cost does not depend on the number of points."""
        step = np.copysign(_SMALL_STEP * np.maximum(1.0, np.abs(z)), z)
        step = np.where(np.abs(z + step) > LARGEST, -step, step)
        rows = _residuals(problem, np.concatenate([z[None], z + np.diag(step)]), spread, prior)
        slopes: Samples = (rows[1:] - rows[0]).T / step
        return slopes

    others = np.random.default_rng(20120624).normal(size=(starts - 1, start.size))
    best, cost = start, np.inf
    for first in (start, *others):
        found = least_squares(
            lambda z: weighted_residuals(problem, z, spread, prior=prior),
            np.clip(first, -3.0, 3.0) if first is not start else first,
            jac=jacobian,
            bounds=(-LARGEST, LARGEST),
            xtol=1e-13,
            ftol=1e-13,
            gtol=1e-13,
            max_nfev=200,
        )
        if found.cost < cost * (1.0 - 1e-9):
            best, cost = found.x, found.cost
    return np.asarray(best, dtype=float)


def weighted_sensitivities(problem: Problem, z: Samples, spread: Spread) -> dict[Quantity, Samples]:
    """Change of each seen mean over its standard error per unit of each coordinate, (seen robots, free numbers)."""
    predicted = problem.predicted_at(z)
    errors = standard_errors(problem, predicted, spread)
    return {
        name: (column * (predicted[name] / errors[name])[:, None])[problem.ratio(name).is_observed]
        for name, column in sensitivities(problem, z).items()
    }


def _degrees_of_freedom(problem: Problem, z: Samples, spread: Spread) -> dict[Quantity, float]:
    """Degrees of freedom that the fit leaves each quantity: its means less its share in fitting the numbers."""
    rows = weighted_sensitivities(problem, z, spread)
    # As if the errors were a per cent: what not even that sees takes nothing away.
    sizes = [max(np.nan_to_num(spread.error[name]), LEAST_ERROR) + spread.discrepancy[name] for name in rows]
    sharp = float(np.mean(sizes)) / _SHARP
    whole = sharp * np.concatenate(list(rows.values()))
    inverse = np.linalg.inv(whole.T @ whole + np.eye(z.size))
    shares = {name: float(np.sum((sharp * own) @ inverse * (sharp * own))) for name, own in rows.items()}
    return {name: max(rows[name].shape[0] - shares[name], 0.0) for name in rows}


def _squares(problem: Problem, z: Samples, error: dict[Quantity, float]) -> dict[Quantity, tuple[float, float]]:
    """Mean squares of the relative residuals, and of what the trials' errors explain of them, by quantity."""
    found: dict[Quantity, tuple[float, float]] = {}
    for name, values in problem.predicted_at(z).items():
        ratio = problem.ratio(name)
        seen = ratio.is_observed
        relative = (ratio.mean[seen] - values[seen]) / values[seen]
        of_mean = ratio.error_of_mean(error[name])[seen] / values[seen]
        found[name] = float(np.mean(relative**2)), float(np.mean(of_mean**2))
    return found


def _discrepancy(
    problem: Problem, z: Samples, error: dict[Quantity, float], left: dict[Quantity, float]
) -> dict[Quantity, float]:
    """Relative misfit from robot to robot beyond the scatter of the trials; its prior's middle where none is left."""
    found: dict[Quantity, float] = {}
    for name, (square, expected) in _squares(problem, z, error).items():
        if left[name] < FEWEST_LEFT:
            found[name] = PRIOR_DISCREPANCY
            continue
        count = np.count_nonzero(problem.ratio(name).is_observed)
        found[name] = float(np.sqrt(max(square * count / left[name] - expected, 0.0)))
        if found[name] < 1e-9:
            found[name] = 0.0
    return found


def sampled_fit(
    problem: Problem, fit: LeastSquares, count: int, rng: np.random.Generator
) -> tuple[Samples, dict[Quantity, Samples]]:
    """Samples around a fit: coordinates (draws, free numbers), and discrepancies by quantity, (draws,)."""
    squares = _squares(problem, fit.z, fit.error)
    predicted = problem.predicted_at(fit.z)
    columns = sensitivities(problem, fit.z)
    information = np.broadcast_to(np.eye(fit.z.size), (count, fit.z.size, fit.z.size))
    taus: dict[Quantity, Samples] = {}
    for name, (square, expected) in squares.items():
        seen = problem.ratio(name).is_observed
        total = square * np.count_nonzero(seen)
        taus[name] = _sampled_discrepancy(total, expected, fit.left[name], count, rng)
        noise = (_noise(problem, name, fit.error[name]) / predicted[name] ** 2)[seen]
        weights = 1.0 / (noise + taus[name][:, None] ** 2)
        information = information + np.einsum("dn,nj,nk->djk", weights, columns[name][seen], columns[name][seen])
    root = np.linalg.cholesky(np.linalg.inv(information))
    z = fit.z + np.einsum("djk,dk->dj", root, rng.normal(size=(count, fit.z.size)))
    return z, taus


def _sampled_discrepancy(total: float, expected: float, left: float, count: int, rng: np.random.Generator) -> Samples:
    """Draws of a discrepancy given the sum of squares that a fit leaves, and its half-normal prior."""
    grid = np.concatenate([[0.0], np.geomspace(1e-5, 4.0 * DISCREPANCY_SCALE, 600)])
    variance = grid**2 + expected + LEAST_ERROR**2
    freedom = left if left >= FEWEST_LEFT else 0.0
    seen = total if freedom else 0.0
    log = -0.5 * (grid / DISCREPANCY_SCALE) ** 2 - 0.5 * freedom * np.log(variance) - 0.5 * seen / variance
    density = np.exp(log - log.max())
    cumulated = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(grid))])
    found: Samples = np.interp(rng.random(count) * cumulated[-1], cumulated, grid)
    return found


_FACTORS = ("body_drag", "body_rotation")


def paper_fit(problem: Problem) -> dict[str, float]:
    """Invert (15) for the drag factors, by their labels."""
    names = [name for name in problem.free if name != "friction"]
    wrong = [name for name in names if name not in _FACTORS]
    if wrong or problem.model.placed:
        raise InputError(
            f"method = 'paper' with free = '{(wrong or names)[0]}' and model '{problem.model.name}'; allowed: "
            "body_drag, body_rotation, friction, with a model that takes drag factors"
        )
    if np.any(problem.experiment.by_motor):
        place = int(np.argmax(problem.experiment.by_motor))
        raise InputError(
            f"{problem.experiment.source}, row {problem.experiment.rows[place][0]}, column tail_rate_Hz: empty; "
            "allowed: a tail rate, which method 'paper' inverts (15) with"
        )
    by_robot, weights = _inverted(problem)
    values: dict[str, float] = {}
    for item in problem.coordinates:
        name, inside = item.parameter.name, problem.experiment.channel == item.channel
        known = inside & np.isfinite(by_robot[name])
        if not np.any(known):
            column = "body_rate_Hz" if name == "body_rotation" else "forward_velocity_mm_s and tail_rate_Hz"
            raise InputError(
                f"{problem.experiment.source} has nothing observed for {item.label}; allowed: a column {column}"
            )
        own, weight = by_robot[name][known], weights[name][known]
        values[item.label] = float(np.sum(weight * own) / np.sum(weight))
        if values[item.label] <= 0:
            raise InputError(
                f"{problem.experiment.source}: {item.label} comes out as {values[item.label]:.3g}; allowed: "
                f"observations that model '{problem.model.name}' can explain with a positive factor"
            )
    return values


def _inverted(problem: Problem) -> tuple[dict[str, Samples], dict[str, Samples]]:
    """Factors of each robot by itself, and their weights."""
    experiment, isolated = problem.experiment, problem.forward.isolated
    one = np.ones((1, 1))
    m = problem.forward.matrices({"body_drag": one, "body_rotation": one})[0]
    force, torque = m[:, 0, :], m[:, 1, :] + m[:, 2, :]
    u, seen = experiment.advance.mean, experiment.turning.mean
    turning = np.where(np.isnan(seen), problem.forward.predict({}).turning[0], seen)
    rates = np.stack([u, turning, np.ones_like(u)], axis=-1)
    drag, rotation = isolated[0] * u, isolated[1] * seen
    by_robot = {
        "body_drag": 1.0 - np.sum(force * rates, axis=-1) / drag,
        "body_rotation": 1.0 - np.sum(torque * rates, axis=-1) / rotation,
    }
    return by_robot, {"body_drag": drag**2, "body_rotation": rotation**2}
