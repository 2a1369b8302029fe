"""A number with its interval as people read it: as many digits as the interval deserves."""

from __future__ import annotations

import math
from typing import NamedTuple

from spirillum.units import for_people, shown_in

_MOST_DIGITS = 7
"""Digits of a value at most, however narrow its interval is."""
_MOST_DECIMALS = 9


class ShownNumber(NamedTuple):
    """A number with its interval as texts; ``-`` for what is not there."""

    value: str
    """The value."""
    low: str
    """Lower end of its interval."""
    high: str
    """Upper end."""
    unit: str
    """Unit of all three; empty where there is no value."""


def shown(value: float | None, low: float | None, high: float | None, unit: str) -> ShownNumber:
    """A number down to the second digit of its interval's half width, and the interval's ends likewise.

    Args:
        value: in SI; None or NaN where there is none. Without an interval it has four digits.
        low: lower end of the interval; None or NaN where there is none.
        high: upper end.
        unit: SI unit.
    """
    if value is None or not math.isfinite(value):
        return ShownNumber("-", "-", "-", "")
    read = for_people(unit)
    number = shown_in(value, read)
    if low is None or high is None or not math.isfinite(low):
        return ShownNumber(f"{number:.4g}", "-", "-", read)
    ends = [shown_in(low, read), shown_in(high, read)]
    decimals = _decimals(number, 0.5 * (ends[1] - ends[0]))
    texts = [f"{round(item, decimals) + 0.0:.{decimals}f}" for item in (number, *ends)]  # + 0.0: no minus zero
    return ShownNumber(texts[0], texts[1], texts[2], read)


def _decimals(value: float, half_width: float) -> int:
    """Decimals down to the second digit of a half width."""
    wanted = 1 - math.floor(math.log10(half_width)) if half_width > 0 else _MOST_DECIMALS
    most = _MOST_DIGITS - 1 - math.floor(math.log10(abs(value))) if value else _MOST_DECIMALS
    return max(min(wanted, most, _MOST_DECIMALS), 0)
