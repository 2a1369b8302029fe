"""A run in time: its path from the side and from above, gap, rates, current, powers and energies over one time axis."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spirillum.arrays import Samples
from spirillum.dynamics.events import told
from spirillum.errors import InputError
from spirillum.quantities import unit_of
from spirillum.view.figures.sheet import Sheet, add_letters
from spirillum.view.figures.style import COLOURS, Scale, plain, styled

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["trajectory_figure"]

_WIDTH, _PATHS, _PANEL = 9.0, 1.75, 1.25
"""Width of the figure; heights of the paths and of a panel over time, inches."""
_MOST_EVENTS = 12
_DECADES = 5
"""Range of a logarithmic axis."""
_SPREAD = 30.0
"""Ratio of the largest values of two lines above which their axis is logarithmic."""


@dataclass(frozen=True)
class _Panel:
    """Lines over time with one unit."""

    label: str
    lines: tuple[tuple[str, str], ...]
    """Variable, and its words in the legend."""
    logarithmic: bool = False
    """Whether a logarithmic axis may be used."""


_PANELS = (
    _Panel("gap to the wall", (("wall_gap", ""),)),
    _Panel("velocity $U_x$", (("forward_velocity", ""),)),
    _Panel("rate", (("tail_rotation_rate", "tail"), ("body_rotation_rate", "body"), ("motor_rotation_rate", "motor"))),
    _Panel("angle", (("pitch", "pitch"), ("yaw", "yaw"))),
    _Panel("wobble angle", (("wobble_angle", ""),)),
    _Panel("phase lag", (("phase_lag", ""),)),
    _Panel("motor current", (("motor_current", ""),)),
    _Panel(
        "power",
        (
            ("electrical_power", "electrical"),
            ("shaft_power", "shaft"),
            ("friction_power", "friction"),
            ("dissipated_power", "in the fluid"),
        ),
        logarithmic=True,
    ),
    _Panel(
        "energy",
        (
            ("electrical_energy", "electrical"),
            ("drive_energy", "drive"),
            ("friction_energy", "friction"),
            ("dissipated_energy", "in the fluid"),
        ),
        logarithmic=True,
    ),
)
_COLOUR_OF = {
    "tail": COLOURS["blue"],
    "body": COLOURS["orange"],
    "motor": COLOURS["green"],
    "pitch": COLOURS["blue"],
    "yaw": COLOURS["vermillion"],
    "electrical": COLOURS["black"],
    "shaft": COLOURS["blue"],
    "drive": COLOURS["blue"],
    "friction": COLOURS["vermillion"],
    "in the fluid": COLOURS["green"],
}
_LINE_OF: dict[str, Any] = {
    "body": "--",
    "motor": (0, (1, 1.2)),
    "yaw": "--",
    "shaft": "--",
    "drive": "--",
    "friction": (0, (1, 1.2)),
    "in the fluid": "-.",
}


def trajectory_figure(dataset: xr.Dataset) -> Figure:
    """A run in time. Panels without data are left out; events are numbered on the time axes and named below.

    Args:
        dataset: what `spirillum.simulate` returns: a free run, a magnetic one, or an axial one.

    Raises:
        InputError: if it has less than two samples of time, or no variable that a panel shows.
    """
    time = _time_of(dataset)
    path = _path_of(dataset, time)
    shown = [panel for panel in _PANELS if any(True for _ in _lines(dataset, panel, time))]
    if path is None and not shown:
        raise InputError("the run has no variable to draw; allowed: a run of `spirillum simulate`")
    events = _events_of(dataset, time)
    facts = [
        f"{name} {plain(str(dataset.attrs[name]), 40)}"
        for name in ("model", "motion", "friction")
        if dataset.attrs.get(name)
    ]
    with styled():
        sheet = Sheet(
            f"{plain(str(dataset.attrs.get('robot', 'a robot')), 50)}: a run in time",
            " · ".join([*facts, "computed, nothing is measured"]),
            width=_WIDTH,
            heights=[_PATHS] * (path is not None) + [_PANEL] * -(-len(shown) // 2),
            columns=2,
            notes=_event_words(events),
            sharey=False,
        )
        panels = iter(sheet.panels.flat)
        if path is not None:
            for name, across in (("side", 2), ("from above", 1)):
                _draw_path(next(panels), path, across, name)
        over_time = []
        for number, panel in enumerate(shown):
            axes = next(panels)
            _draw_panel(axes, dataset, panel, time)
            _mark_events(axes, events, numbered=number < 2)
            axes.set_xlim(float(time[0]), float(time[-1]))
            over_time.append(axes)
            if number + 2 < len(shown):
                axes.tick_params(labelbottom=False)
            else:
                axes.set_xlabel("time (s)")
        for axes in panels:
            axes.remove()
        for axes in over_time[1:]:
            axes.sharex(over_time[0])
        add_letters(axes for axes in sheet.panels.flat if axes.figure is not None)
        return sheet.finished()


def _time_of(dataset: xr.Dataset) -> Samples:
    time = np.asarray(dataset["time"].values, dtype=float) if "time" in dataset.variables else np.zeros(0)
    if time.ndim != 1 or time.size < 2 or not np.all(np.diff(time) > 0):
        raise InputError(f"the run has {time.size} samples of time; allowed: at least 2, increasing")
    return time


def _path_of(dataset: xr.Dataset, time: Samples) -> Samples | None:
    """(n, 3) places of the body's mid-length, m; None where the run has a distance only."""
    if "position" not in dataset or dataset["position"].ndim != 2:
        return None
    values = np.asarray(dataset["position"].transpose("time", ...).values, dtype=float)
    return values if values.shape == (time.size, 3) and np.any(np.isfinite(values)) else None


