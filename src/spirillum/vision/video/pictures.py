"""Images decoded, once it is known how large they are; and large ones reduced."""

from __future__ import annotations

import warnings
from io import BytesIO
from math import inf
from pathlib import Path

import numpy as np

from spirillum.errors import InputError
from spirillum.extras import required
from spirillum.files import read_bytes
from spirillum.files.limits import LARGEST_PICTURE, MOST_PIXELS

__all__ = ["read_image", "reduced", "reduction"]

_WHAT = "an image (png, jpg, tif, bmp)"
_USUAL = 1280
"""Longest side of pictures that are looked at as a whole as they are, pixels."""
_KINDS = ("PNG", "JPEG", "MPO", "TIFF", "BMP")


def reduction(size: tuple[int, int]) -> int:
    """Factor by which pictures of a size are reduced where they are looked at as a whole; 1 for usual ones.

    Args:
        size: width and height, pixels.
    """
    return -(-max(size) // _USUAL)


def reduced(image: np.ndarray, factor: int) -> np.ndarray:
    """A picture whose blocks of `factor` by `factor` pixels are made one, their mean; from the upper left.

    Args:
        image: 8-bit, (h, w) or (h, w, channels).
        factor: a whole number; 1 gives the picture itself.
    """
    if factor == 1:
        return image
    cv2 = required("cv2", "measuring a video", "video")
    height, width = image.shape[0] // factor, image.shape[1] // factor
    whole = image[: height * factor, : width * factor]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA))


def read_image(path: Path, *, grey: bool = False) -> np.ndarray | None:
    """A picture of 8-bit BGR or grey values; None if it cannot be decoded.

    Args:
        path: the file.
        grey: grey values, (height, width), in place of colours, (height, width, 3).

    Raises:
        InputError: if it is no regular file, too large, or has too many pixels.
    """
    cv2 = required("cv2", "measuring a video", "video")
    data = read_bytes(path, _WHAT, LARGEST_PICTURE)
    pixels = _pixels(data)
    if pixels is None:
        return None
    if pixels > MOST_PIXELS:
        million = MOST_PIXELS // 1_000_000
        raise InputError(f"{path} has more than {million} million pixels; allowed: at most {million} million")
    try:
        found: np.ndarray | None = cv2.imdecode(
            np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR
        )
    except cv2.error:
        return None
    return found


def _pixels(data: bytes) -> float | None:
    """Number of pixels as the head of an image states it; None where it is no image."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of large pictures: they are refused by our own limit
            with Image.open(BytesIO(data), formats=_KINDS) as image:
                return image.width * image.height
    except Image.DecompressionBombError:
        return inf
    except Exception:  # a damaged file raises whatever the library meets first
        return None
