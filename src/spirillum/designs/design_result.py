"""The answer of a design: the best values, how sure they are, and what decides them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.designs.confirmation import ConfirmedDesign
from spirillum.designs.evaluation import Evaluation, Objective
from spirillum.display import DisplayMixin
from spirillum.envelope import envelope, quantity
from spirillum.notes import Note
from spirillum.robot.robot import Robot
from spirillum.swimming.steady_quantities import LEVEL, STEADY

_LANDSCAPE_POINTS = 41


@dataclass(frozen=True)
class Alternative:
    """A design to compare with; SI."""

    name: str
    """`today` or `runner_up`."""
    values: Mapping[str, float]
    """Fields with their values."""
    objective: float
    """The objective; NaN where it has no answer."""
    beaten: float
    """Share of the draws in which the best design is better; without unknowns 0 or 1."""
    beaten_low: float
    """Lower end of the 95 % interval of that probability, from the finite number of draws."""
    beaten_high: float
    """Upper end."""
    keeps: bool
    """Whether it can be wound and keeps all conditions."""


@dataclass(frozen=True)
class ObjectiveProfile:
    """The objective along one variable, the others as in the best design; SI."""

    path: str
    unit: str
    values: Samples
    """Of the variable, (points,)."""
    objective: Samples
    """(points,); NaN where a design is refused or breaks a condition."""
    low: float
    """Least value at which the objective is within one per cent of the best."""
    high: float
    """Largest such value."""
    binds: str
    """What ends the range that is allowed, beside the best value; empty where nothing does."""


@dataclass(frozen=True)
class Uncertainty:
    """What the unknowns make of the best design."""

    draws: int
    """Number of draws from which it is stated; none of them was used in the search."""
    low: Mapping[str, float]
    """Lower ends of the 95 % intervals of all quantities, SI."""
    high: Mapping[str, float]
    """Upper ends."""
    probability: tuple[float, float, float] | None
    """Probability that the target is met, with its 95 % interval; None without a target."""
    deciding: Mapping[str, float]
    """Unknown to the share of the objective's spread that goes with it: squared rank correlation over the draws."""


class Learned(NamedTuple):
    """How well a model that is learned is known where the best design is."""

    solves: int
    """Designs around which the flow was solved for."""
    last: float
    """Relative difference of the objective of the best design, learned and then solved."""
    left_out: float
    """Root mean square error of the objective of the better half of the solved designs, each learned from the others,
    relative."""


