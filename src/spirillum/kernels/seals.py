"""Edges of a coloured seal: csrc/seals.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, Int64, native


@native("work", "share", "distance", "kind")
def seal_shares(
    colours: Float64[Array, "3 edges samples"],
    offsets: Float64[Array, "samples"],
    sides: Int64[Array, "count 3"],
    palette: Float64[Array, "kinds 3"],
    beside: float,
    noise: float,
    distinct: float,
    white: float,
    fewest: int,
    pooled: int,
    work: Float64[Array, "2 3 edges"],
    share: Float64[Array, "edges samples"],
    distance: Float64[Array, "edges"],
    kind: Int64[Array, "edges"],
) -> None:
    """Share of the stripe's colour in the samples across each edge of a seal.

    Colours are projected onto the direction that separates a stripe best from the surroundings of its side (Fisher's
    linear discriminant). At a silhouette of known colours the share is that of the colour of which there is most.

    Args:
        colours: profiles across the edges, of 255; NaN out of view.
        offsets: distances of the samples outward from an edge, pixels.
        sides: first edge of each side, the one after its last, and whether the side is a silhouette.
        palette: known colours at the silhouette; none at first.
        beside: distance from an edge from which on colours are those of one side, pixels.
        noise: standard deviation of a colour's noise, of 255.
        distinct: least distance of a stripe from its surroundings, standard deviations.
        white: brightness of glare, of 255, which hides an edge.
        fewest: fewest edges of a side in view.
        pooled: edges on either side whose surroundings are averaged.
        work: memory.
        share: 1 in the stripe to 0 beside it; NaN where unknown.
        distance: squared distance of the stripe from its surroundings; 0 where they look alike.
        kind: index into the palette of the nearest colour; 0 without one.
    """
