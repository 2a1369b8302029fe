"""Velocity and pressure at points, from a single layer on solids of revolution and from blobs along wires.

Both come without factors: velocity times 8 pi mu, pressure times 8 pi. All cores share the points; see csrc/field.c.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Complex128, Float64, native


@native("field", rows="n")
def add_blobs(
    points: Float64[Array, "n 3"],
    sources: Float64[Array, "s 3"],
    forces: Float64[Array, "s 3"],
    e2: Float64[Array, " s"],
    field: Float64[Array, "n 4"],
) -> None:
    """Add the flow of regularised Stokeslets to `field`, velocity and pressure; e2 are squares of the blob radii."""


@native("field", rows="n")
def add_moments(
    points: Float64[Array, "n 3"],
    sources: Float64[Array, "s 3"],
    moments: Float64[Array, "s 3 3"],
    e2: Float64[Array, " s"],
    field: Float64[Array, "n 4"],
) -> None:
    """Add the flow of first moments of forces, trace-free, force by displacement; e2 are squares of the blob radii."""


@native("field", rows="n")
def add_layer(
    points: Float64[Array, "n 3"],
    x_p: Float64[Array, "panels p"],
    rho_p: Float64[Array, "panels p"],
    density: Complex128[Array, "panels p modes 3"],
    nodes: Float64[Array, " p"],
    barycentric: Float64[Array, " p"],
    fine: Float64[Array, " f"],
    fine_weights: Float64[Array, " f"],
    weights: Float64[Array, " p"],
    field: Float64[Array, "n 4"],
) -> None:
    """Add the flow of a single layer on panels.

    Args:
        points: where.
        x_p: nodes of the panels.
        rho_p: nodes of the panels.
        density: complex modes (f_x, f_rho, g) ds/du on the nodes.
        nodes: on [-1, 1].
        barycentric: weights of the nodes.
        fine: abscissas of a finer Gauss rule, for panels near a point.
        fine_weights: their weights.
        weights: Gauss weights of the nodes.
        field: velocity and pressure to add to.
    """
