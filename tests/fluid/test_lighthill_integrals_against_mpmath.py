"""Lighthill's helix integrals against their definitions, their exact limits and the expansion they come from.

The reference integrates period after period with mpmath's adaptive quadrature and extrapolates the partial sums in
the reciprocal number of periods. The generator of the coefficients sums the tail by other means.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from mpmath import mp, mpf

from spirillum.fluid.closed.sbt import ALPHA_MIN, COEFFICIENTS, lighthill_integrals


def integrals_at(alpha: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The three integrals of the module, for numbers as well."""
    return lighthill_integrals(np.asarray(alpha, dtype=float))


def definition(alpha: float) -> list[float]:
    """A_1, A_2, A_3 from the integrals that define them."""
    with mp.workdps(20):
        a = mpf(alpha)

        # The rest is a series in the reciprocal number of periods; it converges where that number exceeds 1/(pi alpha).
        periods = max(40, round(4.5 / alpha))

        def rho(theta: mpf) -> mpf:
            return mp.sqrt((a * theta) ** 2 + 2 * (1 - a**2) * (1 - mp.cos(theta)))

        return [
            integral(lambda t: t * mp.sin(t) / rho(t) ** 3 - 1 / t, lambda t: t * mp.sin(t) / rho(t) ** 3, periods),
            integral(lambda t: mp.sin(t) ** 2 / rho(t) ** 3 - 1 / t, lambda t: mp.sin(t) ** 2 / rho(t) ** 3, periods),
            integral(lambda t: 1 / t - 1 / rho(t), lambda t: 1 / (a * t) - 1 / rho(t), periods),
        ]


def integral(to_one: Callable[[mpf], mpf], beyond: Callable[[mpf], mpf], periods: int) -> float:
    """One integrand from 0 to 1 and another one from 1 to infinity, by that many periods and a series for the rest."""
    total = quadrature(to_one, [0, 1]) + quadrature(beyond, [1, mp.pi, 1.75 * mp.pi, 2 * mp.pi])
    partial_sums = [total]
    for period in range(1, periods):
        # The integrands peak at both ends of a period.
        edges = [2 * mp.pi * (period + part) for part in (0, 0.125, 0.5, 0.875, 1)]
        total += quadrature(beyond, edges)
        partial_sums.append(total)
    counts = range(periods, periods // 4, -(periods // 18))
    return float(extrapolated_to_zero([1 / mpf(count) for count in counts], [partial_sums[n - 1] for n in counts]))


def quadrature(integrand: Callable[[mpf], mpf], edges: list[mpf]) -> mpf:
    return mp.quad(integrand, edges, method="gauss-legendre")


def extrapolated_to_zero(places: list[mpf], values: list[mpf]) -> mpf:
    """Neville's interpolation at zero."""
    for order in range(1, len(values)):
        values = [
            (places[i] * right - places[i + order] * left) / (places[i] - places[i + order])
            for i, (left, right) in enumerate(pairwise(values))
        ]
    return values[0]


@pytest.mark.parametrize("alpha", [0.35, *(pytest.param(a, marks=pytest.mark.slow) for a in (0.05, 0.0963, 0.7, 0.99))])
def test_definition(alpha: float) -> None:
    np.testing.assert_allclose(integrals_at(alpha), definition(alpha), rtol=1e-10, atol=1e-10)


def test_straight_filament() -> None:
    exact = (1 - np.euler_gamma, 1.5 - np.euler_gamma - np.log(2), 0.0)
    np.testing.assert_allclose(integrals_at(1.0), exact, rtol=0, atol=1e-12)


def test_not_a_number_outside_the_range() -> None:
    outside = [-1.0, 0.0, np.nextafter(ALPHA_MIN, 0), np.nextafter(1.0, 2), 3.0, np.inf, -np.inf, np.nan]
    assert np.isnan(integrals_at(outside)).all()
    assert np.isfinite(integrals_at([ALPHA_MIN, 1.0])).all()


@pytest.mark.parametrize("shape", [(), (0,), (7,), (2, 3, 4), (3, 9000)])
def test_every_shape(shape: tuple[int, ...]) -> None:
    alpha = np.linspace(ALPHA_MIN, 1, int(np.prod(shape))).reshape(shape)
    together = integrals_at(alpha)
    assert [(values.shape, values.dtype) for values in together] == 3 * [(shape, np.float64)]
    if alpha.size:
        last = integrals_at(alpha.flat[-1])
        np.testing.assert_allclose([values.flat[-1] for values in together], last, rtol=1e-14, atol=1e-14)


def test_expansion_has_converged() -> None:
    size = np.abs(COEFFICIENTS).max(axis=1)
    assert size[-4:].max() < 1e-12
    # Ten more coefficients gain three digits or more: what is cut off is smaller still.
    assert size[-10:].max() < 1e-3 * size[-20:-10].max()


@pytest.mark.parametrize("alpha", [0.3, 0.6, 0.9])
def test_logarithm_of_the_cut_off(alpha: float) -> None:
    """int_eps^inf theta sin(theta) / rho^3 = -log(eps) + A_1 + O(eps^2)."""
    cut_offs = np.array([0.2, 0.1, 0.05])
    remainders = [integral_from(eps, alpha) + np.log(eps) - integrals_at(alpha)[0] for eps in cut_offs]
    rates = np.log2(np.abs(remainders[:-1]) / np.abs(remainders[1:]))
    np.testing.assert_allclose(rates, 2, atol=0.03)


def integral_from(eps: float, alpha: float) -> float:
    """int_eps^inf theta sin(theta) / rho^3 in double precision by Gauss-Legendre panels, cut after 3000 turns."""
    turns = 3000
    within_a_turn = np.array([0.125, 0.25, 0.5, 0.75, 0.875, 1])
    later = 2 * np.pi * (np.arange(1, turns)[:, None] + within_a_turn).ravel()
    edges = np.concatenate([np.geomspace(eps, np.pi, 8), 2 * np.pi * within_a_turn[3:], later])
    nodes, weights = np.polynomial.legendre.leggauss(16)
    half = np.diff(edges)[:, None] / 2
    theta = edges[:-1, None] + half * (1 + nodes)
    rho = np.sqrt((alpha * theta) ** 2 + 2 * (1 - alpha**2) * (1 - np.cos(theta)))
    return float((theta * np.sin(theta) / rho**3 * half * weights).sum())
