"""The label `synthetic` in the corner of every picture of the virtual camera."""

from __future__ import annotations

import numpy as np

__all__ = ["stamp"]

_TEXT = "synthetic"
_LETTERS = {  # 3 x 5 pixels, rows from the top
    "s": "011 100 010 001 110",
    "y": "000 101 011 001 110",
    "n": "000 110 101 101 101",
    "t": "010 111 010 010 011",
    "h": "100 100 110 101 101",
    "e": "000 010 111 100 011",
    "i": "010 000 010 010 010",
    "c": "000 011 100 100 011",
}
_LARGE = 480
"""Width of a picture above which the letters are twice as large, pixels."""


def stamp(image: np.ndarray) -> None:
    """Write the label into the lower right corner of a picture.

    Args:
        image: (height, width, 3) bytes; changed.
    """
    mask = np.zeros((5, 4 * len(_TEXT) - 1), dtype=bool)
    for place, letter in enumerate(_TEXT):
        rows = [[digit == "1" for digit in row] for row in _LETTERS[letter].split()]
        mask[:, 4 * place : 4 * place + 3] = rows
    times = 2 if image.shape[1] >= _LARGE else 1
    mask = np.repeat(np.repeat(mask, times, axis=0), times, axis=1)
    height, width = mask.shape
    corner = image[-height - 3 : -3, -width - 3 : -3]
    corner[mask] = (60, 60, 66)
