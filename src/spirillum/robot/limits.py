"""Requirements on robots, over arrays: each says field, value, what is allowed, and why."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from spirillum.arrays import Flags, PerRobot
from spirillum.robot.geometry import coil_spacing, shortest_body
from spirillum.units import show

if TYPE_CHECKING:
    from spirillum.robot.batch import RobotBatch

__all__ = ["Limit", "all_hold", "assembly_limits", "broken"]


@dataclass(frozen=True)
class Limit:
    """One requirement on a field, for every robot of a batch.

    Attributes:
        field: the field's name in the robot file, or of a derived quantity.
        value: its SI value.
        relation: such as ``more than``.
        bound: the SI bound.
        unit: unit in which both are shown.
        why: the reason, half a sentence.
        holds: where the requirement holds.
        flag: short name for datasets.
    """

    field: str
    value: PerRobot
    relation: str
    bound: PerRobot
    unit: str
    why: str
    holds: Flags
    flag: str

    @classmethod
    def more_than(cls, field: str, value: PerRobot, bound: PerRobot | float, unit: str, why: str, flag: str) -> Limit:
        """`value` has to exceed `bound`."""
        limit = np.atleast_1d(np.asarray(bound, dtype=float))
        return cls(field, value, "more than", limit, unit, why, value > limit, flag)

    @classmethod
    def less_than(cls, field: str, value: PerRobot, bound: PerRobot | float, unit: str, why: str, flag: str) -> Limit:
        """`value` has to stay below `bound`."""
        limit = np.atleast_1d(np.asarray(bound, dtype=float))
        return cls(field, value, "less than", limit, unit, why, value < limit, flag)

    @classmethod
    def at_most(cls, field: str, value: PerRobot, bound: PerRobot | float, unit: str, why: str, flag: str) -> Limit:
        """`value` may not exceed `bound`."""
        limit = np.atleast_1d(np.asarray(bound, dtype=float))
        return cls(field, value, "at most", limit, unit, why, value <= limit, flag)

    def sentence(self, index: int = 0) -> str:
        """The broken requirement in words, for robot number `index`."""
        value, bound = (a[index if a.size > 1 else 0] for a in (self.value, self.bound))
        return (
            f"{self.field} = {show(value, self.unit)}; allowed: {self.relation} {show(bound, self.unit)}, "
            f"because {self.why}"
        )

    def first_broken(self) -> int:
        """Index of the first robot that breaks it."""
        return int(np.argmin(self.holds))


def broken(limits: Iterable[Limit]) -> list[Limit]:
    """The limits that at least one robot breaks."""
    return [limit for limit in limits if not np.all(limit.holds)]


def all_hold(limits: Iterable[Limit]) -> Flags:
    """Where every limit holds."""
    result: Flags = np.ones(1, dtype=bool)
    for limit in limits:
        result = result & limit.holds
    return result


def assembly_limits(batch: RobotBatch) -> list[Limit]:
    """What a robot needs so that it can be built and put into its channel."""
    b = batch
    limits = _body_limits(b) + _tail_limits(b)
    total = b.body_length + b.coupling_length + b.tail_length
    fits = "has to fit into channel.diameter"
    limits += [
        Limit.less_than(
            "body.diameter", b.body_diameter, b.channel_diameter, "mm", f"the body {fits}", "body-wider-than-channel"
        ),
        Limit.less_than(
            "coupling.diameter",
            b.coupling_diameter,
            b.channel_diameter,
            "mm",
            f"the coupling {fits}",
            "coupling-wider-than-channel",
        ),
        Limit.less_than(
            "tail.amplitude",
            b.amplitude,
            0.5 * (b.channel_diameter - b.wire_diameter),
            "mm",
            f"the tail with half its wire {fits}",
            "tail-wider-than-channel",
        ),
        Limit.at_most(
            "tail.length",
            b.tail_length,
            b.channel_length - (total - b.tail_length),
            "mm",
            "body, coupling and tail together have to fit into channel.length",
            "robot-longer-than-channel",
        ),
    ]
    return limits


def _body_limits(b: RobotBatch) -> list[Limit]:
    limits = []
    if b.shape == "sphere":
        wrong = np.abs(b.body_length - b.body_diameter) <= 1e-9 * b.body_diameter
        limits.append(
            Limit(
                "body.length",
                b.body_length,
                "exactly",
                b.body_diameter,
                "mm",
                "a sphere is as long as its diameter",
                wrong,
                "sphere-not-round",
            )
        )
    elif b.shape != "spheroid":
        limits.append(
            Limit.less_than(
                "body.fillet",
                b.fillet,
                0.5 * b.body_diameter * (1 + 1e-12),
                "mm",
                "an edge radius is at most the body's radius",
                "fillet-too-large",
            )
        )
        shortest = shortest_body(b.body_diameter, b.fillet, b.front, b.rear)
        limits.append(
            Limit.more_than(
                "body.length",
                b.body_length,
                shortest * (1 - 1e-12),
                "mm",
                "both ends have to fit into the overall length",
                "body-shorter-than-ends",
            )
        )
    coupled = b.coupling_length > 0
    limits.append(
        Limit.less_than(
            "coupling.clearance",
            np.where(coupled, b.coupling_clearance, 0.0),
            np.where(coupled, 0.5 * b.coupling_length, np.inf),
            "mm",
            "it is left free on both sides within coupling.length",
            "clearance-too-large",
        )
    )
    return limits


def _tail_limits(b: RobotBatch) -> list[Limit]:
    curvature = b.amplitude * (2 * np.pi / b.wavelength) ** 2 * b.arc_fraction**2
    return [
        Limit.less_than(
            "tail.wire_diameter",
            b.wire_diameter,
            coil_spacing(b.wavelength, b.amplitude),
            "mm",
            "neighbouring turns of the coil (tail.wavelength, tail.amplitude) would touch",
            "turns-touch",
        ),
        Limit.less_than(
            "tail.wire_diameter",
            b.wire_diameter,
            2.0 / curvature,
            "mm",
            "the wire's radius has to stay below the coil's radius of curvature",
            "wire-too-thick-for-coil",
        ),
        Limit.less_than(
            "tail.length",
            b.tail_length,
            1000.0 * b.wavelength,
            "mm",
            "a tail has at most 1000 turns of tail.wavelength",
            "too-many-turns",
        ),
    ]
