"""The soft shadow of a robot on the floor of its channel, which shows how near it lies."""

from __future__ import annotations

from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.links import outlines_of
from spirillum.robot.robot import Robot

__all__ = ["add_shade", "shade"]

_ALONG, _ACROSS = 160, 49
_HALF_ANGLE = 0.9
_DARKEST = 0.5
_REACH = 0.30
"""Distance from the floor over which the shadow fades, in radii of the channel."""


def shade(robot: Robot, radius: float, height: float, x: Samples, angle: Samples) -> Samples:
    """Darkness, 0 to 1, of places on the inner side of a tube under a level robot.

    Args:
        robot: the robot.
        radius: inner radius of the tube, m.
        height: z of the motor axis in the tube's axes, m.
        x: (n,) places along the tube, m.
        angle: (m,) angles from the lowest line of the tube, rad.

    Returns:
        (n, m) a decay with the vertical distance to body and coupling; no computation of light.
    """
    from scipy.ndimage import gaussian_filter

    y, floor = radius * np.sin(angle), -radius * np.cos(angle)
    dark = np.zeros((x.size, angle.size))
    for outline in outlines_of(robot).values():
        around = np.nan_to_num(np.fmax.reduce([piece.radius(x) for piece in outline.pieces]), nan=0.0)
        below = np.sqrt(np.maximum(around[:, None] ** 2 - y**2, 0.0))
        distance = height - below - floor
        covered = np.abs(y) < around[:, None]
        dark = np.maximum(dark, np.where(covered, np.exp(-np.maximum(distance, 0.0) / (_REACH * radius)), 0.0))
    spread = 0.10 * radius
    steps = (spread / (x[1] - x[0]), spread / (radius * (angle[1] - angle[0])))
    return np.asarray(gaussian_filter(dark, steps, mode="constant"))


def add_shade(plotter: Any, pyvista: Any, robot: Robot, unit: float, height: float) -> Any:
    """Add the shadow of a robot whose body's mid-length is at x = 0; the actor moves along the tube with it.

    Args:
        plotter: the scene's plotter.
        pyvista: the library.
        robot: a robot in a channel.
        unit: length of one unit of the scene, m.
        height: z of the motor axis in the tube's axes, m.
    """
    if robot.channel is None:
        raise ValueError("a robot without a channel has no floor to shade")
    radius = 0.5 * robot.channel.diameter
    reach = 0.5 * robot.body.length + 0.5 * radius
    x = np.linspace(-reach - robot.coupling.length, reach, _ALONG)
    angle = np.linspace(-_HALF_ANGLE, _HALF_ANGLE, _ACROSS)
    along, around = np.meshgrid(x, angle, indexing="ij")
    near = 0.9985 * radius
    points = np.stack([along, near * np.sin(around), -near * np.cos(around)], axis=-1).reshape(-1, 3) / unit
    i, j = (index.ravel() for index in np.meshgrid(np.arange(_ALONG - 1), np.arange(_ACROSS - 1), indexing="ij"))
    corner = i * _ACROSS + j
    faces = np.stack([np.full(i.size, 4), corner, corner + 1, corner + _ACROSS + 1, corner + _ACROSS], axis=-1)
    mesh = pyvista.PolyData(points, faces.ravel())
    colour = np.zeros((len(points), 4), dtype=np.uint8)
    colour[:, :3] = (28, 48, 62)
    dark = shade(robot, radius, height, x, angle)
    colour[:, 3] = np.round(255 * _DARKEST * np.clip(dark, 0.0, 1.0)).ravel()
    mesh.point_data["shade"] = colour
    return plotter.add_mesh(mesh, scalars="shade", rgb=True, lighting=False, show_scalar_bar=False)
