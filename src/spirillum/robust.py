"""Scales, lines and stretches of noisy series: median absolute deviation, running median, robust and other lines."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples

MAD_TO_SIGMA = 1.4826  #: Standard deviation of a normal distribution over its median absolute deviation, 1/Phi^-1(3/4).
_MOST_PIECES = 60  # points through which a repeated-median line goes at most: its work grows with their square


class LineFit(NamedTuple):
    """A straight line of one or several quantities over time."""

    time: float  #: Time at which it has `value`.
    value: Samples  #: Its value there, (...).
    slope: Samples  #: Change per unit of time, (...).

    def at(self, time: Samples | float) -> Samples:
        """Its value at a time; at several times, (n,), of a line of one quantity."""
        return np.asarray(self.value + self.slope * (time - self.time))


def mad_scale(residuals: Samples, axis: int | None = None) -> Samples:
    """Standard deviation of residuals about zero from their median absolute value; NaN is left out."""
    return np.asarray(MAD_TO_SIGMA * np.nanmedian(np.abs(residuals), axis=axis))


def running_median(values: Samples, window: int) -> Samples:
    """Median of each value and its neighbours, (n,); the first and last value are repeated beyond the ends."""
    padded = np.pad(values, window // 2, mode="edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, window), axis=1))


def stretches_of(mask: np.ndarray) -> list[np.ndarray]:
    """Indices of a series that follow each other and are in a mask, stretch by stretch."""
    places = np.flatnonzero(mask)
    return np.split(places, np.flatnonzero(np.diff(places) > 1) + 1) if places.size else []


def least_squares_line(time: Samples, values: Samples) -> LineFit:
    """The least-squares line through values (n,) or (n, k); its reference is the mean time."""
    middle, mean = float(time.mean()), values.mean(axis=0)
    spans = time - middle
    slope = spans @ (values - mean) / max(float(spans @ spans), 1e-300)
    return LineFit(middle, np.asarray(mean), np.asarray(slope))


def theil_sen_line(time: Samples, values: Samples) -> LineFit:
    """Theil and Sen's line: the median slope of all pairs of points, through the median of what remains, (n, k)."""
    earlier, later = np.triu_indices(len(time), 1)
    span = time[later] - time[earlier]
    slope = np.median((values[later] - values[earlier]) / span[:, None], axis=0)
    return LineFit(0.0, np.median(values - slope * time[:, None], axis=0), slope)


def _medians_of_stretches(values: Samples) -> Samples:
    """Medians of at most 60 stretches of a series, the first of them longer by one where they are not of one length."""
    count = min(_MOST_PIECES, values.size)
    length, longer = divmod(values.size, count)
    edge = longer * (length + 1)
    parts = values[:edge].reshape(longer, length + 1), values[edge:].reshape(count - longer, length)
    return np.concatenate([np.median(part, axis=1) for part in parts if part.size])


def repeated_median_line(time: Samples, values: Samples) -> LineFit:
    """Siegel's line (Biometrika 69:242, 1982, repeated medians): up to half of the points may be wrong."""
    # It goes through the medians of at most 60 stretches of the series.
    t, y = _medians_of_stretches(time), _medians_of_stretches(values)
    apart = ~np.eye(t.size, dtype=bool)
    with np.errstate(invalid="ignore"):
        slopes = (y[:, None] - y) / (t[:, None] - t)
    slope = np.median(np.median(slopes[apart].reshape(t.size, -1), axis=1))
    return LineFit(0.0, np.asarray(np.median(y - slope * t)), np.asarray(slope))
