"""Mean and confidence interval over repeated trials (Section III: five trials, 95 per cent), and Student's t.

The functions of `scipy.special` are the ones behind `scipy.stats`, without the time that takes to import.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples

NORMAL = 1.959964
"""Half width of a 95 % interval over its standard deviation, of a normal distribution."""


class Mean(NamedTuple):
    """Mean of a few trials with its confidence interval."""

    value: float
    """Arithmetic mean; NaN without trials."""
    half_width: float
    """Half width of the interval; NaN with fewer than two trials."""
    trials: int
    """Number of trials."""


def student_t_quantile(share: float, free: float) -> float:
    """What Student's t with `free` degrees of freedom is below with a probability of `share`."""
    from scipy.special import stdtrit

    return float(stdtrit(free, share))


def student_t(at: Samples, free: float) -> Samples:
    """Probability that Student's t with `free` degrees of freedom is below some values."""
    from scipy.special import stdtr

    return np.asarray(stdtr(free, at))


def mean_with_interval(values: Sequence[float], level: float = 0.95) -> Mean:
    """Mean and Student-t interval of independent trials.

    Args:
        values: one value a trial; NaN (not measured) is left out.
        level: confidence level.
    """
    measured = np.asarray(values, dtype=float)
    measured = measured[~np.isnan(measured)]
    count = measured.size
    if count == 0:
        return Mean(float("nan"), float("nan"), 0)
    if count == 1:
        return Mean(float(measured[0]), float("nan"), 1)
    spread = float(measured.std(ddof=1)) / np.sqrt(count)
    return Mean(float(measured.mean()), student_t_quantile(0.5 + 0.5 * level, count - 1) * spread, count)
