"""A run in time on one sheet: its path, and what it is made of over one time axis.

A run in a tube has its path in the cross-section, the film on a logarithmic axis, azimuth, angles against the wall and
contact; any other its path from the side and from above, current, powers and energies.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from spirillum.arrays import Samples
from spirillum.data_tables import rows_of
from spirillum.dynamics.run_file import check_increasing, robot_of
from spirillum.dynamics.run_summary import merged_events
from spirillum.errors import InputError, check_choice
from spirillum.quantities import unit_of
from spirillum.robot.links import outlines_of
from spirillum.robot.robot import Robot
from spirillum.units import show, show_height, speed_unit
from spirillum.view.figures.sheet import Sheet, write_beside
from spirillum.view.figures.style import COLOURS, COLUMN, PAGE, WHITE_BOX, UnitPrefix, plain, styled

if TYPE_CHECKING:
    import xarray as xr

COLUMNS = {"single": COLUMN, "double": PAGE}  #: Widths of a figure that fills one or both columns of a page, inches.
_HEIGHTS = {"single": (1.2, 2.0, 0.56), "double": (1.75, 2.4, 1.15)}  # paths, section, panel; inches
_LETTERS_BESIDE = 40  # letters of a legend, with seven for each line's sample, above which it has two columns
_MANY_TURNS = 30.0  # turns of the tail above which oscillations fill a panel, and means over a turn are plotted too
_DECADES = 5  # range of a logarithmic axis
_DECADES_BARE = 30.0  # ratio of gaps above which only decades are labelled
_SPREAD = 30.0  # ratio of the largest values of two lines above which their axis is logarithmic
_STILL = 0.5  # change of azimuth below which a robot counts as stationary, degrees
_ONE_WAY = 0.75  # net change of azimuth above which a robot circulates in the tube in one direction


@dataclass(frozen=True)
class _Panel:
    """Lines over time with one unit."""

    label: str
    lines: tuple[tuple[str, str], ...]  # variable and its legend label
    logarithmic: bool = False  # whether a logarithmic axis may be used
    film: bool = False  # whether the axis is logarithmic over the whole range of the lines, with the roughness marked
    changing: bool = False  # whether a panel whose lines are constant is left out
    mean: bool = False  # whether the mean over a turn of the tail is plotted for the first line of a long run


def _panels(run: str) -> list[_Panel]:
    """The rows of `run_panels.csv` for a run: any, or one in a tube."""
    found = []
    for row in rows_of("view/figures/run_panels.csv"):
        lines = [line.partition(" ") for line in row["lines"].split("; ")]
        if row["run"] == run:
            kinds = dict.fromkeys(row["kinds"].split(), True)
            found.append(_Panel(row["label"], tuple((name, label) for name, _, label in lines), **kinds))
    return found


_LEGEND: dict[str, Any] = {
    "handlelength": 1.8,
    "columnspacing": 1.0,
    "borderaxespad": 0.2,
    "labelspacing": 0.2,
    "frameon": True,
    "framealpha": 0.8,
    "edgecolor": "none",
}
_DOTS: dict[str, Any] = {"dots": (0, (1, 1.2))}  # line styles that matplotlib has no name for
_LOOK_OF = {
    row["label"]: (row["colour"], _DOTS.get(row["line"], row["line"])) for row in rows_of("view/figures/run_lines.csv")
}
"""Colour and line of a quantity by its label in the legend."""
_MAIN = ("velocity $U_x$", "gap", "gap to the wall", "rate")  # panels of the short figure, the first two that a run has
PANELS = ("main", "all")  #: Which panels a figure has: speed and gap, or everything.


def trajectory_figure(dataset: xr.Dataset, column: str = "double", panels: str = "all") -> Figure:
    """A run in time, `PANELS` of it without those that lack data; events are numbered on the time axes, named below."""
    check_choice("column", column, COLUMNS)
    check_choice("panels", panels, PANELS)
    time = np.asarray(dataset["time"].values, dtype=float) if "time" in dataset.variables else np.zeros(0)
    check_increasing(time)
    path = _path_of(dataset, time)
    tube = _tube_robot(dataset, path)
    shown = [panel for panel in _panels("any" if tube is None else "in a tube") if _has(dataset, panel, time)]
    if short := panels == "main":
        shown = sorted((one for one in shown if one.label in _MAIN), key=lambda one: _MAIN.index(one.label))[:2]
    if path is None and not shown:
        raise InputError("the run has no variable to draw; allowed: a run of `spirillum simulate`")
    events = events_of(dataset, time)
    turn = _turn_of(dataset, time) if any(panel.mean for panel in shown) else 0
    beside = 2 if column == "double" else 1
    with styled():
        paths, section, panel_height = _HEIGHTS[column]
        heads = 0 if path is None or short else 2 if tube is None else 1
        drawn = heads + len(shown)
        first = [paths if tube is None else section] * -(-heads // beside)
        rows = [*first, *[panel_height] * (-(-drawn // beside) - len(first))]
        sheet = Sheet(
            _headline(dataset, path, in_tube=tube is not None),
            " · ".join([*_facts(dataset, in_tube=tube is not None), "computed, no measured data"]),
            width=COLUMNS[column],
            heights=rows,
            columns=beside,
            notes=[*(["black: means over a turn of the tail"] if turn else []), *event_words(events)],
            sharey=False,
        )
        every = list(sheet.panels.flat)
        for axes in every[drawn:]:
            axes.remove()
        if path is None or short:
            pass
        elif tube is not None:
            draw_cross_section(every[0], dataset, tube, path)
        else:
            for axes, (name, across) in zip(every, (("side", 2), ("from above", 1)), strict=False):
                _draw_path(axes, path, across, name)
        over_time = every[heads:drawn]
        for number, (axes, panel) in enumerate(zip(over_time, shown, strict=True)):
            _draw_panel(axes, dataset, panel, time, beside, turn)
            mark_events(axes, events, time, numbered=number < beside)
            axes.set_xlim(float(time[0]), float(time[-1]))
            if number + beside < len(shown):
                axes.tick_params(labelbottom=False)
            else:
                axes.set_xlabel("time (s)")
        for axes in over_time[1:]:
            axes.sharex(over_time[0])
        return sheet.finished()


def _tube_robot(dataset: xr.Dataset, path: Samples | None) -> Robot | None:
    """The robot of a run in a tube; None for any other."""
    if path is None or "azimuth" not in dataset or "attitude" not in dataset:
        return None
    robot = robot_of(dataset)
    return robot if robot.channel is not None else None


def _headline(dataset: xr.Dataset, path: Samples | None, *, in_tube: bool) -> str:
    """Summary of the run in one line."""
    name = plain(str(dataset.attrs.get("robot", "a robot")), 50)
    if not in_tube or path is None:
        return f"{name}: a run in time"
    time = dataset["time"].values
    span = f"in {float(time[-1]):.4g} s" if time[0] == 0 else f"from {float(time[0]):.4g} to {float(time[-1]):.4g} s"
    return f"{name} swims {1e3 * (path[-1, 0] - path[0, 0]):.4g} mm {span}"


def _around(dataset: xr.Dataset) -> str:
    """Which way a robot went around its tube."""
    azimuth = np.degrees(np.asarray(dataset["azimuth"].values, dtype=float))
    around, swing = float(azimuth[-1] - azimuth[0]), float(np.ptp(azimuth))
    if swing < _STILL:
        return "stays at its azimuth"
    if abs(around) < _ONE_WAY * swing:
        return f"goes {swing:.2g}° around the tube, to and fro"
    turned = float(dataset["body_angle"][-1] - dataset["body_angle"][0]) if "body_angle" in dataset else 0.0
    sense = f" {'with' if turned * around > 0 else 'against'} its body's rotation" if turned else ""
    return f"goes {abs(around):.2g}° around the tube{sense}"


def mean_velocity_in_words(dataset: xr.Dataset) -> list[str]:
    """Return the mean velocity of a run, in the unit of its robot's other speeds; nothing where the run has none."""
    if np.isnan(mean := float(dataset.get("mean_forward_velocity_on", np.nan))):
        return []
    unit = speed_unit(mean, float(dataset.get("mean_tail_rotation_rate_on", np.nan)))
    return [f"mean velocity {show(mean, unit)} with the drive on"]


