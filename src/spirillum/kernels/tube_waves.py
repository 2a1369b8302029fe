"""Stokes flow in a circular tube as waves exp(i p theta + i k x), each carried by the velocity that it has on the wall.

The wall's reflection of a force is -U S U', with the extension U from the wall to target and source, and the single
layer S of a cylinder in unbounded fluid. With f_theta = i g, u_theta = i v, f_x = i F and u_x = i X all matrices are
real. The even wave of order p has X and u_rho as cos(p theta), the odd one as -sin(p theta). See csrc/tube_waves.c.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float32, Float64, native


@native("out")
def wave_extensions(
    k: float,
    radius: float,
    rho: Float64[Array, " n"],
    scale: Float64[Array, " n"],
    first: int,
    out: Float64[Array, "n orders 3 3"],
) -> None:
    """Fill in the velocities (X, u_rho, v) at rho for unit velocities at the radius.

    Args:
        k: wave number, above 0.
        radius: of the cylinder on which the waves are one.
        rho: where.
        scale: I_0(k rho)/I_0(k radius).
        first: the first order p.
        out: to be filled.
    """


@native("layers")
def wall_layers(z: float, first: float, layers: Float64[Array, "orders 3 3"]) -> None:
    """Fill in the single layer S on a cylinder in unbounded fluid, in units of 4 pi R/(8 pi mu).

    Args:
        z: k times the radius R.
        first: K_1(z)/K_0(z).
        layers: velocities (X, u_rho, v) from densities (F, f_rho, g), symmetric; to be filled.
    """


@native("out")
def circle_waves(
    extensions: Float64[Array, "n orders 3 3"],
    angle: Float64[Array, " n"],
    turn: Float64[Array, " n"],
    out: Float64[Array, "2 3 n orders 3"],
) -> None:
    """Velocities (x, rho, theta) of even and odd waves in cylindrical components about a second, parallel axis.

    Args:
        extensions: at points.
        angle: polar angles of the points about the tube's axis.
        turn: those less the angles about the second axis.
        out: to be filled: even, odd; component; point; order; wall component. u_x comes times i.
    """


@native("out")
def station_waves(
    extensions: Float64[Array, "n orders 3 3"],
    angle: Float64[Array, " n"],
    phase: Float64[Array, " n"],
    first: int,
    out: Float64[Array, "n 3 2 2 orders 3"],
) -> None:
    """Velocities (x, y, z) of waves at points.

    Args:
        extensions: at points.
        angle: polar angles of the points about the tube's axis.
        phase: k x.
        first: the first order p.
        out: to be filled: point; component; real, imaginary part; even, odd; order; wall component.
    """


@native("out")
def tilted_waves(
    extensions: Float64[Array, "angles n orders 3 3"],
    angle: Float64[Array, "angles n"],
    phase: Float64[Array, "angles n"],
    theta: Float64[Array, " angles"],
    rotation: Float64[Array, "3 3"],
    first: int,
    out: Float64[Array, "3 2 angles n 2 orders 3"],
) -> None:
    """Velocities (x, rho, theta) of waves on rings about a tilted axis, in cylindrical components about it.

    Args:
        extensions: at the rings' points.
        angle: polar angles of the points about the tube's axis.
        phase: k x there.
        theta: angles about the rings' axis.
        rotation: from the rings' axes to the tube's.
        first: the first order p.
        out: to be filled: component; even, odd; angle; ring; real, imaginary part; order; wall component.
    """


@native("out")
def single_tilted_waves(
    extensions: Float64[Array, "angles n orders 3 3"],
    angle: Float64[Array, "angles n"],
    phase: Float64[Array, "angles n"],
    theta: Float64[Array, " angles"],
    rotation: Float64[Array, "3 3"],
    first: int,
    out: Float32[Array, "3 2 angles n 2 orders 3"],
) -> None:
    """See `tilted_waves`; in single precision."""
