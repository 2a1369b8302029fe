"""Events of a run in its figure: numbered lines over the time axes, and what happened in a note below."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from spirillum.arrays import Samples
from spirillum.dynamics.run_summary import told
from spirillum.view.figures.style import plain

if TYPE_CHECKING:
    import xarray as xr

_MOST_EVENTS = 12
"""Events that are named."""
_WIDE = (0.04, 0.08)
"""Width of a label with one number and with two, over that of the axis: events without room share one."""
_LETTER = 0.07
"""Share of a time axis above which the panel's letter stands."""


def events_of(dataset: xr.Dataset, time: Samples) -> list[tuple[float, str]]:
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
    places = [(when - first) / span for when, _ in events[:_MOST_EVENTS]]
    for numbers in _close_together(places) if numbered else []:
        left = _left_end([places[number] for number in numbers])
        axes.annotate(
            str(numbers[0] + 1) if len(numbers) == 1 else f"{numbers[0] + 1}\u2013{numbers[-1] + 1}",
            (first + (left + 0.5 * _WIDE[len(numbers) > 1]) * span, 1.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=(0, 2),
            textcoords="offset points",
            ha="center",
            size=7,
            color="#555555",
        )


def _left_end(places: list[float]) -> float:
    """Where the label of events begins that lie at these shares of the axis: beside the panel's letter at the least."""
    return max(float(np.mean(places)) - 0.5 * _WIDE[len(places) > 1], _LETTER)


def _close_together(places: list[float]) -> list[list[int]]:
    """Numbers of the events from 0, those together that have no room for a label each."""
    found: list[list[int]] = []
    for number in range(len(places)):
        found.append([number])
        while len(found) > 1:
            before, after = ([places[one] for one in group] for group in found[-2:])
            if _left_end(before) + _WIDE[len(before) > 1] <= _left_end(after):
                break
            last = found.pop()
            found[-1] += last
    return found