def _facts(dataset: xr.Dataset, *, in_tube: bool) -> list[str]:
    attrs = dataset.attrs
    found = [*mean_velocity_in_words(dataset), *([_around(dataset)] if in_tube else [])]
    found += [f"{name} {plain(str(attrs[name]), 40)}" for name in ("model", "motion", "friction") if attrs.get(name)]
    if in_tube:
        named = {"ends": "ends", "friction_coefficient": "dry friction"}
        found += [f"{words} {plain(str(attrs[name]), 40)}" for name, words in named.items() if name in attrs]
        found += [f"roughness {show_height(float(attrs['roughness']))}"] if "roughness" in attrs else []
        found += [f"waited {attrs['wait']:g} s"] if attrs.get("wait") else []
    if "draws" in attrs:
        found.append(f"the median of {attrs['draws']} draws")
    return found


def _has(dataset: xr.Dataset, panel: _Panel, time: Samples) -> bool:
    """Whether a panel has anything to show; a mean flow that is not imposed follows from the rest."""
    if panel.lines[0][0] == "mean_flow" and dataset.attrs.get("ends") != "imposed flow":
        return False
    lines = [line for _, line in _lines(dataset, panel, time)]
    return any(np.nanmax(line) > np.nanmin(line) for line in lines) if panel.changing else bool(lines)


