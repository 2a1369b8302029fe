"""What is not known of a robot: draws from stated ranges or from a posterior, the same for all designs."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.designs.space import Variable, variable_of
from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit, read_fit
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.robot.batch import RobotBatch, batches
from spirillum.robot.robot import Robot
from spirillum.swimming.model_choice import AUTO


class SampledRobots(NamedTuple):
    """Robots that differ in what is not known."""

    batch: RobotBatch
    """A robot for each draw, or one robot where everything is known."""
    values: Mapping[str, Samples]
    """Unknown to its values, (draws,)."""
    number: int
    """Number of draws."""
    sets: int = 1
    """Number of sets that fill the ranges evenly, each by itself and independent of the others, one after the other."""


@dataclass(frozen=True)
class Unknowns:
    """Ranges, or a posterior, of what is not known of a robot."""

    robot: Robot
    """With the posterior median in place of its own values."""
    ranges: tuple[Variable, ...] = ()
    """Fields with the ranges over which they are uniform and independent."""
    fit: Fit = NO_FIT
    """The fit whose draws are unknown."""

    @property
    def posterior(self) -> PosteriorFile | None:
        """Draws of the fit; None without one."""
        return self.fit.posterior

    @property
    def known(self) -> bool:
        """Whether there is nothing unknown."""
        return not self.ranges and self.posterior is None

    def draws(self, count: int, seed: int, sets: int = 1) -> SampledRobots:
        """Robots that may be."""
        if self.known:
            return SampledRobots(RobotBatch.of(self.robot), {}, 1)
        if self.posterior is not None:
            return _of_posterior(self.robot, self.posterior, count, seed)
        from scipy.stats import qmc

        rng = np.random.default_rng(seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # a number that is no power of two fills less evenly
            points = np.concatenate([qmc.Sobol(len(self.ranges), rng=rng).random(count // sets) for _ in range(sets)])
        values = {item.path: item.low + points[:, n] * (item.high - item.low) for n, item in enumerate(self.ranges)}
        return SampledRobots(RobotBatch.of(self.robot).with_values(values), values, len(points), sets)


def _of_posterior(robot: Robot, posterior: PosteriorFile, count: int, seed: int) -> SampledRobots:
    rng = np.random.default_rng(seed)
    values = posterior.of(robot, rng)
    size = next(iter(values.values())).size
    rows = rng.permutation(size)[:count]
    robots = posterior.drawn(robot, size, np.random.default_rng(seed))
    groups = batches([robots[row] for row in rows])
    if len(groups) != 1:
        raise InputError(
            f"{posterior.source} holds draws of force coefficients, which are no column of a batch; allowed: a "
            "posterior without normal_factor and tangential_factor, or ranges"
        )
    return SampledRobots(groups[0][1], {name: column[rows] for name, column in values.items()}, len(rows))


def unknowns_of(
    robot: Robot, unknown: Mapping[str, str | Sequence[object]] | None, posterior: str | Path | None, model: str
) -> Unknowns:
    """What is not known of a robot.

    Args:
        robot: the robot.
        unknown: dotted field to its range.
        posterior: file of a calibration's posterior.
        model: the model that will be asked, or `auto`: that of the posterior.
    """
    if posterior is not None:
        if unknown:
            raise InputError("unknown together with a posterior; allowed: one of them")
        fit = read_fit(None, posterior, *([] if model == AUTO else [model]))
        return Unknowns(fit.central(robot), fit=fit)
    return Unknowns(robot, tuple(variable_of(robot, path, given, "unknown") for path, given in (unknown or {}).items()))
