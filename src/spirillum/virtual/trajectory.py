"""TrialTrajectory of the robot in the camera's frame: steady swimming, or a run of `spirillum simulate`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.dynamics.run_file import Poses

_MAX_OBLIQUITY = 0.5  # largest angle of a run's robot to the channel, rad
_SAMPLES_PER_TURN = 240  # samples of the wobble per turn of the tail


@dataclass(frozen=True)
class CameraFramePose:
    """Position and attitude of the robot at one time, in the camera's frame."""

    position: Samples  #: The body's mid-length, m, (3,).
    body: Samples  #: Rotation of the body, (3, 3).
    rotor: Samples  #: Rotation of the rotor from its tail at phase 0, (3, 3).


@dataclass(frozen=True)
class TrialTrajectory:
    """Position and angles over time in the camera's frame, linear between samples."""

    time: Samples = field(repr=False)  #: (n,) increasing, s.
    position: Samples = field(repr=False)  #: The body's mid-length, m, (n, 3).
    heading: Samples = field(repr=False)  #: Angle of the motor axis to x in the picture's plane, about +z, rad, (n,).
    pitch: Samples = field(repr=False)  #: Angle by which the nose points towards the camera, rad, (n,).
    body_angle: Samples = field(repr=False)  #: Angle of the body about +x, unwrapped, rad, (n,).
    tail_phase: Samples = field(repr=False)  #: Phase of the tail about +x in the lab, unwrapped, rad, (n,).

    @property
    def duration(self) -> float:
        """From the first sample to the last, s."""
        return float(self.time[-1] - self.time[0])

    def series(self, times: Samples) -> dict[str, Samples]:
        """`x`, `y`, `z`, heading, pitch, body angle and tail phase at times, by name."""
        names = ("heading", "pitch", "body_angle", "tail_phase")
        found = {name: np.interp(times, self.time, getattr(self, name)) for name in names}
        found |= {axis: np.interp(times, self.time, self.position[:, k]) for k, axis in enumerate("xyz")}
        return found

    def at(self, time: float) -> CameraFramePose:
        """Pose at a time."""
        now = {name: float(values[0]) for name, values in self.series(np.array([time])).items()}
        attitude = _attitude(now["heading"], now["pitch"])
        position = np.array([now["x"], now["y"], now["z"]])
        return CameraFramePose(position, attitude @ _about_x(now["body_angle"]), attitude @ _about_x(now["tail_phase"]))

    def shifted(self, x: float) -> TrialTrajectory:
        """Translated along the channel by `x`, m."""
        return replace(self, position=self.position + np.array([x, 0.0, 0.0]))

    def until(self, end: float) -> TrialTrajectory:
        """Truncated at a time."""
        if end > float(self.time[-1]) * (1.0 + 1e-9):
            last = float(self.time[-1])
            raise InputError(f"duration = {end:g} s, but the run ends at {last:g} s; allowed: at most that")
        end = min(end, float(self.time[-1]))
        time = np.append(self.time[self.time < end], end)
        if time.size < 2:
            raise InputError(f"duration = {end:g} s; allowed: more than 0 s")
        now = self.series(time)
        position = np.stack([now["x"], now["y"], now["z"]], axis=-1)
        return TrialTrajectory(time, position, now["heading"], now["pitch"], now["body_angle"], now["tail_phase"])

    def rates(self) -> dict[str, float]:
        """Mean rates from the first sample to the last: `forward_velocity`, `body_rotation_rate`, ..."""
        time = self.duration
        forward = float(self.position[-1, 0] - self.position[0, 0]) / time
        body = float(self.body_angle[-1] - self.body_angle[0]) / time
        tail = float(self.tail_phase[-1] - self.tail_phase[0]) / time
        return {
            "forward_velocity": forward,
            "body_rotation_rate": body,
            "tail_rotation_rate": tail,
            "motor_rotation_rate": tail - body,
        }


def _about_x(angle: float) -> Samples:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])


