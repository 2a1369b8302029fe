"""Frenet-Serret frames of the wire: the picture of the local unit vectors in `docs/theory.md`."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.robot.mesh import centreline_of
from spirillum.robot.robot import Robot
from spirillum.view.figures.scene import FAINT, HALO, INK
from spirillum.view.figures.style import COLOURS, PAGE, new_figure, styled

_SIGHT = np.array([0.56, 0.76, -0.34])
"""Direction in which the picture is seen: from the side, from behind and from above."""
_POINTS = 1200
_MARKED = (0.215, 0.415, 0.63, 0.83)  # positions of the frames, shares of the axial length
_SHADES = ("#4a2410", "#c2763a", "#ffd9b0")


class FrenetFrames(NamedTuple):
    """The wire's centreline in the frame of the body, m, and its Frenet-Serret unit vectors, (n, 3)."""

    position: Samples
    tangent: Samples
    normal: Samples
    binormal: Samples


def frenet_frames(robot: Robot, xi: Samples) -> FrenetFrames:
    """Frenet-Serret frames of the wire of eq. (10), its tail at phase 0."""
    step = 1e-5 * robot.tail.length
    ahead, behind = (
        centreline_of(robot, np.clip(xi + sign * step, 0.0, robot.tail.length)).tangent for sign in (1.0, -1.0)
    )
    position, tangent, _ = centreline_of(robot, xi)
    bend = ahead - behind
    bend = bend - np.sum(bend * tangent, axis=1, keepdims=True) * tangent
    size = np.linalg.norm(bend, axis=1, keepdims=True)
    if not np.all(size > 1e-12):
        raise InputError("the wire is straight, where it has no normal; allowed: a helix")
    normal = bend / size
    return FrenetFrames(position, tangent, normal, np.asarray(np.cross(tangent, normal)))


def frenet_figure(robot: Robot) -> Figure:
    """Parallel projection of the wire at phase 0 in units of its amplitude, with t, n, b and the lab's directions."""
    tail = robot.tail
    unit = tail.amplitude
    xi = np.linspace(0.0, tail.length, _POINTS)
    wire = centreline_of(robot, xi).position / unit
    middle = wire.mean(axis=0)
    marked = frenet_frames(robot, np.array(_MARKED) * tail.length)
    reach = 0.085 * tail.length / unit
    start = wire[0] + np.array([1.6 * reach, 0.0, 0.0]) - wire[0] * np.array([0.0, 1.0, 1.0])
    away = _SIGHT / np.linalg.norm(_SIGHT)
    right = np.cross(away, np.array([0.0, 0.0, 1.0]))
    right = right / np.linalg.norm(right)
    up = np.asarray(np.cross(right, away))

    def seen(points: Samples) -> Samples:
        return np.stack([(points - middle) @ right, (points - middle) @ up], axis=-1)

    with styled():
        drawn = np.concatenate([seen(wire), seen(start + 1.3 * reach * np.eye(3)), seen(marked.position / unit)])
        low, high = drawn.min(axis=0) - 0.9 * reach, drawn.max(axis=0) + 0.9 * reach
        low[1] -= 0.4 * reach
        span = high - low
        figure = new_figure(PAGE, PAGE * float(span[1] / span[0]))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_axis_off()
        axis = seen(np.stack([start, wire[-1] * [1, 0, 0] - [0.6 * reach, 0, 0]]))
        axes.plot(axis[:, 0], axis[:, 1], color=FAINT, linewidth=0.9, dashes=(9, 3, 2, 3), zorder=1)
        points = 72.0 * PAGE / float(span[0])
        _draw_wire(axes, seen(wire), (wire - middle) @ away, tail.wire_diameter / unit * points)
        for number, position in enumerate(marked.position / unit):
            vectors = (marked.tangent[number], marked.normal[number], marked.binormal[number])
            colours = (COLOURS["blue"], COLOURS["vermillion"], COLOURS["green"])
            for name, vector, colour in zip("tnb", vectors, colours, strict=True):
                _draw_arrow(
                    axes, seen(position[None])[0], seen((position + reach * vector)[None])[0], name, colour, bold=True
                )
            axes.plot(*seen(position[None])[0], marker="o", markersize=4.5, color=INK, zorder=9)
        for name, vector in zip("xyz", np.eye(3), strict=True):
            _draw_arrow(
                axes, seen(start[None])[0], seen((start + 1.3 * reach * vector)[None])[0], name, INK, bold=False
            )
        words = "$\\mathbf{t}$ along the wire, away from its root · $\\mathbf{n}$ towards its centre of curvature · "
        axes.text(
            low[0] + 0.012 * span[0],
            low[1] + 0.03 * span[1],
            words + "$\\mathbf{b}=\\mathbf{t}\\times\\mathbf{n}$ · $xyz$: the lab, $x$ forward, $z$ up",
            size=7.5,
            color=INK,
            va="bottom",
        )
        return figure


def _draw_wire(axes: Axes, path: Samples, depth: Samples, width: float) -> None:
    """Plot a round wire: dark rim, body, light; farther parts first and darker."""
    pieces = np.stack([path[:-2], path[2:]], axis=1)
    far = (depth[1:-1] - depth.min()) / max(float(np.ptp(depth)), 1e-12)
    shades = np.array([to_rgb(colour) for colour in _SHADES])
    layers = ((1.0, 0.0, 0.0, 0.0), (0.80, 0.5, 0.0, 0.04), (0.28, 0.92, 0.16, 0.08))
    segments, colours, widths, order = [], [], [], []
    for share, tone, lift, before in layers:
        shade = np.clip(tone - 0.22 * far * (tone > 0), 0.0, 1.0)
        colours.append(np.stack([np.interp(shade, (0.0, 0.5, 1.0), shades[:, c]) for c in range(3)], axis=-1))
        segments.append(pieces + np.array([0.0, lift * (path[:, 1].max() - path[:, 1].min()) * 0.02]))
        widths.append(np.full(len(pieces), share * width))
        order.append(-far + before)
    by_depth = np.argsort(np.concatenate(order), kind="stable")
    axes.add_collection(
        LineCollection(
            list(np.concatenate(segments)[by_depth]),
            colors=np.concatenate(colours)[by_depth],
            linewidths=np.concatenate(widths)[by_depth],
            capstyle="round",
            zorder=4,
        )
    )


def _draw_arrow(axes: Axes, start: Samples, end: Samples, name: str, colour: str, *, bold: bool) -> None:
    for shade, width, order in (("white", 3.6, 7.0), (colour, 2.0 if bold else 1.2, 8.0)):
        axes.add_patch(
            FancyArrowPatch(
                (float(start[0]), float(start[1])),
                (float(end[0]), float(end[1])),
                arrowstyle="-|>",
                mutation_scale=9,
                linewidth=width,
                color=shade,
                shrinkA=0,
                shrinkB=0,
                zorder=order,
            )
        )
    way = end - start
    position = end + 0.53 * way / max(float(np.hypot(*way)), 1e-12)
    text = f"$\\mathbf{{{name}}}$" if bold else f"${name}$"
    axes.text(
        float(position[0]),
        float(position[1]),
        text,
        ha="center",
        va="center",
        size=10,
        color=colour,
        path_effects=[HALO],
        zorder=10,
    )
