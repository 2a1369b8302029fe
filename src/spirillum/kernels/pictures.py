"""Colours of a picture between its pixels, and a fit of stripes on a cylinder: csrc/pictures.c."""

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
