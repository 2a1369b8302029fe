"""Side view of a robot: layout, shaded solids, and the marks of a technical drawing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import FancyArrowPatch
from matplotlib.patheffects import withStroke

from spirillum.arrays import Values
from spirillum.robot.mesh import centreline_of
from spirillum.robot.robot import Robot
from spirillum.view.figures.style import PAGE, UnitPrefix, in_words

Metal = tuple[str, str, str]  #: Colours of a shaded surface: shadow, middle, highlight.

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
    return np.sort(x[inside] / unit)[::-1]


def draw_wire(axes: Axes, robot: Robot, colours: Metal, *, phase: float, unit: float, points: float) -> None:
    """Plot the tail's wires in true thickness, seen along +y: hidden parts are darker."""
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


PHASE = 0.35 * np.pi  #: Phase of the tail in the picture, rad.
INK = "#1d2b33"
FAINT = "#6b7d88"
HALO = withStroke(linewidth=2.4, foreground="white", alpha=0.85)  #: White rim that keeps text legible on any background


@dataclass(frozen=True)
class DrawingLayout:
    """Positions of all elements, in the drawing's unit; the motor axis is at z = 0."""

    robot: Robot
    scale: UnitPrefix
    total: float  #: Length of the robot, or twice its height if that is more: the measure of margins and text.
    nose: float
    rear: float
    root: float
    tip: float
    half_height: float  #: Largest distance of the robot from the motor axis.
    floor: float  #: Height of the floor, or of the robot's underside without a channel.
    ceiling: float | None  #: Height of the upper wall where the picture reaches it.
    wall: float  #: Displayed thickness of the walls; the true one is unknown.

    @classmethod
    def of(cls, robot: Robot) -> DrawingLayout:
        """The scene of a robot."""
        length = robot.body.length + robot.coupling.length + robot.tail.length
        scale = UnitPrefix.of(np.array([length]), "m")
        total, nose = length / scale.factor, 0.5 * robot.body.length / scale.factor
        root = -nose - robot.coupling.length / scale.factor
        radius = 0.5 * robot.body.diameter / scale.factor
        tail = (robot.tail.amplitude + 0.5 * robot.tail.wire_diameter) / scale.factor
        coupling = 0.5 * robot.coupling.diameter / scale.factor if robot.coupling.length > 0 else 0.0
        half_height = max(radius, tail, coupling)
        total = max(total, 4.0 * half_height)
        ceiling = None
        if robot.channel is not None:
            height = robot.channel.diameter / scale.factor - radius
            ceiling = height if height <= half_height + 0.5 * total else None
        return cls(
            robot=robot,
            scale=scale,
            total=total,
            nose=nose,
            rear=-nose,
            root=root,
            tip=root - robot.tail.length / scale.factor,
            half_height=half_height,
            floor=-radius if robot.channel is not None else -half_height,
            ceiling=ceiling,
            wall=0.018 * total,
        )

    @property
    def _slack(self) -> float:
        """Additional margin on both sides of a robot that is short for its height."""
        return 0.5 * (self.total - (self.nose - self.tip))

    @property
    def left(self) -> float:
        """Left edge of the picture."""
        return self.tip - 0.215 * self.total - self._slack

    @property
    def right(self) -> float:
        """Right edge of the picture."""
        return self.nose + 0.31 * self.total + self._slack

    @property
    def top(self) -> float:
        """Upper edge of the picture."""
        upper = self.half_height + 0.16 * self.total if self.ceiling is None else self.ceiling + self.wall
        return upper + 0.055 * self.total

    @property
    def bottom(self) -> float:
        """Lower edge of the picture."""
        return min(self.floor, -self.half_height) - self.wall - 0.165 * self.total

    @property
    def lines_at(self) -> float:
        """Height of the row of axial dimensions."""
        return min(self.floor, -self.half_height) - self.wall - 0.055 * self.total

    @property
    def tail_top(self) -> float:
        """Height of the wire's highest points, thickness included."""
        return (self.robot.tail.amplitude + 0.5 * self.robot.tail.wire_diameter) / self.scale.factor

    @cached_property
    def crests(self) -> Values:
        """Positions of the wire's highest points, from root to tip."""
        return crests(self.robot, PHASE, self.scale.factor)

    @property
    def shows_wavelength(self) -> bool:
        """Whether there is room for the wavelength's dimension between two crests."""
        room = np.inf if self.ceiling is None else self.ceiling
        return self.crests.size >= 2 and self.tail_top + 0.08 * self.total < room

    @property
    def shows_wire(self) -> bool:
        """Whether there is room below the tail for the wire's diameter."""
        return self.robot.channel is None or self.tail_top + 0.05 * self.total < -self.floor

    @property
    def stubby(self) -> bool:
        """Whether the body is too short for labels on it."""
        return 2.0 * self.nose < 0.26 * self.total

    @property
    def points(self) -> float:
        """Typographic points in one drawing unit."""
        return 72.0 * PAGE / (self.right - self.left)

    def words(self, symbol: str, value: float) -> str:
        """``symbol = value unit`` of an SI length."""
        return f"${symbol}$ = {in_words(value, 'm')}"


def arrow(axes: Axes, start: Sequence[float] | Values, end: Sequence[float] | Values, **look: Any) -> None:
    """An arrow from tip to tip, thin and dark unless `look` says otherwise."""
    look = {"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0, **({} if "facecolor" in look else {"color": INK}), **look}
    axes.add_patch(FancyArrowPatch((start[0], start[1]), (end[0], end[1]), **look))


def dimension_line(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    """A dimension line with an arrowhead at both ends."""
    arrow(axes, start, end, arrowstyle="<|-|>", mutation_scale=5, linewidth=0.8, zorder=12)


def thin_line(axes: Axes, xs: tuple[float, float], zs: tuple[float, float]) -> None:
    """An extension line of a dimension."""
    axes.plot(xs, zs, color=FAINT, linewidth=0.6, zorder=11)


def label(axes: Axes, x: float, z: float, text: str, **more: str | float) -> None:
    """Text that stays readable on any ground."""
    options: dict[str, str | float] = {"ha": "center", "va": "center", "size": 8, "color": INK, **more}
    axes.text(x, z, text, zorder=13, path_effects=[HALO], **options)  # type: ignore[arg-type]


def round_length(about: float) -> float:
    """A length of 1, 2 or 5 times a power of ten, at most `about`."""
    power = 10.0 ** np.floor(np.log10(about))
    return float(next(m * power for m in (5.0, 2.0, 1.0) if m * power <= about * 1.0001))


def tail_words(robot: Robot) -> str:
    """Shapes and sizes of body and tail, for the alternative text of a picture."""
    body, tail = robot.body, robot.tail
    return (
        f"{body.shape} body of {in_words(body.diameter, 'm')} diameter and {in_words(body.length, 'm')} length, "
        f"a {tail.handedness}-handed helical tail of {in_words(tail.length, 'm')} length, "
        f"{in_words(tail.wavelength, 'm')} wavelength and {in_words(tail.amplitude, 'm')} amplitude behind it"
    )
