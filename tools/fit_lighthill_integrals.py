"""Compute the Chebyshev coefficients of Lighthill's three helix integrals from their definitions.

    python tools/fit_lighthill_integrals.py           check the stored coefficients (about a minute)
    python tools/fit_lighthill_integrals.py --print   print the table of coefficients as well

Method. The integrands peak at theta = 2 pi n, with a width of about 2 pi n alpha, and their tails decay slowly.
The first periods are integrated by Gauss-Legendre panels that shrink towards each peak. All later periods are laid on
top of each other: rho / alpha = sqrt(theta^2 + s^2), where s repeats from period to period, so that the sum over
periods at fixed phase is an Euler-Maclaurin sum of inverse powers of a distance. Its integral is elementary and its
derivatives are Legendre and Gegenbauer polynomials (a multipole expansion). What is left is one smooth period.

The expansion variable. As functions of alpha the integrals are singular where two zeros of rho meet and pinch the path
of integration: at alpha = +-i / x_j with tan(x_j) = x_j, that is 0.223i, 0.129i, 0.092i, ... down to 0, and nowhere
with Re alpha > 0. In log(alpha) these points lie on the lines Im = +-pi/2, none of them right of log(0.223), which is
the middle of the interval. The variable log(alpha / (1 + alpha/2)) shortens the harmless right half and saves a few
coefficients more. The factor alpha removes most of the growth of A_2 and A_3 at small alpha.

Everything is done in multiple precision, so the printed digits do not depend on the machine.
"""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from mpmath import mp, mpf

from spirillum.fluid.closed import sbt as stored

DIGITS = 28
SAMPLES = 64  # Chebyshev nodes: about twice the coefficients kept, so that aliasing stays below the last digit
LAST_COEFFICIENT = 1e-15  # the series is cut where all further coefficients are smaller

Triple = tuple[mpf, mpf, mpf]


@dataclass(frozen=True)
class Rule:
    """How finely the integrals are computed: periods before the summed tail, nodes per panel, tail corrections."""

    periods: int
    nodes: int
    corrections: int


FIT_RULE = Rule(periods=10, nodes=28, corrections=16)
CHECK_RULE = Rule(periods=14, nodes=36, corrections=20)


def gauss_legendre(count: int) -> list[tuple[mpf, mpf]]:
    """Nodes and weights on [-1, 1]: double-precision nodes, polished by Newton's method."""
    rule = []
    for guess in np.polynomial.legendre.leggauss(count)[0]:
        node = mpf(float(guess))
        for _ in range(3):
            below, value = mpf(1), node
            for degree in range(2, count + 1):
                below, value = value, ((2 * degree - 1) * node * value - (degree - 1) * below) / degree
            slope = count * (node * value - below) / (node**2 - 1)
            node -= value / slope
        rule.append((node, 2 / ((1 - node**2) * slope**2)))
    return rule


def on_panels(edges: list[mpf], rule: list[tuple[mpf, mpf]]) -> list[tuple[mpf, mpf]]:
    """The rule repeated on every panel between neighbouring edges: (theta, weight)."""
    points = []
    for left, right in pairwise(edges):
        half = (right - left) / 2
        points += [(left + half * (1 + node), half * weight) for node, weight in rule]
    return points


