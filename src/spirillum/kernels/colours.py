"""Colours of a picture as films keep them, compiled."""

from __future__ import annotations

import numpy as np

from spirillum.kernels.compiled import compiled

_BITS = 16
"""Binary digits of fractions: sums are of whole numbers of 32 bits, which compilers turn into vector instructions."""
_RED, _GREEN, _BLUE = 0.2126, 0.7152, 0.0722
"""Shares of the colours in the luma Y' of Rec. ITU-R BT.709-6, section 3.2."""
_LUMA, _CHROMA = 219.0 / 255.0 * 2**_BITS, 112.0 / 255.0 * 2**_BITS
"""Steps of luma in the limited range of 8 bits for a step of a colour, and half of those of chroma; section 3.4."""
_Y = (round(_RED * _LUMA), round(_GREEN * _LUMA), round(_BLUE * _LUMA))
_CB = (round(-_RED / (1.0 - _BLUE) * _CHROMA), round(-_GREEN / (1.0 - _BLUE) * _CHROMA), round(_CHROMA))
_CR = (round(_CHROMA), round(-_GREEN / (1.0 - _RED) * _CHROMA), round(-_BLUE / (1.0 - _RED) * _CHROMA))
_BLACK, _GREY = (16 << _BITS) + (1 << _BITS - 1), (128 << _BITS + 3) + (1 << _BITS + 2)
"""Luma without light, chroma without colour; half a step more, as whole numbers are cut off."""


@compiled
def film_colours(image: np.ndarray, out: np.ndarray) -> None:
    """Luma, and chroma at half the size, of a picture: 8-bit YUV 4:2:0 of BT.709 in the limited range.

    A sample of chroma lies on an even column between two rows, where H.264 takes it to lie unless told otherwise. It is
    the mean of the two rows, with weights of 1/4, 1/2, 1/4 along them.

    Args:
        image: sRGB bytes, (height, width, 3), height and width even, contiguous.
        out: bytes, (3 height / 2, width): luma, then both parts of chroma row by row.
    """
    height, width = image.shape[0], image.shape[1]
    for i in range(height):
        row, luma = image[i].reshape(-1), out[i]
        for j in range(width):
            of_red, of_green = np.uint32(_Y[0]) * row[3 * j], np.uint32(_Y[1]) * row[3 * j + 1]
            total = np.uint32(of_red + of_green + np.uint32(_Y[2]) * row[3 * j + 2] + np.uint32(_BLACK))
            luma[j] = np.uint8(total >> np.uint32(_BITS))
    chroma = out[height:].reshape((2, height // 2, width // 2))
    sums = np.empty(3 * width, np.int32)
    for i in range(height // 2):
        upper, lower, blues, reds = image[2 * i].reshape(-1), image[2 * i + 1].reshape(-1), chroma[0, i], chroma[1, i]
        for k in range(3 * width):
            sums[k] = np.int32(upper[k]) + np.int32(lower[k])
        for j in range(width // 2):
            here = 6 * j
            left, right = max(here - 3, 0), here + 3
            red = sums[left] + 2 * sums[here] + sums[right]
            green = sums[left + 1] + 2 * sums[here + 1] + sums[right + 1]
            blue = sums[left + 2] + 2 * sums[here + 2] + sums[right + 2]
            blues[j] = np.uint8((_CB[0] * red + _CB[1] * green + _CB[2] * blue + _GREY) >> (_BITS + 3))
            reds[j] = np.uint8((_CR[0] * red + _CR[1] * green + _CR[2] * blue + _GREY) >> (_BITS + 3))
