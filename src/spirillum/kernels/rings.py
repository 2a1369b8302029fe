"""Fourier modes of the Stokeslet around rings about one axis, see csrc/rings.c.

A ring carries a force density (f_x, f_rho, f_theta) that varies as exp(i m theta); with f_theta = i g and u_theta = i v
the 3x3 block between (f_x, f_rho, g) and the velocities (u_x, u_rho, v) at another ring is real. The Stokeslet is
regularised where e > 0; the factor 1/(8 pi mu) is left to the caller. A ring may have shrunk to the axis.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, native


@native("a", "b")
def ring_integrals(
    dx: float,
    delta: float,
    rho: float,
    rho_s: float,
    e2: float,
    a: Float64[Array, " count"],
    b: Float64[Array, " count"],
) -> None:
    """Fill a[n] = int cos(n phi)/r dphi and b[n] = int cos(n phi)/r^3 dphi.

    Args:
        dx: axial distance of the rings.
        delta: rho - rho_s, known better than the difference where the rings are close.
        rho: radius of one ring, above 0.
        rho_s: radius of the other, above 0.
        e2: square of the blob radius; rings that coincide need one.
        a: to be filled, at least 2.
        b: to be filled.
    """


@native("blocks")
def ring_blocks(
    x: Float64[Array, " t"],
    rho: Float64[Array, " t"],
    x_s: Float64[Array, " s"],
    rho_s: Float64[Array, " s"],
    e2: float,
    blocks: Float64[Array, "modes t 3 s 3"],
) -> None:
    """Fill the blocks between all rings of two sets, from the sources (x_s, rho_s) to the targets (x, rho)."""
