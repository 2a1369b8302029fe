"""Frames into a film at an even pace: MP4 (H.264), or GIF."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from spirillum.formats.h264 import h264_writer

FILMS = {".mp4": "a film", ".gif": "a film"}
"""Endings of the films that can be written, for `output_target`."""
_PALETTE_FRAMES = 9
_QUALITY = {"crf": "18", "preset": "veryfast"}


class Writer(Protocol):
    """Takes the frames of a film, one after the other."""

    def add(self, image: np.ndarray) -> None:
        """Append a frame, (height, width, 3) sRGB bytes."""


def film_writer(path: Path, size: tuple[int, int], fps: int, words: dict[str, str]) -> AbstractContextManager[Writer]:
    """A writer for frames of one size; the file is complete when the block ends."""
    if path.suffix == ".gif":
        return _gif(path, fps, words)
    return h264_writer(path, size, Fraction(fps), words, quality=_QUALITY, instead="a .gif", extra="3d")


class _Gif:
    def __init__(self, fps: int) -> None:
        self._fps = fps
        self._frames: list[bytes] = []
        self._shape: tuple[int, ...] = ()

    def add(self, image: np.ndarray) -> None:
        """Keep a frame, compressed: the colours of the film are chosen when all of it is known."""
        self._shape = image.shape
        self._frames.append(zlib.compress(np.ascontiguousarray(image).tobytes(), 1))

    def _image(self, number: int) -> np.ndarray:
        return np.frombuffer(zlib.decompress(self._frames[number]), dtype=np.uint8).reshape(self._shape)

    def pictures(self) -> Iterator[Any]:
        """The frames in at most 256 colours, those of frames from all over the film."""
        from PIL import Image

        chosen = np.unique(np.linspace(0, len(self._frames) - 1, _PALETTE_FRAMES).astype(int))
        several = Image.fromarray(np.concatenate([self._image(int(number)) for number in chosen]))
        # Frequent colours for the shades of glass and body, far ones for the stripes.
        parts = ((160, Image.Quantize.MEDIANCUT), (95, Image.Quantize.MAXCOVERAGE))
        colours = [value for count, method in parts for value in (several.quantize(count, method).getpalette() or [])]
        palette = Image.new("P", (1, 1))
        palette.putpalette([255, 255, 255, *colours])
        for number in range(len(self._frames)):
            frame = Image.fromarray(self._image(number))
            yield frame.quantize(palette=palette, dither=Image.Dither.NONE)

    def durations(self) -> list[int]:
        """Time of each frame, ms: whole hundredths of a second, as the format wants, that add up to the film's."""
        ends = np.round(100.0 * np.arange(len(self._frames) + 1) / self._fps).astype(int)
        return [int(10 * step) for step in np.diff(ends)]


@contextmanager
def _gif(path: Path, fps: int, words: dict[str, str]) -> Iterator[Writer]:
    writer = _Gif(fps)
    yield writer
    pictures = writer.pictures()
    next(pictures).save(
        path,
        format="gif",
        save_all=True,
        append_images=pictures,
        duration=writer.durations(),
        loop=0,
        optimize=False,
        comment=" ".join(words.values()).encode("ascii", "replace"),
    )
