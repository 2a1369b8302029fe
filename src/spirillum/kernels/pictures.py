"""Stripes, travelling waves and refracted rays in pictures: csrc/pictures.c, widths.c, waves.c, snell.c.

Columns of the strip run across the tail, rows along it. A wave is packed as K, a_0, c/L_t (0 or less: no taper) and
amplitude; the tilt of a row as the derivatives with height e and f of the shift along and across, and g of the
magnification.

A camera is packed as 17 numbers: focal length (negative: turned by half a turn), principal point u and v, distortion k1
and k2, height of the lens, height of the surface, refractive index below the surface over that above, and the rotation
matrix whose rows point to the right, up and backwards of the camera. The lens stands at x = y = 0.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, Int64, UInt8, native


@native("colours")
def sampled(image: UInt8[Array, "h w 3"], pixels: Float64[Array, "k 2"], colours: Float64[Array, "k 3"]) -> None:
    """Colours of a picture at pixels (u, v), by bilinear interpolation; NaN outside."""


@native("work", "colours")
def profile_of_rows(
    image: UInt8[Array, "h w 3"],
    first: Float64[Array, "n 2"],
    last: Float64[Array, "n 2"],
    work: Float64[Array, "3 samples"],
    colours: Float64[Array, "n 3"],
) -> None:
    """Interquartile mean of the colours on lines between pixels, which rejects highlights and bubbles.

    Args:
        image: the picture.
        first: start of each line, pixels.
        last: end of each line, pixels.
        work: memory, for as many samples as a line has.
        colours: the colours; NaN where fewer than half of the samples lie in the picture.
    """


@native("colours")
def stripes_at(
    angles: Float64[Array, "n"],
    blur: Float64[Array, "n"],
    roll: float,
    order: Int64[Array, "s"],
    palette: Float64[Array, "classes 3"],
    colours: Float64[Array, "n 3"],
) -> None:
    """Colours of blurred stripes at angles about the axis, for the body's rotation angle `roll`.

    Args:
        angles: angles about the axis, rad.
        blur: standard deviation of the blur at each angle, rad.
        roll: angle of the first stripe's middle, rad.
        order: class of each stripe.
        palette: colour of each class.
        colours: the colours.
    """


@native("work", "losses", "answer")
def stripe_fit(
    profile: Float64[Array, "n 3"],
    scale: Float64[Array, "n"],
    trust: Float64[Array, "n"],
    angles: Float64[Array, "n"],
    shade: Float64[Array, "n 6"],
    order: Int64[Array, "s"],
    palette: Float64[Array, "classes 3"],
    period: float,
    tint: float,
    cut: float,
    usual: float,
    blur: float,
    work: Float64[Array, "n 17"],
    losses: Float64[Array, "t"],
    answer: Float64[Array, "8"],
) -> None:
    """Fit the rotation angle of stripes to a colour profile: grid search, then robust Gauss-Newton steps.

    Args:
        profile: colours along the angle; NaN where invisible.
        scale: pixels per radian at each angle.
        trust: weight of each angle, beside that of its scale.
        angles: angles about the axis, rad.
        shade: shading factor and additive sheen at each angle, in each channel.
        order: class of each stripe.
        palette: colour of each class.
        period: of the pattern, rad.
        tint: strength of the prior on the channels' common gain.
        cut: residual beyond which a sample is an outlier.
        usual: least expected residual.
        blur: standard deviation of the blur, pixels.
        work: memory.
        losses: loss at each angle of the grid, 0 to 1.
        answer: angle, its standard error, loss, least loss at a distant angle, loss of a uniform colour, gains of the
            channels; unchanged where too little is visible.
    """


@native("losses", "found")
def stripe_edges(
    levels: Float64[Array, "n 3"],
    angles: Float64[Array, "n"],
    blur: Float64[Array, "n"],
    shade: Float64[Array, "n 6"],
    colours: Float64[Array, "s 3"],
    roll: float,
    tried: Float64[Array, "t"],
    step: float,
    steepest: float,
    around: float,
    contrast: float,
    fewest: int,
    losses: Float64[Array, "t"],
    found: Float64[Array, "s"],
) -> None:
    """Angles by which the edges between stripes lie beyond their even places, by least squares one by one.

    Args:
        levels: colours along the angle; NaN where nothing is seen.
        angles: angles about the axis, ascending, rad.
        blur: standard deviation of the blur at each angle, rad.
        shade: shading factor and additive sheen at each angle, in each channel.
        colours: of the stripes in their order.
        roll: angle of the first stripe's middle, rad.
        tried: shifts that are tried, evenly spaced, rad.
        step: between them, rad.
        steepest: largest angle from the direction towards the camera at which an edge is located, rad.
        around: half width over that of a stripe of the surroundings.
        contrast: least distance of the colours on either side.
        fewest: fewest samples in the surroundings.
        losses: memory.
        found: the shifts, rad; NaN of edges that are out of view.
    """


@native("work", "ridge")
def ridge_of(
    image: UInt8[Array, "h w 3"],
    middle: Float64[Array, "rows 2"],
    across: Float64[Array, "rows 2"],
    contrast: Float64[Array, "3"],
    inner: int,
    work: Float64[Array, "2 columns"],
    ridge: Float64[Array, "rows columns"],
) -> None:
    """Ridge filter: contrast of a line at each pixel of a strip to both of its sides.

    Args:
        image: the picture.
        middle: pixel of each row's middle.
        across: step from one column to the next, pixels.
        contrast: weight of each channel.
        inner: half the width of the line, columns.
        work: memory.
        ridge: the strip; NaN in rows that leave the picture.
    """


@native("scores")
def wave_scores(
    ridge: Float64[Array, "rows columns"],
    xi: Float64[Array, "rows"],
    tilt: Float64[Array, "rows 3"],
    wave: Float64[Array, "4"],
    step: float,
    every: int,
    turns: Float64[Array, "phases 2"],
    scores: Float64[Array, "phases"],
) -> None:
    """Mean ridge along the wire at evenly spaced phases; NaN with fewer than a third of the rows in the picture.

    Args:
        ridge: the strip.
        xi: distance from the root of each row, m.
        tilt: of each row.
        wave: of the wire.
        step: width of a column, m.
        every: stride of the rows.
        turns: cosine and sine of the phases.
        scores: the score of each phase.
    """


@native("work", "answer")
def wave_fit(
    ridge: Float64[Array, "rows columns"],
    xi: Float64[Array, "rows"],
    tilt: Float64[Array, "rows 3"],
    wave: Float64[Array, "4"],
    phase: float,
    step: float,
    width: float,
    usual: float,
    likely_offset: float,
    likely_lean: float,
    work: Float64[Array, "rows 10"],
    answer: Float64[Array, "10"],
) -> None:
    """Robust Gauss-Newton fit of phase, lateral offset and tilt of a wire, from a phase nearby.

    Args:
        ridge: the strip.
        xi: distance from the root of each row, m.
        tilt: of each row.
        wave: of the wire.
        phase: to begin with, rad.
        step: width of a column, m.
        width: of the wire, m.
        usual: typical ridge on the wire.
        likely_offset: prior standard deviation of the offset, m.
        likely_lean: prior standard deviation of the difference of offsets from end to end, m.
        work: memory.
        answer: phase, its standard error, inlier share of the rows, offset, tilt, numerator and denominator of the
            handedness (0 as assumed, -2 opposite) and of the relative error of the amplitude, mean ridge; unchanged
            where too little is in view.
    """


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
