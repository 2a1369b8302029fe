"""Motion of a robot after release in its tube, as data: the columns beside its held answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from spirillum.envelope import quantity
from spirillum.quantities import QUANTITIES

HELD = "held"
RELEASED = "trial"
"""Motions of a robot in its tube, where a request takes one of both."""
SPEED_OF = "speed, "
"""How a progress message begins that has the speed of a column: a terminal shows it as a line of its own."""


class TrialInterval(NamedTuple):
    """A quantity of a trial over its unknowns."""

    median: float
    low: float
    high: float
    level: float

    def to_dict(self) -> dict[str, Any]:
        """The entries of the quantity in JSON."""
        return {**self._asdict(), "kind": "interval"}


@dataclass(frozen=True)
class ReleasedMotion:
    """A trial or a steady motion in the tube, or the reason why there is none; SI, rates signed about +x."""

    values: Mapping[str, float] = field(default_factory=dict)
    """Means of the quantities of `predict`, and the pose: `gap`, `pitch`, `yaw`, `azimuth`, `contact_force`."""
    basis: Mapping[str, Any] = field(default_factory=dict)
    """What the motion rests on, and what became of the robot, as entries of its JSON."""
    intervals: Mapping[str, TrialInterval] = field(default_factory=dict)
    """Intervals of the quantities over the unknowns; none where they were not requested."""
    reason: str = ""
    """Why there is none, in a sentence; empty where there is one."""

    def to_dict(self) -> dict[str, Any]:
        """The object `trial` or `steady` of an answer."""
        if self.reason:
            return {"reason": self.reason}
        over = {name: found.to_dict() for name, found in self.intervals.items()}
        values = {
            name: quantity(value, QUANTITIES[name].unit, **over.get(name, {})) for name, value in self.values.items()
        }
        return {**self.basis, **values}