class HelixIntegrals:
    """A_1, A_2, A_3 by one rule; what does not depend on alpha is computed once."""

    def __init__(self, rule: Rule) -> None:
        gauss = gauss_legendre(rule.nodes)
        # The first panels end at 1, where the subtracted terms of the definitions change.
        edges = [mpf(0), mpf(1), mp.pi]
        for period in range(1, rule.periods + 1):
            peak = 2 * mp.pi * period
            edges += [peak - mp.pi / 2**k for k in (1, 2, 3)]
            edges += [peak]
            if period < rule.periods:
                edges += [peak + mp.pi / 2**k for k in (3, 2, 1, 0)]
        self.near = [(theta, weight, mp.sin(theta), 2 - 2 * mp.cos(theta)) for theta, weight in on_panels(edges, gauss)]
        start = edges[-1]
        tail = on_panels([start, start + mp.pi, start + 2 * mp.pi], gauss)
        self.tail = [(theta, weight, mp.sin(theta), 2 - 2 * mp.cos(theta)) for theta, weight in tail]
        # B_2k (2 pi)^(2k-1) / 2k, the weights of the Euler-Maclaurin corrections for f^(2k-1) / (2k-1)!
        self.corrections = [
            mp.bernoulli(2 * k) * (2 * mp.pi) ** (2 * k - 1) / (2 * k) for k in range(1, rule.corrections + 1)
        ]

    def __call__(self, alpha: mpf) -> Triple:
        """A_1, A_2, A_3 at one alpha."""
        near, tail = self._first_periods(alpha), self._later_periods(alpha)
        return near[0] + tail[0], near[1] + tail[1], near[2] + tail[2]

    def _first_periods(self, alpha: mpf) -> Triple:
        a1, a2, a3 = mpf(0), mpf(0), mpf(0)
        for theta, weight, sine, chord in self.near:  # chord = 2 (1 - cos theta)
            rho = mp.sqrt((alpha * theta) ** 2 + (1 - alpha**2) * chord)
            pole = weight / theta
            inverse = weight / rho
            inverse_cubed = inverse / rho**2
            a1 += theta * sine * inverse_cubed
            a2 += sine**2 * inverse_cubed
            a3 -= inverse
            if theta < 1:
                a1 -= pole
                a2 -= pole
                a3 += pole
            else:
                a3 += pole / alpha
        return a1, a2, a3

    def _later_periods(self, alpha: mpf) -> Triple:
        a1, a2, a3 = mpf(0), mpf(0), mpf(0)
        for theta, weight, sine, chord in self.tail:
            sums = self._sum_over_periods(theta, (1 - alpha**2) / alpha**2 * chord)
            a1 += weight * sine * sums[0] / alpha**3
            a2 += weight * sine**2 * sums[1] / alpha**3
            a3 -= weight * sums[2] / alpha
        return a1, a2, a3

    def _sum_over_periods(self, x: mpf, s_squared: mpf) -> Triple:
        """Sums of x/R^3, 1/R^3 and 1/R - 1/x over x, x + 2 pi, x + 4 pi, ..., with R^2 = x^2 + s^2.

        With c = x/R, the q-th derivatives in x over q! are (-1)^q P_q(c) / R^(q+1) for 1/R and
        (-1)^q C_q(c) / R^(q+3) for 1/R^3, where C_q is the Gegenbauer polynomial of index 3/2; x/R^3 = -d(1/R)/dx.
        """
        distance = mp.sqrt(x**2 + s_squared)
        c = x / distance
        step = 2 * mp.pi
        # The integrals over all later x, and half of the first terms.
        axial = 1 / (distance * step) + c / distance**2 / 2
        cubed = 1 / (distance * (distance + x) * step) + 1 / distance**3 / 2
        single = mp.log(2 * x / (x + distance)) / step + (1 / distance - 1 / x) / 2
        legendre, legendre_next = c, (3 * c**2 - 1) / 2  # P_q and P_(q+1), q odd
        gegenbauer_below, gegenbauer = mpf(1), 3 * c  # C_(q-1) and C_q
        for k, correction in enumerate(self.corrections, start=1):
            power = distance ** (2 * k)
            axial += correction * 2 * k * legendre_next / (power * distance)
            cubed += correction * gegenbauer / (power * distance**2)
            single += correction * (legendre / power - 1 / x ** (2 * k))
            for q in (2 * k, 2 * k + 1):
                legendre, legendre_next = (
                    legendre_next,
                    ((2 * q + 1) * c * legendre_next - q * legendre) / (q + 1),
                )
                gegenbauer_below, gegenbauer = (
                    gegenbauer,
                    ((2 * q + 1) * c * gegenbauer - (q + 1) * gegenbauer_below) / q,
                )
        return axial, cubed, single


