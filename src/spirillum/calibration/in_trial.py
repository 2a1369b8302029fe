"""The forward model of trials: runs over the free parameters, and smooth surfaces through their observables.

A trial takes a second, a fit asks for many thousands of them. Each robot makes some trials that fill the ranges of the
priors evenly (Sobol' points in the logarithms); between them its advance, turning and motor rate are interpolated by
thin-plate splines (`scipy.interpolate.RBFInterpolator`). How far a surface through three quarters of them misses the
others is their error: no prediction is taken to be better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.experiment import Experiment
from spirillum.calibration.in_tube import without_tables
from spirillum.dynamics.simulation import simulate
from spirillum.dynamics.trial import trial_means
from spirillum.errors import InputError
from spirillum.kernels.native import thread_count
from spirillum.robot.batch import RobotBatch
from spirillum.robot.robot import Robot
from spirillum.robot.toml_writer import with_numbers
from spirillum.swimming.drawn_resistance import Draws
from spirillum.swimming.model_choice import WALLED, has_table
from spirillum.swimming.preparation import prepare_all

if TYPE_CHECKING:
    from scipy.interpolate import RBFInterpolator

FREE = ("shared_friction", "friction_coefficient", "roughness")
"""Parameters that a fit of trials may free: where a robot lies follows from the run."""
_RUNS = {1: 16, 2: 32, 3: 64}
"""Trials of each robot, by the number of free parameters."""
_FEWEST = 0.75
"""Share of a robot's trials that have to have an answer."""
Ends = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class TrialSurfaces:
    """Observables of the trials of an experiment as functions of the free parameters."""

    names: tuple[str, ...]
    ends: Ends
    """Least and largest value of each parameter at which trials were made."""
    surfaces: tuple[RBFInterpolator, ...]
    """For each robot U/omega, Omega/omega and the motor's rate over the logarithms of the parameters."""
    scales: Samples
    """Sizes of these three of each robot, (robots, 3)."""
    error: float
    """Median relative error of advance and motor rate at trials that were left out."""

    def at(self, draws: Draws) -> tuple[Samples, Samples, Samples]:
        """U/omega, m/rad, Omega/omega and omega_m, rad/s, (draws, robots) each; beyond the ends as at these."""
        logs = [np.log(np.clip(draws[name], *self.ends[name])) for name in self.names]
        found = []
        for place, surface in enumerate(self.surfaces):
            x = np.stack([column[:, min(place, column.shape[1] - 1)] for column in logs], axis=-1)
            found.append(surface(x) * self.scales[place])
        stacked = np.stack(found, axis=1)
        return stacked[..., 0], stacked[..., 1], stacked[..., 2]


def check_free(free: Sequence[str], model: str) -> None:
    """Refuse parameters that a trial does not have, and models without one.

    Raises:
        InputError: naming them.
    """
    if model != WALLED:
        raise InputError(f"answer = 'trial' with model '{model}', which has no trials; allowed: model '{WALLED}'")
    wrong = [name for name in free if name not in FREE]
    if wrong:
        raise InputError(f"free = '{wrong[0]}' with answer = 'trial'; allowed: {', '.join(FREE)}")


def trial_surfaces(
    experiment: Experiment, ends: Ends, tell: Callable[[str, int, int], None], *, prepare: bool
) -> TrialSurfaces:
    """Make the trials of all robots and lay surfaces through them.

    Args:
        experiment: the observations with their robots.
        ends: free parameter to the least and largest value that its prior allows.
        tell: progress.
        prepare: make tables with yawed poses that are not there.
    """
    _tables(experiment, tell, prepare=prepare)
    return surfaces_of(experiment.robots, ends, tell)


def surfaces_of(robots: Sequence[Robot], ends: Ends, tell: Callable[[str, int, int], None]) -> TrialSurfaces:
    """Make the trials of robots with tables, and lay surfaces through them.

    Args:
        robots: the robots.
        ends: free parameter to the least and largest value at which trials are made.
        tell: progress.
    """
    names, count = tuple(ends), _RUNS[len(ends)]
    logs = _points(ends, count)
    surfaces, scales, errors = [], [], []
    for place, robot in enumerate(robots):
        seen = np.full((count, 3), np.nan)
        values = [dict(zip(names, row.tolist(), strict=True)) for row in np.exp(logs)]
        with ThreadPoolExecutor(thread_count()) as pool:  # the compiled loops release the GIL
            for number, measured in enumerate(pool.map(partial(_measured, robot), values)):
                tell("trials of the robots", place * count + number, len(robots) * count)
                seen[number] = measured
        known = np.isfinite(seen).all(axis=1)
        if known.mean() < _FEWEST:
            raise InputError(
                f"{robot.with_tail}: {count - int(known.sum())} of {count} trials have no answer; allowed: robots that "
                "stay in their tables"
            )
        scale = np.abs(seen[known]).max(axis=0)
        surfaces.append(_surface(logs[known], seen[known] / scale))
        scales.append(scale)
        errors.append(_left_out(logs[known], seen[known] / scale))
    return TrialSurfaces(names, ends, tuple(surfaces), np.array(scales), float(np.max(errors)))


def _tables(experiment: Experiment, tell: Callable[[str, int, int], None], *, prepare: bool) -> None:
    """Make the tables that are not there, or refuse."""
    known = [has_table(RobotBatch.of(robot), "yaw") for robot in experiment.robots]
    lacking = [label for label, has in zip(experiment.labels(), known, strict=True) if not has]
    if lacking and not prepare:
        raise without_tables(experiment, lacking, "a trial asks a table with yawed poses")
    if lacking:
        prepare_all(experiment.robots, stage="yaw", progress=tell)


def _points(ends: Ends, count: int) -> Samples:
    """Logarithms of the parameters at the trials, (trials, parameters)."""
    from scipy.stats import qmc

    shares = qmc.Sobol(len(ends), rng=np.random.default_rng(1)).random(count)
    low, high = (np.log([pair[end] for pair in ends.values()]) for end in (0, 1))
    found: Samples = low + (high - low) * shares
    return found


def _measured(robot: Robot, values: Mapping[str, float]) -> tuple[float, float, float]:
    """U/omega, Omega/omega and the motor's rate of a trial; NaN where there is none."""
    more: dict[str, Any] = {}
    if "roughness" in values:
        more["roughness"] = values["roughness"]
    if "friction_coefficient" in values:
        more["in_tube"] = {"friction_coefficient": values["friction_coefficient"]}
    if "shared_friction" in values:
        robot = with_numbers(robot, {"friction.effective": values["shared_friction"]})
    try:
        trial = trial_means(simulate(robot, model=WALLED, **more)).values
    except InputError:
        return (np.nan, np.nan, np.nan)
    tail = trial["tail_rotation_rate"]
    return trial["forward_velocity"] / tail, trial["body_rotation_rate"] / tail, trial["motor_rotation_rate"]


def _surface(x: Samples, values: Samples) -> RBFInterpolator:
    from scipy.interpolate import RBFInterpolator

    return RBFInterpolator(x, values, kernel="thin_plate_spline", degree=1)


def _left_out(x: Samples, values: Samples) -> float:
    """Median relative error of advance and motor rate at every fourth trial, by a surface through the others."""
    apart = np.arange(len(x)) % 4 == 3
    missed = _surface(x[~apart], values[~apart])(x[apart]) - values[apart]
    relative = np.median(np.abs(missed / values[apart]), axis=0)
    return float(max(relative[0], relative[2]))
