"""Fourier modes of the Stokeslet around rings about one axis.

A ring carries a force density (f_x, f_rho, f_theta) that varies as exp(i m theta). Velocities at another ring
about the same axis vary alike. With f_theta = i g and u_theta = i v the 3x3 block between (f_x, f_rho, g) and
(u_x, u_rho, v) is real, and symmetric under exchange of the rings. All of it follows from

    A_n = int cos(n phi)/r dphi,   B_n = int cos(n phi)/r^3 dphi,
    r^2 = X^2 + rho^2 + rho'^2 - 2 rho rho' cos(phi) + e^2,

Legendre functions of half-integer degree (DLMF 14.19), by integration by parts, such as
rho rho' int sin(phi) sin(m phi)/r^3 dphi = m A_m, so that nothing cancels where the rings come close. The kernel is
(1/r + e^2/r^3) I + x x'/r^3: the Stokeslet for e = 0, regularised (Cortez, SIAM J. Sci. Comput. 23:1204, 2001)
otherwise; the factor 1/(8 pi mu) is left to the caller.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled


@compiled
def _elliptic(complement: float) -> tuple[float, float]:
    """Complete elliptic integrals (K, E) from 1 - k^2, by the arithmetic-geometric mean (DLMF 19.8)."""
    a, b, weight, total = 1.0, math.sqrt(complement), 0.5, 0.5 * (1.0 - complement)
    for _ in range(40):
        c = 0.5 * (a - b)
        a, b = 0.5 * (a + b), math.sqrt(a * b)
        weight *= 2.0
        total += weight * c * c
        if c <= 1e-16 * a:
            break
    k = 0.5 * math.pi / a
    return k, k * (1.0 - total)


@compiled
def ring_integrals(
    dx: float, delta: float, rho: float, rho_s: float, e2: float, count: int, a: Samples, b: Samples
) -> None:
    """Fill a[n] = A_n and b[n] = B_n for n < count.

    Args:
        dx: axial distance of the rings.
        delta: rho - rho_s, asked for since it is known better than the difference where the rings are close.
        rho: radius of one ring, above 0.
        rho_s: radius of the other.
        e2: square of the blob radius; rings that coincide need one.
        count: number of integrals, at least 2.
        a: to be filled.
        b: to be filled.
    """
    p = rho * rho_s
    near2 = max(dx * dx + delta * delta + e2, 1e-30 * (p + dx * dx))
    far2 = near2 + 4.0 * p
    s = 0.5 * (near2 + 2.0 * p)
    big_k, big_e = _elliptic(near2 / far2)
    far = math.sqrt(far2)
    a[0] = 4.0 * big_k / far
    excess = near2 / (2.0 * p)  # cosh(zeta) - 1: A_n falls off as exp(-n zeta)
    zeta = math.log1p(excess + math.sqrt(excess * (excess + 2.0)))
    if count * zeta < 1.0:
        a[1] = (s * a[0] - 2.0 * far * big_e) / p
        for n in range(1, count - 1):
            a[n + 1] = (2.0 * n * s * a[n] - (n - 0.5) * p * a[n - 1]) / ((n + 0.5) * p)
    else:  # A_n is the solution that falls off: ratios by backward recurrence
        last = count + 2 + int(18.0 / zeta)
        ratio = 0.0
        for n in range(last, count - 1, -1):
            ratio = (n - 0.5) * p / (2.0 * n * s - (n + 0.5) * p * ratio)
        for n in range(count - 1, 0, -1):
            ratio = (n - 0.5) * p / (2.0 * n * s - (n + 0.5) * p * ratio)
            a[n] = ratio
        for n in range(1, count):
            a[n] *= a[n - 1]
    b[0] = 4.0 * big_e / (near2 * far)
    scale = 4.0 / (near2 * far2)
    for n in range(1, count):
        b[n] = scale * (n - 0.5) * (p * a[n - 1] - s * a[n])


@compiled
def ring_b_v(m: int, a: Samples, b: Samples, near2: float, p: float) -> float:
    """Integral of v cos(m phi)/r^3 with v = 1 - cos(phi): from A_m where the rings are close, since B_m cancels."""
    close = near2 < 0.3 * p
    value: float = (a[m] - near2 * b[m]) / (2.0 * p) if close else b[m] - 0.5 * (b[m + 1] + b[abs(m - 1)])
    return value


@compiled
def ring_modes(
    dx: float, delta: float, rho: float, rho_s: float, e2: float, modes: int, a: Samples, b: Samples, k: Samples
) -> None:
    """Fill k[m] with the 3x3 block of mode m, from a force density on the ring rho_s to velocities at rho.

    Args:
        dx: x of the target less x of the source.
        delta: rho - rho_s.
        rho: radius of the target.
        rho_s: radius of the source.
        e2: square of the blob radius.
        modes: number of modes, m = 0 to modes - 1.
        a: work space for modes + 1 numbers.
        b: work space for modes + 1 numbers.
        k: to be filled, (modes, 3, 3).
    """
    tiny = 1e-14 * (abs(dx) + rho + rho_s)
    rho, rho_s = max(rho, tiny), max(rho_s, tiny)
    ring_integrals(dx, delta, rho, rho_s, e2, modes + 1, a, b)
    p = rho * rho_s
    near2 = dx * dx + delta * delta + e2
    for m in range(modes):
        before = abs(m - 1)
        a_m, b_m = a[m], b[m]
        a_cos, a_sin = 0.5 * (a[m + 1] + a[before]), 0.5 * (a[before] - a[m + 1])
        if m == 0:
            a_sin = 0.0
        a_v = a_m - a_cos  # v = 1 - cos(phi)
        b_v = ring_b_v(m, a, b, near2, p)
        b_cos = b_m - b_v
        p_b_sin = m * a_m
        h_m, h_cos, h_sin = a_m + e2 * b_m, a_cos + e2 * b_cos, a_sin + e2 * p_b_sin / p
        mixed = h_sin + a_sin + m * a_v
        k[m, 0, 0] = h_m + dx * dx * b_m
        k[m, 0, 1] = dx * (delta * b_m - rho * b_v)
        k[m, 0, 2] = dx * p_b_sin / rho_s
        k[m, 1, 0] = dx * (delta * b_m + rho_s * b_v)
        k[m, 1, 1] = h_cos + delta * delta * b_cos - 0.5 * (a_v - near2 * b_v)
        k[m, 1, 2] = mixed + delta * p_b_sin / rho_s
        k[m, 2, 0] = -dx * p_b_sin / rho
        k[m, 2, 1] = mixed - delta * p_b_sin / rho
        k[m, 2, 2] = h_cos + a_cos - m * a_sin


@compiled
def ring_blocks(x: Samples, rho: Samples, x_s: Samples, rho_s: Samples, e2: float, modes: int) -> Samples:
    """Blocks between all rings of two sets, (modes, 3 targets, 3 sources)."""
    blocks = np.empty((modes, 3 * x.size, 3 * x_s.size))
    a, b, k = np.empty(modes + 1), np.empty(modes + 1), np.empty((modes, 3, 3))
    for i in range(x.size):
        for j in range(x_s.size):
            ring_modes(x[i] - x_s[j], rho[i] - rho_s[j], rho[i], rho_s[j], e2, modes, a, b, k)
            for m in range(modes):
                for c in range(3):
                    for d in range(3):
                        blocks[m, 3 * i + c, 3 * j + d] = k[m, c, d]
    return blocks
