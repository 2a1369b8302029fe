"""Apparent contour of a body from its polynomials, and its projection into the picture: csrc/contours.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, native


@native("points")
def edge_points(
    pose: Float64[Array, "3"],
    factors: Float64[Array, "8 5 4 n"],
    normals: Float64[Array, "n 2"],
    reach: Float64[Array, "2"],
    points: Float64[Array, "n 2"],
) -> None:
    """Edge points in the plane through the axis, in the body's frame.

    Args:
        pose: x, y, heading.
        factors: Chebyshev coefficients, in the lens's place along and across, of x and y with the upper rims of flat
            ends, and of x and y with the lower ones; the outer point of the two is taken.
        normals: outward normals.
        reach: largest distances of the lens along and across, m.
        points: the points, m.
    """


@native("pixels", "directions", "size", "slopes")
def edge_places(
    pose: Float64[Array, "3"],
    factors: Float64[Array, "8 5 4 n"],
    normals: Float64[Array, "n 2"],
    reach: Float64[Array, "2"],
    axis_height: float,
    camera: Float64[Array, "17"],
    pixels: Float64[Array, "n 2"],
    directions: Float64[Array, "n 2"],
    size: Float64[Array, "n"],
    slopes: Float64[Array, "n 3"],
) -> None:
    """Project a body's apparent contour into the picture.

    Args:
        pose: x, y, heading.
        factors: coefficients of the edge points, as in `edge_points`.
        normals: outward normals in the body's frame.
        reach: largest distances of the lens along and across, m.
        axis_height: height of the axis, m.
        camera: packed, see `kernels.snell`.
        pixels: the edge points.
        directions: unit normals in the picture.
        size: pixels per m along them.
        slopes: Jacobian of the displacement along each normal by (x, y, heading), pixels per m and per rad.
    """