def stretched(alpha: mpf) -> mpf:
    """The variable in which the expansion converges fast; see the module's docstring."""
    return mp.log(alpha / (1 + alpha / 2))


def chebyshev_coefficients(integrals: Callable[[mpf], Triple]) -> list[Triple]:
    """All SAMPLES coefficients of alpha A_1, alpha A_2, alpha A_3, by interpolation in the Chebyshev nodes."""
    low, high = stretched(mpf(1) / 20), stretched(mpf(1))
    angles = [mp.pi * (2 * j + 1) / (2 * SAMPLES) for j in range(SAMPLES)]
    samples = []
    for angle in angles:
        u = mp.exp((low + high) / 2 + (high - low) / 2 * mp.cos(angle))
        alpha = u / (1 - u / 2)
        samples.append([alpha * value for value in integrals(alpha)])
    table = []
    for k in range(SAMPLES):
        norm = mpf(1 if k == 0 else 2) / SAMPLES
        cosines = [mp.cos(k * angle) for angle in angles]
        a1, a2, a3 = (norm * mp.fdot(cosines, column) for column in zip(*samples, strict=True))
        table.append((a1, a2, a3))
    return table


def cut(table: list[Triple]) -> int:
    """The number of coefficients to keep."""
    return 1 + max(k for k, row in enumerate(table) if max(abs(value) for value in row) >= LAST_COEFFICIENT)


def largest_errors(points: int) -> tuple[float, float]:
    """Largest error of the stored expansion, as such and over max(1, |A|), on points equidistant in log(alpha)."""
    alphas = np.geomspace(stored.ALPHA_MIN, 1.0, points)
    # Rounding must not push the two ends out of the range.
    alphas[0], alphas[-1] = stored.ALPHA_MIN, 1.0
    expansion = np.stack(stored.lighthill_integrals(alphas), axis=-1)
    integrals = HelixIntegrals(CHECK_RULE)
    absolute = scaled = 0.0
    for alpha, row in zip(alphas, expansion, strict=True):
        for value, exact in zip(row, integrals(mpf(float(alpha))), strict=True):
            error = float(abs(mpf(float(value)) - exact))
            absolute = max(absolute, error)
            scaled = max(scaled, error / max(1.0, float(abs(exact))))
    return absolute, scaled


def main() -> int:
    """Fit, compare with what is stored, measure the error."""
    parser = argparse.ArgumentParser(description="Fit Lighthill's helix integrals and check the stored expansion.")
    parser.add_argument("--print", action="store_true", help="print the table of coefficients")
    parser.add_argument("--points", type=int, default=300, help="points of the check grid (default 300)")
    arguments = parser.parse_args()
    mp.dps = DIGITS

    table = chebyshev_coefficients(HelixIntegrals(FIT_RULE))
    kept = cut(table)
    rows = [tuple(float(value) for value in row) for row in table[:kept]]
    if arguments.print:
        for row in rows:
            print(",".join(map(repr, row)))
    tails = [float(sum(abs(value) for value in column[kept:])) for column in zip(*table, strict=True)]
    print(f"coefficients kept: {kept} for each integral")
    print("sum of the dropped ones, of alpha A_1, alpha A_2, alpha A_3: " + ", ".join(f"{tail:.1e}" for tail in tails))

    same = stored.COEFFICIENTS.tolist() == [list(row) for row in rows]
    print("stored coefficients: " + ("the same" if same else "DIFFERENT, run with --print and store the table"))
    absolute, scaled = largest_errors(arguments.points)
    print(f"on {arguments.points} alphas, against a finer quadrature of the definitions:")
    print(f"largest error {absolute:.1e}, relative to max(1, |A|) {scaled:.1e}")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
