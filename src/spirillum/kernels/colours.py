"""Colours of a picture as films keep them: csrc/colours.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, UInt8, native


@native("out")
def film_colours(image: UInt8[Array, "height width 3"], out: UInt8[Array, "rows width"]) -> None:
    """Luma, and chroma at half the size, of a picture: 8-bit YUV 4:2:0 of BT.709 in the limited range.

    A sample of chroma lies on an even column between two rows, where H.264 takes it to lie unless told otherwise. It is
    the mean of the two rows, with weights of 1/4, 1/2, 1/4 along them.

    Args:
        image: sRGB bytes; height and width are even.
        out: bytes, rows = 3 height / 2: luma, then both parts of chroma row by row.
    """
