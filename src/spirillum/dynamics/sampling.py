"""Length and sample times of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.units import KINDS, parse_option

__all__ = ["check_samples", "duration_of", "sample_times", "stated_duration"]

_LARGEST_SAMPLES = 1_000_000
_MOST_A_TURN = 10_000
_SHORTEST = 1e-6
"""Shortest run, in turns."""
_ROUNDING = 1e-9
"""Difference of two times that is rounding, over the distance of two samples."""


def stated_duration(turns: float, duration: str | float | None) -> float | None:
    """Length of a run as far as it is known without a rate: s, or None where it is in turns.

    Args:
        turns: length in turns.
        duration: length in time instead.

    Raises:
        InputError: for a length that is none.
    """
    if not _SHORTEST <= turns <= 1e5:
        raise InputError(f"turns = {turns}; allowed: {_SHORTEST:g} to 1e5")
    return None if duration is None else parse_option("duration", duration, KINDS["time"])


def duration_of(turns: float, turn: float, duration: str | float | None) -> float:
    """Length of a run, s.

    Args:
        turns: length in turns.
        turn: time of a turn, s.
        duration: length in time instead.

    Raises:
        InputError: for a length that is none.
    """
    end = stated_duration(turns, duration)
    if end is None:
        return turns * turn
    if end < _SHORTEST * turn:
        raise InputError(f"duration = {end:g} s; allowed: at least {_SHORTEST * turn:.3g} s, a millionth of a turn")
    return end


def check_samples(samples_per_turn: int) -> None:
    """Refuse a number of samples a turn that is none.

    Raises:
        InputError: for less than one, or too many.
    """
    if not 1 <= samples_per_turn <= _MOST_A_TURN:
        raise InputError(f"samples-per-turn = {samples_per_turn}; allowed: 1 to {_MOST_A_TURN} a turn")


def sample_times(end: float, turn: float, samples_per_turn: int, switches: Sequence[float] = ()) -> Samples:
    """Evenly spaced times from 0 to `end`, s.

    A sample that differs from a switching by rounding is at the switching, so that what it shows does not depend on
    which of the two is rounded up.

    Args:
        end: length of the run, s.
        turn: time of a turn, s.
        samples_per_turn: samples in it.
        switches: times of switchings within the run, s.

    Raises:
        InputError: for no samples, or too many.
    """
    check_samples(samples_per_turn)
    count = math.ceil(end / turn * samples_per_turn)
    if count > _LARGEST_SAMPLES:
        raise InputError(
            f"samples-per-turn = {samples_per_turn} makes {count} samples; allowed: at most {_LARGEST_SAMPLES} in all"
        )
    time = np.linspace(0.0, end, max(count, 1) + 1)
    for switch in switches:
        nearest = round(switch / end * (time.size - 1))
        if 0 < nearest < time.size - 1 and abs(time[nearest] - switch) < _ROUNDING * time[1]:
            time[nearest] = switch
    return time
