"""Brightness profiles across edges, displacements of edges, robust pose updates, scores of places: csrc/edges.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float32, Float64, Int64, native


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
