"""The virtual camera before a robot that moves step by step: a picture of each moment, as a real one would give it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spirillum.argument_validation import as_number, check_kind, validate_arguments
from spirillum.dynamics.run_file import Poses, RobotPose
from spirillum.errors import InputError, clipped
from spirillum.files import write_text
from spirillum.robot.load import is_preset, load
from spirillum.robot.robot import Robot, robot_text
from spirillum.virtual.artifacts import Degradation
from spirillum.virtual.disturbances import Disturbances, tilt_of
from spirillum.virtual.optics import check_size, lens_of, swimming_range, tank_of
from spirillum.virtual.pictures import FrameEncoder, Painter
from spirillum.virtual.trajectory import TrialTrajectory, trajectory_of
from spirillum.virtual.trial_options import CameraOptions, Seeded
from spirillum.virtual.truth import setup_text

_LAMP_TIME = 20.0  # time over which the lamp drifts once, s, as in a trial's usual length
_SHARE = 0.1  # initial position of the robot, as a share of the path on which it is fully visible


class Shot(NamedTuple):
    """A picture."""

    time: float  #: The middle of its exposure, s; the exposure ends at the moment that was shown.
    image: np.ndarray  #: 8-bit RGB, (height, width, 3), synthetic, and marked so.


class VirtualCamera:
    """Takes pictures of a robot whose poses come one by one, as from `spirillum.Plant`; all of it is synthetic."""

    @validate_arguments
    def __init__(
        self,
        robot: str | Path | Mapping[str, Any] | Robot,
        pose: RobotPose,
        *,
        camera: CameraOptions | Mapping[str, Any] | None = None,
        degradation: str | Degradation | Mapping[str, Any] | None = None,
        seed: int = 0,
    ) -> None:
        """Set the camera up above a robot, which has most of the picture before it.

        Args:
            robot: a preset's name, a robot file, its tables, or a loaded robot.
            pose: where it is at first, in the lab.
            camera: `CameraOptions`: view, direction, frame rate, size of the picture, exposure, field of view,
                distortion.
            degradation: `clean`, `degraded`, or `Degradation`; frames are lost by whoever takes none.
            seed: of all random numbers.

        Raises:
            InputError: for wrong input, or a robot that this camera cannot show.
        """
        self.camera, self.degradation = CameraOptions.of(camera), Degradation.of(degradation)
        self.robot, seed = load(robot), Seeded.of({"seed": seed}).seed
        self._tank = tank_of(self.robot, self.camera.view, self.camera.shrunk)
        self._lens = lens_of(self.camera, tilt_of(self.degradation, seed))
        check_size(self.robot, self._tank, self._lens)
        self._disturbances = Disturbances.of_robot(
            self.degradation, seed, self._lens, _LAMP_TIME, self.robot, self._tank
        )
        self._painter = Painter(self.robot, self._tank, self._lens)
        low, high = swimming_range(self.robot, self.camera)
        self._shift = low + _SHARE * (high - low) - float(pose.position[0])
        self._height = float(self._trajectory(0.0, pose, 1.0, pose).position[0, 2])
        self._last: tuple[float, RobotPose] | None = None

    def take(self, time: float, pose: RobotPose) -> Shot:
        """The picture whose exposure ends at a moment; what moved since the last picture is blurred.

        Args:
            time: of the moment, s, later than that of the picture before.
            pose: of the robot, in the lab.

        Raises:
            InputError: for a time that does not rise, or a robot that turns across the channel.
        """
        check_kind("pose", pose, "RobotPose")
        now = as_number(time)
        before = (now - 1.0, pose) if self._last is None else self._last
        if not before[0] < now < math.inf:
            last = "a number of s" if self._last is None else f"later than the picture before, {self._last[0]:g} s"
            raise InputError(f"time = {clipped(time)} s; allowed: {last}")
        trajectory, self._last = self._trajectory(*before, time, pose), (time, pose)
        exposure = min(self.camera.exposure, time - before[0])
        frames = FrameEncoder(self._painter, self._disturbances, trajectory, exposure)
        middle = time - 0.5 * exposure
        return Shot(middle, frames.image(middle))

    def setup(self, path: str | Path) -> Path:
        """Write the setup file as an experimenter would; the file of a robot that is no preset is beside it.

        Args:
            path: the file (`.toml`).
        """
        path = Path(path)
        own = path.with_name(f"{path.stem}.robot.toml")
        name = self.robot.name if is_preset(self.robot) else own.name
        if name == own.name:
            write_text(own, robot_text(self.robot))
        axis = self._height, 0.0
        write_text(path, setup_text(name, self.camera, self._lens, self._tank.spacing, axis, timed=True))
        return path

    def x_of(self, pose: RobotPose) -> float:
        """Position of a robot's mid-length along the channel from below the lens, in the tracker's convention, m."""
        return float(pose.position[0]) + self._shift

    def _trajectory(self, before: float, first: RobotPose, now: float, last: RobotPose) -> TrialTrajectory:
        """From one pose to the next, at their times."""
        both = (first, last)
        poses = Poses(
            time=np.array([before, now]),
            position=np.array([one.position for one in both]),
            attitude=np.array([one.attitude for one in both]),
            tail_phase=np.array([one.tail_phase for one in both]),
            roll=np.zeros(2),
        )
        seen = trajectory_of(poses, self.camera.view, leftwards=self.camera.leftwards, axis=self._tank.tube_height)
        return replace(seen.shifted(self._shift), time=poses.time)
