"""Comparison of another program's track with the robot in the pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.robot.robot import Robot
from spirillum.vision.camera.camera import opened, samples_of
from spirillum.vision.camera.optics import seen
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.learning import learnt_from
from spirillum.vision.track.track import Track

_BESIDE = 0.5
"""Distance from the robot's axis from which on a track is not the robot's, body lengths."""
_OTHERWISE = 0.25
"""Relative difference of two velocities in the picture from which on they are not of one robot."""
_SMALL = 5.0
"""Way of the robot below which velocities are not compared, pixels."""
_PIXELS = "pixels of the stored picture from its upper left corner, y downwards, of the robot"


def check_track(track: Track, table: Path, video: Path, setup: Setup, robot: Robot, folder: Path) -> tuple[Flag, ...]:
    """Flags on a track that cannot be, or does not stand, compared with the robot that the first look finds."""
    film = opened(video, setup)
    try:
        known = learnt_from(film, samples_of(film, setup.start, setup.end), setup, robot, folder).known
    except InputError:
        return (_unchecked(table, "no robot was found in the video"),)
    middle = track.picture[:, :2]
    there = np.isfinite(middle[:, 0])
    path = [(time, pose) for time, pose in known.start.path if _covered(time, track.time[there])]
    if not known.robot or not path:
        why = "no frame of it shows the robot" if known.robot else "no robot was recognised in the video"
        return (_unchecked(table, why),)
    time = np.array([at for at, _ in path])
    stated = np.column_stack([np.interp(time, track.time[there], middle[there, axis]) for axis in range(2)])
    half, tail = 0.5 * robot.body.length, robot.coupling.length + robot.tail.length
    axis = np.array([[half, 0.0, 0.0], [-half, 0.0, 0.0], [-half - tail, 0.0, 0.0]])
    found = np.array([seen(axis, pose, known.start.body.optics) for _, pose in path])
    length = float(np.median(np.hypot(*(found[:, 0] - found[:, 1]).T)))
    off = np.array([_distance(point, ends[0], ends[2]) for point, ends in zip(stated, found, strict=True)])
    if np.median(off) > _BESIDE * length:
        place = int(np.argsort(off)[off.size // 2])
        (u, v), (nose_u, nose_v), (rear_u, rear_v) = stated[place], found[place, 0], found[place, 1]
        sentence = (
            f"{table.name} places the robot at ({u:.0f}, {v:.0f}) pixels at {time[place]:.2f} s, but the picture shows "
            f"its body from ({rear_u:.0f}, {rear_v:.0f}) to ({nose_u:.0f}, {nose_v:.0f})"
        )
        if known.whole:
            raise InputError(f"{sentence}; allowed: {_PIXELS}")
        return (Flag("track-beside-the-robot", f"{sentence}: the positions have to be {_PIXELS}"),)
    return _otherwise(table, time, stated, found[:, :2].mean(axis=1))


def _unchecked(table: Path, why: str) -> Flag:
    sentence = f"{table.name} was not compared with the pictures ({why}): its positions have to be {_PIXELS}"
    return Flag("track-not-checked", sentence)


def _covered(time: float, times: Samples) -> bool:
    return bool(times.size) and times[0] <= time <= times[-1]


def _distance(point: Samples, one: Samples, other: Samples) -> float:
    """Distance of a point from a straight line between two others."""
    along = other - one
    share = np.clip((point - one) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
    return float(np.hypot(*(point - one - share * along)))


def _otherwise(table: Path, time: Samples, stated: Samples, found: Samples) -> tuple[Flag, ...]:
    """A flag where the track moves otherwise than the robot, both by their mean velocities in the picture."""
    span = float(np.ptp(time))
    if time.size < 3 or span == 0.0:
        return ()
    one, other = (np.polyfit(time - time.mean(), values, 1)[0] for values in (stated, found))
    if span * np.hypot(*other) < _SMALL or np.hypot(*(one - other)) < _OTHERWISE * np.hypot(*other):
        return ()
    sentence = (
        f"{table.name} moves by {span * np.hypot(*one):.1f} pixels where the robot in the picture moves by "
        f"{span * np.hypot(*other):.1f}: its positions have to be {_PIXELS}, and its frames those of the video"
    )
    return (Flag("track-moves-otherwise", sentence),)