def _lines(dataset: xr.Dataset, panel: _Panel, time: Samples) -> Iterator[tuple[str, Samples]]:
    """Words and SI values of the lines of a panel that the run has."""
    for name, words in panel.lines:
        if name in dataset and dataset[name].dims == ("time",):
            values = np.asarray(dataset[name].values, dtype=float)
            if values.size == time.size and np.any(np.isfinite(values)):
                yield words, values


def _draw_path(axes: Axes, path: Samples, across: int, name: str) -> None:
    lengths = Scale.of(np.ptp(path[np.isfinite(path).all(axis=1)], axis=0), "m")
    x, y = lengths(path[:, 0]), lengths(path[:, across])
    axes.plot(x, y, color=COLOURS["blue"])
    axes.plot(x[:1], y[:1], marker="o", color="white", markeredgecolor=COLOURS["blue"], linestyle="none")
    axes.plot(x[-1:], y[-1:], marker="o", color=COLOURS["blue"], linestyle="none")
    axes.set_xlabel(f"$x$ ({lengths.unit})")
    axes.set_ylabel(f"${'xyz'[across]}$ ({lengths.unit})")
    _widen(axes, x, y)
    axes.set_title(f"path, {name}; scales differ", loc="right", pad=3, size=8, color="#555555")


def _widen(axes: Axes, x: Samples, y: Samples) -> None:
    """Keep rounding from filling an axis across which nothing moves."""
    reach = float(np.nanmax(x) - np.nanmin(x))
    low, high = float(np.nanmin(y)), float(np.nanmax(y))
    if high - low < 1e-6 * max(reach, abs(low)) or high == low:
        room = 0.1 * max(reach, abs(low), 1e-9)
        axes.set_ylim(low - room, high + room)


def _draw_panel(axes: Axes, dataset: xr.Dataset, panel: _Panel, time: Samples) -> None:
    lines = list(_lines(dataset, panel, time))
    values = np.concatenate([line for _, line in lines])
    scale = Scale.of(values, unit_of(panel.lines[0][0]))
    largest = [float(np.nanmax(np.abs(line))) for _, line in lines]
    steep = panel.logarithmic and min(largest) > 0 and max(largest) > _SPREAD * min(largest)
    for words, line in lines:
        drawn = np.where(line > 0, line, np.nan) if steep else line
        axes.plot(
            time,
            scale(drawn),
            color=_COLOUR_OF.get(words, COLOURS["blue"]),
            linestyle=_LINE_OF.get(words, "-"),
            label=words or None,
        )
    if steep:
        top = max(largest) / scale.factor
        axes.set_yscale("log")
        axes.set_ylim(max(0.1 * min(largest) / scale.factor, top * 10.0**-_DECADES), 3.0 * top)
    elif panel.lines[0][0] == "wall_gap":
        axes.set_ylim(bottom=min(0.0, float(np.nanmin(values)) / scale.factor))
    axes.set_ylabel(f"{panel.label} ({scale.unit})")
    if any(words for words, _ in lines):
        axes.legend(loc="upper right", ncols=4, handlelength=1.8, columnspacing=1.0, borderaxespad=0.2)
        _make_room(axes)


def _make_room(axes: Axes) -> None:
    """Room above the lines for the legend."""
    low, high = axes.get_ylim()
    if axes.get_yscale() == "log":
        axes.set_ylim(low, high * (high / low) ** 0.22)
    else:
        axes.set_ylim(low, high + 0.28 * (high - low))


def _events_of(dataset: xr.Dataset, time: Samples) -> list[tuple[float, str]]:
    """Times within the run, and what happened then; what it begins with is no event in it.

    Of what happens again and again, as where a contact bounces, the first time and the number of times.
    """
    try:
        listed = json.loads(str(dataset.attrs.get("events", "[]")))
        found = [(float(event["time"]), plain(str(event["what"]), 60)) for event in listed]
    except (ValueError, TypeError, KeyError):
        return []  # they are notes on a picture; a run without them can still be drawn
    inside = [event for event in found if time[0] < event[0] <= time[-1]]
    return [
        (event.time, f"{event.what}, {event.times} times" if event.times > 1 else event.what) for event in told(inside)
    ]


def _event_words(events: list[tuple[float, str]]) -> list[str]:
    """The events by number, in one note."""
    words = [f"{number}: {what} ({when:.4g} s)" for number, (when, what) in enumerate(events[:_MOST_EVENTS], 1)]
    if len(events) > _MOST_EVENTS:
        words.append(f"and {len(events) - _MOST_EVENTS} more")
    return [" · ".join(words)] if words else []


def _mark_events(axes: Axes, events: list[tuple[float, str]], *, numbered: bool) -> None:
    for number, (when, _) in enumerate(events, 1):
        axes.axvline(when, color="#777777", linewidth=0.8, dashes=(3, 2), zorder=1)
        if numbered and number <= _MOST_EVENTS:
            level = 1.02 + 0.09 * _crowded(events, number - 1)
            axes.text(
                when, level, str(number), transform=axes.get_xaxis_transform(), ha="center", size=7, color="#555555"
            )


def _crowded(events: list[tuple[float, str]], place: int) -> int:
    """0 or 1: every other one of events close to each other stands higher."""
    span = max(events[-1][0] - events[0][0], 1e-300)
    near = [later[0] - earlier[0] < 0.02 * span for earlier, later in pairwise(events[: place + 1])]
    level = 0
    for close in near:
        level = 1 - level if close else 0
    return level
