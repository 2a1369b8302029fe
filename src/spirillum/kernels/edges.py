"""Edges in pictures: brightness profiles, the contour of a body, a coloured seal: csrc/edges.c, contours.c, seals.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float32, Float64, Int64, UInt8, native


@native("profiles")
def profiles_across(
    picture: Float32[Array, "h w channels"],
    origin: Float64[Array, "2"],
    pixels: Float64[Array, "n 2"],
    normals: Float64[Array, "n 2"],
    offsets: Float64[Array, "m"],
    profiles: Float64[Array, "channels n m"],
) -> None:
    """Brightness profiles along the normals of edge points, by cubic convolution; NaN outside of the region.

    Args:
        picture: brightness, or colours, of a region of the picture.
        origin: pixel (u, v) of the region's upper left corner.
        pixels: the edge points.
        normals: unit directions.
        offsets: distances along them, pixels.
        profiles: the profiles.
    """


@native("shifts", "strengths", "residuals")
def shifts_of_profiles(
    profiles: Float64[Array, "n m"],
    templates: Float64[Array, "n m"],
    slopes: Float64[Array, "n m"],
    shifts: Float64[Array, "n"],
    strengths: Float64[Array, "n"],
    residuals: Float64[Array, "n"],
) -> None:
    """Displacement d of each edge along its normal: q(s) = b + c s + a (p(s) - d p'(s)) by least squares.

    Offset b, slope c and contrast a of either sign are free at every point, so that lamp, shadows and the colour of a
    stripe do not bias the displacement.

    Args:
        profiles: brightness q.
        templates: template p of the undisplaced edge, without mean and slope.
        slopes: derivative p' of the template, per sample.
        shifts: d, samples; NaN where the fit is singular.
        strengths: a.
        residuals: root mean square residual.
    """


@native("work", "scores")
def edge_scores(
    slope_u: Float64[Array, "w h"],
    slope_v: Float64[Array, "w h"],
    pixels: Float64[Array, "n 2"],
    normals: Float64[Array, "n 2"],
    group: Int64[Array, "n"],
    first_u: float,
    first_v: float,
    work: Float64[Array, "2 5 r"],
    scores: Float64[Array, "c r"],
) -> None:
    """Edge scores of a shape at a grid of places in a picture.

    The score of a group of edges is its mean gradient along the normals: signed over a few neighbouring points, which
    cancels noise and clutter, then in magnitude. The total is the geometric mean of the first four groups (both ends,
    both sides), so that none can replace another, plus a share of the fifth.

    Args:
        slope_u: brightness gradient along u, transposed.
        slope_v: brightness gradient along v, transposed.
        pixels: edge points of the shape.
        normals: their unit normals.
        group: index of the group of each point, 0 to 4.
        first_u: shift of the shape to the first place along u, pixels.
        first_v: along v.
        work: memory.
        scores: the scores at shifts by whole columns and rows from the first place; 0 where more than half of a group
            is outside.
    """


@native("work", "used", "change")
def robust_change(
    shifts: Float64[Array, "n"],
    slopes: Float64[Array, "n 3"],
    weights: Float64[Array, "n"],
    work: Float64[Array, "2 n"],
    used: Float64[Array, "n"],
    change: Float64[Array, "3"],
) -> float:
    """Robust least squares of a pose change, by reweighting with Tukey's biweight.

    Args:
        shifts: displacement of each edge along its normal, pixels.
        slopes: Jacobian of the displacements.
        weights: inverse variances, 0 for invalid edges.
        work: memory.
        used: the final weights, 0 for outliers.
        change: the pose change.

    Returns:
        The residual scale over the expected one, at least 1/2.
    """


@native("sums")
def sums_along(
    rows: Float64[Array, "n m"],
    design: Float64[Array, "n 4"],
    middle: float,
    trials: Float64[Array, "q 4"],
    sums: Float64[Array, "q"],
) -> None:
    """Sums of one sample from each row, at positions linear in four parameters; 0 beyond the rows' ends.

    Args:
        rows: samples.
        design: Jacobian of the position in each row, samples.
        middle: position where all parameters are zero, samples.
        trials: the trial parameters.
        sums: the sums.
    """


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
        camera: packed, see `kernels.pictures`.
        pixels: the edge points.
        directions: unit normals in the picture.
        size: pixels per m along them.
        slopes: Jacobian of the displacement along each normal by (x, y, heading), pixels per m and per rad.
    """


@native("work", "share", "distance", "kind")
def seal_shares(
    colours: Float64[Array, "3 edges samples"],
    offsets: Float64[Array, "samples"],
    sides: Int64[Array, "count 3"],
    palette: Float64[Array, "kinds 3"],
    ground: Float64[Array, "2 3 3"],
    beside: float,
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
        ground: covariance of colours, by noise and by what lies farther out, at ends and at silhouettes, of 255.
        beside: distance from an edge from which on colours are those of one side, pixels.
        distinct: least distance of a stripe from its surroundings, standard deviations.
        white: brightness of glare, of 255, which hides an edge.
        fewest: fewest edges of a side in view.
        pooled: edges on either side whose surroundings are averaged.
        work: memory.
        share: 1 in the stripe to 0 beside it; NaN where unknown.
        distance: squared distance of the stripe from its surroundings; 0 where they look alike.
        kind: index into the palette of the nearest colour; 0 without one.
    """


@native("shifts", "known", "variance")
def seal_shifts(
    share: Float64[Array, "edges samples"],
    distance: Float64[Array, "edges"],
    kind: Int64[Array, "edges"],
    sides: Int64[Array, "count 3"],
    bias: Float64[Array, "count kinds"],
    design: Float64[Array, "samples 3"],
    inverses: Float64[Array, "2 3 samples"],
    starts: Int64[Array, "2"],
    steepness: float,
    largest: float,
    weakest: float,
    strongest: float,
    noise: float,
    shifts: Float64[Array, "edges"],
    known: UInt8[Array, "edges"],
    variance: Float64[Array, "edges"],
) -> None:
    """Displacement of each edge of a seal along its normal, by least squares of a template.

    Args:
        share: share of the stripe's colour in the samples across each edge.
        distance: squared distance of the stripe from its surroundings; 0 where they look alike.
        kind: class of the colour at each edge.
        sides: first edge of each side, the one after its last, and whether the side is a silhouette.
        bias: displacement by each class of colour at each side, samples.
        design: the template's columns: level, the edge of contrast 1, its slope.
        inverses: their pseudoinverses, at other sides and at silhouettes.
        starts: first sample that is used at these.
        steepness: root sum square of the slope.
        largest: largest valid displacement, samples.
        weakest: least valid contrast.
        strongest: largest one.
        noise: least residual, times the distance.
        shifts: the displacements, samples; NaN out of view.
        known: 1 where the displacement is valid.
        variance: its variance, samples^2.
    """
