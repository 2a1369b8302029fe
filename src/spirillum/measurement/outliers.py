"""What lies far from all others: frames of a series, and trials among trials."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spirillum.arrays import Samples
from spirillum.measurement.statistics import student_t_quantile

__all__ = ["GRUBBS_LEVEL", "outlying_trial", "stray_frames"]

GRUBBS_LEVEL = 0.01
"""Chance that Grubbs' test names one of trials that are all alike."""
_WINDOW = 9
_REACH = 6.0
_MAD = 1.4826
_LEAST = 0.25
"""A step that is small against the whole series' own spread is no stray, however smooth its neighbours are."""


def stray_frames(time: Samples, values: Samples, error: Samples | None = None) -> np.ndarray:
    """Frames that lie more than six standard deviations (from the median deviation) from their neighbours.

    First from the median of nine neighbours about a robust line, which finds single frames; then from the line
    itself, which finds short bursts, unless the series bends away from it as a whole.

    Args:
        time: times, (n,).
        values: the series, (n,); NaN where it was not measured.
        error: standard error of frames that are known to be less sure than their neighbours, such as those read by
            hand, (n,); NaN of others. Such a frame is a stray only beyond six of it.

    Returns:
        Truth values, (n,).
    """
    found = np.zeros(values.shape, dtype=bool)
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(time))
    if known.size < 2 * _WINDOW:
        return found
    own = np.zeros(values.shape) if error is None else np.nan_to_num(error)
    level = values[known] - _robust_line(time[known], values[known])
    around = np.lib.stride_tricks.sliding_window_view(np.pad(level, _WINDOW // 2, mode="edge"), _WINDOW)
    near = level - np.median(around, axis=1)
    strays = _far(near, np.maximum(_LEAST * _spread(level), own[known]))
    kept = known[~strays]
    found[known[strays]] = True
    level = values[kept] - _robust_line(time[kept], values[kept])
    bursts = _far(level, own[kept])
    if bursts.mean() < 0.1:
        found[kept[bursts]] = True
    return found


def _spread(deviation: Samples) -> float:
    return _MAD * float(np.median(np.abs(deviation - np.median(deviation))))


def _far(deviation: Samples, least: Samples) -> np.ndarray:
    """Where a deviation is more than six of its spread, or of the least standard error of each."""
    spread = np.maximum(_spread(deviation), least)
    return np.asarray((np.abs(deviation - np.median(deviation)) > _REACH * spread) & (spread > 0))


def _robust_line(time: Samples, values: Samples) -> Samples:
    """Siegel's line (1982, repeated medians) through the medians of some stretches: half of them may be wrong."""
    pieces = np.array_split(np.arange(time.size), min(60, time.size))
    t = np.array([np.median(time[piece]) for piece in pieces])
    y = np.array([np.median(values[piece]) for piece in pieces])
    apart = ~np.eye(t.size, dtype=bool)
    with np.errstate(invalid="ignore"):
        slopes = (y[:, None] - y) / (t[:, None] - t)
    slope = np.median(np.median(slopes[apart].reshape(t.size, -1), axis=1))
    return np.asarray(np.median(y - slope * t) + slope * time)


def outlying_trial(values: Sequence[float]) -> int | None:
    """The trial that does not fit in with the others, by Grubbs' test (1950), two-sided, at 1 %.

    Args:
        values: one value a trial; NaN is left out.

    Returns:
        Its index; None if all fit, or with fewer than three.
    """
    numbers = np.asarray(values, dtype=float)
    known = np.flatnonzero(np.isfinite(numbers))
    count = known.size
    if count < 3:
        return None
    spread = float(numbers[known].std(ddof=1))
    if spread <= 0:
        return None
    distance = np.abs(numbers[known] - numbers[known].mean()) / spread
    quantile = student_t_quantile(1.0 - GRUBBS_LEVEL / (2 * count), count - 2)
    bound = (count - 1) / np.sqrt(count) * np.sqrt(quantile**2 / (count - 2 + quantile**2))
    worst = int(np.argmax(distance))
    return int(known[worst]) if distance[worst] > bound else None
