"""Evaluation of designs under all draws of what is unknown: objectives, constraints, and what refuses a design."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from spirillum.arrays import Flags, PerRobot, Samples
from spirillum.designs.criteria import Condition, Manufacturability, Space, Variable, variable_of
from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit, read_fit
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.fluid.model import SwimmerModel
from spirillum.quantities import Quantity
from spirillum.robot.batch import RobotBatch, batches
from spirillum.robot.limits import Limit
from spirillum.robot.robot import Robot
from spirillum.swimming.motions import Swimming
from spirillum.swimming.preparation import AUTO
from spirillum.swimming.steady import swim


class SampledRobots(NamedTuple):
    """Robots that differ in what is not known."""

    batch: RobotBatch  #: A robot for each draw, or one robot where everything is known.
    values: Mapping[str, Samples]  #: Unknown to its values, (draws,).
    number: int
    sets: int = 1  #: Number of independent sets that each fill the ranges evenly, one after the other.


@dataclass(frozen=True)
class Unknowns:
    """Ranges, or a posterior, of what is not known of a robot."""

    robot: Robot  #: With the posterior median in place of its own values.
    ranges: tuple[Variable, ...] = ()  #: Fields with the ranges over which they are uniform and independent.
    fit: Fit = NO_FIT  #: The fit whose draws are unknown.

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
    robots = posterior.sampled_robots(robot, size, np.random.default_rng(seed))
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
    """What is not known of a robot."""
    if posterior is not None:
        if unknown:
            raise InputError("unknown together with a posterior; allowed: one of them")
        fit = read_fit(None, posterior, *([] if model == AUTO else [model]))
        return Unknowns(fit.central(robot), fit=fit)
    return Unknowns(robot, tuple(variable_of(robot, path, given, "unknown") for path, given in (unknown or {}).items()))


REFUSED = 1e6  #: Score of a design that cannot be built, plus what it breaks: worse than any broken condition.
BROKEN = 1e3  #: Score of a design that breaks a condition, to which the excess is added: worse than any that keeps all.
_MOST = 1e2
_TIE = 1e-6  # weight of the mean excess beside a probability, which does not change between neighbouring designs

Statistic = Literal["mean", "quantile", "probability"]


@dataclass(frozen=True)
class Objective:
    """What is best: a quantity, largest or least, by a statistic of its draws."""

    quantity: Quantity
    sign: float  #: +1 where more is better, -1 where less is.
    statistic: Statistic = "mean"
    level: float = 0.1  #: Of the statistic `quantile`: the share of the draws that are worse.
    target: Condition | None = None  #: Of the statistic `probability`: what is to be kept.

    def of(self, values: Samples) -> Samples:
        """The statistic, (designs,), of a quantity's values, (designs, draws); NaN where a draw has none."""
        if self.target is not None:
            values = np.where(np.isnan(values), np.nan, self.target.excess(values) <= 0)
        elif self.statistic == "quantile":
            return np.asarray(np.quantile(values, self.level if self.sign > 0 else 1.0 - self.level, axis=-1))
        mean: Samples = np.mean(values, axis=-1)
        return mean

    def cost(self, values: Samples) -> Samples:
        """What is minimised, (designs,)."""
        found = self.of(values)
        if self.target is None:
            return -self.sign * found
        excess = np.clip(self.target.excess(values), -1.0, 1.0)
        cost: Samples = -found + _TIE * np.mean(excess, axis=-1)
        return cost

    @property
    def direction(self) -> float:
        """+1 where a larger value is better, -1 where a smaller one is."""
        return self.sign if self.target is None else 1.0

    @property
    def name(self) -> str:
        """Name of its values in tables: the quantity's, or `probability`."""
        return self.quantity.name if self.target is None else "probability"

    @property
    def unit(self) -> str:
        """SI unit of its values."""
        return self.quantity.unit if self.target is None else "1"

    @property
    def words(self) -> str:
        """The objective in words."""
        if self.target is not None:
            return f"probability that {self.target.words}"
        name = self.quantity.name.replace("_", " ")
        kind = {"mean": "", "quantile": f"{self.level:g} quantile (worse end) of "}.get(self.statistic, "")
        return f"{'largest' if self.sign > 0 else 'least'} {kind}{name}"


