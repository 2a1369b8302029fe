"""Mean and confidence interval over repeated trials (Section III: five trials, 95 per cent)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

__all__ = ["Mean", "mean_with_interval"]


class Mean(NamedTuple):
    """Mean of a few trials with its confidence interval."""

    value: float
    """Arithmetic mean; NaN without trials."""
    half_width: float
    """Half width of the interval; NaN with fewer than two trials."""
    trials: int
    """Number of trials."""


def mean_with_interval(values: Sequence[float], level: float = 0.95) -> Mean:
    """Mean and Student-t interval of independent trials.

    Args:
        values: one value a trial; NaN (not measured) is left out.
        level: confidence level.
    """
    from scipy.stats import t

    measured = np.asarray(values, dtype=float)
    measured = measured[~np.isnan(measured)]
    count = measured.size
    if count == 0:
        return Mean(float("nan"), float("nan"), 0)
    if count == 1:
        return Mean(float(measured[0]), float("nan"), 1)
    spread = float(measured.std(ddof=1)) / np.sqrt(count)
    return Mean(float(measured.mean()), float(t.ppf(0.5 + 0.5 * level, count - 1) * spread), count)
