"""The field of coils while a robot swims: how fast it turns, about which axis, and how strong it is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, TypeVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.free_robot import FreeRobot
from spirillum.errors import InputError
from spirillum.kernels import rigid_links
from spirillum.robot.arguments import Options
from spirillum.robot.fields import MagneticField, Pitch, Rate, Yaw

_A = TypeVar("_A", bound=FreeRobot)


class Field(Options):
    """Settings of the coils from now on; what is not given stays as it was."""

    argument: ClassVar[str] = "field"
    prefixed: ClassVar[bool] = True

    rotation_rate: Rate | None = None
    """Rotation rate of the field about its axis."""
    yaw: Yaw | None = None
    """Angle to +y of the field's axis of rotation, up to 45 degrees; along the lab's +x without it."""
    pitch: Pitch | None = None
    """Elevation of that axis from the horizontal."""
    strength: MagneticField | None = None
    """Flux density, at right angles to the axis."""


@dataclass(frozen=True)
class TurningField:
    """A uniform field that turns about an axis, at right angles to it; SI."""

    rotation_rate: float
    """rad/s."""
    strength: float
    """T."""
    yaw: float = 0.0
    """Of the axis, rad."""
    pitch: float = 0.0
    """Of the axis, rad."""
    phase: float = 0.0
    """Angle at time 0 at this rate, from up, rad."""

    @classmethod
    def of(cls, links: FreeRobot) -> TurningField | None:
        """The field of a robot's file; None for another drive."""
        if links.drive[rigid_links.KIND] != rigid_links.MAGNETIC:
            return None
        return cls(float(links.drive[rigid_links.FIELD_RATE]), float(links.drive[rigid_links.FIELD]))

    @property
    def axis(self) -> Samples:
        """Direction of the axis in the lab, (3,)."""
        level = np.cos(self.pitch)
        return np.array([level * np.cos(self.yaw), level * np.sin(self.yaw), np.sin(self.pitch)])

    def changed(self, asked: Field, time: float) -> TurningField:
        """The field from a time on; its angle does not jump.

        Args:
            asked: what changes.
            time: s.
        """
        given = asked.model_dump(exclude_none=True)
        rate = given.get("rotation_rate", self.rotation_rate)
        return replace(self, **given, phase=self.phase + (self.rotation_rate - rate) * time)

    def on(self, links: _A) -> _A:
        """A robot in this field."""
        drive = links.drive.copy()
        drive[rigid_links.FIELD_RATE], drive[rigid_links.FIELD] = self.rotation_rate, self.strength
        drive[rigid_links.AXIS_Y : rigid_links.FIELD_PHASE] = self.axis[1:]
        drive[rigid_links.FIELD_PHASE] = self.phase
        return replace(links, drive=drive)


def in_tilted_field(links: _A, asked: Field) -> _A:
    """A robot in the field of its file, which rotates about the given axis.

    Args:
        links: what its rates follow from.
        asked: yaw and pitch of the axis; what is not given is 0.
    """
    given = asked.model_dump(exclude_none=True)
    if not given:
        return links
    own = TurningField.of(links)
    if own is None:
        raise InputError(f"field.{next(iter(given))} without a field; allowed: with drive.kind = 'magnetic'")
    for name in ("rotation_rate", "strength"):
        if name in given:
            place = "magnetic.field" if name == "strength" else f"magnetic.{name}"
            raise InputError(f"field.{name} of a run; allowed: {place} of the robot")
    return own.changed(asked, 0.0).on(links)
