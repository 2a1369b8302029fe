"""Lubrication films whose pressure is bounded below: csrc/cavitation.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, native


@native("out")
def lift_of_cavitation(
    gap: Float64[Array, "count"],
    bend: Float64[Array, "count"],
    opening: Float64[Array, "count"],
    entrainment: Float64[Array, "count"],
    viscosity: float,
    bound: float,
    out: Float64[Array, "count 6"],
) -> None:
    """Fill what the bound of the pressure adds to the forces of line contacts, per length, N/m.

    Args:
        gap: smallest gaps h0, m, (n,).
        bend: R' of the gaps h0 + x^2/(2 R'), m, (n,).
        opening: V = dh0/dt, m/s, (n,).
        entrainment: u, mean velocity of both surfaces as seen from the contact line, m/s, (n,).
        viscosity: Pa s.
        bound: p_c, the pressure is not below -p_c, Pa.
        out: force that opens the gap, force that works on u, their derivatives in V, and in u, (n, 6).
    """
