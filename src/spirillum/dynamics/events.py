"""What happens in a run again and again, told once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

_MOST_ALIKE = 4
"""Events of one kind that are told one by one."""


class Told(NamedTuple):
    """An event, or the first of many that are alike."""

    time: float
    """When, s."""
    what: str
    """What happened."""
    times: int
    """How often."""
    last: float
    """When for the last time, s."""


def told(events: Sequence[tuple[float, str]]) -> list[Told]:
    """Events in the order of time; those that come more than a few times, as where a contact bounces, are one.

    Args:
        events: time, s, and what happened.
    """
    moments_of: dict[str, list[float]] = {}
    for when, what in events:
        moments_of.setdefault(what, []).append(when)
    found = []
    for what, moments in moments_of.items():
        if len(moments) > _MOST_ALIKE:
            found.append(Told(min(moments), what, len(moments), max(moments)))
        else:
            found += [Told(when, what, 1, when) for when in moments]
    return sorted(found)
