"""Panels of a run: event marks on the time axes, and the path in the tube's cross-section."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from spirillum.arrays import Samples
from spirillum.dynamics.run_summary import merged_events
from spirillum.robot.links import outlines_of
from spirillum.robot.robot import Robot
from spirillum.view.figures.sheet import write_beside
from spirillum.view.figures.style import COLOURS, UnitPrefix, plain

if TYPE_CHECKING:
    import xarray as xr


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
        write_beside(axes, words, at, (0, 2), **look)


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
