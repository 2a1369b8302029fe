"""Motion of a robot after release in its tube, as data: the columns that stand beside its held answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from spirillum.envelope import quantity
from spirillum.quantities import QUANTITIES


@dataclass(frozen=True)
class ReleasedMotion:
    """A trial or a steady motion in the tube, or the reason why there is none; SI, rates signed about +x."""

    values: Mapping[str, float] = field(default_factory=dict)
    """Means of the quantities of `predict`, and the pose: `gap`, `pitch`, `yaw`, `azimuth`, `contact_force`."""
    basis: Mapping[str, Any] = field(default_factory=dict)
    """What the motion rests on, and what became of the robot, as entries of its JSON."""
    reason: str = ""
    """Why there is none, in a sentence; empty where there is one."""

    def to_dict(self) -> dict[str, Any]:
        """The object `trial` or `steady` of an answer."""
        if self.reason:
            return {"reason": self.reason}
        return {**self.basis, **{name: quantity(value, QUANTITIES[name].unit) for name, value in self.values.items()}}
