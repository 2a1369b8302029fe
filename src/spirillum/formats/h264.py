"""Frames encoded as H.264 in an MP4 file by PyAV, with time stamps and declared colours (BT.709)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.errors import InputError
from spirillum.kernels.core import film_colours
from spirillum.optional_dependencies import import_optional

ENCODERS = ("libx264", "libopenh264", "h264")  #: Encoders of H.264, best first, as far as the build of PyAV has them.
_BT709 = 1
_LIMITED_RANGE = 1


class H264Writer:
    """Takes the frames of a film, one after the other."""

    def __init__(self, av: Any, container: Any, stream: Any) -> None:
        """Take an open file; `h264_writer` makes it."""
        self._av, self._container, self._stream = av, container, stream
        self._next = 0
        self._colours = np.empty((3 * stream.height // 2, stream.width), dtype=np.uint8)

    def add(self, image: np.ndarray, number: int | None = None) -> None:
        """Append a frame of sRGB bytes; its number, in ticks, is later than that before, or None: the next tick."""
        size = 2 * len(self._colours) // 3, self._colours.shape[1], 3
        if image.shape != size:
            raise ValueError(f"a frame of shape {image.shape} in a film of frames of shape {size}")
        film_colours(image, self._colours)
        frame = self._av.VideoFrame.from_ndarray(self._colours, format="yuv420p")
        frame.colorspace, frame.color_range = _BT709, _LIMITED_RANGE
        frame.pts = self._next if number is None else number
        frame.time_base = self._stream.codec_context.time_base
        self._next = frame.pts + 1
        self._container.mux(self._stream.encode(frame))

    def finish(self) -> None:
        """Flush the encoder."""
        self._container.mux(self._stream.encode(None))


@contextmanager
def h264_writer(
    path: Path,
    size: tuple[int, int],
    rate: Fraction,
    tags: Mapping[str, str],
    *,
    quality: Mapping[str, str],
    instead: str,
    extra: str,
    tick: Fraction | None = None,
    threads: int = 0,
    encoders: Sequence[str] = ENCODERS,
) -> Iterator[H264Writer]:
    """A writer of an MP4 file; the file is complete when the block ends."""
    av = import_optional("av", "a film", extra)
    av.logging.set_level(None)
    name = next((name for name in encoders if _is_there(av, name)), None)
    if name is None:
        missing = " or ".join(encoders)
        raise InputError(f"{path.name} cannot be encoded: PyAV has no {missing} for H.264 here; allowed: {instead}")
    with av.open(f"file:{path}", "w", format="mp4", options={"movflags": "+faststart"}) as container:
        container.metadata.update(tags)
        stream = container.add_stream(name, rate=rate, options=dict(quality) if name == "libx264" else {})
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        context = stream.codec_context
        context.thread_count = threads
        context.time_base = tick or 1 / rate
        context.colorspace = context.color_primaries = context.color_trc = _BT709
        context.color_range = _LIMITED_RANGE
        writer = H264Writer(av, container, stream)
        yield writer
        writer.finish()


def _is_there(av: Any, name: str) -> bool:
    try:
        av.codec.Codec(name, "w")
    except (ValueError, OSError):
        return False
    return True
