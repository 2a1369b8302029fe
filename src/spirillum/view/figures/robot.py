"""Side view of a robot in its channel, to scale, with the dimensions of the paper's Fig. 1b."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Rectangle

from spirillum.robot.links import outlines_of
from spirillum.robot.mesh import is_steel
from spirillum.robot.robot import Robot
from spirillum.view.figures.scene import (
    FAINT,
    HALO,
    INK,
    PHASE,
    DrawingLayout,
    Metal,
    arrow,
    dimension_line,
    draw_solid,
    draw_wire,
    label,
    round_length,
    tail_words,
    thin_line,
)
from spirillum.view.figures.style import COLOURS, PAGE, in_words, new_figure, plain, styled


def draw_dimensions(axes: Axes, s: DrawingLayout) -> None:
    """Draw D_b, D_ch, L_b, L_c, L_t, lambda, B_o and D_t."""
    robot = s.robot
    _axial_dimensions(axes, s)
    radius = 0.5 * robot.body.diameter / s.scale.factor
    straight = robot.body.shape in ("capsule", "cylinder") and not s.stubby
    x = 0.66 * s.rear if straight else 0.0  # where the body is as wide as that
    dimension_line(axes, (x, -radius), (x, radius))
    if s.stubby:
        label(axes, 0.0, radius + 0.02 * s.total, s.words("D_b", robot.body.diameter))
    else:
        label(axes, x + 0.008 * s.total, 0.35 * radius, s.words("D_b", robot.body.diameter), ha="left")
    if robot.channel is not None:
        x = s.nose + 0.115 * s.total
        words = s.words("D_{ch}", robot.channel.diameter)
        if s.ceiling is not None:
            dimension_line(axes, (x, s.floor), (x, s.ceiling))
            label(axes, x + 0.008 * s.total, 0.5 * (s.floor + s.ceiling), words, ha="left")
        else:
            label(axes, x, 0.4 * s.half_height, f"{words}\n(upper wall\nout of view)", ha="left", size=7.5)
    _tail_dimensions(axes, s)


def _axial_dimensions(axes: Axes, s: DrawingLayout) -> None:
    robot = s.robot
    spans = [
        ("L_b", robot.body.length, s.rear, s.nose),
        ("L_c", robot.coupling.length, s.root, s.rear),
        ("L_t", robot.tail.length, s.tip, s.root),
    ]
    radius = 0.5 * robot.body.diameter / s.scale.factor
    for x, z in {s.tip: 0.0, s.root: 0.0, s.rear: -radius, s.nose: 0.0}.items():
        thin_line(axes, (x, x), (s.lines_at - 0.012 * s.total, z))
    for symbol, value, start, end in spans:
        if value <= 0:
            continue
        dimension_line(axes, (start, s.lines_at), (end, s.lines_at))
        text = s.words(symbol, value)
        if symbol == "L_t":
            text = ",  ".join([text, *_tail_words(s)])
        if end - start < 0.12 * s.total:
            text = text.replace(" = ", "\n")
        label(axes, 0.5 * (start + end), s.lines_at - 0.013 * s.total, text, va="top")


def _tail_words(s: DrawingLayout) -> Iterator[str]:
    """Dimensions of the tail that have no room in the drawing, as text."""
    if not s.shows_wavelength:
        yield s.words("\\lambda", s.robot.tail.wavelength)
    if not s.shows_wire:
        yield s.words("D_t", s.robot.tail.wire_diameter)


def _tail_dimensions(axes: Axes, s: DrawingLayout) -> None:
    tail, tops = s.robot.tail, s.crests
    amplitude = tail.amplitude / s.scale.factor
    if s.shows_wavelength:
        above, centre = s.tail_top + 0.035 * s.total, 0.5 * (s.root + s.tip)
        pair = min(range(tops.size - 1), key=lambda i: abs(0.5 * (tops[i] + tops[i + 1]) - centre))
        start, end = float(tops[pair + 1]), float(tops[pair])
        for x in (start, end):
            thin_line(axes, (x, x), (amplitude, above + 0.01 * s.total))
        dimension_line(axes, (start, above), (end, above))
        label(axes, 0.5 * (start + end), above + 0.022 * s.total, s.words("\\lambda", tail.wavelength))
    x = s.tip - 0.022 * s.total
    nearest = float(tops[-1]) if tops.size else s.tip
    thin_line(axes, (x - 0.008 * s.total, nearest), (amplitude, amplitude))
    thin_line(axes, (x - 0.008 * s.total, s.tip), (0.0, 0.0))
    dimension_line(axes, (x, 0.0), (x, amplitude))
    label(axes, x - 0.012 * s.total, 0.5 * amplitude, s.words("B_o", tail.amplitude), ha="right")
    if s.shows_wire:
        _wire_thickness(axes, s)


def _wire_thickness(axes: Axes, s: DrawingLayout) -> None:
    """D_t with a leader from below, at the lowest point of the wire nearest to the tip."""
    tail, unit = s.robot.tail, s.scale.factor
    low = float(s.crests[-1]) - 0.5 * tail.wavelength / unit if s.crests.size else s.tip
    if low < s.tip:
        low += tail.wavelength / unit
    axes.annotate(
        s.words("D_t", tail.wire_diameter),
        (low, -tail.amplitude / unit),
        xytext=(low + 0.03 * s.total, -s.tail_top - 0.03 * s.total),
        ha="left",
        va="center",
        size=8,
        color=INK,
        zorder=13,
        arrowprops={"arrowstyle": "-", "linewidth": 0.7, "color": INK, "shrinkB": 0},
        path_effects=[HALO],
    )


_BODY: Metal = ("#3f5b70", "#8fb0c6", "#f4fafd")
_COUPLING: Metal = ("#5b5f63", "#a9afb4", "#f7f8f9")
_COPPER: Metal = ("#4a2410", "#c2763a", "#ffd9b0")
_FLUID, _GLASS, _GLASS_EDGE = "#eef5f9", "#cfe0ea", "#54788e"


def robot_words(robot: Robot) -> str:
    """Alternative text of the picture."""
    where = "without a channel"
    if robot.channel is not None:
        where = f"on the floor of a channel of {in_words(robot.channel.diameter, 'm')} diameter"
    towards = "right" if _sense(robot) > 0 else "left"
    view = f"side view to scale, swimming to the {towards}. Computed geometry, not a photograph."
    return f"A {tail_words(robot)}, {where}; {view}"


def _sense(robot: Robot) -> float:
    """+1 where the drive makes the robot swim nose first, -1 where it swims tail first."""
    drive, sign = robot.drive, 1.0
    if drive is not None and drive.kind == "dc-motor" and robot.motor is not None:
        sign = -1.0 if robot.motor.polarity == "reverse" else 1.0
    elif drive is not None and (
        given := drive.rate or drive.torque or (0.0 if robot.magnetic is None else robot.magnetic.rotation_rate)
    ):
        sign = robot.hand * (1.0 if given > 0 else -1.0)
    return sign


def robot_figure(robot: Robot) -> Figure:
    """Side view of a robot in its channel, to scale: computed geometry with its dimensions."""
    with styled():
        scene = DrawingLayout.of(robot)
        height = PAGE * (scene.top - scene.bottom) / (scene.right - scene.left)
        figure = new_figure(PAGE, height)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_xlim(scene.left, scene.right)
        axes.set_ylim(scene.bottom, scene.top)
        axes.set_axis_off()
        _draw_channel(axes, scene)
        _draw_robot(axes, scene)
        draw_dimensions(axes, scene)
        _draw_motion(axes, scene)
        _draw_frame(axes, scene)
        return figure


def _draw_channel(axes: Axes, s: DrawingLayout) -> None:
    upper = s.ceiling if s.ceiling is not None else s.top - 0.055 * s.total
    lower = s.floor if s.robot.channel is not None else s.floor - 0.03 * s.total
    width = s.right - s.left
    axes.add_patch(Rectangle((s.left, lower), width, upper - lower, facecolor=_FLUID, edgecolor="none", zorder=0))
    if s.robot.channel is None:
        return
    walls = [(s.floor - s.wall, s.floor)] + ([(s.ceiling, s.ceiling)] if s.ceiling is not None else [])
    for start, face in walls:
        axes.add_patch(Rectangle((s.left, start), width, s.wall, facecolor=_GLASS, edgecolor="none", zorder=1))
        axes.plot([s.left, s.right], [face, face], color=_GLASS_EDGE, linewidth=1.3, zorder=2)
        shine = start + 0.55 * s.wall
        axes.plot([s.left, s.right], [shine, shine], color="white", linewidth=1.6, alpha=0.8, zorder=1.5)


def _draw_robot(axes: Axes, s: DrawingLayout) -> None:
    robot, unit = s.robot, s.scale.factor
    if robot.channel is not None:
        shadow = 0.010 * s.total
        for share in (1.0, 0.8, 0.6, 0.4):
            size = 2.0 * s.nose * share, shadow * share
            axes.add_patch(Ellipse((0.0, s.floor), *size, color="#24414f", alpha=0.16, zorder=2.5))
    axis = (s.tip - 0.02 * s.total, s.nose + 0.02 * s.total)
    axes.plot(axis, (0, 0), color=FAINT, linewidth=0.7, dashes=(9, 3, 2, 3), zorder=3)
    metal = _COUPLING if is_steel(robot.tail.density) else _COPPER
    draw_wire(axes, robot, metal, phase=PHASE, unit=unit, points=s.points)
    outlines = outlines_of(robot)
    for name, colours, order in (("coupling", _COUPLING, 7), ("body", _BODY, 8)):
        if name in outlines:
            x, radius = outlines[name].line(np.linspace(0.0, 1.0, 60))
            draw_solid(axes, x / unit, radius / unit, colours, order=order)


def _turning(axes: Axes, s: DrawingLayout, x: float, reach: float, sense: float, text: str) -> None:
    """Arrow around the motor axis on the viewer's side; sense +1 points down there, as a turn about +x does."""
    start, end = (x, sense * reach), (x, -sense * reach)
    curve = f"arc3,rad={-0.45 * sense:.3f}"
    for colour, width, order in (("white", 3.6, 9.4), (COLOURS["vermillion"], 1.7, 9.5)):
        look = {"color": colour, "linewidth": width, "zorder": order}
        arrow(axes, start, end, connectionstyle=curve, mutation_scale=8, shrinkA=2, shrinkB=2, **look)
    label(axes, x, reach + 0.008 * s.total, text, va="bottom", color=COLOURS["vermillion"], weight="bold")


