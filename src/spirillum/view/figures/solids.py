"""Solids of a robot as seen from the side: shaded bodies of revolution and a wire with front and back."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb

from spirillum.arrays import Values
from spirillum.robot.mesh import centreline_of
from spirillum.robot.robot import Robot

Metal = tuple[str, str, str]
"""Colours of a shaded surface: shadow, middle, highlight."""

_SHELLS = 48
_LARGEST_WIRE = 4000
_LIGHT_HEIGHT = 0.42


def _shades(colours: Metal, amount: Values) -> Values:
    """Colours from shadow (0) over middle (0.5) to highlight (1)."""
    stops = np.array([to_rgb(colour) for colour in colours])
    return np.stack([np.interp(amount, (0.0, 0.5, 1.0), stops[:, channel]) for channel in range(3)], axis=-1)


def draw_solid(axes: Axes, x: Values, radius: Values, colours: Metal, *, order: float) -> None:
    """A body of revolution about the horizontal axis, lit from above: nested shells, brighter inwards."""
    inward = np.linspace(0.0, 1.0, _SHELLS)
    shells = []
    for share in inward:
        shift = _LIGHT_HEIGHT * share
        upper, lower = radius * (1.0 - share + shift), radius * (share - 1.0 + shift)
        shells.append(np.column_stack([np.concatenate([x, x[::-1]]), np.concatenate([upper, lower[::-1]])]))
    axes.add_collection(
        PolyCollection(shells, facecolors=_shades(colours, inward**1.3), edgecolors="none", zorder=order)
    )
    edge = np.concatenate([radius, -radius[::-1]])
    axes.plot(np.concatenate([x, x[::-1]]), edge, color="#2b3a44", linewidth=0.8, zorder=order + 0.1)


def wire_lines(robot: Robot, phase: float, unit: float) -> list[Values]:
    """Points (x, y, z) of each wire's centreline from its root on, in `unit`."""
    tail = robot.tail
    count = int(np.clip(max(90 * tail.length / tail.wavelength, 8 * len(tail.curve or ())), 200, _LARGEST_WIRE))
    xi = np.linspace(0.0, tail.length, count)
    return [centreline_of(robot, xi, float(phase + turn)).position / unit for turn in tail.form.turns]


def crests(robot: Robot, phase: float, unit: float) -> Values:
    """Positions x of the wire's highest points, from the root to the tip, in `unit`; without the rising root."""
    tail, hand = robot.tail, robot.hand
    if not tail.form.is_helix:
        return np.zeros(0)
    root = 0.5 * robot.body.length + robot.coupling.length
    most = np.ceil((root + tail.length) / tail.wavelength) + 1
    number = np.arange(-most, most + 1)
    x = (0.5 * np.pi - phase + 2 * np.pi * number) * tail.wavelength / (2 * np.pi) * hand
    settled = 0.0 if tail.taper is None else 4.0 * tail.length / tail.taper
    inside = (x <= -root - min(settled, 0.5 * tail.length)) & (x >= -root - tail.length)
    found: Values = np.sort(x[inside] / unit)[::-1]
    return found


def draw_wire(axes: Axes, robot: Robot, colours: Metal, *, phase: float, unit: float, points: float) -> None:
    """Plot the tail's wires in true thickness, seen along +y: hidden parts are darker.

    Args:
        axes: where to draw, in `unit`.
        robot: the robot.
        colours: shadow, middle, highlight.
        phase: phase of the tail, rad.
        unit: length of one drawing unit, m.
        points: typographic points in one drawing unit.
    """
    paths = wire_lines(robot, phase, unit)
    thickness, amplitude = robot.tail.wire_diameter / unit, robot.tail.amplitude / unit
    pieces = np.concatenate([np.stack([path[:-1, [0, 2]], path[1:, [0, 2]]], axis=1) for path in paths])
    depth = np.concatenate([0.5 * (path[:-1, 1] + path[1:, 1]) for path in paths])
    behind = np.clip(0.5 + 0.5 * depth / max(amplitude, 1e-12), 0.0, 1.0)
    bias = min(thickness, 0.8 * amplitude)
    layers = (  # share of the thickness, shade before and behind, depth before the centreline, height of the light
        (1.0, 0.02, 0.0, -1.0, 0.0),
        (0.78, 0.50, 0.10, 0.0, 0.0),
        (0.26, 1.0, 0.30, 0.5, 0.14),
    )
    segments, shades, widths, depths = [], [], [], []
    for share, front, back, before, height in layers:
        segments.append(pieces + np.array([0.0, height * thickness]))
        shades.append(_shades(colours, front + (back - front) * behind))
        widths.append(np.full(depth.size, share * thickness * points))
        depths.append(depth - before * bias)
    order = np.argsort(-np.concatenate(depths), kind="stable")
    axes.add_collection(
        LineCollection(
            list(np.concatenate(segments)[order]),
            colors=np.concatenate(shades)[order],
            linewidths=np.maximum(np.concatenate(widths)[order], 0.15),
            capstyle="round",
            zorder=6,
        )
    )
