"""Per-frame detections of a robot, the cues they rest on, and its motion as time series."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robust import repeated_median_line
from spirillum.vision.camera.scale import Scale
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.contour import EDGE_CUES

_ALONG = 0, 0, 1
"""Coordinate of the pose that each cue of edges determines: x, or y for the coupling, of which the sides are seen."""


@dataclass(frozen=True)
class CueConstants:
    """Agreement of the cues to where the body is."""

    fewest: int = 5  #: Fewest edges of a cue on a frame.
    frames: int = 8  #: Fewest frames with outline and seal for a comparison of their motions.
    apart: float = 0.4  #: Flagged standard error of the displacement from end to end by cues that disagree, pixels.
    colour_drift: float = 0.1
    """Standard error of the displacement from end to end where colours locate the edges, pixels; at most a half
    of this way.

    Compression lets colours lag by this much: of nine path traced videos, at most 0.22 pixels were seen."""


CUES = CueConstants()


class Cue(NamedTuple):
    """How far a cue was used in a video."""

    share: float  #: Share of the frames on which it was used, 0 to 1.
    disagreement: float  #: Root mean square distance from the joint fit, standard deviations; NaN where it is not known


class Agreement(NamedTuple):
    """Cues of a video, and what their disagreement leaves in the speed."""

    cues: dict[str, Cue]  #: Cues by name.
    drift: float  #: Standard error of the displacement from end to end by cues that disagree, m.
    flags: tuple[Flag, ...]  #: A flag where outline and seal do not move alike, and both count.


def cue_shifts(left: Samples, slopes: Samples, used: Samples, cue: np.ndarray, level: float) -> Samples:
    """Displacement of each cue of edges from the joint pose, and its standard error, m, (cues, 2); NaN if unused."""
    found = np.full((len(EDGE_CUES), 2), np.nan)
    for number, along in enumerate(_ALONG):
        mine = (cue == number) & (used > 0.0)
        if np.count_nonzero(mine) < CUES.fewest:
            continue
        slope, weight = slopes[mine, along], used[mine]
        square = float(np.sum(weight * slope**2))
        if square > 0.0:
            found[number] = float(np.sum(weight * slope * left[mine])) / square, level / math.sqrt(square)
    return found


def agreement_of(time: Samples, shifts: Sequence[Samples], tail: Samples, pixel: float, suspect: str = "") -> Agreement:
    """Cues of a video: how often each was used, and whether they agree."""
    # Where outline and seal move unlike, the body may have followed either: the standard error of its way is that of a
    # mixture of both, with their weights.
    stack = np.array(shifts)
    cues = {}
    for number, name in enumerate(EDGE_CUES):
        ratio = stack[:, number, 0] / stack[:, number, 1]
        known = np.isfinite(ratio)
        off = float(np.sqrt(np.mean(ratio[known] ** 2))) if known.any() else math.nan
        cues[name] = Cue(float(np.mean(known)), off)
    cues["tail"] = Cue(float(np.mean(np.isfinite(tail))), math.nan)
    (outline, seal), spread = stack[:, :2, 0].T, stack[:, :2, 1]
    known = np.isfinite(outline) & np.isfinite(seal)
    if np.count_nonzero(known) < CUES.frames:
        return Agreement(cues, 0.0, ())
    apart = outline[known] - seal[known]
    way = float(repeated_median_line(time[known], apart).slope) * float(np.ptp(time[known]))
    weight = np.median(1.0 / spread[known] ** 2, axis=0)
    share = float(weight[0] / weight.sum())
    drift = abs(way) * math.sqrt(share * (1.0 - share))
    if drift < CUES.apart * pixel:
        return Agreement(cues, drift, ())
    odd = int(np.flatnonzero(known)[np.argmax(np.abs(apart - np.median(apart)))])
    why = f"the outline follows {suspect}" if suspect else "outline and seal of the body disagree"
    flag = Flag.named("cues-disagree", odd, why=why, time=time[odd], way=abs(way) / pixel)
    return Agreement(cues, drift, (flag,))


class RobotMotion(NamedTuple):
    """Position and unwrapped angles of a robot on every frame; NaN where unknown."""

    time: Samples  #: Time of each frame, s, (n,).
    x: Samples  #: Position along the channel, m, (n,).
    body_angle: Samples  #: Rotation angle of the body, unwrapped, rad, (n,).
    tail_phase: Samples  #: Phase of the tail, unwrapped, rad, (n,).


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
    position: Samples = field(repr=False)  #: The body's mid-length (x, y), m, (n, 2).
    heading: Samples = field(repr=False)  #: Angle of the motor axis to x in the plane of the picture, rad, (n,).
    body_angle: Samples = field(repr=False)  #: Angle by which the body has turned about +x, unwrapped, rad, (n,).
    tail_phase: Samples = field(repr=False)  #: Phase phi of the tail about +x in the lab, unwrapped, rad, (n,).
    position_error: Samples = field(repr=False)  #: Estimated standard error of the x position on each frame, m, (n,).
    body_angle_error: Samples = field(repr=False)  #: Standard error of the body's angle on each frame, rad, (n,).
    tail_phase_error: Samples = field(repr=False)  #: Standard error of the tail's phase on each frame, rad, (n,).
    picture: Samples = field(repr=False)  #: For drawing: pixel (u, v) of the body's mid-length and of its nose, (n, 4).
    size: tuple[int, int]  #: Width and height of the picture, pixels.
    scale: Scale  #: Scale of lengths.
    setup: Setup = field(repr=False)  #: The setup that it was measured with.
    video: str  #: Name of the video.
    flags: tuple[Flag, ...] = ()  #: What to know about it.
    words: str = ""  #: Metadata of the video's file, such as that it is synthetic.
    drift: float = 0.0
    """Standard uncertainty of the velocity by drift of the camera along the channel and by glare, m/s."""
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
    """Standard error of the displacement from end to end by cues that disagree, and by colours that lag, m."""
    sideways: Samples = field(repr=False, default_factory=lambda: np.zeros(0))
    """Distance of the seal from the pose across the channel, m, (n,); empty where no pose was fitted."""
