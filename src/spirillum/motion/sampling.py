"""Length and sample times of a run."""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.units import KINDS, parse_option

__all__ = ["duration_of", "sample_times"]

_LARGEST_SAMPLES = 1_000_000


def duration_of(turns: float, turn: float, duration: str | float | None) -> float:
    """Length of a run, s.

    Args:
        turns: length in turns.
        turn: time of a turn, s.
        duration: length in time instead.

    Raises:
        InputError: for a length that is none.
    """
    if duration is None:
        if not 0 < turns <= 1e5:
            raise InputError(f"turns = {turns}; allowed: more than 0, at most 1e5")
        return turns * turn
    end = parse_option("duration", duration, KINDS["time"])
    if end <= 0:
        raise InputError(f"duration = {end:g} s; allowed: more than 0 s")
    return end


def sample_times(end: float, turn: float, samples_per_turn: int) -> Samples:
    """Evenly spaced times from 0 to `end`, s.

    Args:
        end: length of the run, s.
        turn: time of a turn, s.
        samples_per_turn: samples in it.

    Raises:
        InputError: for no samples, or too many.
    """
    count = math.ceil(end / turn * samples_per_turn)
    if not 1 <= samples_per_turn <= 10_000 or count > _LARGEST_SAMPLES:
        raise InputError(
            f"samples-per-turn = {samples_per_turn} makes {count} samples; allowed: 1 to 10000 a turn and "
            f"{_LARGEST_SAMPLES} in all"
        )
    return np.linspace(0.0, end, max(count, 1) + 1)
