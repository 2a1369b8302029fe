"""Images of one camera in their order: files of a folder, or pages of one TIFF file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from spirillum.errors import InputError
from spirillum.files.limits import MOST_IMAGES
from spirillum.vision.flag import Flag
from spirillum.vision.video.display import Display, display_flags, stated_aspect
from spirillum.vision.video.pictures import IMAGES, Header, bits_of, eight_bit, read_header, read_image, read_pages
from spirillum.vision.video.streams import VIDEO, stated_size

_FEW = 10
"""First images, whose usual size is that of all; and images spread over all, whose brightest value is."""


@dataclass(frozen=True)
class ImageSequence:
    """Images that are read one by one."""

    files: tuple[Path, ...]
    """The files of the images, or the one whose pages they are."""
    pages: int
    """Number of pages; 0 where each image is a file."""
    numbers: tuple[int, ...] = field(repr=False)
    """Numbers of the images from 0, counted as they were recorded."""
    display: Display
    """How the images are shown."""
    header: Header = field(repr=False)
    """What the first image states."""
    bits: int
    """Number of bits that their values fill."""
    flags: tuple[Flag, ...] = ()
    """What was done to them."""

    def __len__(self) -> int:
        """Number of images."""
        return len(self.numbers)

    def name(self, index: int) -> str:
        """Name of an image in a sentence."""
        return f"page {index + 1} of {self.files[0].name}" if self.pages else self.files[index].name

    def read(self, index: int) -> np.ndarray | None:
        """An image as it is shown, 8-bit RGB, (height, width, 3); None where it cannot be read."""
        return next(self.read_from(index, 1))

    def read_from(self, index: int, batch: int) -> Iterator[np.ndarray | None]:
        """The images from one on, as `read` gives them."""
        if self.pages:
            for start in range(index, self.pages, batch):
                count = min(batch, self.pages - start)
                yield from map(self._shown, read_pages(self.files[0], self.header, start, count))
            return
        for path in islice(self.files, index, None):
            picture = _readable(path, self.display)
            if picture is not None:
                _check_same_size(path, picture.shape[1::-1], self.header.size)
            yield self._shown(picture)

    def _shown(self, picture: np.ndarray | None) -> np.ndarray | None:
        return None if picture is None else self.display.shown(eight_bit(picture, self.bits)[:, :, ::-1])


def image_folder(path: Path, aspect: float | None) -> ImageSequence:
    """The images of a folder in their natural order.

    Numbers at the end of the names count the images as they were recorded, if they rise in steps of which the smallest
    is 1: a number that is missing is an image that was dropped.
    """
    found = (entry for entry in path.iterdir() if entry.suffix.lower() in IMAGES and entry.is_file())
    files = [entry for entry in found if not entry.name.startswith(".")]
    if len(files) > MOST_IMAGES:
        raise InputError(f"{path} holds {len(files)} images; allowed: at most {MOST_IMAGES}")
    if not files:
        raise InputError(f"{path} holds no images; allowed: {VIDEO}")
    files.sort(key=lambda entry: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", entry.name)])
    first = [(name, picture) for name in files[:_FEW] if (picture := _readable(name)) is not None]
    if not first:
        read_image(files[0])  # says where it is no picture for its size, or of a kind that is not read
        raise InputError(f"{path}: {files[0].name} cannot be read as an image; allowed: {VIDEO}")
    stored = Counter(picture.shape[1::-1] for _, picture in first).most_common(1)[0][0]
    stated = ((name, stated_size(name)) for name in files)
    for name, size in (
        *((name, picture.shape[1::-1]) for name, picture in first),
        *((name, size) for name, size in stated if size is not None),
    ):
        _check_same_size(name, size, stored)
    header = read_header(first[0][0])
    assert header is not None  # noqa: S101 - it was read
    deep = any(picture.dtype == np.uint16 for _, picture in first)
    spread = [_readable(files[place]) for place in _spread(len(files))] if deep else []
    return _sequence(tuple(files), 0, _numbers(files), header, spread, first[0][0], aspect)


def image_stack(path: Path, aspect: float | None) -> ImageSequence:
    """The pages of a TIFF file."""
    header = read_header(path)
    spread = [] if header is None else [read_pages(path, header, place, 1)[0] for place in _spread(header.pages)]
    if header is None or all(picture is None for picture in spread):
        raise InputError(f"{path} cannot be read as a TIFF file; allowed: {VIDEO}")
    return _sequence((path,), header.pages, tuple(range(header.pages)), header, spread, path, aspect)


def _spread(count: int) -> list[int]:
    """Places of some images of all."""
    return [int(place) for place in np.unique(np.linspace(0, count - 1, min(count, _FEW)).round())]


def _sequence(
    files: tuple[Path, ...],
    pages: int,
    numbers: tuple[int, ...],
    header: Header,
    spread: list[np.ndarray | None],
    first: Path,
    aspect: float | None,
) -> ImageSequence:
    stated = header.aspect(first, aspect)
    display = header.display._replace(aspect=stated_aspect(str(first), stated, aspect))
    deep = [picture for picture in spread if picture is not None and picture.dtype == np.uint16]
    bits = max(map(bits_of, deep), default=8)
    flags = display_flags(display, header.size, stated, aspect)
    if deep:
        sentence = (
            f"16-bit images whose values fill {bits} bits (by {len(deep)} of them) are measured in 8 bits: "
            f"{2**bits - 1} and more is white"
        )
        flags.append(Flag("sixteen-bit-images", sentence))
    return ImageSequence(files, pages, numbers, display, header, bits, tuple(flags))


def _numbers(files: list[Path]) -> tuple[int, ...]:
    """Numbers of images from 0, by the ends of their names where these count them."""
    ends = [re.findall(r"\d+", entry.stem)[-1:] for entry in files]
    numbers = np.array([int(end[0]) for end in ends]) if all(ends) else np.arange(len(files))
    steps = np.diff(numbers)
    if len(files) > 1 and (steps.min() != 1 or steps.max() > 1e6):
        numbers = np.arange(len(files))
    return tuple(int(number - numbers[0]) for number in numbers)


def _check_same_size(image: Path, size: tuple[int, ...], expected: tuple[int, int]) -> None:
    """Pictures of one folder are of one camera, and of one part of what it sees: else no place can be compared."""
    if size != expected:
        raise InputError(
            f"{image} has {size[0]} x {size[1]} pixels, others in its folder {expected[0]} x {expected[1]}; allowed: "
            "images of one size"
        )


def _readable(path: Path, display: Display | None = None) -> np.ndarray | None:
    """An image as it is stored; None where it cannot be read."""
    try:
        return read_image(path, display=display)
    except InputError:
        return None
