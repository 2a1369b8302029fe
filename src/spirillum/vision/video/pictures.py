"""Images decoded, once it is known how large they are; and large ones reduced."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from spirillum.errors import InputError
from spirillum.files import opened, read_bytes
from spirillum.files.limits import LARGEST_PICTURE, MOST_IMAGES, MOST_PIXELS
from spirillum.vision.video import opencv as cv2
from spirillum.vision.video.display import Display

IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")  #: Endings of images.
STACKS = (".tif", ".tiff")  #: Endings of files that may hold several pictures, one a page.
_WHAT = "an image (png, jpg, tif, bmp)"
_USUAL = 1280  # longest side of pictures that are looked at as a whole as they are, pixels
_OPENERS = ("PNG", "JPEG", "TIFF", "BMP")  # formats as Pillow names what opens them; that of JPEG opens MPO too
_TOO_DEEP = {"F": "32-bit floating-point numbers", "I": "32-bit whole numbers", "F;16": "16-bit floating-point numbers"}
"""Modes of Pillow whose values have no known white."""
_ORIENTATIONS = {
    2: (False, True, False), 3: (False, True, True), 4: (False, False, True), 5: (True, False, False),
    6: (True, True, False), 7: (True, True, True), 8: (True, False, True),
}  # fmt: skip
"""Exif's orientations: whether an image is transposed, and then mirrored across and down."""
_ORIENTATION = 274  # exif's tag
_SQUARE = 1e-3  # relative difference of two densities that is rounding


class Header(NamedTuple):
    """What an image states of itself."""

    size: tuple[int, int]  #: Width and height as stored, pixels.
    display: Display  #: Its orientation.
    densities: tuple[float, float, bool]
    """Pixels per length across and down, as stored; and whether they are stated without a unit."""
    pages: int  #: Number of pictures in the file.
    is_tiff: bool  #: Whether it is a TIFF file.

    def aspect(self, path: Path, given: float | None) -> float | None:
        """Width of a pixel over its height by the densities; None where they state nothing."""
        across, down, bare = self.densities
        if not (across > 0 and down > 0 and abs(down / across - 1.0) > _SQUARE):
            return None
        if not bare:
            return down / across
        if given is None:
            raise InputError(
                f"{path} states pixels that are not square, {across:g} and {down:g} without a unit, which programs "
                "write either way round; allowed: camera.pixel_aspect_ratio in the setup (width over height; 1: square)"
            )
        return None


def reduction(size: tuple[int, int]) -> int:
    """Factor by which pictures of a size are reduced where they are looked at as a whole; 1 for usual ones."""
    return -(-max(size) // _USUAL)


def reduced(image: np.ndarray, factor: int) -> np.ndarray:
    """A picture whose blocks of `factor` by `factor` pixels are made one, their mean; from the upper left."""
    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    whole = image[: height * factor, : width * factor]
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA))


def bits_of(image: np.ndarray) -> int:
    """Number of bits, 8 at least, that the values of an image fill: 12 of a 12-bit camera's in 16."""
    return max(8, int(image.max()).bit_length())


def eight_bit(image: np.ndarray, bits: int) -> np.ndarray:
    """An image of 8-bit values; what is brighter than `bits` bits is white."""
    if image.dtype == np.uint8:
        return image
    bright: np.ndarray = np.minimum(image >> (bits - 8), 255)
    return bright.astype(np.uint8)


def read_image(path: Path, *, grey: bool = False, display: Display | None = None) -> np.ndarray | None:
    """A picture as it is stored, 8-bit or 16-bit BGR or grey values; None if it cannot be decoded."""
    data = read_bytes(path, _WHAT, LARGEST_PICTURE)
    header = _header(BytesIO(data), path)
    if header is None:
        return None
    if header.pages > 1 and path.suffix.lower() in STACKS:
        raise InputError(f"{path} holds {header.pages} pages; allowed: one picture a file, or the file as the video")
    if display is not None and display[1:] != header.display[1:]:
        raise InputError(f"{path} states another orientation than others in its folder; allowed: one for all")
    try:
        found: np.ndarray | None = cv2.imdecode(np.frombuffer(data, np.uint8), _flags(grey=grey))
    except cv2.error:
        return None
    return _stored(found, header)


