"""The flow around a robot on a plane: speed with streamlines, and pressure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize, SymLogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import FancyArrowPatch
from matplotlib.ticker import NullLocator, StrMethodFormatter

from spirillum.arrays import Values
from spirillum.plots.scene import HALO
from spirillum.plots.section import draw_section
from spirillum.plots.style import COLOURS, Scale, new_figure, plain, styled
from spirillum.units import Hz

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.motion.flow import Flow

__all__ = ["flow_figure"]

_LEFT, _RIGHT, _HEAD, _FOOT, _X_LABEL, _GAP = 0.72, 0.95, 0.86, 0.52, 0.46, 0.3
"""Margins of the figure, room below a panel, and room between panels, inches."""
_WIDE, _SQUARE, _TALLEST = 6.6, 3.3, 4.2
"""Width of a panel among stacked ones and of one beside another; largest height, inches."""
_SPEED_DECADES = 3.0
"""Largest range of the logarithmic colours: what is slower has the darkest one."""
_PRESSURE_DECADES = 2.0
"""Range of the pressure's logarithmic colours on each side; below it they are linear."""
_LINES_PER_INCH = 0.36


@dataclass(frozen=True)
class _View:
    """A plane's data as a panel shows them: rows upwards, lengths in a readable unit."""

    plane: xr.Dataset
    first: str
    """Horizontal axis."""
    second: str
    """Vertical axis."""
    across: str
    """Axis across the plane."""
    lengths: Scale
    x: Values
    y: Values
    solid: Values

    @classmethod
    def of(cls, plane: xr.Dataset) -> _View:
        first, second = (str(name) for name in plane["inside"].dims)
        x, y = (np.asarray(plane[name].values, dtype=float) for name in (first, second))
        lengths = Scale.of(np.array([0.1 * max(np.ptp(x), np.ptp(y))]), "m")  # mm for a robot of 10 cm
        across = next(axis for axis in "xyz" if axis not in (first, second))
        solid = np.asarray(plane["inside"].values, dtype=bool).T
        return cls(plane, first, second, across, lengths, lengths(x), lengths(y), solid)

    @property
    def name(self) -> str:
        """Such as `xz`."""
        return self.first + self.second

    @property
    def offset(self) -> float:
        """Place of the plane on the axis across it, m."""
        return float(self.plane[self.across])

    def values(self, name: str) -> Values:
        """A variable, SI, rows upwards."""
        found: Values = np.asarray(self.plane[name].values, dtype=float).T
        return found

    def continued(self, values: Values) -> Values:
        """Values carried on into the solids, which are drawn above: no fringe of cells without colour around them."""
        from scipy.ndimage import distance_transform_edt

        if not self.solid.any() or self.solid.all():
            return values
        nearest = distance_transform_edt(self.solid, return_distances=False, return_indices=True)
        carried: Values = values[tuple(nearest)]
        return carried


def flow_figure(flow: Flow, plane: xr.Dataset) -> Figure:
    """Two panels to scale: speed (logarithmic colours) with streamlines, and pressure (colours about zero).

    Args:
        flow: what `spirillum.flow` returns.
        plane: what its `plane` returns.
    """
    view = _View.of(plane)
    with styled():
        figure, panels, bars = _panels(float(np.ptp(view.x)), float(np.ptp(view.y)))
        scale = 72.0 * figure.get_size_inches()[0] * panels[0].get_position().width / float(np.ptp(view.x))
        unit = view.lengths.factor
        for letter, axes in zip("ab", panels, strict=True):
            axes.set_xlim(view.x[0], view.x[-1])
            axes.set_ylim(view.y[0], view.y[-1])
            axes.set_title(f"{letter})", loc="left", pad=3, weight="bold")
            axes.set_xlabel(f"${view.first}$ ({view.lengths.unit})")
            axes.set_ylabel(f"${view.second}$ ({view.lengths.unit})")
            draw_section(axes, flow.robot, view.name, view.offset, phase=flow.phase, unit=unit, points=scale)
        _draw_speed(figure, panels[0], bars[0], view)
        _draw_lines(figure, panels[0], view)
        _draw_pressure(figure, panels[1], bars[1], view)
        if flow.frame == "lab" and view.first == "x":
            _draw_heading(panels[0], flow, unit)
        _write_words(figure, flow, view)
        return figure


