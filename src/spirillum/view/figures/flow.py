"""The flow around a robot on a plane: speed with streamlines, and pressure; in a tube the pressure along it too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize, SymLogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import NullLocator

from spirillum.arrays import Values
from spirillum.units import Hz
from spirillum.view.figures.scene import arrow, label
from spirillum.view.figures.section import draw_glass, draw_section
from spirillum.view.figures.sheet import Sheet, add_letters
from spirillum.view.figures.style import COLOURS, PAGE, UnitPrefix, in_words, plain, styled

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.fields.flow import Flow

_BESIDE, _STRIP = 1.45, 1.1  # room beside a panel for labels and colour bar; height of the pressure in a tube, inches
_TALLEST = 4.2  # largest height of a panel, inches
_SPEED_DECADES = 3.0  # largest range of the logarithmic colours: what is slower has the darkest one
_PRESSURE_DECADES = 2.0  # range of the pressure's logarithmic colours on each side; below it they are linear
_LINES_PER_INCH = 0.36
_HELD = "Held from moving sideways by"
_LINES = "direction of the velocity's part in the plane"


@dataclass(frozen=True)
class _View:
    """A plane's data as a panel shows them: rows upwards, lengths in a readable unit."""

    plane: xr.Dataset
    first: str  # horizontal axis
    second: str  # vertical axis
    across: str  # axis across the plane
    lengths: UnitPrefix
    x: Values
    y: Values
    solid: Values

    @classmethod
    def of(cls, plane: xr.Dataset) -> _View:
        first, second = (str(name) for name in plane["inside"].dims)
        x, y = (np.asarray(plane[name].values, dtype=float) for name in (first, second))
        lengths = UnitPrefix.of(np.array([0.1 * max(np.ptp(x), np.ptp(y))]), "m")  # mm for a robot of 10 cm
        across = next(axis for axis in "xyz" if axis not in (first, second))
        solid = np.asarray(plane["inside"].values, dtype=bool).T
        return cls(plane, first, second, across, lengths, lengths(x), lengths(y), solid)

    @property
    def name(self) -> str:
        """Such as `xz`."""
        return self.first + self.second

    @property
    def offset(self) -> float:
        """Position of the plane on the axis across it, m."""
        return float(self.plane[self.across])

    def values(self, name: str) -> Values:
        """A variable, SI, rows upwards."""
        return np.asarray(self.plane[name].values, dtype=float).T

    def continued(self, values: Values) -> Values:
        """Values extrapolated into the solids, which are plotted above: avoids a fringe of cells without colour."""
        from scipy.ndimage import distance_transform_edt

        if not self.solid.any() or self.solid.all():
            return values
        nearest = distance_transform_edt(self.solid, return_distances=False, return_indices=True)
        carried: Values = values[tuple(nearest)]
        return carried


def flow_figure(flow: Flow, plane: xr.Dataset) -> Figure:
    """Two panels to scale: speed (logarithmic colours) with streamlines, and pressure (colours about zero)."""
    # In a tube a plane along it gets a third one: the pressure at the glass that the robot does not lie on.
    view = _View.of(plane)
    strip = flow.seat is not None and view.first == "x" and bool(_at_glass(view)[0].size)
    with styled():
        sheet = _sheet(flow, view, strip=strip)
        stacked = sheet.panels.shape[1] == 1
        panels = sheet.panels[:2, 0] if stacked else sheet.panels[0]
        for axes in panels:
            axes.set_xlim(view.x[0], view.x[-1])
            axes.set_ylim(view.y[0], view.y[-1])
            axes.set_xlabel(f"${view.first}$ ({view.lengths.unit})")
            axes.set_ylabel(f"${view.second}$ ({view.lengths.unit})")
            axes.grid(visible=False)
        _draw_speed(panels[0], view)
        _draw_pressure(panels[1], view)
        if strip:
            _draw_strip(sheet.panels[-1, -1], view)
        if strip and not stacked:
            sheet.panels[1, 0].remove()
            add_letters([*panels, sheet.panels[1, 1]])
        figure = sheet.finished(shape=float(np.ptp(view.y) / np.ptp(view.x)))
        for axes in panels:
            axes.set_aspect("equal")
            axes.apply_aspect()
            _draw_solids(axes, flow, view)
        _draw_lines(panels[0], view)
        if flow.frame == "lab" and view.first == "x":
            _draw_heading(panels[0], flow, view)
        return figure


def _sheet(flow: Flow, view: _View, *, strip: bool) -> Sheet:
    """Panels for speed and pressure: stacked for a long plane, else side by side; one below them along a tube."""
    width, height = float(np.ptp(view.x)), float(np.ptp(view.y))
    stacked = width > 1.25 * height
    columns = 1 if stacked else 2
    across = min(PAGE / columns - _BESIDE, _TALLEST * width / height)
    return Sheet(
        f"Flow around {plain(flow.robot.name, 50)}",
        "\n".join(_conditions(flow, view)).replace("-", "−"),
        width=columns * (across + _BESIDE),
        heights=[across * height / width] * (3 - columns) + [_STRIP] * strip,
        columns=columns,
        notes=list(_notes(flow, view)),
        sharey=False,
    )


