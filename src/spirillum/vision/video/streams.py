"""The video stream of a video's file, and how long the file states it to be."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from spirillum.errors import InputError
from spirillum.files import opened, read_bytes
from spirillum.files.limits import LARGEST_PICTURE
from spirillum.optional_dependencies import import_optional
from spirillum.vision.flag import Flag

VIDEO = "a film (mp4, avi, mov, mkv, webm), a TIFF file of several pages, or a folder of images (png, jpg, tif, bmp)"
"""What a video may be, for sentences."""
_OPENING = {
    "protocol_whitelist": "file",
    "format_whitelist": "mov,mp4,m4a,3gp,3g2,mj2,avi,matroska,webm,mpeg,mpegts,mpegvideo,asf,flv,ogg,gif,dv,h264,hevc,"
    "wav,mp3",
    "max_streams": "100",
}
"""A video is one file: no playlist that opens other files, or asks a network for them."""
_FEW = 2
"""Frames of a stream that is a picture, not a video."""
_NEAR = 0.02
"""Least part of a video that is said to be missing."""
_LOOSE = 0.5
"""Least part of a video that is said to be missing where its length is that of the whole file, with sound, s."""


class Stated(NamedTuple):
    """Length of a video as its file states it."""

    duration: float | None
    """Length in time, s."""
    frames: int
    """Number of frames; 0 where it is not stated."""
    tolerance: float
    """By how much a video that is read to its end may fall short of that length, s."""


UNSTATED = Stated(None, 0, _LOOSE)
"""Length of a video whose file states none."""


def open_container(path: Path) -> Any:
    """A video's file, opened by PyAV."""
    av = import_optional("av", "measuring a video", "video")
    try:
        return av.open(f"file:{path}", options=_OPENING, metadata_errors="replace")
    except (av.error.FFmpegError, ValueError, OSError) as error:
        raise InputError(f"{path} cannot be read as a film ({short_reason(error)}); allowed: {VIDEO}") from error


def film_stream(container: Any) -> tuple[Any, list[Flag]]:
    """The longest stream of pictures that is no thumbnail, and a flag where several are videos.

    Of streams that are about as long, the largest pictures are taken, else the first.
    """
    av = import_optional("av", "measuring a video", "video")
    attached = av.stream.Disposition.attached_pic
    streams = list(container.streams.video)
    films = [one for one in streams if not one.disposition & attached and not 0 < one.frames < _FEW] or streams
    lengths = {one.index: stated_length(container, one).duration or 0.0 for one in films}
    longest = max(lengths.values())
    whole = [one for one in films if lengths[one.index] >= (1.0 - _NEAR) * longest]
    chosen = max(whole, key=lambda one: (_area(one), -one.index))
    if len(films) == 1:
        return chosen, []
    known = [one for one in films if _area(one)]
    told = ", ".join(f"{one.index} ({one.width} x {one.height}, {lengths[one.index]:.3g} s)" for one in known)
    sentence = (
        f"the file holds {len(films)} films, in streams {told}: stream {chosen.index} is measured; to measure another, "
        "write it to a file of its own"
    )
    return chosen, [Flag("several-films", sentence)]


def _area(stream: Any) -> int:
    """Pixels of a stream's pictures; 0 where no decoder knows them."""
    return (getattr(stream, "width", 0) or 0) * (getattr(stream, "height", 0) or 0)


def frame_clock(container: Any, stream: Any) -> Callable[[Any], float | None]:
    """A function that gives the time of each decoded frame in turn, s; None where nothing states it.

    AVI numbers the frames as they are stored. Where codecs store them in another order than they are shown (B frames),
    these numbers rise with the decoder's time stamps alone.
    """
    if container.format.name != "avi":
        return lambda frame: frame.time
    step, last = 1.0 / float(stream.average_rate or 30.0), math.nan

    def time_of(frame: Any) -> float | None:
        nonlocal last
        if frame.dts is not None:
            last = float(frame.dts * stream.time_base)
        else:  # the last frames leave the decoder without one
            last = frame.time if math.isnan(last) else last + step
        return last

    return time_of


def stated_length(container: Any, stream: Any) -> Stated:
    """How long a video is by what its file states of it.

    AVI states frames; its length in time is FFmpeg's guess where the file is cut off.
    """
    av = import_optional("av", "measuring a video", "video")
    rate = float(stream.average_rate or 0.0)
    tight = 3.0 / rate if rate else _LOOSE
    if container.format.name == "avi" and stream.frames and rate:
        return Stated(stream.frames / rate, stream.frames, tight)
    if stream.duration is not None and stream.time_base is not None:
        return Stated(float(stream.duration * stream.time_base), stream.frames, tight)
    if (tagged := _seconds(stream.metadata.get("DURATION", ""))) is not None:
        return Stated(tagged, stream.frames, tight)
    if container.duration is not None:
        return Stated(container.duration / av.time_base, stream.frames, _LOOSE)
    return UNSTATED._replace(frames=stream.frames)


def _seconds(tag: str) -> float | None:
    """Seconds of Matroska's `HH:MM:SS.fraction`; None for other texts."""
    parts = tag.split(":")
    try:
        hours, minutes, seconds = (float(part) for part in parts)
    except ValueError:
        return None
    return 3600.0 * hours + 60.0 * minutes + seconds


def short_reason(error: BaseException) -> str:
    """What a library says of an error, shortened."""
    return str(getattr(error, "strerror", None) or error)[:120]


_MOST_WORDS = 2000


def words_of_images(folder: Path, image: Path) -> str:
    """Texts in a PNG file, and of a README in its folder or beside it."""
    found = []
    if image.suffix.lower() == ".png":
        data = read_bytes(image, "an image", LARGEST_PICTURE)
        at = 8
        while at + 8 <= len(data):
            length, kind = int.from_bytes(data[at : at + 4], "big"), data[at + 4 : at + 8]
            if kind in (b"tEXt", b"iTXt"):
                found.append(data[at + 8 : at + 8 + min(length, _MOST_WORDS)].decode("utf-8", "replace"))
            at += 12 + length
    for place in (folder, folder.parent):
        for name in ("README", "README.txt", "README.md"):
            with suppress(InputError), opened(place / name, "a text", sys.maxsize) as file:
                found.append(file.read(_MOST_WORDS).decode("utf-8", "replace"))
    return one_line(" ".join(found))


def stated_size(image: Path) -> tuple[int, int] | None:
    """Width and height that a PNG file states at its start, pixels; None for any other file."""
    with suppress(InputError), opened(image, "an image", LARGEST_PICTURE) as file:
        start = file.read(24)
        if start[:8] == b"\x89PNG\r\n\x1a\n" and start[12:16] == b"IHDR" and len(start) == 24:
            return int.from_bytes(start[16:20], "big"), int.from_bytes(start[20:24], "big")
    return None


def one_line(text: str) -> str:
    """A text of a user's file in one line."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())[:_MOST_WORDS]