def _panels(width: float, height: float) -> tuple[Figure, list[Axes], list[Axes]]:
    """Figure, panels and the axes of their colour bars: stacked for a long plane, else side by side."""
    stacked = width > 1.25 * height
    across = _WIDE if stacked else _SQUARE
    share = min(1.0, _TALLEST / (across * height / width))
    w, h = across * share, across * height / width * share
    columns, rows = (1, 2) if stacked else (2, 1)
    total_w = columns * (_LEFT + w + _RIGHT)
    total_h = _HEAD + rows * (h + _X_LABEL) + (rows - 1) * _GAP + _FOOT
    figure = new_figure(total_w, total_h)
    panels, bars = [], []
    for number in range(2):
        column, row = (0, number) if stacked else (number, 0)
        left = column * (_LEFT + w + _RIGHT) + _LEFT
        bottom = total_h - _HEAD - (row + 1) * h - row * (_X_LABEL + _GAP)
        panels.append(figure.add_axes((left / total_w, bottom / total_h, w / total_w, h / total_h)))
        bars.append(figure.add_axes(((left + w + 0.1) / total_w, bottom / total_h, 0.13 / total_w, h / total_h)))
        # Ticks are made when they are drawn, which a caller may do outside `styled`.
        panels[-1].tick_params(labelsize=8, colors="#333333", length=2.5, width=0.6)
        panels[-1].grid(visible=False)
    return figure, panels, bars


def _draw_colours(axes: Axes, view: _View, values: Values, colours: str, norm: Normalize) -> AxesImage:
    half_x, half_y = 0.5 * (view.x[1] - view.x[0]), 0.5 * (view.y[1] - view.y[0])
    box = (view.x[0] - half_x, view.x[-1] + half_x, view.y[0] - half_y, view.y[-1] + half_y)
    limits = axes.get_xlim(), axes.get_ylim()
    image = axes.imshow(values, extent=box, origin="lower", cmap=colours, norm=norm, interpolation="bilinear")
    axes.set_xlim(limits[0])
    axes.set_ylim(limits[1])
    axes.set_aspect("equal")
    return image


def _draw_speed(figure: Figure, axes: Axes, bar: Axes, view: _View) -> None:
    speed = np.sqrt(sum(view.values(f"velocity_{axis}") ** 2 for axis in "xyz"))
    known = speed[np.isfinite(speed)]
    scale = Scale.of(known, "m/s")
    highest = float(known.max()) / scale.factor if known.size and known.max() > 0 else 1.0
    lowest = float(known.min()) / scale.factor if known.size else 0.0
    floor = min(max(lowest, highest * 10.0**-_SPEED_DECADES), 0.5 * highest)
    shown = np.maximum(view.continued(speed) / scale.factor, 0.1 * floor)  # a logarithm knows no zero
    image = _draw_colours(axes, view, shown, "viridis", LogNorm(floor, highest))
    _bar(figure, image, bar, f"speed ({scale.unit})", "min" if lowest < floor else "neither")
    steps = _round_steps(floor, highest, (1.0, 2.0, 5.0))
    bar.set_yticks(steps if steps.size >= 2 else [floor, highest])


def _draw_pressure(figure: Figure, axes: Axes, bar: Axes, view: _View) -> None:
    pressure = view.values("pressure")
    known = np.abs(pressure[np.isfinite(pressure)])
    highest = float(known.max()) if known.size and known.max() > 0 else 1.0
    scale = Scale.of(np.array([highest]), "Pa")
    limit = highest / scale.factor
    threshold = limit * 10.0**-_PRESSURE_DECADES
    # It peaks at the wire: on a linear scale the body's pressure would have no colour.
    norm = SymLogNorm(linthresh=threshold, vmin=-limit, vmax=limit, base=10)
    image = _draw_colours(axes, view, view.continued(pressure) / scale.factor, "RdBu_r", norm)
    _bar(figure, image, bar, f"pressure ({scale.unit})")
    steps = _round_steps(threshold, limit, (1.0,))
    bar.set_yticks([*(-steps[::-1]), 0.0, *steps])


def _bar(figure: Figure, image: AxesImage, bar: Axes, label: str, extend: str = "neither") -> None:
    colour_bar = figure.colorbar(image, cax=bar, extend=extend, format=StrMethodFormatter("{x:.3g}"))
    colour_bar.set_label(label)
    bar.yaxis.set_minor_locator(NullLocator())
    bar.tick_params(labelsize=8, colors="#333333", length=2.5, width=0.6)


