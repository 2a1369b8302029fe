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
    image: UInt8[Array, "h w 3"],  # the picture
    first: Float64[Array, "n 2"],  # start of each line, pixels
    last: Float64[Array, "n 2"],  # end of each line, pixels
    work: Float64[Array, "3 samples"],  # memory, for as many samples as a line has
    colours: Float64[Array, "n 3"],  # the colours; NaN where fewer than half of the samples lie in the picture
) -> None:
    """Interquartile mean of the colours on lines between pixels, which rejects highlights and bubbles."""


@native("colours")
def stripes_at(
    angles: Float64[Array, "n"],  # angles about the axis, rad
    blur: Float64[Array, "n"],  # standard deviation of the blur at each angle, rad
    roll: float,  # angle of the first stripe's middle, rad
    order: Int64[Array, "s"],  # class of each stripe
    palette: Float64[Array, "classes 3"],  # colour of each class
    colours: Float64[Array, "n 3"],  # the colours
) -> None:
    """Colours of blurred stripes at angles about the axis, for the body's rotation angle `roll`."""


@native("work", "losses", "answer")
def stripe_fit(
    profile: Float64[Array, "n 3"],  # colours along the angle; NaN where invisible
    scale: Float64[Array, "n"],  # pixels per radian at each angle
    trust: Float64[Array, "n"],  # weight of each angle, beside that of its scale
    angles: Float64[Array, "n"],  # angles about the axis, rad
    shade: Float64[Array, "n 6"],  # shading factor and additive sheen at each angle, in each channel
    order: Int64[Array, "s"],  # class of each stripe
    palette: Float64[Array, "classes 3"],  # colour of each class
    period: float,  # of the pattern, rad
    tint: float,  # strength of the prior on the channels' common gain
    cut: float,  # residual beyond which a sample is an outlier
    usual: float,  # least expected residual
    blur: float,  # standard deviation of the blur, pixels
    work: Float64[Array, "n 17"],
    losses: Float64[Array, "t"],  # loss at each angle of the grid, 0 to 1
    # angle, its standard error, loss, least loss at a distant angle, loss of a uniform colour, gains of the channels;
    # unchanged where too little is visible
    answer: Float64[Array, "8"],
) -> None:
    """Fit the rotation angle of stripes to a colour profile: grid search, then robust Gauss-Newton steps."""


@native("losses", "found")
def stripe_edges(
    levels: Float64[Array, "n 3"],  # colours along the angle; NaN where nothing is seen
    angles: Float64[Array, "n"],  # angles about the axis, ascending, rad
    blur: Float64[Array, "n"],  # standard deviation of the blur at each angle, rad
    shade: Float64[Array, "n 6"],  # shading factor and additive sheen at each angle, in each channel
    colours: Float64[Array, "s 3"],  # of the stripes in their order
    roll: float,  # angle of the first stripe's middle, rad
    tried: Float64[Array, "t"],  # shifts that are tried, evenly spaced, rad
    step: float,  # between them, rad
    steepest: float,  # largest angle from the direction towards the camera at which an edge is located, rad
    around: float,  # half width over that of a stripe of the surroundings
    contrast: float,  # least distance of the colours on either side
    fewest: int,  # fewest samples in the surroundings
    losses: Float64[Array, "t"],
    found: Float64[Array, "s"],  # the shifts, rad; NaN of edges that are out of view
) -> None:
    """Angles by which the edges between stripes lie beyond their even places, by least squares one by one."""


@native("work", "ridge")
def ridge_of(
    image: UInt8[Array, "h w 3"],  # the picture
    middle: Float64[Array, "rows 2"],  # pixel of each row's middle
    across: Float64[Array, "rows 2"],  # step from one column to the next, pixels
    contrast: Float64[Array, "3"],  # weight of each channel
    inner: int,  # half the width of the line, columns
    work: Float64[Array, "2 columns"],
    ridge: Float64[Array, "rows columns"],  # the strip; NaN in rows that leave the picture
) -> None:
    """Ridge filter: contrast of a line at each pixel of a strip to both of its sides."""


@native("scores")
def wave_scores(
    ridge: Float64[Array, "rows columns"],  # the strip
    xi: Float64[Array, "rows"],  # distance from the root of each row, m
    tilt: Float64[Array, "rows 3"],  # of each row
    wave: Float64[Array, "4"],  # of the wire
    step: float,  # width of a column, m
    every: int,  # stride of the rows
    turns: Float64[Array, "phases 2"],  # cosine and sine of the phases
    scores: Float64[Array, "phases"],  # the score of each phase
) -> None:
    """Mean ridge along the wire at evenly spaced phases; NaN with fewer than a third of the rows in the picture."""


@native("work", "answer")
def wave_fit(
    ridge: Float64[Array, "rows columns"],  # the strip
    xi: Float64[Array, "rows"],  # distance from the root of each row, m
    tilt: Float64[Array, "rows 3"],  # of each row
    wave: Float64[Array, "4"],  # of the wire
    phase: float,  # to begin with, rad
    step: float,  # width of a column, m
    width: float,  # of the wire, m
    usual: float,  # typical ridge on the wire
    likely_offset: float,  # prior standard deviation of the offset, m
    likely_lean: float,  # prior standard deviation of the difference of offsets from end to end, m
    work: Float64[Array, "rows 10"],
    # phase, its standard error, inlier share of the rows, offset, tilt, numerator and denominator of the handedness (0
    # as assumed, -2 opposite) and of the relative error of the amplitude, mean ridge; unchanged where too little is in
    # view
    answer: Float64[Array, "10"],
) -> None:
    """Robust Gauss-Newton fit of phase, lateral offset and tilt of a wire, from a phase nearby."""


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
