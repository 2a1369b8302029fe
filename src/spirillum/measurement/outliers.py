"""Outliers: frames of a series, and trials among trials."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spirillum.arrays import Samples
from spirillum.measurement.statistics import student_t_quantile
from spirillum.robust import mad_scale, repeated_median_line, running_median

GRUBBS_LEVEL = 0.01
"""Significance level of Grubbs' test: the probability that it names one of trials of one distribution."""
_WINDOW = 9
"""Frames of the running median."""
_SIGMAS = 6.0
"""Standard deviations beyond which a frame is an outlier."""
_LEAST = 0.25
"""Least scale of the residuals of the running median, over that of the whole series: a step that is small against the
series' own scatter is no outlier, however smooth its neighbours are."""


def outlying_frames(
    time: Samples, values: Samples, error: Samples | None = None, *, straight: bool = True
) -> np.ndarray:
    """Frames that lie more than six standard deviations (from the median absolute deviation) from their neighbours.

    First from the median of nine neighbours about a robust line, which finds single frames; then from the line
    itself, which finds short bursts, unless the series bends away from it as a whole.

    Args:
        time: times, (n,).
        values: the series, (n,); NaN where it was not measured.
        error: standard error of frames that are known to be less sure than their neighbours, such as those read by
            hand, (n,); NaN of others. Such a frame is an outlier only beyond six of it.
        straight: whether the series may be compared with a line at all; else its neighbours alone tell an outlier.

    Returns:
        Truth values, (n,).
    """
    found = np.zeros(values.shape, dtype=bool)
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(time))
    if known.size < 2 * _WINDOW:
        return found
    own = np.zeros(values.shape) if error is None else np.nan_to_num(error)
    residual = values[known] - repeated_median_line(time[known], values[known]).at(time[known])
    near = residual - running_median(residual, _WINDOW)
    single = _far(near, np.maximum(_LEAST * _scale(residual), own[known]))
    kept = known[~single]
    found[known[single]] = True
    if not straight:
        return found
    residual = values[kept] - repeated_median_line(time[kept], values[kept]).at(time[kept])
    bursts = _far(residual, own[kept])
    if bursts.mean() < 0.1:
        found[kept[bursts]] = True
    return found


def _scale(residual: Samples) -> float:
    """Standard deviation about the median, from the median absolute deviation."""
    return float(mad_scale(residual - np.median(residual)))


def _far(residual: Samples, least: Samples) -> np.ndarray:
    """Where a residual is more than six of its standard deviation, or of the least standard error of each."""
    scale = np.maximum(_scale(residual), least)
    return np.asarray((np.abs(residual - np.median(residual)) > _SIGMAS * scale) & (scale > 0))


def outlying_trial(values: Sequence[float]) -> int | None:
    """The trial that does not fit in with the others, by Grubbs' test (1950), two-sided, at 1 %.

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