class DesignScores(NamedTuple):
    """What some designs are worth."""

    cost: Samples  #: To be minimised by one objective, what is broken added, (objectives, designs).
    values: Samples  #: Of every objective; NaN for a design refused or breaking a condition, (objectives, designs).
    refused: Flags  #: Whether a design cannot be built or has no answer, (designs,).


@dataclass(frozen=True)
class Evaluation:
    """Designs of a space under some draws."""

    space: Space
    model: SwimmerModel
    objectives: tuple[Objective, ...]
    conditions: tuple[Condition, ...]
    manufacturability: Manufacturability
    samples: SampledRobots
    confidence: float  #: Share of the draws that must satisfy a condition.
    tail_rate: float | None = None  #: Prescribed rate of the tail, rad/s; None: the robot's own drive.

    def motion(self, shares: Samples | None) -> Swimming:
        """Every design under every draw, the draws of one design one after the other; None: the robot as it is."""
        batch = self.samples.batch
        if shares is not None:
            draws = self.samples.number
            columns = {path: np.repeat(column, draws) for path, column in self.space.columns(shares).items()}
            batch = batch.taken(np.tile(np.arange(batch.size), len(shares))).with_values(columns)
        return swim(batch, self.model, tail_rate=None if self.tail_rate is None else np.full(1, self.tail_rate))

    def quantity(self, motion: Swimming, name: str) -> Samples:
        """A quantity of what `motion` returns, (designs, draws)."""
        return np.asarray(getattr(motion, name)).reshape(-1, self.samples.number)

    def scores(self, shares: Samples) -> DesignScores:
        """Objective values of designs by shares of the ranges, (designs, variables); infeasible ones are skipped."""
        count = len(shares)
        excess = self.unbuildable(shares)
        cost = np.tile(REFUSED + excess, (len(self.objectives), 1))
        values = np.full((len(self.objectives), count), np.nan)
        able = np.flatnonzero(excess <= 0)
        refused = excess > 0
        if able.size == 0:
            return DesignScores(cost, values, refused)
        motion = self.motion(shares[able])
        answered = np.all(np.isfinite(self.quantity(motion, "forward_velocity")), axis=-1)
        broken = self.broken(motion)
        for row, objective in enumerate(self.objectives):
            drawn = self.quantity(motion, objective.quantity.name)
            known = answered & np.all(np.isfinite(drawn), axis=-1)
            good = known & (broken <= 0)
            own = np.where(good, np.nan_to_num(objective.cost(drawn)), BROKEN + np.nan_to_num(broken))
            cost[row, able] = np.where(known, own, REFUSED)
            values[row, able] = np.where(good, objective.of(drawn), np.nan)
        refused[able] = ~answered
        return DesignScores(cost, values, refused)

    def unbuildable(self, shares: Samples) -> Samples:
        """Summed violation of the limits of manufacture, tube and model, (designs,); 0 where there is none."""
        found = np.zeros(len(shares))
        for limit in self.limits(shares):
            found = found + np.broadcast_to(np.where(limit.holds, 0.0, _excess(limit)), found.shape)
        return found

    def limits(self, shares: Samples | None) -> list[Limit]:
        """Limits of manufacture, tube and model for designs; None: of the robot as it is."""
        batch = RobotBatch.of(self.space.robot) if shares is None else self.space.batch(shares)
        with np.errstate(all="ignore"):  # what is out of all proportion is refused by a limit
            return [*self.model.requirements(batch), *self.manufacturability.limits(batch)]

    def excess(self, condition: Condition, motion: Swimming) -> Samples:
        """By how much designs break a condition in the draws that have to keep it, (designs,)."""
        values = condition.excess(self.quantity(motion, condition.quantity.name))
        found = np.quantile(values, self.confidence, axis=-1, method="higher")
        return np.clip(np.where(np.isnan(found), _MOST, found), -_MOST, _MOST)

    def broken(self, motion: Swimming) -> Samples:
        """Largest excess over all conditions, (designs,); 0 or less where all are kept."""
        found = np.full(motion.valid.size // self.samples.number, -_MOST)
        for condition in self.conditions:
            found = np.maximum(found, self.excess(condition, motion))
        return found


def _excess(limit: Limit) -> PerRobot:
    """By how much a limit is broken, relative to its bound, 0 to 100; 100 where that is no number."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.abs(limit.value - limit.bound) / np.abs(limit.bound)
    return np.clip(np.where(np.isfinite(share), np.maximum(share, 1e-9), _MOST), 0.0, _MOST)
