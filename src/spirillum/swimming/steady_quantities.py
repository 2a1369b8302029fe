"""The answer of the steady force balance: one value of each quantity for every robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from spirillum.arrays import Flags, PerRobot
from spirillum.display import DisplayMixin
from spirillum.envelope import envelope, quantity
from spirillum.quantities import QUANTITIES, Quantity

LEVEL = 0.95
"""Level of the intervals."""


@dataclass(frozen=True, repr=False)
class Swimming(DisplayMixin):
    """Steady motion of a batch, one value for each robot, SI, rates signed about +x; NaN where not `valid`.

    Units, meanings and sources stand in `spirillum.quantities`.
    """

    forward_velocity: PerRobot
    advance_per_radian: PerRobot
    tail_rotation_rate: PerRobot
    body_rotation_rate: PerRobot
    motor_rotation_rate: PerRobot
    tail_torque: PerRobot
    drive_torque: PerRobot
    motor_current: PerRobot
    battery_voltage: PerRobot
    effective_friction: PerRobot
    motor_residual_torque: PerRobot
    electrical_power: PerRobot
    shaft_power: PerRobot
    friction_power: PerRobot
    dissipated_power: PerRobot
    hydrodynamic_efficiency: PerRobot
    propulsive_power: PerRobot
    overall_efficiency: PerRobot
    cost_of_transport: PerRobot
    reynolds_number: PerRobot
    tail_reynolds_number: PerRobot
    battery_run_time: PerRobot
    plug_velocity: PerRobot
    wobble_angle: PerRobot
    path_radius: PerRobot
    step_out_rate: PerRobot
    phase_lag: PerRobot
    valid: Flags

    def to_dict(self) -> dict[str, Any]:
        """Median, least and largest of every quantity over the robots, as data."""
        found = {item.name: np.asarray(getattr(self, item.name))[self.valid] for item in STEADY}
        known = {name: column[np.isfinite(column)] for name, column in found.items()}
        content = {
            "robots": int(self.valid.size),
            "valid": int(np.count_nonzero(self.valid)),
            **{
                name: quantity(np.median(column), QUANTITIES[name].unit, low=column.min(), high=column.max())
                for name, column in known.items()
                if column.size
            },
        }
        return envelope("swimming", content, ())

    def _shown(self) -> tuple[Mapping[str, Any], list[str]]:
        """See `DisplayMixin`: the quantities that matter most."""
        answer = self.to_dict()
        return answer, [name for name in HEADLINE if name in answer][:_SHOWN]


STEADY: tuple[Quantity, ...] = tuple(QUANTITIES[item.name] for item in fields(Swimming) if item.name != "valid")
"""The quantities of steady swimming, in their order."""


HEADLINE: tuple[str, ...] = (
    "forward_velocity",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_current",
    "step_out_rate",
    "hydrodynamic_efficiency",
    "tail_torque",
)
"""The quantities that matter most, most first: an answer shows the first five of them that apply."""
_SHOWN = 5


def headline(answer: Mapping[str, Any]) -> list[str]:
    """Names of the five quantities of a robot's JSON that matter most."""
    return [name for name in HEADLINE if answer[name]["value"] is not None][:_SHOWN]


@dataclass(frozen=True)
class Intervals:
    """Limits of the intervals of every quantity of one robot."""

    low: Mapping[str, float]
    high: Mapping[str, float]
    middle: Mapping[str, float]
    """Medians of the draws."""

    def of(self, name: str) -> dict[str, Any]:
        """Entries `low`, `high`, `kind` and `level` of a quantity's JSON; none for one that does not apply."""
        if not np.isfinite(self.low[name]):
            return {}
        return {"low": self.low[name], "high": self.high[name], "kind": "interval", "level": LEVEL}
