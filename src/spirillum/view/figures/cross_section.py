"""The path of a run in its tube's cross-section: the glass, the body at start and end, and where its middle went."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from spirillum.arrays import Samples
from spirillum.robot.links import outlines_of
from spirillum.robot.robot import Robot
from spirillum.view.figures.style import COLOURS, UnitPrefix

if TYPE_CHECKING:
    import xarray as xr

_RIM, _FILL, _EDGE = "#5d7486", "#dfe3e6", "#4a5258"
_ROOM = 1.06
"""Half-width of the panel over the tube's radius."""
_AROUND = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
_ALONG = np.linspace(0.0, 1.0, 12)


def silhouette(robot: Robot, position: Samples, attitude: Samples) -> Samples:
    """Outline (n, 2) of the body as seen along the tube: y and z in the lab, m.

    Args:
        robot: the robot; its body is convex.
        position: place of the body's mid-length (3,), m.
        attitude: unit quaternion w, x, y, z from body axes to the lab's.
    """
    from scipy.spatial import ConvexHull
    from scipy.spatial.transform import Rotation

    pieces = [piece.points(_ALONG) for piece in outlines_of(robot)["body"].pieces]
    x, rho = (np.concatenate(part) for part in zip(*pieces, strict=True))
    surface = np.stack(
        [x[:, None] + 0.0 * _AROUND, rho[:, None] * np.cos(_AROUND), rho[:, None] * np.sin(_AROUND)], axis=-1
    ).reshape(-1, 3)
    seen = position[1:] + Rotation.from_quat(attitude, scalar_first=True).apply(surface)[:, 1:]
    return np.asarray(seen[ConvexHull(seen).vertices], dtype=float)


def draw_cross_section(axes: Axes, dataset: xr.Dataset, robot: Robot, path: Samples) -> None:
    """Draw the tube as seen from its front end, y to the right and z up, so that positive azimuth is anticlockwise.

    Args:
        axes: an empty panel.
        dataset: a run in a tube, with `attitude`.
        robot: its robot, with a channel.
        path: (n, 3) places of the body's mid-length, m.
    """
    assert robot.channel is not None  # noqa: S101 - the caller's promise
    radius = 0.5 * robot.channel.diameter
    lengths = UnitPrefix.of(np.array([radius]), "m")
    attitude = np.asarray(dataset["attitude"].transpose("time", ...).values, dtype=float)
    whole = np.flatnonzero(np.isfinite(path).all(axis=1) & np.isfinite(attitude).all(axis=1))
    outlines = [lengths(silhouette(robot, path[row], attitude[row])) for row in whole[[0, -1]]]
    axes.add_patch(Polygon(outlines[1], closed=True, facecolor=_FILL, edgecolor=_EDGE, linewidth=0.9, zorder=2))
    axes.add_patch(
        Polygon(outlines[0], closed=True, fill=False, edgecolor=_EDGE, linewidth=0.9, linestyle="--", zorder=3)
    )
    axes.add_patch(Circle((0.0, 0.0), radius / lengths.factor, fill=False, edgecolor=_RIM, linewidth=1.6, zorder=4))
    y, z = lengths(path[:, 1]), lengths(path[:, 2])
    blue = COLOURS["blue"]
    axes.plot(y, z, color=blue, zorder=5)
    axes.plot(y[whole[:1]], z[whole[:1]], "o", color="white", markeredgecolor=blue, zorder=6)
    axes.plot(y[whole[-1:]], z[whole[-1:]], "o", color=blue, zorder=6)
    reach = _ROOM * radius / lengths.factor
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_aspect("equal", anchor="C")
    axes.grid(visible=False)
    axes.set_xlabel(f"$y$ ({lengths.unit})")
    axes.set_ylabel(f"$z$ ({lengths.unit})")
    axes.set_title("from the front; start dashed, end grey", loc="right", pad=3, size=8, color="#555555")
