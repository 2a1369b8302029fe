"""Pose of a robot: position, attitude, and the angle of its tail."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.run_file import check_increasing, numbers_of
from spirillum.errors import InputError
from spirillum.units import show

if TYPE_CHECKING:
    import xarray as xr

_REST = np.array([1.0, 0.0, 0.0, 0.0])


class RobotPose(NamedTuple):
    """A robot at one moment."""

    position: Samples
    """(3,) the body's mid-length in the lab, m."""
    attitude: Samples
    """(4,) unit quaternion w, x, y, z from the body's axes to the lab's."""
    tail_phase: float
    """Angle of the tail against the body, positive about +x, rad."""

    @property
    def body(self) -> Samples:
        """4x4 matrix from the body's axes to the lab."""
        matrix = np.eye(4)
        matrix[:3, :3] = rotation_matrix(self.attitude)
        matrix[:3, 3] = self.position
        return matrix

    @property
    def rotor(self) -> Samples:
        """4x4 matrix from the axes of the rotor, its tail at phase 0, to the lab."""
        matrix = self.body
        matrix[:3, :3] = matrix[:3, :3] @ rotation_matrix(rolled(self.tail_phase))
        return matrix


def rolled(angle: float) -> Samples:
    """The quaternion of a turn about +x, rad."""
    return np.array([np.cos(0.5 * angle), np.sin(0.5 * angle), 0.0, 0.0])


def rotation_matrix(quaternion: Samples) -> Samples:
    """3x3 matrix of a unit quaternion w, x, y, z."""
    w, x, y, z = (float(value) for value in quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@dataclass(frozen=True)
class Poses:
    """A robot's way through time."""

    time: Samples
    """(n,) increasing, s."""
    position: Samples
    """(n, 3), m."""
    attitude: Samples
    """(n, 4) unit quaternions without jumps of sign."""
    tail_phase: Samples
    """(n,) not wrapped, rad."""
    roll: Samples
    """(n,) angle by which the body has turned about its axis, not wrapped, rad."""

    @property
    def duration(self) -> float:
        """From the first sample to the last, s."""
        return float(self.time[-1] - self.time[0])

    @property
    def travelled(self) -> float:
        """Largest distance between positions of the body, along the axis on which it is largest, m."""
        return float(np.ptp(self.position, axis=0).max())

    @property
    def tail_angle(self) -> Samples:
        """(n,) angle by which the tail has turned in the lab about the body's axis, rad."""
        return np.asarray(self.tail_phase + self.roll)

    def at(self, time: float) -> RobotPose:
        """The pose at a time, between samples in straight lines and even turns."""
        place = int(np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, self.time.size - 2))
        step = float(self.time[place + 1] - self.time[place])
        share = float(np.clip((time - self.time[place]) / step, 0.0, 1.0))

        def between(values: Samples) -> Samples:
            return np.asarray(values[place] + share * (values[place + 1] - values[place]))

        attitude = _turned(self.attitude[place], self.attitude[place + 1], share)
        return RobotPose(between(self.position), attitude, float(between(self.tail_phase)))


def _turned(start: Samples, end: Samples, share: float) -> Samples:
    """Part of the even turn from one quaternion to another."""
    cosine = float(np.clip(start @ end, -1.0, 1.0))
    angle = np.arccos(cosine)
    if angle < 1e-6:
        mixed = (1.0 - share) * start + share * end
    else:
        mixed = (np.sin((1.0 - share) * angle) * start + np.sin(share * angle) * end) / np.sin(angle)
    return np.asarray(mixed / np.linalg.norm(mixed))


def poses_of(dataset: xr.Dataset, height: float = 0.0) -> Poses:
    """The robot's way from a run: one with six degrees of freedom, or an axial one.

    Args:
        dataset: what `spirillum.simulate` returns.
        height: z of the motor axis in an axial run, which does not hold it, m.
    """
    time = numbers_of(dataset, "time", ())
    check_increasing(time)
    if "attitude" in dataset:
        position = numbers_of(dataset, "position", ("axis",), (3,))
        attitude = attitudes_of(dataset)
        return Poses(time, position, attitude, numbers_of(dataset, "tail_phase", ()), _roll_of(attitude))
    along, tail, body = (numbers_of(dataset, name, ()) for name in ("position", "tail_angle", "body_angle"))
    position = np.stack([along, np.zeros_like(along), np.full_like(along, height)], axis=-1)
    attitude = np.stack([np.cos(0.5 * body), np.sin(0.5 * body), 0.0 * body, 0.0 * body], axis=-1)
    return Poses(time, position, _continued(attitude), tail - body, body)


def attitudes_of(dataset: xr.Dataset) -> Samples:
    """(n, 4) attitudes of a free run as unit quaternions, without jumps of sign."""
    attitude = numbers_of(dataset, "attitude", ("quaternion",), (4,))
    off = np.abs(np.linalg.norm(attitude, axis=1) - 1.0)
    if np.any(off > 1e-2):
        bad = int(np.argmax(off))
        when = show(float(dataset["time"][bad]), "s")
        raise InputError(
            f"the run's attitude at time = {when} has the length {np.linalg.norm(attitude[bad]):.4g}; allowed: 1, "
            "a rotation"
        )
    return _continued(attitude)


def _continued(attitude: Samples) -> Samples:
    """Unit quaternions whose sign does not jump: q and -q are the same attitude."""
    unit = attitude / np.linalg.norm(attitude, axis=1)[:, None]
    sign = np.where(np.sum(unit[1:] * unit[:-1], axis=1) < 0, -1.0, 1.0)
    return np.asarray(unit * np.concatenate([[1.0], np.cumprod(sign)])[:, None])


def _roll_of(attitude: Samples) -> Samples:
    """Angle turned about the body's own axis, summed over the samples, rad."""
    (w, x, y, z), (a, b, c, d) = attitude[:-1].T, attitude[1:].T
    scalar = w * a + x * b + y * c + z * d
    along = w * b - x * a - y * d + z * c  # x of the turn from one sample to the next, in the body's axes
    steps = 2.0 * np.arctan2(along, scalar)
    return np.concatenate([[0.0], np.cumsum((steps + np.pi) % (2.0 * np.pi) - np.pi)])