def _round_steps(low: float, high: float, digits: tuple[float, ...]) -> Values:
    """The numbers with one of these digits and zeros between two bounds."""
    powers = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    steps: Values = np.sort(np.outer(10.0**powers, digits).ravel())
    return steps[(steps >= low * (1 - 1e-9)) & (steps <= high * (1 + 1e-9))]


def _draw_lines(figure: Figure, axes: Axes, view: _View) -> None:
    """Streamlines of the velocity's part in the plane; they end at solids."""
    parts = [view.values(f"velocity_{axis}") for axis in (view.first, view.second)]
    u, v = (np.ma.array(part, mask=~np.isfinite(part)) for part in parts)
    if min(u.shape) < 3 or u.mask.all():
        return
    place = axes.get_position()
    width, height = figure.get_size_inches() * (place.width, place.height)
    axes.streamplot(
        view.x,
        view.y,
        u,
        v,
        density=(max(_LINES_PER_INCH * width, 0.3), max(_LINES_PER_INCH * height, 0.3)),
        color="white",
        linewidth=0.7,
        arrowsize=0.7,
        zorder=3,
    )


def _draw_heading(axes: Axes, flow: Flow, unit: float) -> None:
    """An arrow before the nose, or behind the tail: where the robot swims."""
    ahead = flow.prediction.forward_velocity >= 0
    body, coupling, tail = flow.robot.body, flow.robot.coupling, flow.robot.tail
    end = 0.5 * body.length if ahead else -0.5 * body.length - coupling.length - tail.length
    sense, reach = (1.0 if ahead else -1.0), 0.35 * body.diameter
    start = (end + sense * 0.2 * reach) / unit
    stop = (end + sense * 1.4 * reach) / unit
    axes.add_patch(
        FancyArrowPatch(
            (start, 0.0),
            (stop, 0.0),
            arrowstyle="simple,head_length=0.5,head_width=0.55,tail_width=0.2",
            mutation_scale=18,
            facecolor=COLOURS["orange"],
            edgecolor="white",
            linewidth=0.7,
            zorder=9,
        )
    )
    place = (0.5 * (start + stop), 0.28 * body.diameter / unit)
    axes.text(*place, "$U_x$", ha="center", va="center", size=9, color="black", path_effects=[HALO], zorder=10)


def _write_words(figure: Figure, flow: Flow, view: _View) -> None:
    width, height = figure.get_size_inches()
    left = 0.15 / width
    title = f"Flow around {plain(flow.robot.name, 50)}"
    figure.text(left, 1 - 0.12 / height, title, va="top", size=11, weight="bold")
    words = "\n".join(_conditions(flow, view)).replace("-", "−")
    figure.text(left, 1 - 0.36 / height, words, va="top", size=9, color="#333", linespacing=1.25)
    for number, line in enumerate(_notes(flow, view)):
        figure.text(left, (0.40 - 0.17 * number) / height, line, va="top", size=8, color="#333")


def _conditions(flow: Flow, view: _View) -> Iterator[str]:
    motion, unit = flow.prediction, view.lengths
    frame = "lab frame" if flow.frame == "lab" else "frame of the swimming robot"
    where = f"plane {view.name} at {view.across} = {view.offset / unit.factor:.4g} {unit.unit}"
    yield f"{where} · {frame} · phase {np.degrees(flow.phase):.4g}° · model {motion.model.name}"
    speed = Scale.of(np.array([motion.forward_velocity]), "m/s")
    yield (
        f"$U_x$ = {motion.forward_velocity / speed.factor:.4g} {speed.unit}, "
        f"tail {motion.tail_rotation_rate / Hz:.4g} Hz, body {motion.body_rotation_rate / Hz:.4g} Hz"
    )


def _notes(flow: Flow, view: _View) -> Iterator[str]:
    drawn = ["grey: robot where the plane cuts it"]
    if view.first == "x":
        drawn.append("white band: tail")
        drawn += ["dashed: its full outline"] if view.offset != 0 else []
    yield f"Lines: direction of the velocity's part in the plane; {', '.join(drawn)}."
    held = ""
    if flow.held_force > 0:
        force = Scale.of(np.array([flow.held_force]), "N")
        held = f" Held from moving sideways by {flow.held_force / force.factor:.2g} {force.unit}."
    yield f"Unbounded fluid: no walls.{held} Computed, nothing is measured."
