"""Integrals of the ring modes over panels of an outline, see csrc/panels.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, Int64, native


@native("blocks")
def layer_blocks(
    x: Float64[Array, " t"],
    rho: Float64[Array, " t"],
    own: Int64[Array, " t"],
    x_p: Float64[Array, "panels p"],
    rho_p: Float64[Array, "panels p"],
    e2: float,
    nodes: Float64[Array, " p"],
    barycentric: Float64[Array, " p"],
    fine: Float64[Array, " f"],
    fine_weights: Float64[Array, " f"],
    weights: Float64[Array, " p"],
    blocks: Float64[Array, "modes t 3 panels p 3"],
) -> None:
    """Fill the velocities of every mode at rings, from a single layer on the panels of outlines.

    The density is interpolated between the panel's nodes and multiplied by the length of du, so that the integrals
    are over rho du.

    Args:
        x: targets.
        rho: targets.
        own: index of the node that a target is, panel by panel; -1 for a target off the outline.
        x_p: nodes of the panels.
        rho_p: nodes of the panels.
        e2: square of the blob radius.
        nodes: on [-1, 1].
        barycentric: weights of the nodes.
        fine: abscissas of a finer Gauss rule, for panels near a target.
        fine_weights: their weights.
        weights: Gauss weights of the nodes.
        blocks: to be filled.
    """
