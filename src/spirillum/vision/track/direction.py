"""Direction of the channel in a picture without a ruler: the robot's own way through it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robust import mad_scale, repeated_median_line
from spirillum.vision.flag import Flag


@dataclass(frozen=True)
class DirectionConstants:
    """Direction of the channel where no ruler tells it."""

    frames: int = 10
    """Fewest frames with a place."""
    way: float = 20.0
    """Least way of a robot over the scatter of its places, to tell the direction."""
    least: float = 0.026
    """Least angle to the rows of the picture, rad: below it lengths are wrong by less than the lens's 0.03 %."""


DIRECTION = DirectionConstants()


class AlignedTrack(NamedTuple):
    """Places and headings against the channel."""

    position: Samples
    """Along and across the channel, m, (n, 2)."""
    heading: Samples
    """Angle of the motor axis to the channel, rad, (n,)."""
    flags: tuple[Flag, ...]


def align_with_path(time: Samples, position: Samples, heading: Samples) -> AlignedTrack:
    """Turn a track so that x runs along the robot's way.

    A ruler says how the camera is rolled against the channel; a stated scale does not. The channel then runs where the
    robot goes, by robust lines through its places; or, for a robot that hardly moves, along its motor axis.

    Args:
        time: of each frame, s, (n,).
        position: along the rows and columns of the picture, m, (n, 2); NaN where unknown.
        heading: angle of the motor axis to the rows, rad, (n,).
    """
    known = np.isfinite(position).all(axis=1)
    if np.count_nonzero(known) < DIRECTION.frames:
        return AlignedTrack(position, heading, ())
    at, places = time[known], position[known].T
    lines = [repeated_median_line(at, values) for values in places]
    way = np.array([float(line.slope) for line in lines]) * np.ptp(at)
    scatter = float(mad_scale(np.array([values - line.at(at) for line, values in zip(lines, places, strict=True)])))
    moves = float(np.hypot(*way)) > DIRECTION.way * scatter
    roll = float(np.arctan2(way[1], way[0])) if moves else float(np.nanmedian(heading))
    roll -= np.pi * round(roll / np.pi)  # forwards and backwards are one way
    if abs(roll) < DIRECTION.least:
        return AlignedTrack(position, heading, ())
    c, s = np.cos(roll), np.sin(roll)
    sentence = (
        f"the robot {'moves' if moves else 'lies'} at {np.degrees(roll):.1f} deg to the rows of the picture: lengths "
        "are measured along its way, so the camera is taken to be rolled; put a ruler beside the channel to be sure"
    )
    return AlignedTrack(position @ np.array([[c, -s], [s, c]]), heading - roll, (Flag("camera-rolled", sentence),))
