"""Dimensions of a robot in its side view, with the symbols of the paper's Fig. 1b and Table I."""

from __future__ import annotations

from collections.abc import Iterator

from matplotlib.axes import Axes

from spirillum.view.figures.scene import HALO, INK, Scene, dimension_line, label, thin_line

__all__ = ["draw_dimensions"]


def draw_dimensions(axes: Axes, s: Scene) -> None:
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
        if s.ceiling is not None:
            dimension_line(axes, (x, s.floor), (x, s.ceiling))
            label(
                axes,
                x + 0.008 * s.total,
                0.5 * (s.floor + s.ceiling),
                s.words("D_{ch}", robot.channel.diameter),
                ha="left",
            )
        else:
            text = f"{s.words('D_{ch}', robot.channel.diameter)}\n(upper wall\nout of view)"
            label(axes, x, 0.4 * s.half_height, text, ha="left", size=7.5)
    _tail_dimensions(axes, s)


def _axial_dimensions(axes: Axes, s: Scene) -> None:
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


def _tail_words(s: Scene) -> Iterator[str]:
    """What has no room as a drawn dimension of the tail."""
    if not s.shows_wavelength:
        yield s.words("\\lambda", s.robot.tail.wavelength)
    if not s.shows_wire:
        yield s.words("D_t", s.robot.tail.wire_diameter)


def _tail_dimensions(axes: Axes, s: Scene) -> None:
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


def _wire_thickness(axes: Axes, s: Scene) -> None:
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