def _draw_solids(axes: Axes, flow: Flow, view: _View) -> None:
    """Plot tube and robot; the panel has its final size, so that the wire has its true thickness."""
    unit, scale = view.lengths.factor, _inches(axes)[0] * 72.0 / float(np.ptp(view.x))
    if flow.seat is not None:
        draw_glass(axes, flow.seat, view.name, view.offset, unit)
    drop = flow.prediction.batch.placement.tail_drop
    draw_section(axes, flow.robot, view.name, view.offset, phase=flow.phase, unit=unit, points=scale, drop=drop)


def _inches(axes: Axes) -> tuple[float, float]:
    """Width and height of a panel, inches."""
    extent = axes.get_window_extent().transformed(axes.figure.dpi_scale_trans.inverted())
    return float(extent.width), float(extent.height)


def _draw_colours(axes: Axes, view: _View, values: Values, colours: str, norm: Normalize) -> AxesImage:
    half_x, half_y = 0.5 * (view.x[1] - view.x[0]), 0.5 * (view.y[1] - view.y[0])
    box = (view.x[0] - half_x, view.x[-1] + half_x, view.y[0] - half_y, view.y[-1] + half_y)
    axes.set_autoscale_on(False)
    return axes.imshow(
        values, extent=box, origin="lower", cmap=colours, norm=norm, interpolation="bilinear", aspect="auto"
    )


def _draw_speed(axes: Axes, view: _View) -> None:
    speed = np.sqrt(sum(view.values(f"velocity_{axis}") ** 2 for axis in "xyz"))
    known = speed[np.isfinite(speed)]
    scale = UnitPrefix.of(known, "m/s")
    highest = float(known.max()) / scale.factor if known.size and known.max() > 0 else 1.0
    lowest = float(known.min()) / scale.factor if known.size else 0.0
    floor = min(max(lowest, highest * 10.0**-_SPEED_DECADES), 0.5 * highest)
    shown = np.maximum(view.continued(speed) / scale.factor, 0.1 * floor)  # a logarithm knows no zero
    image = _draw_colours(axes, view, shown, "viridis", LogNorm(floor, highest))
    steps = _round_steps(floor, highest, (1.0, 2.0, 5.0))
    ticks = steps if steps.size >= 2 else np.array([floor, highest])
    _add_bar(axes, image, f"speed ({scale.unit})", ticks, "min" if lowest < floor else "neither")


def _draw_pressure(axes: Axes, view: _View) -> None:
    pressure = view.values("pressure")
    known = np.abs(pressure[np.isfinite(pressure)])
    highest = float(known.max()) if known.size and known.max() > 0 else 1.0
    scale = UnitPrefix.of(np.array([highest]), "Pa")
    limit = highest / scale.factor
    threshold = limit * 10.0**-_PRESSURE_DECADES
    # It peaks at the wire: on a linear scale the body's pressure would have no colour.
    norm = SymLogNorm(linthresh=threshold, vmin=-limit, vmax=limit, base=10)
    image = _draw_colours(axes, view, view.continued(pressure) / scale.factor, "RdBu_r", norm)
    steps = _round_steps(threshold, limit, (1.0,))
    _add_bar(axes, image, f"pressure ({scale.unit})", np.array([*(-steps[::-1]), 0.0, *steps]))


def _add_bar(axes: Axes, image: AxesImage, label: str, ticks: Values, extend: str = "neither") -> None:
    slim = _inches(axes)[1] / 0.13
    bar = axes.figure.colorbar(
        image, ax=axes, label=label, ticks=ticks, extend=extend, format="{x:.3g}", pad=0.01, fraction=0.05, aspect=slim
    )
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.tick_params(labelsize=8, colors="#333333", length=2.5, width=0.6)


def _round_steps(low: float, high: float, digits: tuple[float, ...]) -> Values:
    """The numbers with one of these digits and zeros between two bounds."""
    powers = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    steps: Values = np.sort(np.outer(10.0**powers, digits).ravel())
    return steps[(steps >= low * (1 - 1e-9)) & (steps <= high * (1 + 1e-9))]


def _draw_lines(axes: Axes, view: _View) -> None:
    """Streamlines of the velocity's part in the plane; they end at solids."""
    parts = [view.values(f"velocity_{axis}") for axis in (view.first, view.second)]
    u, v = (np.ma.array(part, mask=~np.isfinite(part)) for part in parts)
    if min(u.shape) < 3 or u.mask.all():
        return
    width, height = _inches(axes)
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