def _attitude(heading: float, pitch: float) -> Samples:
    """Rotation by the heading about z, after the nose was raised by the pitch."""
    (ch, sh), (cp, sp) = (np.cos(heading), np.sin(heading)), (np.cos(pitch), np.sin(pitch))
    turn = np.array([[ch, -sh, 0.0], [sh, ch, 0.0], [0.0, 0.0, 1.0]])
    raise_nose = np.array([[cp, 0.0, -sp], [0.0, 1.0, 0.0], [sp, 0.0, cp]])
    return np.asarray(turn @ raise_nose)


def steady_trajectory(
    duration: float,
    *,
    forward_velocity: float,
    body_rotation_rate: float,
    tail_rotation_rate: float,
    position: Samples,
    heading: float = 0.0,
    wobble: float = 0.0,
    body_angle: float = 0.0,
    tail_phase: float = 0.0,
) -> TrialTrajectory:
    """Swimming at constant rates along the channel; `wobble` is the amplitude of a transverse oscillation, m."""
    turns = abs(tail_rotation_rate) * duration / (2.0 * np.pi)
    time = np.linspace(0.0, duration, 2 + (int(_SAMPLES_PER_TURN * turns) if wobble > 0 else 0))
    path = position + np.outer(time, [forward_velocity, 0.0, 0.0])
    path[:, 1] += wobble * np.cos(tail_phase + tail_rotation_rate * time)
    return TrialTrajectory(
        time,
        path,
        np.full_like(time, heading),
        np.zeros_like(time),
        body_angle + body_rotation_rate * time,
        tail_phase + tail_rotation_rate * time,
    )


def lab_to_camera(view: str, *, leftwards: bool) -> Samples:
    """(3, 3) rotation about x from the lab (z up) to the camera's frame (z towards the camera)."""
    if view == "top":
        return np.eye(3)
    side = -1.0 if not leftwards else 1.0  # nose right: the camera stands at -y; nose left: at +y
    return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -side], [0.0, side, 0.0]])


def run_trajectory(dataset: xr.Dataset, view: str, *, leftwards: bool, axis: float, level: float) -> TrialTrajectory:
    """Trajectory of a run in the frame of the camera, whose channel axis is at the height `axis`, m."""
    from spirillum.dynamics.run_file import poses_of

    return trajectory_of(poses_of(dataset, level), view, leftwards=leftwards, axis=axis)


def trajectory_of(poses: Poses, view: str, *, leftwards: bool, axis: float) -> TrialTrajectory:
    """TrialTrajectory of a robot's poses in the lab, from the time 0 on."""
    from spirillum.dynamics.run_file import rotation_matrix

    turn = lab_to_camera(view, leftwards=leftwards)
    turns = np.array([turn @ rotation_matrix(attitude) for attitude in poses.attitude])
    noses = turns[:, :, 0]
    heading, pitch = np.arctan2(noses[:, 1], noses[:, 0]), np.arcsin(np.clip(noses[:, 2], -1.0, 1.0))
    if np.abs(heading).max() > _MAX_OBLIQUITY or np.abs(pitch).max() > _MAX_OBLIQUITY:
        raise InputError(
            f"the robot turns across the channel by more than {_MAX_OBLIQUITY} rad; allowed: one that swims along"
        )
    upright = np.array([_attitude(*angles) for angles in zip(heading.tolist(), pitch.tolist(), strict=True)])
    rolled = np.swapaxes(upright, 1, 2) @ turns
    angle = np.arctan2(rolled[:, 2, 1], rolled[:, 1, 1])
    # Unwrapped by the run's own count of turns.
    guess = angle[0] + poses.roll - poses.roll[0]
    roll = angle + 2.0 * np.pi * np.round((guess - angle) / (2.0 * np.pi))
    position = poses.position @ turn.T + np.array([0.0, 0.0, axis])
    return TrialTrajectory(poses.time - poses.time[0], position, heading, pitch, roll, roll + poses.tail_phase)
