"""Section of a robot by a plane: cut solids filled, solids beyond the plane outlined.

Panels have their limits before anything is plotted on them. Solids are added as artists and not as patches, for which
matplotlib looks for the extent of every segment: half a second for a tube.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path

from spirillum.arrays import Values
from spirillum.robot.links import outlines_of
from spirillum.robot.outline import Outline
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import TubePose
from spirillum.view.figures.scene import wire_lines

_GLASS, _RIM = "#dfe9f1", "#5d7486"
_FILL, _EDGE, _BEYOND = "#a3a8ac", "#22292e", "#4a5258"
_SAMPLES = np.linspace(0.0, 1.0, 400)
_CELLS_PER_RADIUS = 6.0
_MOST_CELLS = 400_000


def draw_section(
    axes: Axes, robot: Robot, plane: str, offset: float, *, phase: float, unit: float, points: float, drop: float = 0.0
) -> None:
    """Plot the robot on the plane of the panel's axes; lengths in m, `points` typographic points in a drawing unit."""
    lines = [line - np.array([0.0, 0.0, drop]) for line in wire_lines(robot, phase, 1.0)]
    across = next(number for number, axis in enumerate("xyz") if axis not in plane)
    along = [number for number in range(3) if number != across]
    if plane != "yz":
        # The tail's silhouette, in true thickness; it does not hide the flow.
        width = robot.tail.wire_diameter / unit * points
        look: dict[str, Any] = {
            "color": "white",
            "linewidth": width,
            "alpha": 0.35,
            "solid_capstyle": "round",
            "zorder": 4,
        }
        for line in lines:
            axes.plot(*line[:, along].T / unit, **look)
    for outline in outlines_of(robot).values():
        if (cut := _cut(outline, plane, 0.0)) is not None and offset != 0.0 and plane != "yz":
            axes.add_artist(
                Polygon(cut / unit, closed=True, fill=False, edgecolor=_BEYOND, linewidth=0.7, linestyle="--", zorder=5)
            )
        if (cut := _cut(outline, plane, offset)) is not None:
            axes.add_artist(Polygon(cut / unit, closed=True, facecolor=_FILL, edgecolor=_EDGE, linewidth=0.8, zorder=7))
    for line in lines:
        _draw_wire_cut(axes, robot, line, (along[0], along[1], across), offset, unit)


def draw_glass(axes: Axes, pose: TubePose, plane: str, offset: float, unit: float) -> None:
    """Plot the section of a tube's wall above the elements beyond it, on axes whose limits are set."""
    wall = _bore(pose, plane, offset, np.array(axes.get_xlim()) * unit) / unit
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    frame = np.array([[left, low], [right, low], [right, high], [left, high], [left, low]])
    # A path with a hole: the bore runs against the frame.
    codes = [[Path.MOVETO, *[Path.LINETO] * (len(line) - 1)] for line in (frame, wall)]
    glass = Path(np.concatenate([frame, wall]), np.concatenate(codes))
    axes.add_artist(PathPatch(glass, facecolor=_GLASS, edgecolor="none", zorder=5.5))
    axes.add_artist(Polygon(wall, closed=True, fill=False, edgecolor=_RIM, linewidth=1.0, zorder=5.6))


def _bore(pose: TubePose, plane: str, offset: float, ends: Values) -> Values:
    """Corners of the bore's section, clockwise, m, (n, 2); it is carried on beyond both ends of the panel."""
    first, second = ("xyz".index(axis) for axis in plane)
    third = 3 - first - second
    start = pose.across[:, third] * offset - [pose.offset, 0.0]
    along, up = pose.across[:, first], pose.across[:, second]  # on the wall |start + x along + y up| = R
    if plane == "yz":
        angle = -2.0 * np.pi * _SAMPLES
        circle = pose.radius * np.stack([np.sin(angle), -np.cos(angle)])
        corners = np.linalg.solve(np.column_stack([along, up]), circle - start[:, None]).T
        return np.asarray(corners, dtype=float)
    x = ends.mean() + 0.55 * np.ptp(ends) * np.linspace(-1.0, 1.0, 800)
    there = start + x[:, None] * along
    size = float(up @ up)
    middle: Values = -(there @ up) / size
    half = np.sqrt(np.maximum(middle**2 - (np.sum(there**2, axis=1) - pose.radius**2) / size, 0.0))
    upper, lower = np.column_stack([x, middle + half]), np.column_stack([x, middle - half])
    return np.concatenate([upper, lower[::-1]])


def _cut(outline: Outline, plane: str, offset: float) -> Values | None:
    """Corners of a solid of revolution's section, m, (n, 2); None where the plane misses it."""
    if plane == "yz":
        radius = np.fmax.reduce([piece.radius(np.array(offset)) for piece in outline.pieces])
        if not radius > 0:
            return None
        angle = 2.0 * np.pi * _SAMPLES
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    x, rho = outline.line(_SAMPLES)
    met = rho > abs(offset)
    if not met.any():
        return None
    height = np.sqrt(rho[met] ** 2 - offset**2)
    x = x[met]
    return np.column_stack([np.concatenate([x, x[::-1]]), np.concatenate([height, -height[::-1]])])


def _draw_wire_cut(
    axes: Axes, robot: Robot, line: Values, order: tuple[int, int, int], offset: float, unit: float
) -> None:
    """The wire's section: where the distance from its centreline is less than its radius."""
    from scipy.spatial import cKDTree

    radius = 0.5 * robot.tail.wire_diameter
    line = _denser(line, radius / _CELLS_PER_RADIUS)
    if np.min(np.abs(line[:, order[2]] - offset)) > radius and np.ptp(np.sign(line[:, order[2]] - offset)) == 0:
        return
    near = line[np.abs(line[:, order[2]] - offset) < 2.0 * radius] if order[2] == 0 else line
    sides = [(near[:, axis].min() - 1.5 * radius, near[:, axis].max() + 1.5 * radius) for axis in order[:2]]
    cell = radius / _CELLS_PER_RADIUS
    cell *= max(1.0, np.sqrt(np.prod([(high - low) / cell for low, high in sides]) / _MOST_CELLS))
    first, second = (np.arange(low, high + cell, cell) for low, high in sides)
    grid = np.empty((first.size, second.size, 3))
    grid[..., order[0]], grid[..., order[1]], grid[..., order[2]] = first[:, None], second[None, :], offset
    distance, _ = cKDTree(line).query(grid.reshape(-1, 3), distance_upper_bound=4.0 * radius)
    depth = radius - np.minimum(distance, 3.0 * radius).reshape(first.size, second.size)
    if not depth.max() > 0:
        return
    coordinates = (first / unit, second / unit, depth.T)
    axes.contourf(*coordinates, levels=[0.0, 2.0 * radius], colors=[_FILL], zorder=6)
    axes.contour(*coordinates, levels=[0.0], colors=[_EDGE], linewidths=0.8, zorder=6.1)


def _denser(line: Values, spacing: float) -> Values:
    """Points along a line so close that their distance and the line's are the same to the eye."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    count = int(np.clip(along[-1] / spacing, line.shape[0], _MOST_CELLS))
    positions = np.linspace(0.0, along[-1], count)
    return np.stack([np.interp(positions, along, line[:, axis]) for axis in range(3)], axis=-1)