def _draw_motion(axes: Axes, s: DrawingLayout) -> None:
    sense = _sense(s.robot)
    start, end = s.nose + 0.018 * s.total, s.nose + 0.095 * s.total
    start, end = (start, end) if sense > 0 else (end, start)
    shape = "simple,head_length=0.55,head_width=0.6,tail_width=0.22"
    swims = {"facecolor": COLOURS["blue"], "edgecolor": "white", "linewidth": 0.8, "zorder": 12}
    arrow(axes, (start, 0.0), (end, 0.0), arrowstyle=shape, mutation_scale=18, shrinkA=2, shrinkB=2, **swims)
    label(axes, 0.5 * (start + end), 0.045 * s.total, "$U_x$", color=COLOURS["blue"], size=9)
    turn = s.robot.hand * sense
    radius = 0.5 * s.robot.body.diameter / s.scale.factor
    if not s.stubby:
        _turning(axes, s, 0.55 * s.nose, 0.62 * radius, -turn, "$\\Omega_x$")
    wire = (s.robot.tail.amplitude + s.robot.tail.wire_diameter) / s.scale.factor
    _turning(axes, s, s.root - 0.05 * s.total, wire + 0.012 * s.total, turn, "$\\omega$")


def _draw_frame(axes: Axes, s: DrawingLayout) -> None:
    edge, line = 0.012 * s.total, s.top - 0.012 * s.total
    axes.text(s.left + edge, line, plain(s.robot.name, 60), va="top", size=9, weight="bold", color=INK)
    small: dict[str, Any] = {"va": "top", "ha": "right", "size": 7.5, "color": FAINT}
    axes.text(s.right - edge, line - 0.002 * s.total, "computed geometry, to scale", **small)
    x, z, size = s.left + 0.025 * s.total, s.bottom + 0.025 * s.total, 0.055 * s.total
    for dx, dz, name in ((size, 0.0, "$x$"), (0.0, size, "$z$")):
        arrow(axes, (x, z), (x + dx, z + dz), mutation_scale=6, linewidth=0.9)
        label(axes, x + 1.22 * dx, z + 1.22 * dz, name)
    length = round_length(0.16 * s.total * s.scale.factor)
    end = s.right - 0.02 * s.total
    start, z = end - length / s.scale.factor, s.bottom + 0.030 * s.total
    axes.plot([start, end], [z, z], color=INK, linewidth=2.0, solid_capstyle="butt", zorder=12)
    label(axes, 0.5 * (start + end), z + 0.022 * s.total, in_words(length, "m"))
