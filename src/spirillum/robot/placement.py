"""Pose of a robot in its channel, and the imposed flow."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from spirillum.arrays import Samples
from spirillum.robot.arguments import Options
from spirillum.robot.fields import Length, LengthOrZero, Pitch, Velocity, Yaw, refuse
from spirillum.units import show

Ends = Literal["open", "closed"]  #: Ends of the channel: both open into a bath, or closed (no net flux).


def gap_on_asperities(roughness: Samples | float) -> Samples:
    """Gap of a level robot whose two ends rest on asperities of a height s that carry half of its weight W each, m."""
    # They carry N(h) = W (s/h - 1)^2 at a gap h of the mean surfaces (csrc/contacts.c): for W/2 h = s/(1 + sqrt(1/2)).
    found: Samples = np.asarray(roughness, dtype=float) / (1.0 + np.sqrt(0.5))
    return found


class Placement(Options, argument="placement", prefixed=True):
    """Position and attitude of a robot in its channel, for models that compute the walls; frozen, SI inside.

    The channel is horizontal, the body's mid-length lies in the vertical plane through the channel's axis, and without
    yaw so does the robot's axis. What is None was left open: a model then takes its own default, or answers with a band
    over what is open.
    """

    gap: Length | None = None  #: Smallest distance between the body's surface and the glass.
    eccentricity: Annotated[float | None, Field(strict=True, ge=0.0, le=1.0, allow_inf_nan=False)] = None
    """Instead of `gap`, for a level robot: offset of the body's centre over R - a, towards the floor; 0 on the axis."""
    pitch: Pitch | None = None
    """Angle by which the nose is raised, about the body's mid-length; negative for a nose that is lowered."""
    yaw: Yaw = 0.0  #: Angle by which the nose is turned to +y (left), about the vertical through the body's mid-length.
    tail_drop: LengthOrZero = 0.0
    """Distance by which the tail's axis is lowered: a surrogate, impossible with a rigid joint."""
    ends: Ends | None = None
    """Ends of the channel, `open` or `closed`; unset: `open` where the robot has a `channel.length`, else `closed`."""
    flow: Velocity | None = None
    """Imposed mean velocity of the fluid far from the robot, signed about +x; instead of `ends`."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        problems = []
        if self.eccentricity is not None and self.gap is not None:
            problems.append(
                f"placement.eccentricity = {self.eccentricity:g} is given together with "
                f"placement.gap = {show(self.gap, 'mm')}; allowed: one of them"
            )
        for name, angle in (("pitch", self.pitch), ("yaw", self.yaw)):
            if self.eccentricity is not None and angle:
                problems.append(
                    f"placement.{name} = {show(angle, 'deg')} is given together with placement.eccentricity; "
                    f"allowed: 0 deg, or placement.gap for a {name}ed robot"
                )
        if self.flow is not None and self.ends is not None:
            problems.append(
                f"placement.ends = '{self.ends}' is given together with placement.flow = {show(self.flow, 'mm/s')}; "
                "allowed: one of them"
            )
        if problems:
            raise refuse(*problems)
        return self

    @property
    def is_set(self) -> bool:
        """Whether any field is set."""
        return self != type(self)()

    @property
    def level(self) -> bool:
        """Whether the robot's axis is prescribed parallel to the channel's."""
        return self.eccentricity is not None or (self.pitch == 0 and self.yaw == 0)

    def ends_of(self, channel_length: float) -> Ends | None:
        """Effective ends for a channel of that length, m (infinite or NaN: unspecified); None with an imposed flow."""
        if self.flow is not None:
            return None
        return self.ends or ("open" if np.isfinite(channel_length) else "closed")
