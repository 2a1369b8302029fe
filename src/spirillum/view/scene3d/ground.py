"""A faint grid where there is no channel, against which a robot is seen to move. Lengths in units of the scene."""

from __future__ import annotations

from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.view.scene3d.camera import View

__all__ = ["add_grid"]

_COLOUR = "#c3d3dd"
_MOST_LINES = 400
_BEYOND = 8
"""Lines beyond what is to be seen, on every side."""
_WIDTH = 0.014
"""Width of a line, in distances of lines."""
_ACROSS: dict[View, int] = {"perspective": 2, "top": 2, "side": 1}
"""Axis across the grid, by view; along x there is none, for the robot swims through it."""


def add_grid(plotter: Any, pyvista: Any, view: View, low: Samples, high: Samples, step: float) -> None:
    """Add a grid below the robot, or behind it where it is seen from the side.

    Args:
        plotter: the scene's plotter.
        pyvista: the library.
        view: the view.
        low: (3,) smallest coordinates of what is to be seen in front of it.
        high: (3,) largest ones.
        step: distance of its lines.
    """
    if view not in _ACROSS:
        return
    across = _ACROSS[view]
    level = high[1] + 0.5 * step if across == 1 else low[2] - 0.5 * step
    first = np.floor(low / step - _BEYOND).astype(int)
    last = np.ceil(high / step + _BEYOND).astype(int)
    in_plane = [axis for axis in range(3) if axis != across]
    points: list[Samples] = []
    faces: list[list[int]] = []
    for axis, other in (in_plane, in_plane[::-1]):
        for line in range(first[axis], min(last[axis], first[axis] + _MOST_LINES) + 1):
            corners = np.full((4, 3), level)
            corners[:, axis] = step * (line + _WIDTH * np.array([-0.5, 0.5, 0.5, -0.5]))
            corners[:, other] = step * np.array([first[other], first[other], last[other], last[other]])
            faces.append([4, *range(len(points) * 4, len(points) * 4 + 4)])
            points.append(corners)
    mesh = pyvista.PolyData(np.concatenate(points), np.concatenate(faces))
    plotter.add_mesh(mesh, color=_COLOUR, lighting=False, show_scalar_bar=False)
