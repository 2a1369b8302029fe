"""Edges in pictures: brightness profiles, the contour of a body, a coloured seal: csrc/edges.c, contours.c, seals.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float32, Float64, Int64, UInt8, native


@native("profiles")
def profiles_across(
    picture: Float32[Array, "h w channels"],  # brightness, or colours, of a region of the picture
    origin: Float64[Array, "2"],  # pixel (u, v) of the region's upper left corner
    pixels: Float64[Array, "n 2"],  # the edge points
    normals: Float64[Array, "n 2"],  # unit directions
    offsets: Float64[Array, "m"],  # distances along them, pixels
    profiles: Float64[Array, "channels n m"],  # the profiles
) -> None:
    """Brightness profiles along the normals of edge points, by cubic convolution; NaN outside of the region."""


@native("shifts", "strengths", "residuals")
def shifts_of_profiles(
    profiles: Float64[Array, "n m"],  # brightness q
    templates: Float64[Array, "n m"],  # template p of the undisplaced edge, without mean and slope
    slopes: Float64[Array, "n m"],  # derivative p' of the template, per sample
    shifts: Float64[Array, "n"],  # d, samples; NaN where the fit is singular
    strengths: Float64[Array, "n"],  # a
    residuals: Float64[Array, "n"],  # root mean square residual
) -> None:
    """Displacement d of each edge along its normal: q(s) = b + c s + a (p(s) - d p'(s)) by least squares.

    Offset b, slope c and contrast a of either sign are free at every point, so that lamp, shadows and the colour of a
    stripe do not bias the displacement.
    """


@native("work", "scores")
def edge_scores(
    slope_u: Float64[Array, "w h"],  # brightness gradient along u, transposed
    slope_v: Float64[Array, "w h"],  # brightness gradient along v, transposed
    pixels: Float64[Array, "n 2"],  # edge points of the shape
    normals: Float64[Array, "n 2"],  # their unit normals
    group: Int64[Array, "n"],  # index of the group of each point, 0 to 4
    first_u: float,  # shift of the shape to the first place along u, pixels
    first_v: float,  # along v
    work: Float64[Array, "2 5 r"],
    # the scores at shifts by whole columns and rows from the first place; 0 where more than half of a group is outside
    scores: Float64[Array, "c r"],
) -> None:
    """Edge scores of a shape at a grid of places in a picture.

    The score of a group of edges is its mean gradient along the normals: signed over a few neighbouring points, which
    cancels noise and clutter, then in magnitude. The total is the geometric mean of the first four groups (both ends,
    both sides), so that none can replace another, plus a share of the fifth.
    """


@native("work", "used", "change")
def robust_change(
    shifts: Float64[Array, "n"],  # displacement of each edge along its normal, pixels
    slopes: Float64[Array, "n 3"],  # Jacobian of the displacements
    weights: Float64[Array, "n"],  # inverse variances, 0 for invalid edges
    work: Float64[Array, "2 n"],
    used: Float64[Array, "n"],  # the final weights, 0 for outliers
    change: Float64[Array, "3"],  # the pose change
) -> float:
    """Robust least squares of a pose change, by reweighting with Tukey's biweight.

    Returns:
        The residual scale over the expected one, at least 1/2.
    """


@native("sums")
def sums_along(
    rows: Float64[Array, "n m"],  # samples
    design: Float64[Array, "n 4"],  # Jacobian of the position in each row, samples
    middle: float,  # position where all parameters are zero, samples
    trials: Float64[Array, "q 4"],  # the trial parameters
    sums: Float64[Array, "q"],  # the sums
) -> None:
    """Sums of one sample from each row, at positions linear in four parameters; 0 beyond the rows' ends."""


@native("points")
def edge_points(
    pose: Float64[Array, "3"],  # x, y, heading
    # Chebyshev coefficients, in the lens's place along and across, of x and y with the upper rims of flat ends, and of
    # x and y with the lower ones; the outer point of the two is taken
    factors: Float64[Array, "8 5 4 n"],
    normals: Float64[Array, "n 2"],  # outward normals
    reach: Float64[Array, "2"],  # largest distances of the lens along and across, m
    points: Float64[Array, "n 2"],  # the points, m
) -> None:
    """Edge points in the plane through the axis, in the body's frame."""


@native("pixels", "directions", "size", "slopes")
def edge_places(
    pose: Float64[Array, "3"],  # x, y, heading
    factors: Float64[Array, "8 5 4 n"],  # coefficients of the edge points, as in `edge_points`
    normals: Float64[Array, "n 2"],  # outward normals in the body's frame
    reach: Float64[Array, "2"],  # largest distances of the lens along and across, m
    axis_height: float,  # height of the axis, m
    camera: Float64[Array, "17"],  # packed, see `kernels.pictures`
    pixels: Float64[Array, "n 2"],  # the edge points
    directions: Float64[Array, "n 2"],  # unit normals in the picture
    size: Float64[Array, "n"],  # pixels per m along them
    # Jacobian of the displacement along each normal by (x, y, heading), pixels per m and per rad
    slopes: Float64[Array, "n 3"],
) -> None:
    """Project a body's apparent contour into the picture."""


@native("work", "share", "distance", "kind")
def seal_shares(
    colours: Float64[Array, "3 edges samples"],  # profiles across the edges, of 255; NaN out of view
    offsets: Float64[Array, "samples"],  # distances of the samples outward from an edge, pixels
    # first edge of each side, the one after its last, and whether the side is a silhouette
    sides: Int64[Array, "count 3"],
    palette: Float64[Array, "kinds 3"],  # known colours at the silhouette; none at first
    # covariance of colours, by noise and by what lies farther out, at ends and at silhouettes, of 255
    ground: Float64[Array, "2 3 3"],
    beside: float,  # distance from an edge from which on colours are those of one side, pixels
    distinct: float,  # least distance of a stripe from its surroundings, standard deviations
    white: float,  # brightness of glare, of 255, which hides an edge
    fewest: int,  # fewest edges of a side in view
    pooled: int,  # edges on either side whose surroundings are averaged
    work: Float64[Array, "2 3 edges"],
    share: Float64[Array, "edges samples"],  # 1 in the stripe to 0 beside it; NaN where unknown
    distance: Float64[Array, "edges"],  # squared distance of the stripe from its surroundings; 0 where they look alike
    kind: Int64[Array, "edges"],  # index into the palette of the nearest colour; 0 without one
) -> None:
    """Share of the stripe's colour in the samples across each edge of a seal.

    Colours are projected onto the direction that separates a stripe best from the surroundings of its side (Fisher's
    linear discriminant). At a silhouette of known colours the share is that of the colour of which there is most.
    """


@native("shifts", "known", "variance")
def seal_shifts(
    share: Float64[Array, "edges samples"],  # share of the stripe's colour in the samples across each edge
    distance: Float64[Array, "edges"],  # squared distance of the stripe from its surroundings; 0 where they look alike
    kind: Int64[Array, "edges"],  # class of the colour at each edge
    # first edge of each side, the one after its last, and whether the side is a silhouette
    sides: Int64[Array, "count 3"],
    bias: Float64[Array, "count kinds"],  # displacement by each class of colour at each side, samples
    design: Float64[Array, "samples 3"],  # the template's columns: level, the edge of contrast 1, its slope
    inverses: Float64[Array, "2 3 samples"],  # their pseudoinverses, at other sides and at silhouettes
    starts: Int64[Array, "2"],  # first sample that is used at these
    steepness: float,  # root sum square of the slope
    largest: float,  # largest valid displacement, samples
    weakest: float,  # least valid contrast
    strongest: float,  # largest one
    noise: float,  # least residual, times the distance
    shifts: Float64[Array, "edges"],  # the displacements, samples; NaN out of view
    known: UInt8[Array, "edges"],  # 1 where the displacement is valid
    variance: Float64[Array, "edges"],  # its variance, samples^2
) -> None:
    """Displacement of each edge of a seal along its normal, by least squares of a template."""
