"""What was seen of a robot on every frame of a video, and its motion as time series."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.vision.camera.scale import Scale
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.cues import Cue


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


@dataclass(frozen=True)
class Track:
    """A robot on every frame; NaN where it was not seen. SI.

    The frame has x along the channel towards the nose, z towards the camera, y = z x x; its origin lies in the middle
    of the picture, at the height of the robot's axis. All angles are signed about +x (or, for the heading, about +z).
    """

    time: Samples = field(repr=False)
    """Time of each frame in the video, s, (n,); corrected where frames were lost while the times went on evenly."""
    frame: Samples = field(repr=False)
    """Number of each frame in the video, counted as it was recorded where that is known, (n,)."""
    position: Samples = field(repr=False)
    """The body's mid-length (x, y), m, (n, 2)."""
    heading: Samples = field(repr=False)
    """Angle of the motor axis to the x axis in the plane of the picture, rad, (n,)."""
    body_angle: Samples = field(repr=False)
    """Angle by which the body has turned about +x, unwrapped, rad, (n,)."""
    tail_phase: Samples = field(repr=False)
    """Phase phi of the tail about +x in the lab, unwrapped, rad, (n,)."""
    position_error: Samples = field(repr=False)
    """Estimated standard error of the x position on each frame, m, (n,)."""
    body_angle_error: Samples = field(repr=False)
    """Estimated standard error of the body's angle on each frame, rad, (n,)."""
    tail_phase_error: Samples = field(repr=False)
    """Estimated standard error of the tail's phase on each frame, rad, (n,)."""
    picture: Samples = field(repr=False)
    """For drawing: pixel (u, v) of the body's mid-length and of its nose, (n, 4)."""
    size: tuple[int, int]
    """Width and height of the picture, pixels."""
    scale: Scale
    """Scale of lengths."""
    setup: Setup = field(repr=False)
    """The setup that it was measured with."""
    video: str
    """Name of the video."""
    flags: tuple[Flag, ...] = ()
    """What to know about it."""
    words: str = ""
    """What the video's file says of itself, such as that it is synthetic."""
    drift: float = 0.0
    """Standard uncertainty of the velocity by a camera that drifted along the channel, and by glare, m/s."""
    body_angle_drift: float = 0.0
    """Standard uncertainty of the body's angle from end to end, by glare on its stripes or their widths, rad."""
    tail_phase_drift: float = 0.0
    """Standard uncertainty of the tail's phase from end to end, by an outline that hopped and by `cue_drift`, rad."""
    time_uncertainty: float = 0.0
    """Relative standard uncertainty of the video's length in time, where lost frames were put back in doubt."""
    elongation: Samples = field(repr=False, default_factory=lambda: np.zeros(0))
    """By how much nose and rear lie farther apart than a level body's do, m, (n,); empty where no edges were fitted."""
    cues: Mapping[str, Cue] = field(repr=False, default_factory=dict)
    """Outline, seal, coupling and tail: how often each was used, and whether they agree; empty where unknown."""
    cue_drift: float = 0.0
    """Standard error of the way from the first frame to the last by cues that disagree, and by colours that lag, m."""
