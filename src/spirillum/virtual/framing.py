"""Field of view of the virtual camera: its optics, and the visibility of the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spirillum.errors import InputError
from spirillum.notes import Note
from spirillum.robot.robot import Robot
from spirillum.virtual.optics import Tank, VirtualLens, tube_height
from spirillum.virtual.trajectory import TrialTrajectory
from spirillum.virtual.trial_options import CameraOptions

_SURFACE = 60e-3
"""Height of the oil's surface above the reference plane, m; assumed."""
_EYE = _SURFACE + 150e-3
"""Height of the lens: 150 mm above the oil, as the paper has its camera above the tank."""
_INDEX = 1.40
"""Refractive index of silicone oil."""
_FOCAL = 740.0 / 640.0
"""Focal length over the width of the usual picture; assumed."""
_SHORTEST, _LONGEST = 24, 2.0
"""Shortest robot in pixels, longest in widths of the picture."""
_LOOKS = 1001
"""Times at which the visibility of the robot is checked."""


def lens_of(camera: CameraOptions, tilt: tuple[float, float]) -> VirtualLens:
    """The lens of a camera.

    Args:
        camera: its options.
        tilt: angles of the optical axis to the vertical about x, then about y, rad.
    """
    return replace(_ideal_lens(camera), tilt=tilt, distortion=(camera.distortion, 0.0))


def _ideal_lens(camera: CameraOptions) -> VirtualLens:
    """The lens without tilt and distortion."""
    focal = _FOCAL * camera.size[0] / camera.shrunk
    return VirtualLens(_EYE, _SURFACE, _INDEX, focal, camera.size, leftwards=camera.leftwards)


def check_size(robot: Robot, tank: Tank, lens: VirtualLens) -> None:
    """The robot is large enough for this camera, and its tube small enough for the tank."""
    if tank.tube is not None and tank.tube_height + tank.outside >= lens.surface:
        most = 1e3 * (lens.surface - 2.0 * (tank.outside - tank.tube))
        raise InputError(
            f"channel.diameter = {2e3 * tank.tube:.4g} mm; allowed: less than {most:.4g} mm, a tube under the oil"
        )
    ends, (rear, nose) = _visible(lens, tank.tube_height), _extent(robot)
    width, length = ends[1] - ends[0], nose - rear
    low, high = _SHORTEST / lens.size[0] * width, _LONGEST * width
    if not low <= length <= high:
        wide = f"which a picture {1e3 * width:.4g} mm wide can show, or another field_of_view"
        allowed = f"{1e3 * low:.3g} to {1e3 * high:.4g} mm, {wide}"
        raise InputError(f"{robot.name} is {1e3 * length:.4g} mm long; allowed: {allowed}")


def swimming_range(robot: Robot, camera: CameraOptions) -> tuple[float, float]:
    """Smallest and largest x of the body's mid-length at which the whole robot is in the picture, m."""
    low, high = _visible(_ideal_lens(camera), tube_height(robot, camera.view))
    rear, nose = _extent(robot)
    return low - rear, high - nose


def framed(trajectory: TrialTrajectory, robot: Robot, lens: VirtualLens, start: float | None) -> TrialTrajectory:
    """The trajectory from a first x, or centred in the picture.

    Args:
        trajectory: of the robot.
        robot: a checked robot.
        lens: the camera.
        start: x of the body's mid-length at the first frame, m; None: centred.
    """
    _check_beside_axis(trajectory, robot, lens)
    x = trajectory.position[:, 0]
    low, high = _visible(lens, float(trajectory.position[:, 2].mean()))
    rear, nose = _extent(robot)
    centred = 0.5 * (low - rear - float(x.min()) + high - nose - float(x.max()))
    shift = centred if start is None else start - float(x[0])
    if x.max() + shift + nose < low or x.min() + shift + rear > high:
        first = 1e3 * (float(x[0]) + shift)
        raise InputError(f"start = {first:.4g} mm: the robot is never in the picture; allowed: nearer to 0")
    return trajectory.shifted(shift)


def out_of_picture(trajectory: TrialTrajectory, robot: Robot, lens: VirtualLens) -> tuple[Note, ...]:
    """A note if the robot is beyond the left or the right edge of the picture for a part of the film."""
    times = np.linspace(trajectory.time[0], trajectory.time[-1], _LOOKS)
    x = np.interp(times, trajectory.time, trajectory.position[:, 0])
    low, high = _visible(lens, float(trajectory.position[:, 2].mean()))
    rear, nose = _extent(robot)
    seen = float(np.mean((x + nose > low) & (x + rear < high)))
    if seen == 1.0:
        return ()
    length = trajectory.duration
    words = (
        f"the robot is in the picture for {seen * length:.3g} of {length:.3g} s: it swims out of it; shorten the trial"
    )
    return (Note("out-of-picture", words, ("duration",)),)


def _check_beside_axis(trajectory: TrialTrajectory, robot: Robot, lens: VirtualLens) -> None:
    """Check that the robot stays between floor and oil surface, and between the picture's upper and lower edge."""
    radius = 0.5 * robot.body.diameter
    _, y, z = trajectory.position.T
    nearer = "allowed: a lateral nearer to 0, or a run that stays nearer to the axis"
    inside = (z > 0.0) & (z < lens.surface)
    if not inside.any():
        where = "under the floor" if z[0] <= 0.0 else "above the oil"
        raise InputError(f"the robot is {where} in this view ({1e3 * float(z[0]):.4g} mm above the floor); {nearer}")
    middle = 0.5 * (lens.size[0] - 1)
    rows = np.array([[middle, 0.0], [middle, lens.size[1] - 1.0]])
    edges = lens.points(rows, float(z[inside].mean()))[:, 1]
    if not np.any(inside & (y > edges.min() - radius) & (y < edges.max() + radius)):
        raise InputError(f"the robot is never in the picture, {1e3 * float(y[0]):.4g} mm beside its centre; {nearer}")


def _visible(lens: VirtualLens, height: float) -> tuple[float, float]:
    """Smallest and largest x in the picture's middle row at a height, m."""
    middle = 0.5 * (lens.size[1] - 1)
    ends = lens.points(np.array([[0.0, middle], [lens.size[0] - 1.0, middle]]), height)[:, 0]
    return float(ends.min()), float(ends.max())


def _extent(robot: Robot) -> tuple[float, float]:
    """Smallest and largest x of a robot from its body's mid-length, m."""
    half = 0.5 * robot.body.length
    return -half - robot.coupling.length - robot.tail.length, half
