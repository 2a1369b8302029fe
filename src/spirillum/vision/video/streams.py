"""Sources of pictures: the stream of a video file, and ordered images of a folder or a TIFF file."""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spirillum.errors import InputError
from spirillum.files import opened, read_bytes
from spirillum.files.limits import LARGEST_PICTURE, MOST_IMAGES
from spirillum.optional_dependencies import import_optional
from spirillum.vision.flag import Flag
from spirillum.vision.video.display import Display, display_flags, stated_aspect
from spirillum.vision.video.pictures import IMAGES, Header, bits_of, eight_bit, read_header, read_image, read_pages

VIDEO = "a film (mp4, avi, mov, mkv, webm), a TIFF file of several pages, or a folder of images (png, jpg, tif, bmp)"
"""What a video may be, for sentences."""
_OPENING = {
    "protocol_whitelist": "file",
    "format_whitelist": "mov,mp4,m4a,3gp,3g2,mj2,avi,matroska,webm,mpeg,mpegts,mpegvideo,asf,flv,ogg,gif,dv,h264,hevc,"
    "wav,mp3",
    "max_streams": "100",
}
"""A video is one file: no playlist that opens other files, or asks a network for them."""
_FEW = 2  # frames of a stream that is a picture, not a video
_NEAR = 0.02  # least part of a video that is flagged as missing
_LOOSE = 0.5  # least missing part that is flagged where a video's length is that of the whole file, with sound, s


class Stated(NamedTuple):
    """Length of a video as its file states it."""

    duration: float | None  #: Length in time, s.
    frames: int  #: Number of frames; 0 where it is not stated.
    tolerance: float  #: By how much a video that is read to its end may fall short of that length, s.


UNSTATED = Stated(None, 0, _LOOSE)  #: Length of a video whose file states none.


def open_container(path: Path) -> Any:
    """A video's file, opened by PyAV."""
    av = import_optional("av", "measuring a video", "video")
    before_19 = int(av.__version__.partition(".")[0]) < 19  # from there on it decodes metadata of any encoding
    more = {"metadata_errors": "replace"} if before_19 else {}
    try:
        return av.open(f"file:{path}", options=_OPENING, **more)
    except (av.error.FFmpegError, ValueError, OSError) as error:
        raise InputError(f"{path} cannot be read as a film ({short_reason(error)}); allowed: {VIDEO}") from error


def main_video_stream(container: Any) -> tuple[Any, list[Flag]]:
    """The longest stream of pictures that is no thumbnail, and a flag where several are videos."""
    # Of streams that are about as long, the largest pictures are taken, else the first.
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
    return chosen, [Flag.named("several-films", count=len(films), streams=told, chosen=chosen.index)]


def _area(stream: Any) -> int:
    """Pixels of a stream's pictures; 0 where no decoder knows them."""
    return (getattr(stream, "width", 0) or 0) * (getattr(stream, "height", 0) or 0)


def frame_clock(container: Any, stream: Any) -> Callable[[Any], float | None]:
    """A function that gives the time of each decoded frame in turn, s; None where nothing states it."""
    # AVI numbers the frames as they are stored. Where codecs store them in another order than they are shown (B
    # frames), these numbers rise with the decoder's time stamps alone.
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
    """How long a video is by what its file states of it."""
    # AVI states frames; its length in time is FFmpeg's guess where the file is cut off.
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
    """A library's message of an error, shortened."""
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


_SAMPLED_IMAGES = 10  # first images, whose usual size is that of all; images spread over all, whose brightest value is


@dataclass(frozen=True)
class ImageSequence:
    """Images that are read one by one."""

    files: tuple[Path, ...]  #: The files of the images, or the one whose pages they are.
    pages: int  #: Number of pages; 0 where each image is a file.
    numbers: tuple[int, ...] = field(repr=False)  #: Numbers of the images from 0, counted as they were recorded.
    display: Display  #: How the images are shown.
    header: Header = field(repr=False)  #: What the first image states.
    bits: int  #: Number of bits that their values fill.
    flags: tuple[Flag, ...] = ()  #: What was done to them.

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
        return None if picture is None else self.display.display_picture(eight_bit(picture, self.bits)[:, :, ::-1])


def image_folder(path: Path, aspect: float | None) -> ImageSequence:
    """The images of a folder in their natural order."""
    # Numbers at the end of the names count the images as they were recorded, if they rise in steps of which the
    # smallest is 1: a number that is missing is an image that was dropped.
    found = (entry for entry in path.iterdir() if entry.suffix.lower() in IMAGES and entry.is_file())
    files = [entry for entry in found if not entry.name.startswith(".")]
    if len(files) > MOST_IMAGES:
        raise InputError(f"{path} holds {len(files)} images; allowed: at most {MOST_IMAGES}")
    if not files:
        raise InputError(f"{path} holds no images; allowed: {VIDEO}")
    files.sort(key=lambda entry: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", entry.name)])
    first = [(name, picture) for name in files[:_SAMPLED_IMAGES] if (picture := _readable(name)) is not None]
    if not first:
        read_image(files[0])  # raises where it is no picture for its size, or of a kind that is not read
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
    return [int(place) for place in np.unique(np.linspace(0, count - 1, min(count, _SAMPLED_IMAGES)).round())]


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
        flags.append(Flag.named("sixteen-bit-images", bits=bits, count=len(deep), most=2**bits - 1))
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
