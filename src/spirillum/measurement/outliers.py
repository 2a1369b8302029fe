"""Outliers: frames of a series, trials among trials, and the first frames of a compressed video, which are ahead.

The first picture is stored whole. The next ones store what changed, which noise hides: within some frames the robot
falls behind, by up to a third of a pixel and two degrees of the tail, and stays so. At the end of a line such frames
have much weight. On twenty degraded videos of 3 s, in two styles, the speed fell short by 0.17 pixels from end to end
in the mean, without them by 0.08.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spirillum.arrays import Samples
from spirillum.measurement.statistics import student_t_quantile
from spirillum.robust import mad_scale, repeated_median_line, running_median
from spirillum.vision.track.track import Track

GRUBBS_LEVEL = 0.01  #: Significance level of Grubbs' test: the probability that it names a trial of one distribution.
_WINDOW = 9  # frames of the running median
_SIGMAS = 6.0  # standard deviations beyond which a frame is an outlier
_LEAST = 0.5
"""Least scale of the residuals of the running median, over that of the whole series: a step that is small against the
series' own scatter is no outlier, however smooth its neighbours are, as where stripes pass under a highlight."""


def outlying_frames(
    time: Samples, values: Samples, error: Samples | None = None, *, straight: bool = True
) -> np.ndarray:
    """Frames that differ by more than six standard deviations from their neighbours.

    First from the median of nine neighbours about a robust line, which finds single frames; then from the line
    itself, which finds short bursts, unless the series bends away from it as a whole.

    Args:
        time: times, (n,).
        values: the series, (n,); NaN where it was not measured.
        error: least standard deviation of each frame, (n,); NaN where none is known.
        straight: whether the series may be compared with a line at all; else its neighbours alone show an outlier.

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
    """Index of the outlier by Grubbs' test (1950), two-sided, at 1 %; None if all fit or with fewer than three."""
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


LEADING = 6  #: First frames that are left out; with three, ahead frames were left in, and nine cost more than they gave
_FEWEST = 30  # fewest frames of a track from which they are left out
_BESIDE = 20  # frames that the first one is compared with
_AHEAD = 1.5  # standard errors by which position and angles together lead. Chance leaves them out 14 times in 100.
_MOST = 4.0  # standard errors that one of them counts at most


def without_codec_lag(track: Track) -> Track:
    """The track without its first frames, where the first one leads the next ones (codec lag)."""
    if track.time.size < _FEWEST or not _leads(track):
        return track
    first = np.arange(track.time.size) < LEADING
    return replace(
        track,
        position=np.where(first[:, None], np.nan, track.position),
        body_angle=np.where(first, np.nan, track.body_angle),
        tail_phase=np.where(first, np.nan, track.tail_phase),
    )


def _leads(track: Track) -> bool:
    """Whether position and angles on the first frame lead a line through the next ones."""
    near, ahead = slice(LEADING, LEADING + _BESIDE), []
    time = track.time - track.time[0]
    for series in (track.position[:, 0], track.body_angle, track.tail_phase):
        known = np.isfinite(series[near])
        if known.sum() < 0.5 * _BESIDE or not np.isfinite(series[0]):
            continue
        slope, start = np.polyfit(time[near][known], series[near][known], 1)
        scatter = float(mad_scale(series[near][known] - start - slope * time[near][known]))
        if scatter > 0.0:
            ahead.append(float(np.clip(np.sign(slope) * (series[0] - start) / scatter, -_MOST, _MOST)))
    return bool(ahead) and sum(ahead) > _AHEAD * math.sqrt(len(ahead))
