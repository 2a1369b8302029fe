"""Variance of a sum of autocorrelated terms (Newey and West), compiled."""

from __future__ import annotations

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled


@compiled
def variance_of_sum(terms: Samples, reach: int) -> float:
    """Variance of the sum of autocorrelated terms with mean zero: autocovariances with Bartlett's triangular window.

    W. K. Newey and K. D. West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
    covariance matrix, Econometrica 55:703, 1987.

    Args:
        terms: the terms in order, (n,).
        reach: largest lag with a correlation.
    """
    total, count = 0.0, terms.size
    for i in range(count):
        for j in range(max(0, i - reach), min(count, i + reach + 1)):
            total += terms[i] * terms[j] * (1.0 - abs(i - j) / (reach + 1.0))
    return total
