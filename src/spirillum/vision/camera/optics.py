"""Projection of points in the tank into the picture, and its inverse at a given height."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import pixels_of_points, points_of_pixels
from spirillum.vision.setup import Setup

DIRECTIONS = {"right": 0.0, "left": -np.pi, "up": 0.5 * np.pi, "down": -0.5 * np.pi}
"""Angle by which each direction in the picture lies against the clock from the right, rad."""


def opposite(direction: str) -> str:
    """The other end of a direction in the picture."""
    return {"right": "left", "left": "right", "up": "down", "down": "up"}[direction]


class BodyPose(NamedTuple):
    """Pose of the body's mid-length in the camera's frame, at the height of the robot's axis."""

    x: float  #: Position along the channel from below the lens, m.
    y: float  #: Lateral position from below the lens, m.
    heading: float  #: Angle of the motor axis to the x axis about +z, rad.


@dataclass(frozen=True)
class Optics:
    """A pinhole camera with radial distortion above a flat refracting surface.

    The frame has x along the channel towards the nose, z from the reference plane towards the camera, y = z x x; the
    lens is at (0, 0, height). Pixels (u right, v down) have their centres at integer coordinates. Without tilts the
    camera looks along -z with x towards `direction` in the picture. It is rotated by `rotation` about its optical axis,
    then by `tilt_y` about y, then by `tilt_x` about x.
    """

    size: tuple[int, int]  #: Width and height of the picture, pixels.
    focal: float  #: Focal length, pixels.
    height: float  #: Height of the lens above the reference plane, m.
    axis_height: float  #: Height of the robot's axis above the reference plane, m.
    surface: float | None = None  #: Height of the surface above the reference plane, m; None: no refraction.
    index: float = 1.0  #: Refractive index below the surface over that above.
    centre: tuple[float, float] | None = None  #: Principal point, pixels; None: the centre of the picture.
    tilt_x: float = 0.0  #: Tilt about x, rad.
    tilt_y: float = 0.0  #: Tilt about y, rad.
    rotation: float = 0.0  #: Rotation about the optical axis, rad.
    k1: float = 0.0  #: Radial distortion: r, the tangent of the angle to the axis, becomes r (1 + k1 r^2 + k2 r^4).
    k2: float = 0.0  #: Radial distortion of fourth order.
    direction: str = "right"  #: Where in the picture x points: one of `DIRECTIONS`.

    @cached_property
    def numbers(self) -> Samples:
        """Parameters for the compiled loops, (17,): focal, u, v, k1, k2, height, surface, index, rotation matrix."""
        turn = self.rotation - DIRECTIONS[self.direction]
        (c_x, s_x), (c_y, s_y), (c_z, s_z) = ((np.cos(a), np.sin(a)) for a in (self.tilt_x, self.tilt_y, turn))
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, c_x, -s_x], [0.0, s_x, c_x]])
        about_y = np.array([[c_y, 0.0, s_y], [0.0, 1.0, 0.0], [-s_y, 0.0, c_y]])
        about_z = np.array([[c_z, -s_z, 0.0], [s_z, c_z, 0.0], [0.0, 0.0, 1.0]])
        axes = (about_x @ about_y @ about_z).T  # rows: right, up and backwards of the camera
        u, v = self.picture_centre if self.centre is None else self.centre
        refracts = self.surface is not None and self.index != 1.0
        surface, index = (self.surface, self.index) if refracts else (-1e30, 1.0)
        head = [self.focal, u, v, self.k1, self.k2, self.height, surface, index]
        return np.concatenate([np.array(head, dtype=float), axes.ravel()])

    @property
    def upright(self) -> bool:
        """Whether the channel runs along the picture's columns rather than its rows."""
        return self.direction in ("up", "down")

    @property
    def picture_centre(self) -> tuple[float, float]:
        """Centre of the picture, pixels."""
        return 0.5 * (self.size[0] - 1.0), 0.5 * (self.size[1] - 1.0)

    def pixels(self, points: Samples) -> Samples:
        """Project points (k, 3), m, to pixels (k, 2); NaN behind the camera."""
        points = np.ascontiguousarray(points, dtype=float)
        found = np.empty((len(points), 2))
        pixels_of_points(points, self.numbers, found)
        return found

    def points(self, pixels: Samples, height: float) -> Samples:
        """Points (k, 3), m, at a height on the rays of pixels (k, 2); NaN where a ray does not reach the height."""
        pixels = np.ascontiguousarray(pixels, dtype=float)
        found = np.empty((len(pixels), 3))
        points_of_pixels(pixels, float(height), self.numbers, found)
        return found

    @cached_property
    def origin(self) -> Samples:
        """Point at the height of the axis on the ray of the picture's centre: the origin of a track, m, (3,)."""
        return np.asarray(self.points(np.array([self.picture_centre]), self.axis_height)[0])

    @cached_property
    def length_per_pixel(self) -> float:
        """Length per pixel along x, at the height of the axis in the centre of the picture, m."""
        step = 1e-3 * self.height
        ends = self.origin + np.array([[-step, 0.0, 0.0], [step, 0.0, 0.0]])
        return float(2.0 * step / np.linalg.norm(np.diff(self.pixels(ends), axis=0)))

    def reduced(self, factor: int) -> Self:
        """Return the camera of pictures binned by `factor` by `factor` pixels, from the upper left."""
        if factor == 1:
            return self
        size = self.size[0] // factor, self.size[1] // factor
        u, v = (
            (at - 0.5 * (factor - 1)) / factor for at in (self.picture_centre if self.centre is None else self.centre)
        )
        return replace(self, size=size, focal=self.focal / factor, centre=(u, v))

    def moved(self, changes: Mapping[str, float]) -> Self:
        """A copy with changed parameters."""
        return replace(self, **changes)  # type: ignore[arg-type]


def optics_of(setup: Setup, size: tuple[int, int], focal: float) -> Optics:
    """The camera of a setup, upright and without distortion; lengths in pixels."""
    return Optics(
        size=size,
        focal=focal,
        height=setup.camera.height,
        axis_height=setup.robot.axis_height,
        surface=setup.tank.surface,
        index=setup.tank.index,
        direction=setup.robot.direction,
    )


def placed(points: Samples, pose: BodyPose, axis_height: float) -> Samples:
    """Transform points (k, 3) from the body's to the camera's frame, m."""
    cos, sin = np.cos(pose.heading), np.sin(pose.heading)
    turned: Samples = points @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    turned += np.array([pose.x, pose.y, axis_height])
    return turned


def project(points: Samples, pose: BodyPose, optics: Optics) -> Samples:
    """Project points (k, 3) in the body's frame, m, to pixels (k, 2)."""
    return optics.pixels(placed(points, pose, optics.axis_height))


def positions_seen_by(one: Optics, other: Optics, places: Samples) -> Samples:
    """Positions (n, 2) by camera `one` at the pixels where camera `other` shows `places` (n, 2), at axis height, m."""
    points = np.column_stack([places, np.full(len(places), other.axis_height)])
    return np.asarray(one.points(other.pixels(points), one.axis_height)[:, :2])