def _turn_of(dataset: xr.Dataset, time: Samples) -> int:
    """Samples of a turn of the tail where the run has many turns and samples of each; else 0."""
    if "tail_angle" not in dataset:
        return 0
    turns = abs(float(dataset["tail_angle"][-1] - dataset["tail_angle"][0])) / (2.0 * np.pi)
    return round(time.size / turns) if _MANY_TURNS < turns < time.size / 4 else 0


def _path_of(dataset: xr.Dataset, time: Samples) -> Samples | None:
    """(n, 3) positions of the body's mid-length, m; None for a run with a distance only."""
    if "position" not in dataset or dataset["position"].ndim != 2:
        return None
    values = np.asarray(dataset["position"].transpose("time", ...).values, dtype=float)
    return values if values.shape == (time.size, 3) and np.any(np.isfinite(values)) else None


def _lines(dataset: xr.Dataset, panel: _Panel, time: Samples) -> list[tuple[str, Samples]]:
    """Labels and SI values of the lines of a panel that the run has, without lines that are always 0."""
    found = []
    for name, words in panel.lines:
        if name in dataset and dataset[name].dims == ("time",):
            values = np.asarray(dataset[name].values, dtype=float)
            if values.size == time.size and np.any(np.isfinite(values)):
                found.append((words, values))
    moving = [(words, values) for words, values in found if np.any(np.nan_to_num(values))]
    return moving or found


def _draw_path(axes: Axes, path: Samples, across: int, name: str) -> None:
    lengths = UnitPrefix.of(np.ptp(path[np.isfinite(path).all(axis=1)], axis=0), "m")
    x, y = lengths(path[:, 0]), lengths(path[:, across])
    axes.plot(x, y, color=COLOURS["blue"])
    axes.plot(x[:1], y[:1], marker="o", color="white", markeredgecolor=COLOURS["blue"], linestyle="none")
    axes.plot(x[-1:], y[-1:], marker="o", color=COLOURS["blue"], linestyle="none")
    axes.set_xlabel(f"$x$ ({lengths.unit})")
    axes.set_ylabel(f"${'xyz'[across]}$ ({lengths.unit})")
    _widen(axes, x, y)
    axes.set_title(f"path, {name}; scales differ", loc="right", pad=3, size=8, color="#555555")


