"""A design of experiments with two levels: every factor low or high, and what each does to an answer.

Half of all combinations suffice: with the last factor's level the product of the others' (with five factors a design of
resolution V), no main effect is confounded with another or with an interaction of two (`box2005`).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from spirillum.arrays import Values

Levels = np.ndarray[tuple[int, ...], np.dtype[np.intp]]
"""Levels of the factors in each run, (runs, factors): -1 low, +1 high."""


def half_fraction(factors: int) -> Levels:
    """The levels of a half fraction of all combinations, the last factor's the product of the others'.

    Returns:
        (2**(factors - 1), factors); -1 low, +1 high. Every column adds up to 0, and any two are orthogonal from three
        factors on.
    """
    free = np.array(list(product((-1, 1), repeat=factors - 1)), dtype=np.intp)
    return np.concatenate([free, np.prod(free, axis=1, keepdims=True)], axis=1)


def main_effects(values: Values, levels: Levels) -> Values:
    """Mean at the high level less mean at the low one, for each factor; runs without an answer are left out.

    Args:
        values: answers of the runs, (..., runs); NaN where there is none.
        levels: of the factors, (runs, factors).

    Returns:
        (..., factors); NaN where a level has no answer.
    """
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)
    means = []
    for sign in (1, -1):
        chosen = (levels == sign).astype(float)
        count = known.astype(float) @ chosen
        with np.errstate(invalid="ignore", divide="ignore"):
            means.append(filled @ chosen / np.where(count > 0, count, np.nan))
    found: Values = means[0] - means[1]
    return found
