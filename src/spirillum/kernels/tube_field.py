"""Velocity and pressure in a tube from many forces at once: what its wall reflects, wave by wave.

The waves are those of `tube_waves`; see csrc/tube_field.c.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, Int64, native


@native("steps", "amplitudes", rows="waves")
def wave_amplitudes(
    wave_k: Float64[Array, " waves"],
    weights: Float64[Array, " waves"],
    orders: Int64[Array, " waves"],
    bessel: Float64[Array, " waves"],
    radius: float,
    rho: Float64[Array, " columns"],
    angle: Float64[Array, " columns"],
    steepest: Float64[Array, " columns"],
    first: Int64[Array, " edges"],
    x: Float64[Array, " n"],
    forces: Float64[Array, "n 2 3"],
    steps: Float64[Array, "waves most"],
    amplitudes: Float64[Array, "waves 2 2 most 3"],
) -> None:
    """Add up the amplitudes of the flows of which each wave of the wall's reflection consists.

    Sources stand in columns along the tube. Of the forces the even part moves even waves, the odd part odd ones.

    Args:
        wave_k: k of each wave.
        weights: of the nodes in k.
        orders: numbers of orders p.
        bessel: K_1/K_0 at k radius.
        radius: of the tube.
        rho: distance of each column from the axis.
        angle: polar angle of each column.
        steepest: wave that matters for each column.
        first: number of the first source of each column, and of all sources, (columns + 1,).
        x: of the sources.
        forces: even and odd part, along x, rho and theta.
        steps: to be filled with I_{p+1}/I_p at the wall.
        amplitudes: zeros, to be filled: even, odd; real, imaginary; order; flow.
    """


@native("field", rows="n")
def add_waves(
    points: Float64[Array, "n 3"],
    steepest: Float64[Array, " n"],
    wave_k: Float64[Array, " waves"],
    orders: Int64[Array, " waves"],
    radius: float,
    steps: Float64[Array, "waves most"],
    amplitudes: Float64[Array, "waves 2 2 most 3"],
    field: Float64[Array, "n 4"],
) -> None:
    """Add velocity (times 8 pi mu) and pressure (times 8 pi) of waves.

    Args:
        points: (x, y, z) about the tube's axis, no farther from it than the radius.
        steepest: wave from which on nothing is added at each point; they are faded out towards it.
        wave_k: k of each wave.
        orders: numbers of orders p.
        radius: of the tube.
        steps: of `wave_amplitudes`.
        amplitudes: of `wave_amplitudes`.
        field: velocity (x, y, z) and pressure to add to.
    """