@dataclass(frozen=True, repr=False)
class Design(DisplayMixin):
    """The best values of some fields of a robot, SI."""

    robot: Robot
    """The robot with the best values."""
    today: Robot = field(repr=False)
    """The robot as it was given."""
    model: str
    objectives: tuple[Objective, ...] = field(repr=False)
    conditions: tuple[str, ...]
    values: Mapping[str, float]
    """Fields with their best values."""
    units: Mapping[str, str] = field(repr=False)
    objective: float
    """The objective of the best design, from draws that were not used in the search."""
    quantities: Mapping[str, float] = field(repr=False)
    """Every quantity of steady swimming, its mean over the draws."""
    uncertainty: Uncertainty | None
    alternatives: tuple[Alternative, ...]
    profiles: tuple[ObjectiveProfile, ...] = field(repr=False)
    front: Mapping[str, Samples] | None = field(repr=False)
    """With two objectives, designs of which none is better in both: fields and both objectives, (points,)."""
    searched: Evaluation = field(repr=False, compare=False)
    """Designs under the draws of the search, for those who want to know more of them."""
    bound_by: tuple[str, ...]
    """What the best design touches: ends of ranges and conditions."""
    swum: int
    refused: int
    breaking: int
    warnings: tuple[Note, ...]
    learned: Learned | None = None
    """Accuracy of a model that solves for the flow; None where it was evaluated for every design."""
    model_reason: str = ""
    """Reason of the model, in half a sentence; empty where it was named."""
    leading: tuple[Samples, ...] = field(default=(), repr=False)
    """The best design and the next ones, at least a tenth of a range apart: positions in the ranges, (variables,)."""
    confirmed: tuple[ConfirmedDesign, ...] = ()
    """Trials of these, by `tube`; none for other models."""

    @property
    def calibrated(self) -> bool:
        """Whether calibration factors for this model, the robot's or a posterior's, apply to every design."""
        return self.model in self.searched.space.robot.calibration

    @property
    def winding(self) -> dict[str, float]:
        """How to wind the tail: mandrel, pitch, turns and length of wire, m."""
        tail = self.robot.tail
        return {
            "mandrel_diameter": 2.0 * tail.amplitude - tail.wire_diameter,
            "pitch": tail.wavelength,
            "turns": tail.length / tail.wavelength,
            "wire_length": self.robot.derived()["arc_length"].value,
        }

    @cached_property
    def landscape(self) -> tuple[Samples, Samples, Samples] | None:
        """With two variables: their values and the objective under the draws of the search, (n,), (m,), (m, n)."""
        variables = self.searched.space.variables
        if len(variables) != 2:
            return None
        axes = []
        for item in variables:
            whole = [item.share(value) for value in np.arange(item.low, item.high + 1.0)] if item.is_whole else None
            axes.append(np.linspace(0.0, 1.0, _LANDSCAPE_POINTS) if whole is None else np.array(whole))
        x, y = np.meshgrid(*axes)
        values = self.searched.scores(np.stack([x.ravel(), y.ravel()], axis=-1)).values[0]
        return variables[0].at(axes[0]), variables[1].at(axes[1]), values.reshape(x.shape)

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum design --json`."""
        named = {item.name: item for item in STEADY}
        first = self.objectives[0]
        unit = first.unit
        content: dict[str, Any] = {
            "robot": self.today.name,
            "model": self.model,
            "calibrated": self.calibrated,
            **({"model_reason": self.model_reason} if self.model_reason else {}),
            "objective": {"words": first.words, **quantity(self.objective, unit)},
            "conditions": list(self.conditions),
            "design": {path: quantity(value, self.units[path]) for path, value in self.values.items()},
            "winding": {name: quantity(value, "1" if name == "turns" else "m") for name, value in self.winding.items()},
            "bound_by": list(self.bound_by),
            "quantities": {
                name: quantity(value, named[name].unit, **self._ends(name)) for name, value in self.quantities.items()
            },
            "alternatives": [
                {
                    "name": other.name,
                    "design": {path: quantity(value, self.units[path]) for path, value in other.values.items()},
                    "objective": quantity(other.objective, unit),
                    "keeps_conditions": other.keeps,
                    "probability_that_the_design_is_better": quantity(
                        other.beaten, "1", low=other.beaten_low, high=other.beaten_high, kind="interval", level=LEVEL
                    ),
                }
                for other in self.alternatives
            ],
            "sensitivity": {
                profile.path: {
                    "within_one_per_cent": quantity([profile.low, profile.high], profile.unit),
                    "binds": profile.binds,
                    "values": quantity(profile.values, profile.unit),
                    "objective": quantity(profile.objective, unit),
                }
                for profile in self.profiles
            },
            "designs": {"swum": self.swum, "refused": self.refused, "breaking_a_condition": self.breaking},
        }
        if self.confirmed:
            content["confirmed"] = [self._confirmed(one) for one in self.confirmed]
        if self.uncertainty is not None:
            content["uncertainty"] = self._uncertainty(self.uncertainty)
        if self.learned is not None:
            content["learned"] = {
                "solves": self.learned.solves,
                "error_of_the_best": quantity(self.learned.last, "1"),
                "error_left_out": quantity(self.learned.left_out, "1"),
            }
        if self.front is not None:
            units = dict(self.units) | {item.name: item.unit for item in self.objectives}
            content["front"] = {name: quantity(column, units[name]) for name, column in self.front.items()}
        return envelope("design", content, self.warnings)

    def _confirmed(self, one: ConfirmedDesign) -> dict[str, Any]:
        space = self.searched.space
        values = zip(space.variables, space.values(one.shares[None])[0], strict=True)
        return {
            "design": {item.path: quantity(float(value), item.unit) for item, value in values},
            "held": {"forward_velocity": quantity(one.held, "m/s")},
            "trial": one.trial.to_dict(),
        }

    def _ends(self, name: str) -> dict[str, Any]:
        known = self.uncertainty
        if known is None or not np.isfinite(known.low.get(name, np.nan)):
            return {}
        return {"low": known.low[name], "high": known.high[name], "kind": "interval", "level": LEVEL}

    def _uncertainty(self, known: Uncertainty) -> dict[str, Any]:
        found: dict[str, Any] = {"draws": known.draws, "deciding": dict(known.deciding)}
        if known.probability is not None:
            share, low, high = known.probability
            found["probability"] = quantity(share, "1", low=low, high=high, kind="interval", level=LEVEL)
        return found
