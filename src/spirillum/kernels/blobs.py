"""Regularised Stokeslets at points, and their gradients: forces and first moments of forces to velocities.

The kernel is that of Cortez (SIAM J. Sci. Comput. 23:1204, 2001); factors 1/(8 pi mu) are left to the caller. A pair of
points takes the mean of the squares e2 of their blob radii. See csrc/blobs.c.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, native


@native("matrix")
def force_matrix(points: Float64[Array, "n 3"], e2: Float64[Array, " n"], matrix: Float64[Array, "n 3 n 3"]) -> None:
    """Fill in the velocities at points from unit forces at the same points, symmetric."""


@native("velocities", "gradients")
def moment_matrices(
    points: Float64[Array, "n 3"],
    e2: Float64[Array, " n"],
    moments: Float64[Array, "n q 3 3"],
    velocities: Float64[Array, "n 3 n q"],
    gradients: Float64[Array, "n q n q"],
) -> None:
    """Fill in what unit first moments at points do.

    Args:
        points: m.
        e2: square of the blob radius of each point.
        moments: trace-free tensors of the moments at each point, force by displacement.
        velocities: to be filled.
        gradients: of the velocities along the moments, symmetric; to be filled.
    """
