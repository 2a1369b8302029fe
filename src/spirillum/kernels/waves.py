"""Fit of a travelling wave to a ridge in a strip of a picture: csrc/waves.c, which states its geometry.

Columns of the strip run across the tail, rows along it. A wave is packed as K, a_0, c/L_t (0 or less: no taper) and
amplitude; the tilt of a row as the derivatives with height e and f of the shift along and across, and g of the
magnification.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, UInt8, native


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