def _draw_heading(axes: Axes, flow: Flow, view: _View) -> None:
    """An arrow before the nose, or behind the tail: where the robot swims."""
    unit = view.lengths.factor
    ahead = flow.prediction.forward_velocity >= 0
    body, coupling, tail = flow.robot.body, flow.robot.coupling, flow.robot.tail
    end = 0.5 * body.length if ahead else -0.5 * body.length - coupling.length - tail.length
    sense, reach = (1.0 if ahead else -1.0), 0.35 * body.diameter
    along = flow.heading[["xyz".index(view.first), "xyz".index(view.second)]]
    start = np.array([end + sense * 0.2 * reach, 0.0]) / unit
    stop = start + sense * 1.2 * reach / unit * along
    shape = "simple,head_length=0.5,head_width=0.55,tail_width=0.2"
    swims = {"facecolor": COLOURS["orange"], "edgecolor": "white", "linewidth": 0.7, "zorder": 9}
    arrow(axes, start, stop, arrowstyle=shape, mutation_scale=18, shrinkA=2, shrinkB=2, **swims)
    x, y = 0.5 * (start + stop) + np.array([0.0, 0.28 * body.diameter / unit])
    label(axes, x, y, "$U_x$", size=9, color="black")


def _at_glass(view: _View) -> tuple[Values, Values]:
    """Positions along the tube, and pressures (Pa) at the plane's uppermost points of the fluid there."""
    pressure = view.values("pressure")
    free = np.isfinite(pressure)
    there = np.flatnonzero(free.any(axis=0))
    upper = len(free) - 1 - np.argmax(free[::-1], axis=0)
    return view.x[there], pressure[upper[there], there]


def _draw_strip(axes: Axes, view: _View) -> None:
    x, pressure = _at_glass(view)
    scale = UnitPrefix.of(pressure, "Pa")
    axes.plot(x, pressure / scale.factor, color=COLOURS["blue"], linewidth=1.4)
    axes.axhline(0.0, color="#888888", linewidth=0.6)
    axes.set_xlim(view.x[0], view.x[-1])
    axes.set_xlabel(f"${view.first}$ ({view.lengths.unit})")
    axes.set_ylabel(f"pressure ({scale.unit})")
    side = "upper glass" if view.second == "z" else "glass on the left"
    axes.set_title(f"at the {side}", loc="right", pad=3, size=8, color="#333333")


def _conditions(flow: Flow, view: _View) -> Iterator[str]:
    motion, unit = flow.prediction, view.lengths
    frame = "lab frame" if flow.frame == "lab" else "frame of the swimming robot"
    plane = f"plane {view.name} at {view.across} = {view.offset / unit.factor:.4g} {unit.unit}"
    where = f"{plane}, origin at the body's mid-length"
    yield f"{where} · {frame} · phase {np.degrees(flow.phase):.4g}° · model {motion.model.name}"
    yield (
        f"$U_x$ = {in_words(motion.forward_velocity, 'm/s')}, "
        f"tail {motion.tail_rotation_rate / Hz:.4g} Hz, body {motion.body_rotation_rate / Hz:.4g} Hz"
    )
    if flow.seat is not None:
        yield ", ".join(_place(flow, unit))


def _place(flow: Flow, lengths: UnitPrefix) -> Iterator[str]:
    """Pose of the robot in its tube, and the imposed flow."""
    placement, motion = flow.prediction.placement, flow.prediction
    film = placement["gap"]["value"]
    in_run = f" (in the run {in_words(film - flow.lifted, 'm')})" if flow.lifted > 0.0 else ""
    yield f"gap {film / lengths.factor:.4g} {lengths.unit}{in_run}"
    if flow.seat is not None and flow.seat.pitch:
        yield f"pitch {np.degrees(flow.seat.pitch):.4g}°"
    if flow.seat is not None and flow.seat.yaw:
        yield f"yaw {np.degrees(flow.seat.yaw):.4g}°"
    if "tail_drop" in placement:
        yield f"tail lowered by {placement['tail_drop']['value'] / lengths.factor:.4g} {lengths.unit}"
    through = in_words(motion.plug_velocity, "m/s")
    if motion.motion == "free":  # a moment of a run, which states how its ends and an imposed flow drive the fluid
        yield f"mean flow {through}"
    elif motion.batch.placement.flow is not None:
        yield f"imposed mean flow {through}"
    elif placement["ends"] == "closed":
        yield "ends closed"
    else:
        yield f"ends open, mean flow {through}"


def _notes(flow: Flow, view: _View) -> Iterator[str]:
    oblique = flow.seat is not None and (view.name == "xy" or view.offset != 0)
    lines = "velocity component in the plane, ending at an oblique wall" if oblique else _LINES
    drawn = ["grey: robot where it is cut" if oblique else "grey: robot where the plane cuts it"]
    if view.first == "x":
        drawn.append("white band: tail")
        drawn += ["dashed: its full outline"] if view.offset != 0 else []
    yield f"Lines: {lines}; {', '.join(drawn)}."
    held = ""
    if flow.held_force > 0:
        words = "Weight and contact push it sideways with" if flow.prediction.motion == "free" else _HELD
        held = f" {words} {in_words(flow.held_force, 'N', 2)}."
    walls = "Unbounded fluid: no walls." if flow.seat is None else "Pressure: above the mean of the tube's ends."
    yield f"{walls}{held} Computed, no measured data."
