"""Motion of a robot as time series."""

from __future__ import annotations

from typing import NamedTuple

from spirillum.arrays import Samples


class RobotMotion(NamedTuple):
    """Position and unwrapped angles of a robot on every frame; NaN where unknown."""

    time: Samples
    """Time of each frame, s, (n,)."""
    x: Samples
    """Position along the channel, m, (n,)."""
    body_angle: Samples
    """Rotation angle of the body, unwrapped, rad, (n,)."""
    tail_phase: Samples
    """Phase of the tail, unwrapped, rad, (n,)."""