def _widen(axes: Axes, x: Samples, y: Samples) -> None:
    """Widen a nearly constant axis, on which rounding would dominate."""
    reach = float(np.nanmax(x) - np.nanmin(x))
    low, high = float(np.nanmin(y)), float(np.nanmax(y))
    if high - low < 1e-6 * max(reach, abs(low)) or high == low:
        room = 0.1 * max(reach, abs(low), 1e-9)
        axes.set_ylim(low - room, high + room)


def _draw_panel(axes: Axes, dataset: xr.Dataset, panel: _Panel, time: Samples, beside: int, turn: int) -> None:
    """Draw lines over time in a sheet of `beside` columns; a single one has low panels."""
    # The mean over `turn` samples is plotted too, where the panel has one; 0: none.
    lines = _lines(dataset, panel, time)
    values = np.concatenate([line for _, line in lines])
    scale = UnitPrefix.of(values, unit_of(panel.lines[0][0]))
    film = panel.film and bool(np.all(values[np.isfinite(values)] > 0))
    largest = [float(np.nanmax(np.abs(line))) for _, line in lines]
    steep = panel.logarithmic and min(largest) > 0 and max(largest) > _SPREAD * min(largest)
    for words, line in lines:
        drawn = np.where(line > 0, line, np.nan) if steep else line
        colour, style = _LOOK_OF.get(words, ("blue", "-"))
        axes.plot(time, scale(drawn), color=COLOURS[colour], linestyle=style, label=words or None)
    if panel.mean and turn:
        middle, mean = (np.convolve(of, np.ones(turn) / turn, mode="valid") for of in (time, lines[0][1]))
        axes.plot(middle, scale(mean), color=COLOURS["black"], linewidth=1.0)
    if steep:
        top = max(largest) / scale.factor
        axes.set_yscale("log")
        axes.set_ylim(max(0.1 * min(largest) / scale.factor, top * 10.0**-_DECADES), 3.0 * top)
    elif film:
        _draw_gap_axis(axes, dataset, values, scale)
    elif panel.lines[0][0] == "wall_gap":
        axes.set_ylim(bottom=min(0.0, float(np.nanmin(values)) / scale.factor))
    axes.set_ylabel(f"{panel.label}{' ' if beside > 1 else chr(10)}({scale.unit})")
    if any(words for words, _ in lines) and not (film and len(lines) == 1):
        columns = len(lines) if sum(len(words) + 7 for words, _ in lines) <= _LETTERS_BESIDE else 2
        axes.legend(loc="upper right", ncols=columns, **_LEGEND)
        _make_room(axes, -(-len(lines) // columns) * (1.0 if beside > 1 else 2.0))


def _draw_gap_axis(axes: Axes, dataset: xr.Dataset, values: Samples, scale: UnitPrefix) -> None:
    """A logarithmic axis for gaps, with the height of the asperities: below it they carry."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    roughness = float(dataset.attrs.get("roughness", np.nan))
    if roughness > 0:
        low = min(low, roughness)
        axes.axhline(roughness / scale.factor, color="#555555", linewidth=0.9, linestyle=(0, (1, 1.5)))
        look: dict[str, Any] = {"xycoords": axes.get_yaxis_transform(), "size": 7.5, "color": "#555555"}
        write_beside(axes, "roughness", (0.01, roughness / scale.factor), (0, 4), bbox=WHITE_BOX, **look)
    axes.set_yscale("log")
    axes.set_ylim(0.6 * low / scale.factor, max(1.6 * high, 10.0 * low) / scale.factor)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0,) if high > _DECADES_BARE * low else (1.0, 2.0, 5.0), numticks=7))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _make_room(axes: Axes, rows: float) -> None:
    """Room above the lines for a legend of so many rows of the higher panels."""
    low, high = axes.get_ylim()
    if axes.get_yscale() == "log":
        axes.set_ylim(low, high * (high / low) ** (0.32 * rows))
    else:
        axes.set_ylim(low, high + 0.28 * rows * (high - low))


_MOST_EVENTS = 12  # events that are named
_WIDE = (0.04, 0.08)  # width of a label with one number and with two, over the axis's: events without room share one
_LETTER = 0.07  # share of a time axis above which the panel's letter is placed


def events_of(dataset: xr.Dataset, time: Samples) -> list[tuple[float, str]]:
    """Times within the run, and what happened then; what it begins with is no event in it."""
    # Of what happens again and again, as where a contact bounces, the first time and the number of times.
    try:
        listed = json.loads(str(dataset.attrs.get("events", "[]")))
        found = [(float(event["time"]), plain(str(event["what"]), 60)) for event in listed]
    except (ValueError, TypeError, KeyError):
        return []  # they are notes on a picture; a run without them can still be drawn
    inside = [event for event in found if time[0] < event[0] <= time[-1]]
    return [
        (event.time, f"{event.what}, {event.times} times" if event.times > 1 else event.what)
        for event in merged_events(inside)
    ]


def event_words(events: list[tuple[float, str]]) -> list[str]:
    """The events of `events_of` by number, in one note; none where there are none."""
    words = [f"{number}: {what} ({when:.4g}\u00a0s)" for number, (when, what) in enumerate(events[:_MOST_EVENTS], 1)]
    if len(events) > _MOST_EVENTS:
        words.append(f"and {len(events) - _MOST_EVENTS} more")
    return [" · ".join(words)] if words else []


def mark_events(axes: Axes, events: list[tuple[float, str]], time: Samples, *, numbered: bool) -> None:
    """Draw the events over a time axis; above it their numbers where it is `numbered`."""
    first, span = float(time[0]), float(time[-1] - time[0])
    for when, _ in events:
        axes.axvline(when, color="#777777", linewidth=0.8, dashes=(3, 2), zorder=1)
    positions = [(when - first) / span for when, _ in events[:_MOST_EVENTS]]
    for numbers in _close_together(positions) if numbered else []:
        left = _left_end([positions[number] for number in numbers])
        words = str(numbers[0] + 1) if len(numbers) == 1 else f"{numbers[0] + 1}\u2013{numbers[-1] + 1}"
        at = first + (left + 0.5 * _WIDE[len(numbers) > 1]) * span, 1.0
        look = {"xycoords": axes.get_xaxis_transform(), "ha": "center", "size": 7, "color": "#555555"}
        write_beside(axes, words, at, (0, 2), bbox=WHITE_BOX, **look)


def _left_end(positions: list[float]) -> float:
    """Left end of the labels of events at these shares of the axis, right of the panel's letter."""
    return max(float(np.mean(positions)) - 0.5 * _WIDE[len(positions) > 1], _LETTER)


def _close_together(positions: list[float]) -> list[list[int]]:
    """Numbers of the events from 0, those together that have no room for a label each."""
    found: list[list[int]] = []
    for number in range(len(positions)):
        found.append([number])
        while len(found) > 1:
            before, after = ([positions[one] for one in group] for group in found[-2:])
            if _left_end(before) + _WIDE[len(before) > 1] <= _left_end(after):
                break
            last = found.pop()
            found[-1] += last
    return found


_RIM, _FILL, _EDGE = "#5d7486", "#dfe3e6", "#4a5258"
_ROOM = 1.06  # half-width of the panel over the tube's radius
_AROUND = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
_ALONG = np.linspace(0.0, 1.0, 12)


def silhouette(robot: Robot, position: Samples, attitude: Samples) -> Samples:
    """Outline (n, 2) of a convex body as seen along the tube: y and z in the lab, m; `attitude` is w, x, y, z."""
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
    """Draw the tube as seen from its front end, y to the right and z up, so that positive azimuth is anticlockwise."""
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
