"""The variance of a sum whose terms are alike where they are neighbours, compiled."""

from __future__ import annotations

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

__all__ = ["variance_of_sum"]


@compiled
def variance_of_sum(terms: Samples, reach: int) -> float:
    """Variance of the sum of terms with mean zero: products of neighbours under a triangular window.

    W. K. Newey and K. D. West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
    covariance matrix, Econometrica 55:703, 1987.

    Args:
        terms: in their order, (n,).
        reach: how far from each other terms may be alike.
    """
    total, count = 0.0, terms.size
    for i in range(count):
        for j in range(max(0, i - reach), min(count, i + reach + 1)):
            total += terms[i] * terms[j] * (1.0 - abs(i - j) / (reach + 1.0))
    return total
