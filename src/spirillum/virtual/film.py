"""Frames into a video with their true times: MP4 (H.264), or a folder of PNG files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Protocol

import numpy as np

from spirillum.errors import InputError
from spirillum.files import MARK, check_replaceable, holds_own_only, output_target, whole_file, whole_folder
from spirillum.formats.h264 import h264_writer

__all__ = ["FrameWriter", "video_target", "video_writer"]

_QUALITY = {"preset": "veryfast", "x264-params": "mbtree=0"}
"""With `mbtree`, small pictures now and then gave different bytes from equal frames."""
_THREADS = 2
"""Threads of the encoder, a fixed number, so that a seed determines the bytes."""


class FrameWriter(Protocol):
    """Takes frames, one after the other."""

    def add(self, image: np.ndarray, number: int) -> None:
        """Append a frame, (height, width, 3) sRGB bytes, that was recorded as this number, counted from 0."""


def video_target(path: str | Path) -> Path:
    """The video to write, or the folder for its frames.

    Raises:
        InputError: if it has another ending, or cannot be written.
    """
    path = Path(path)
    if path.suffix:
        return output_target(path, {".mp4": "a video, or a folder without an ending"}, "trial.mp4")
    if not path.parent.is_dir():
        raise InputError(f"{path} cannot be written (no such folder); allowed: a folder you may write to")
    if not path.is_dir():
        check_replaceable(path)
    if path.exists() and not (path.is_dir() and holds_own_only(path)):
        raise InputError(f"{path} is there and not empty; allowed: a new folder for the frames, or a .mp4")
    return path


@contextmanager
def video_writer(
    target: Path, size: tuple[int, int], fps: float, crf: int, tags: Mapping[str, str]
) -> Iterator[FrameWriter]:
    """A writer of a video; it appears, complete, when the block ends.

    Args:
        target: an MP4 file, or a new or empty folder for PNG files that are named by the frames' numbers.
        size: width and height, even numbers.
        fps: frames a second; frames that are left out leave gaps in the time stamps.
        crf: constant rate factor.
        tags: of the file, or of every PNG file.

    Raises:
        InputError: if it cannot be written, or PyAV is missing or has no libx264.
    """
    if target.suffix != ".mp4":
        with _png_writer(target, tags) as pngs:
            yield pngs
        return
    with (
        whole_file(target) as temporary,
        h264_writer(
            temporary,
            size,
            Fraction(fps).limit_denominator(1001),
            tags,
            quality=_QUALITY | {"crf": str(crf)},
            threads=_THREADS,
            encoders=("libx264",),  # others know no constant rate factor
            instead="a folder of PNG files",
            extra="video",
        ) as writer,
    ):
        yield writer


class _Pngs:
    """Writes frames as PNG files into a folder."""

    def __init__(self, folder: Path, tags: Mapping[str, str]) -> None:
        self._folder, self._tags = folder, tags

    def add(self, image: np.ndarray, number: int) -> None:
        """Write a frame under its number."""
        from PIL import Image, PngImagePlugin

        info = PngImagePlugin.PngInfo()
        info.add_text("Software", MARK)
        for name, text in self._tags.items():
            info.add_itxt(name.capitalize(), text)
        Image.fromarray(image).save(self._folder / f"{number:05d}.png", compress_level=1, pnginfo=info)


@contextmanager
def _png_writer(folder: Path, tags: Mapping[str, str]) -> Iterator[FrameWriter]:
    with whole_folder(folder) as part:
        yield _Pngs(part, tags)
