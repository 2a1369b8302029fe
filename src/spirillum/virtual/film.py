"""Frames into a video with their true times: MP4 (H.264), or a folder of PNG files."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Protocol

import numpy as np

from spirillum.errors import InputError
from spirillum.formats.h264 import h264_writer

__all__ = ["FrameWriter", "mp4_writer", "png_writer"]

_QUALITY = {"preset": "veryfast", "x264-params": "mbtree=0"}
"""With `mbtree` small pictures gave now and then other bytes from the same frames."""
_THREADS = 2
"""Threads of the encoder, always as many: the same seed is to give the same bytes."""


class FrameWriter(Protocol):
    """Takes frames, one after the other."""

    def add(self, image: np.ndarray, number: int) -> None:
        """Append a frame, (height, width, 3) sRGB bytes, that was recorded as this number, counted from 0."""


def mp4_writer(
    path: Path, size: tuple[int, int], fps: Fraction, crf: int, words: dict[str, str]
) -> AbstractContextManager[FrameWriter]:
    """A writer of an MP4 file; it is complete when the block ends.

    Args:
        path: the file.
        size: width and height, even numbers.
        fps: frames a second; frames that are left out leave gaps in the time stamps.
        crf: constant rate factor.
        words: tags of the file.

    Raises:
        InputError: if PyAV is missing or has no libx264.
    """
    return h264_writer(
        path,
        size,
        fps,
        words,
        quality=_QUALITY | {"crf": str(crf)},
        threads=_THREADS,
        encoders=("libx264",),  # others know no constant rate factor
        instead="a folder of PNG files",
        extra="video",
    )


class _Pngs:
    def __init__(self, folder: Path, words: dict[str, str]) -> None:
        self._folder, self._words = folder, words

    def add(self, image: np.ndarray, number: int) -> None:
        """Write a frame under its number."""
        from PIL import Image, PngImagePlugin

        facts = PngImagePlugin.PngInfo()
        for name, text in self._words.items():
            facts.add_itxt(name.capitalize(), text)
        Image.fromarray(image).save(self._folder / f"{number:05d}.png", compress_level=1, pnginfo=facts)


@contextmanager
def png_writer(folder: Path, words: dict[str, str]) -> Iterator[FrameWriter]:
    """A writer of PNG files named by the frames' numbers, in a folder that appears when the block ends.

    Args:
        folder: the folder, new or empty.
        words: tags of the files.

    Raises:
        InputError: if it cannot be written.
    """
    part = folder.parent / f".{folder.name}.part"
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.mkdir()
    except OSError as error:
        why = error.strerror
        raise InputError(f"{folder} cannot be written ({why}); allowed: a folder you may write to") from error
    try:
        yield _Pngs(part, words)
        if folder.exists():
            folder.rmdir()
        part.replace(folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)
