"""From observations to parameters, with what they are worth.

Which hydrodynamic model is fitted where none is named: that with which `spirillum.predict` answers.
A model without walls fitted to robots in a tube gives factors and friction that hold what the walls do: a friction
planted in a tube comes back a fifth off. Where every observed robot has the table of its tube, `tube` is fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.calibrated import Calibrated
from spirillum.calibration.experiment import Experiment, Quantity, read_experiment
from spirillum.calibration.fit_warnings import (
    check_plausible,
    common_warnings,
    edge_warnings,
    factor_misfit_warnings,
    friction_interval_warnings,
    friction_warnings,
    inertia_warnings,
    misfit_warnings,
    narrow_channel_warnings,
    outlier_warnings,
    prior_warnings,
)
from spirillum.calibration.identifiability import (
    Identifiability,
    check_identifiable,
    friction_sensitivity,
    friction_statement,
    identified,
    torque_error,
)
from spirillum.calibration.least_squares import LeastSquares, least_squares_fit, paper_fit, sampled_fit
from spirillum.calibration.methods import METHODS
from spirillum.calibration.parameters import LEVEL, UNWALLED, Estimate, assumed_uncertainties, free_names, is_free_in
from spirillum.calibration.posterior import Posterior, Sampling, sampled
from spirillum.calibration.problem import Problem, posed, stated_spread
from spirillum.errors import InputError, check_choice
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.tube.library import TabledTube
from spirillum.notes import Note
from spirillum.optional_dependencies import import_optional
from spirillum.progress import Progress
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.swimming.motions import HELD, RELEASED
from spirillum.swimming.preparation import AUTO, IN_CHANNEL, WALLED, ModelChoice

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor


def is_fitted_in_tube(asked: str, free: str | Sequence[str] | None, method: str) -> bool:
    """Return whether a fit may include the walls: requested by name, or with `auto` allowed by its free parameters."""
    if asked != AUTO:
        return asked == WALLED
    return method != "paper" and is_free_in(WALLED, free)


def choose_fitted_model(
    asked: str, experiment: Experiment, free: str | Sequence[str] | None, method: str
) -> ModelChoice:
    """Return the model that is fitted, and why."""
    if asked != AUTO:
        return ModelChoice(find_swimmer_model(asked, AUTO).name)
    if not is_fitted_in_tube(asked, free, method):
        why = "method 'paper' inverts" if method == "paper" else "the free numbers are of"
        return ModelChoice(UNWALLED, f"{why} a model with drag factors")
    if all(robot.channel is None for robot in experiment.robots):
        return ModelChoice(UNWALLED, "no robot has a channel")
    batch = RobotBatch.of(experiment.robots)
    outside = broken(TabledTube({}).requirements(batch))
    if outside:
        raise InputError(f"{experiment.source}: {outside[0].sentence()}; or model '{UNWALLED}', without walls")
    return ModelChoice(WALLED, IN_CHANNEL)


_READINGS = ("rotor", "paper")
_FRICTION_DRAWS = 2000

RobotSource = str | Path | Mapping[str, Any] | Robot


def load_robots(robots: RobotSource | Sequence[RobotSource]) -> list[Robot]:
    """One robot or several, loaded."""
    several = isinstance(robots, Sequence) and not isinstance(robots, str)
    items: Sequence[Any] = robots if several else [robots]  # type: ignore[assignment]
    if not items:
        raise InputError("no robot is given; allowed: a preset or a robot file for each channel")
    return [load(item) for item in items]


def fit_model(
    observations: str | Path,
    robots: RobotSource | Sequence[RobotSource],
    *,
    model: str = AUTO,
    free: str | Sequence[str] | None = None,
    method: str = "posterior",
    friction: str = "rotor",
    assume_uncertainty: Mapping[str, str | float] | None = None,
    sampling: Sampling | None = None,
    prepare: bool = False,
    answer: str = HELD,
    progress: Progress | None = None,
    beside: ProcessPoolExecutor | None = None,
) -> Calibrated:
    """Fit parameters of a model to observed speeds and rates; `beside` is a process that takes half of the sampling."""
    check_choice("method", method, METHODS)
    if friction not in _READINGS:
        raise InputError(
            f"friction = {friction!r}; allowed: {', '.join(_READINGS)}, for no other reading lets (18) give B_eff"
        )
    check_choice("answer", answer, (HELD, RELEASED))
    if answer == RELEASED and method == "paper":
        raise InputError("answer = 'trial' with method 'paper', which inverts held motion; allowed: another method")
    if model != AUTO:
        free_names(free, find_swimmer_model(model, AUTO).name, released=answer == RELEASED)
    if prepare and not is_fitted_in_tube(model, free, method):
        raise InputError(f"prepare with model '{model}', which takes no tables; allowed: with model 'tube'")
    assumed = assumed_uncertainties(assume_uncertainty)
    if assumed and method == "paper":
        raise InputError("assume-uncertainty with method 'paper', which gives no intervals; allowed: another method")
    experiment = read_experiment(observations, load_robots(robots))
    choice = choose_fitted_model(model, experiment, free, method)
    names = free_names(free, choice.model, released=answer == RELEASED)
    robot = experiment.robots[0]
    driven = robot.drive is not None and robot.drive.kind == "dc-motor" and robot.drive.joint == "revolute"
    if free is None and not (driven and robot.motor is not None and np.any(experiment.motor_rate.is_observed)):
        names = tuple(name for name in names if name not in ("friction", "shared_friction"))
    if method == "posterior":  # before tables and trials are computed
        for library in ("emcee", "arviz_base", "arviz_stats"):
            import_optional(library, "method 'posterior'", "posterior")
    problem = posed(experiment, choice.model, names, progress, assumed, prepare=prepare, answer=answer)
    inertia_warnings(experiment)
    if method == "paper":
        return replace(_by_paper(problem, friction), model_reason=choice.reason)
    fit = least_squares_fit(problem)
    check_identifiable(problem, fit.z)
    check_plausible(problem, fit.z)
    report = identified(problem, fit)
    posterior = None if method == "least-squares" else sampled(problem, fit, sampling, progress, beside)
    found = _by_draws(problem, fit, report, reading=friction, posterior=posterior)
    return replace(found, model_reason=choice.reason)


def _by_paper(problem: Problem, reading: str) -> Calibrated:
    factors = paper_fit(problem)
    values = {name: Estimate(value) for name, value in factors.items()}
    z = problem.coordinate_of({name: np.array(value) for name, value in factors.items()})
    check_plausible(problem, z)
    friction: tuple[Estimate, ...] = ()
    if "friction" in problem.free:
        best = problem.friction(z[None], problem.experiment.motor_rate.mean[None], reading)[0]
        friction = tuple(Estimate(float(value)) for value in best)
    sensitivity = friction_sensitivity(problem, z, reading)
    unknown = np.full(problem.experiment.size, nan)
    return Calibrated(
        problem=problem,
        method="paper",
        reading=reading,
        values=values,
        friction=friction,
        friction_sensitivity=sensitivity,
        friction_statement=friction_statement(problem, friction, sensitivity),
        predicted={name: (values, unknown, unknown) for name, values in problem.predicted_at(z).items()},
        error={name: problem.ratio(name).pooled_error for name in problem.quantities},
        warnings=(
            Note.named("no-uncertainty"),
            *outlier_warnings(problem, z),
            *prior_warnings(problem, z),
            *factor_misfit_warnings(problem, z),
            *friction_warnings(problem, z, reading),
            *narrow_channel_warnings(problem, values),
            *common_warnings(problem, friction),
        ),
    )


def _by_draws(
    problem: Problem, fit: LeastSquares, report: Identifiability, *, reading: str, posterior: Posterior | None
) -> Calibrated:
    """Estimates with intervals from draws: of a posterior, else in coordinates around the best fit."""
    rng, unusable = np.random.default_rng(1), list[Note]()
    if posterior is None:
        z, tau = sampled_fit(problem, fit, _FRICTION_DRAWS, rng)
        middle, error, of_a_trial, draws = fit.z, fit.error, fit.error, problem.values(z)
        values = {name: _fitted(best, draws[name]) for name, best in problem.values_at(middle).items()}
        # Moments of a few residuals may give none, or one at the end of what may be: the middle of that is stated.
        discrepancy = {name: _median(tau[name]) for name in fit.discrepancy}
    else:
        chosen = posterior.flat[rng.permutation(posterior.flat.shape[0])[:_FRICTION_DRAWS]]
        free = posterior.flat[:, : len(problem.coordinates)]
        z, middle = chosen[:, : len(problem.coordinates)], np.median(free, axis=0)
        every = {name: one.reshape(-1) for name, one in posterior.values().items()}
        tau, sigma = posterior.density.nuisances(chosen)
        error = {name: float(np.median(s)) for name, s in sigma.items()}
        of_a_trial = {name: float(np.median(every[f"error_{name}"])) for name in problem.quantities}
        values = {item.label: _median(every[item.label]) for item in problem.coordinates}
        discrepancy = {name: _median(every[f"discrepancy_{name}"]) for name in problem.quantities}
        unusable = [Note.named("posterior-not-usable", words=words) for words in posterior.problems()]
        unusable += edge_warnings(problem, free)
    given, within, friction = _friction(problem, z, middle, error, reading, rng)
    sensitivity = friction_sensitivity(problem, middle, reading)
    return Calibrated(
        problem=problem,
        method="least-squares" if posterior is None else "posterior",
        reading=reading,
        values=values,
        friction=friction,
        friction_given=given,
        friction_within_model=within,
        friction_sensitivity=sensitivity,
        friction_statement=friction_statement(problem, within, sensitivity),
        predicted=_predicted(problem, middle, z, tau, rng),
        discrepancy=discrepancy,
        error=of_a_trial,
        least_squares=fit,
        posterior=posterior,
        identifiability=report,
        warnings=(
            *unusable,
            *outlier_warnings(problem, fit.z),
            *report.warnings,
            *prior_warnings(problem, fit.z),
            *friction_warnings(problem, fit.z, reading),
            *friction_interval_warnings(problem),
            *misfit_warnings(problem, discrepancy, fit),
            *narrow_channel_warnings(problem, values),
            *common_warnings(problem, friction),
        ),
    )


def _limits(draws: Samples) -> tuple[Samples, Samples]:
    """Limits of the 95 % interval along the first axis."""
    low, high = np.quantile(draws, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL], axis=0)
    return low, high


def _fitted(value: float, draws: Samples) -> Estimate:
    low, high = (float(end) for end in _limits(draws))
    return Estimate(value, min(low, value), max(high, value))


def _median(draws: Samples) -> Estimate:
    return _fitted(float(np.median(draws)), draws)


def _friction(
    problem: Problem, z: Samples, best: Samples, error: Mapping[Quantity, float], reading: str, rng: np.random.Generator
) -> tuple[tuple[Estimate, ...], tuple[Estimate, ...], tuple[Estimate, ...]]:
    """B_eff of every robot: with constants as they are, with their uncertainties, and with the torque's error too."""
    if "friction" not in problem.free:
        return (), (), ()
    ratio = problem.experiment.motor_rate
    own_error = error.get("motor_rate", ratio.sampled_error(z.shape[0], rng))
    rates = ratio.mean + ratio.error_of_mean(own_error) * rng.normal(size=(z.shape[0], problem.experiment.size))
    middle = problem.friction(best[None], ratio.mean[None], reading)[0]
    own = np.random.default_rng(2)  # one fluid, one motor and one model for all tails
    scaled = {
        name: np.exp(stated_spread(size) * own.normal(size=(z.shape[0], 1))) for name, size in problem.assumed.items()
    }
    given = within = _estimates(middle, problem.friction(z, rates, reading))
    if scaled:
        within = _estimates(middle, problem.friction(z, rates, reading, scaled))
    off = torque_error(problem)
    if off is None:
        return given, within, tuple(Estimate(item.value) for item in given)
    # In Stokes flow a torque that is off by a factor is that of a fluid whose viscosity is.
    torque = np.exp(stated_spread(off) * own.normal(size=(z.shape[0], 1)))
    scaled["viscosity"] = scaled.get("viscosity", 1.0) * torque
    return given, within, _estimates(middle, problem.friction(z, rates, reading, scaled))


def _estimates(middle: Samples, draws: Samples) -> tuple[Estimate, ...]:
    low, high = _limits(draws)
    low, high = np.minimum(low, middle), np.maximum(high, middle)  # NaN where no motor rate was observed
    return tuple(Estimate(float(m), float(a), float(b)) for m, a, b in zip(middle, low, high, strict=True))


def _predicted(
    problem: Problem, best: Samples, z: Samples, discrepancy: Mapping[Quantity, Samples], rng: np.random.Generator
) -> dict[Quantity, tuple[Samples, Samples, Samples]]:
    draws, middles = problem.predicted(z), problem.predicted_at(best)
    found: dict[Quantity, tuple[Samples, Samples, Samples]] = {}
    for name, values in draws.items():
        spread = values * (1.0 + discrepancy[name][:, None] * rng.normal(size=values.shape))
        low, high = _limits(spread)
        middle = middles[name]
        found[name] = (middle, np.minimum(low, middle), np.maximum(high, middle))
    return found