def read_pages(path: Path, header: Header, start: int, count: int) -> list[np.ndarray | None]:
    """Some pages of a TIFF file as they are stored, 8-bit or 16-bit BGR; None for one that cannot be decoded."""
    try:
        _, found = cv2.imreadmulti(str(path), start, count, flags=_flags(grey=False))
    except cv2.error:
        found = ()
    if len(found) == count or count == 1:
        return [_stored(page, header) for page in found] or [None]
    return [page for number in range(start, start + count) for page in read_pages(path, header, number, 1)]


def read_header(path: Path) -> Header | None:
    """What an image states of itself; None where it is none."""
    largest = sys.maxsize if path.suffix.lower() in STACKS else LARGEST_PICTURE
    with opened(path, _WHAT, largest) as stream:
        return _header(stream, path)


def _flags(*, grey: bool) -> int:
    kind = cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR
    return int(kind | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION)


def _stored(image: np.ndarray | None, header: Header) -> np.ndarray | None:
    """A decoded image as it is stored: OpenCV turns those of TIFF files by their tag, whatever its flags."""
    if image is None or image.dtype not in (np.uint8, np.uint16):
        return None
    return header.display.turned_back(image) if header.is_tiff else image


def _header(stream: BinaryIO | BytesIO, path: Path) -> Header | None:
    """What an image states of itself; None where it is none."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of large pictures: they are refused by our own limit
            with Image.open(stream, formats=_OPENERS) as image:
                sizes, mode, is_tiff = list(_sizes(image)), image.mode, image.format == "TIFF"
                densities, orientation = _densities(image), image.getexif().get(_ORIENTATION)
    except Image.DecompressionBombError:
        sizes, mode, is_tiff, densities, orientation = [(MOST_PIXELS + 1, 1)], "L", False, (1.0, 1.0, False), None
    except Exception:  # a damaged file raises whatever the library meets first
        return None
    if max(width * height for width, height in sizes) > MOST_PIXELS:
        million = MOST_PIXELS // 1_000_000
        raise InputError(f"{path} has more than {million} million pixels; allowed: at most {million} million")
    if mode in _TOO_DEEP:
        raise InputError(f"{path} holds {_TOO_DEEP[mode]}; allowed: 8-bit or 16-bit grey values or colours")
    if len(sizes) > MOST_IMAGES:
        raise InputError(f"{path} holds more than {MOST_IMAGES} pages; allowed: at most {MOST_IMAGES}")
    other = next((number for number, size in enumerate(sizes, 1) if size != sizes[0]), None)
    if other is not None:
        shown = [f"{width} x {height}" for width, height in (sizes[other - 1], sizes[0])]
        raise InputError(
            f"{path}: page {other} has {shown[0]} pixels, the first {shown[1]}; allowed: pages of one size"
        )
    turned = _ORIENTATIONS.get(orientation or 1, (False, False, False))
    return Header(sizes[0], Display(1.0, *turned), densities, len(sizes), is_tiff)


def _sizes(image: Any) -> Iterator[tuple[int, int]]:
    """Widths and heights of an image's pages as stored."""
    if image.format != "TIFF":
        yield image.size
        return
    for page in range(MOST_IMAGES + 1):
        try:
            image.seek(page)
        except EOFError:
            image.seek(0)
            return
        yield image.tag_v2[256], image.tag_v2[257]  # Pillow's `size` is turned by the file's tag


def _densities(image: Any) -> tuple[float, float, bool]:
    """Pixels per length across and down as an image states them, 1 where it does not, and whether without a unit."""
    bare = image.info.get("aspect")  # of PNG
    if bare is None and image.info.get("jfif_unit") == 0:
        bare = image.info.get("jfif_density")
    across, down = bare or image.info.get("dpi", (1.0, 1.0))
    return float(across), float(down), bare is not None
