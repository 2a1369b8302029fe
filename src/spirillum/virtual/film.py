"""Frames into a video with their true times: MP4 (H.264) by PyAV, or a folder of PNG files."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from spirillum.errors import InputError
from spirillum.extras import required

__all__ = ["FrameWriter", "mp4_writer", "png_writer"]

_BT709 = 1
_QUALITY = {"preset": "veryfast", "x264-params": "mbtree=0"}
"""With `mbtree` small pictures gave now and then other bytes from the same frames."""
_THREADS = 2
"""Threads of the encoder: their number changes the bytes, so that it is always the same."""


class FrameWriter(Protocol):
    """Takes frames, one after the other."""

    def add(self, image: np.ndarray, number: int) -> None:
        """Append a frame, (height, width, 3) sRGB bytes, that was recorded as this number, counted from 0."""


class _Mp4:
    def __init__(self, av: Any, container: Any, stream: Any) -> None:
        self._av, self._container, self._stream = av, container, stream

    def add(self, image: np.ndarray, number: int) -> None:
        """Append a frame at its time."""
        frame = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
        frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709")
        frame.pts, frame.time_base = number, self._stream.codec_context.time_base
        self._container.mux(self._stream.encode(frame))

    def finish(self) -> None:
        """Write what is still in the encoder."""
        self._container.mux(self._stream.encode(None))


@contextmanager
def mp4_writer(
    path: Path, size: tuple[int, int], fps: Fraction, crf: int, words: dict[str, str]
) -> Iterator[FrameWriter]:
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
    av = required("av", "a video", "video")
    av.logging.set_level(None)
    container = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
    try:
        container.metadata.update(words)
        try:
            stream = container.add_stream("libx264", rate=fps, options=_QUALITY | {"crf": str(crf)})
        except (ValueError, OSError) as error:
            raise InputError(
                f"{path.name} cannot be encoded: PyAV has no libx264 here; allowed: a folder of PNG files"
            ) from error
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        context = stream.codec_context
        context.thread_count = _THREADS
        context.time_base = 1 / fps
        context.colorspace = context.color_primaries = context.color_trc = context.color_range = _BT709
        writer = _Mp4(av, container, stream)
        yield writer
        writer.finish()
    finally:
        container.close()


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
