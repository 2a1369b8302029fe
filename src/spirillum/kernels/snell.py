"""Rays of a pinhole camera through a flat refracting surface, exact by Snell's law: csrc/snell.c.

A camera is packed as 17 numbers: focal length (negative: turned by half a turn), principal point u and v, distortion k1
and k2, height of the lens, height of the surface, refractive index below the surface over that above, and the rotation
matrix whose rows point to the right, up and backwards of the camera. The lens stands at x = y = 0.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, native


@native("pixels")
def pixels_of_points(
    points: Float64[Array, "k 3"], camera: Float64[Array, "17"], pixels: Float64[Array, "k 2"]
) -> None:
    """Project points, m, to pixels (u, v); NaN behind the camera."""


@native("points")
def points_of_pixels(
    pixels: Float64[Array, "k 2"], level: float, camera: Float64[Array, "17"], points: Float64[Array, "k 3"]
) -> None:
    """Points at the height `level` on the rays of pixels, m; NaN where a ray does not reach it."""
