"""Events of a run in its figure: numbered lines over the time axes, and what happened in a note below."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from spirillum.arrays import Samples
from spirillum.dynamics.events import told
from spirillum.view.figures.style import plain

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["event_words", "events_of", "mark_events"]

_MOST_EVENTS = 12
"""Events that are named."""
_CROWDED = 0.05
"""Distance of events over that of the axis below which they share a label."""
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
    words = [f"{number}: {what} ({when:.4g} s)" for number, (when, what) in enumerate(events[:_MOST_EVENTS], 1)]
    if len(events) > _MOST_EVENTS:
        words.append(f"and {len(events) - _MOST_EVENTS} more")
    return [" · ".join(words)] if words else []


def mark_events(axes: Axes, events: list[tuple[float, str]], time: Samples, *, numbered: bool) -> None:
    """Draw the events over a time axis; above it their numbers where it is `numbered`."""
    first, span = float(time[0]), float(time[-1] - time[0])
    for when, _ in events:
        axes.axvline(when, color="#777777", linewidth=0.8, dashes=(3, 2), zorder=1)
    for numbers in _close_together(events[:_MOST_EVENTS], span) if numbered else []:
        middle = float(np.mean([events[number][0] for number in numbers]))
        beside_letter = first + _LETTER * span
        axes.annotate(
            str(numbers[0] + 1) if len(numbers) == 1 else f"{numbers[0] + 1}\u2013{numbers[-1] + 1}",
            (max(middle, beside_letter), 1.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=(0, 2),
            textcoords="offset points",
            ha="center" if middle > beside_letter + 0.02 * span else "left",
            size=7,
            color="#555555",
        )


def _close_together(events: list[tuple[float, str]], span: float) -> list[list[int]]:
    """Numbers of the events from 0, those together that have no room for a label each."""
    found: list[list[int]] = []
    for number, (when, _) in enumerate(events):
        if found and when - events[found[-1][0]][0] < _CROWDED * span:
            found[-1].append(number)
        else:
            found.append([number])
    return found
