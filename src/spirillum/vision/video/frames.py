"""Pictures of a video with the times at which they were taken: from a film, or from a folder of images."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.errors import InputError
from spirillum.extras import required
from spirillum.files import checked_path, opened
from spirillum.files.limits import MOST_IMAGES, MOST_PIXELS, SMALLEST_SIDE
from spirillum.vision.flag import Flag
from spirillum.vision.video.pictures import read_image, reduced
from spirillum.vision.video.provenance import one_line, stated_size, words_of_images
from spirillum.vision.video.read_ahead import ahead

__all__ = ["FILMS", "PICTURES", "Frame", "Video", "converter", "open_video"]

FILMS = (".mp4", ".avi", ".mov", ".mkv", ".m4v", ".webm")
"""Endings of films."""
PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
"""Endings of images in a folder."""

_WHAT = "a film (mp4, avi, mov, mkv) or a folder of images (png, jpg, tif, bmp)"
_PURPOSE = "measuring a video"
_AHEAD, _FEWEST_AHEAD, _AHEAD_BYTES = 12, 2, 48_000_000
"""Most and fewest frames that wait between two threads, and the bytes that they may take between."""
_OPENING = {
    "protocol_whitelist": "file",
    "format_whitelist": "mov,mp4,m4a,3gp,3g2,mj2,avi,matroska,webm,mpeg,mpegts,mpegvideo,asf,flv,ogg,gif,dv,h264,hevc,"
    "wav,mp3",
    "max_streams": "100",
}
"""A film is one file: no playlist that opens other files, or asks a network for them."""
_SAME_RATE = 0.01
"""Relative difference from which on two rates are not the same."""
_FEW = 10
"""Images whose usual size is that of a folder's pictures."""
_NEAR = 10.0
"""Seconds that are rather decoded through than jumped over."""


@dataclass(frozen=True)
class Frame:
    """One picture."""

    index: int
    """Its number among those of the video, from 0."""
    time: float
    """When it was taken, s."""
    image: np.ndarray = field(repr=False)
    """8-bit RGB, (height, width, 3)."""
    _reduced: dict[int, np.ndarray] = field(default_factory=dict, init=False, repr=False, compare=False)

    def reduced(self, factor: int) -> np.ndarray:
        """The picture reduced by a whole factor; it is kept."""
        if factor not in self._reduced:
            self._reduced[factor] = reduced(self.image, factor)
        return self._reduced[factor]

    def small(self, factor: int) -> Frame:
        """The frame with its picture reduced by a whole factor in place of the full one."""
        return Frame(self.index, self.time, self.reduced(factor))


@dataclass
class Video:
    """A video that can be read any number of times."""

    path: Path
    """The film, or the folder."""
    size: tuple[int, int]
    """Width and height as shown, pixels."""
    duration: float | None
    """Length as the file states it, s; with a given rate, that of the frames that it states."""
    rate: float | None
    """Frames a second as the file states them, or as the setup gives them."""
    given_rate: float | None = None
    """Frames a second that replace a film's own time stamps."""
    images: tuple[Path, ...] = ()
    """The images of a folder, in their order."""
    numbers: tuple[int, ...] = ()
    """Their numbers, counted as they were recorded."""
    words: str = ""
    """What the file says of itself: title and comment of a film, texts in a folder's first image and its README."""
    flags: list[Flag] = field(default_factory=list)
    """What was found while reading."""

    @property
    def name(self) -> str:
        """Name of the film or folder."""
        return self.path.name

    @property
    def count(self) -> int | None:
        """Number of frames, about, where the file states it."""
        if self.images:
            return len(self.images)
        return round(self.duration * self.rate) if self.duration and self.rate else None

    @property
    def waiting(self) -> int:
        """Number of frames that may wait between two threads: few large ones."""
        return self.frames_within(_AHEAD_BYTES, _FEWEST_AHEAD, _AHEAD)

    def frames_within(self, size: int, fewest: int, most: int) -> int:
        """Number of frames of this video whose pictures take a number of bytes, between two limits."""
        return max(fewest, min(size // (3 * self.size[0] * self.size[1]), most))

    def frames(self, start: float = 0.0, end: float | None = None) -> Iterator[Frame]:
        """The frames from one time to another, decoded ahead by a thread of its own.

        Raises:
            InputError: if there is none, or the first cannot be read.
        """
        return ahead(self._read(start, end), self.waiting)

    def samples(self, times: Sequence[float]) -> list[Frame]:
        """The first frames at or after some rising times; fewer where the video has ended.

        Raises:
            InputError: if there is none at all.
        """
        if self.images:
            stamps = self._stamps()
            chosen = sorted({int(np.searchsorted(stamps, time - 1e-9)) for time in times})
            read = (self._image(index) for index in chosen if index < len(stamps))
            return [frame for frame in read if frame is not None]
        return self._film_samples(list(times))

    def _read(self, start: float, end: float | None) -> Iterator[Frame]:
        first = True
        for index, time, image in self._pictures() if self.images else self._film():
            if time < start - 1e-9:
                continue
            if end is not None and time > end + 1e-9:
                break
            picture = image()
            if picture is not None:
                first = False
                yield Frame(index, time, picture)
        if first:
            raise InputError(f"{self.path} has no frame {_between(start, end)}; allowed: {_WHAT}")

    def _pictures(self) -> Iterator[tuple[int, float, Any]]:
        for index, time in enumerate(self._stamps()):
            yield index, float(time), lambda index=index: (found := self._image(index)) and found.image

    def _stamps(self) -> np.ndarray:
        assert self.rate is not None  # noqa: S101 - open_video has seen to it
        return np.array(self.numbers, dtype=float) / self.rate

    def _image(self, index: int) -> Frame | None:
        picture = _read_image(self.images[index])
        if picture is None:
            self._note("unreadable-frames", f"{self.images[index].name} cannot be read: such images are left out")
            return None
        _check_same_size(self.images[index], picture.shape[1::-1], self.size)
        return Frame(index, float(self._stamps()[index]), picture)

    def _note(self, name: str, sentence: str) -> None:
        if all(flag.name != name for flag in self.flags):
            self.flags.append(Flag(name, sentence))

    def _film(self) -> Iterator[tuple[int, float, Any]]:
        """Index, time and a function that gives the picture, of every frame that can be decoded."""
        before, last, origin, rgb = None, None, None, converter()
        for index, frame in enumerate(self._decoded()):
            if (frame.width, frame.height)[:: _turn(frame)] != self.size:
                self._note("unreadable-frames", "the film changes its size on the way: frames of another are left out")
                continue
            if self.given_rate or frame.time is None:
                time = index / (self.rate or 30.0)
            else:
                origin = frame.time if origin is None else origin
                time = float(frame.time - origin)
            if last is not None and time <= last:
                self._note("unordered-times", "time stamps that do not rise were found: such frames are left out")
                continue
            before, last = last, time
            yield index, time, partial(rgb, frame)
        if before is not None and last is not None and self.duration:
            missing = self.duration - (2.0 * last - before)
            if missing > max(0.5, 0.02 * self.duration):
                self._ends_early(f"it ends at {last:.2f} s, {missing:.1f} s are missing")

    def _decoded(self) -> Iterator[Any]:
        """The film's frames until its end, or until it cannot be decoded any further.

        Raises:
            InputError: if not even the first can be decoded.
        """
        av = required("av", _PURPOSE, "video")
        count = 0
        with _opened(self.path) as container:
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            try:
                for frame in container.decode(stream):
                    count += 1
                    yield frame
            except (av.error.FFmpegError, ValueError) as error:
                if not count:
                    raise InputError(f"{self.path} cannot be decoded ({_short(error)}); allowed: {_WHAT}") from error
                self._ends_early(f"after {count} frames: {_short(error)}")

    def _ends_early(self, reason: str) -> None:
        self._note("video-ends-early", f"the video could not be read to its end ({reason}): what was read is kept")

    def _film_samples(self, times: list[float]) -> list[Frame]:
        if self.given_rate or not self.duration:  # its own time stamps do not count
            return self._some(self._passed(times))
        av = required("av", _PURPOSE, "video")
        found: list[Frame] = []
        with _opened(self.path) as container, suppress(av.error.FFmpegError, ValueError):  # what can be read has to do
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            decoded, now, origin, rgb = container.decode(stream), -1.0, None, converter()
            for wanted in times:
                if now >= wanted:
                    continue
                if origin is not None and wanted - now > _NEAR:
                    container.seek(int((wanted + origin) / stream.time_base), stream=stream)
                    decoded = container.decode(stream)
                for frame in decoded:
                    origin = frame.time if origin is None else origin
                    now = now if frame.time is None else frame.time - origin
                    if now >= wanted - 1e-9:
                        found.append(Frame(-1, float(now), rgb(frame)))
                        break
        return self._some([frame for frame in found if frame.image.shape[1::-1] == self.size])

    def _passed(self, times: list[float]) -> list[Frame]:
        """The first frames at or after some times, by reading all."""
        found: list[Frame] = []
        for index, time, image in self._film():
            if time >= times[len(found)] - 1e-9:
                found.append(Frame(index, time, image()))
                times = [*times[: len(found)], *(later for later in times[len(found) :] if later > time)]
            if len(found) == len(times):
                break
        return found

    def _some(self, found: list[Frame]) -> list[Frame]:
        if not found:
            raise InputError(f"{self.path} has no frame that can be decoded; allowed: {_WHAT}")
        return found


def open_video(path: str | Path, frames_per_second: float | None = None) -> Video:
    """Open a film, or a folder of images in their natural order.

    Numbers at the end of the images' names count the frames as they were recorded, if they rise in steps of which the
    smallest is 1: a number that is missing is a frame that was dropped.

    Args:
        path: the film or folder.
        frames_per_second: rate of a folder's images, or instead of a film's own time stamps.

    Raises:
        InputError: if it is missing, empty, not a video, has no pictures or an absurd size, or a folder has no rate.
    """
    path = checked_path(path, _WHAT)
    try:
        if path.is_dir():
            return _folder(path, frames_per_second)
        with opened(path, _WHAT, sys.maxsize) as stream:
            if not stream.read(1):
                raise InputError(f"{path} is empty; allowed: {_WHAT}")
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); allowed: {_WHAT}") from error
    return _film(path, frames_per_second)


def _film(path: Path, frames_per_second: float | None) -> Video:
    av = required("av", _PURPOSE, "video")
    with _opened(path) as container:
        if not container.streams.video:
            raise InputError(f"{path} has no pictures; allowed: {_WHAT}")
        stream = container.streams.video[0]
        if stream.codec_context is not None and stream.width and stream.height:
            _check_size(path, (stream.width, stream.height))
        try:
            frame = next(container.decode(stream), None)
        except (av.error.FFmpegError, ValueError) as error:
            raise InputError(f"{path} cannot be decoded ({_short(error)}); allowed: {_WHAT}") from error
        if frame is None:
            raise InputError(f"{path} has no frames; allowed: {_WHAT}")
        size = (frame.width, frame.height)[:: _turn(frame)]
        _check_size(path, size)
        duration = None
        if stream.duration is not None and stream.time_base is not None:
            duration = float(stream.duration * stream.time_base)
        elif container.duration is not None:
            duration = container.duration / av.time_base
        rate = frames_per_second or (float(stream.average_rate) if stream.average_rate else None)
        flags = _replaced(frames_per_second, float(stream.average_rate or 0.0))
        if frames_per_second:  # its own length is in its own times, which do not count
            duration = stream.frames / frames_per_second if stream.frames else None
        words = [str(container.metadata.get(key, "")) for key in ("title", "comment", "description")]
    return Video(path, size, duration, rate, frames_per_second, words=one_line(" ".join(words)), flags=flags)


def _replaced(given: float | None, own: float) -> list[Flag]:
    """That a rate which the setup gives stands in place of another one, as of a camera for slow motion."""
    if given is None or own == 0.0 or abs(given / own - 1.0) < _SAME_RATE:
        return []
    sentence = (
        f"camera.frames_per_second = {given:g} stands in place of the {own:.4g} frames a second that the film states: "
        "all speeds and rates follow it"
    )
    return [Flag("rate-replaced", sentence)]


def _folder(path: Path, frames_per_second: float | None) -> Video:
    pictures = (entry for entry in path.iterdir() if entry.suffix.lower() in PICTURES and entry.is_file())
    names = [entry for entry in pictures if not entry.name.startswith(".")]
    if len(names) > MOST_IMAGES:
        raise InputError(f"{path} holds {len(names)} images; allowed: at most {MOST_IMAGES}")
    if not names:
        raise InputError(f"{path} holds no images; allowed: {_WHAT}")
    if frames_per_second is None:
        raise InputError(
            f"camera.frames_per_second is missing, but {path} is a folder of images; allowed: their rate, 0.01 to 1e5"
        )
    names.sort(key=lambda entry: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", entry.name)])
    ends = [re.findall(r"\d+", entry.stem)[-1:] for entry in names]
    numbers = np.array([int(end[0]) for end in ends]) if all(ends) else np.arange(len(names))
    steps = np.diff(numbers)
    if len(names) > 1 and (steps.min() != 1 or steps.max() > 1e6):
        numbers = np.arange(len(names))
    first = [(name, picture.shape[1::-1]) for name in names[:_FEW] if (picture := _read_image(name)) is not None]
    if not first:
        read_image(names[0])  # says where it is no picture for its size
        raise InputError(f"{path}: {names[0].name} cannot be read as an image; allowed: {_WHAT}")
    width, height = Counter(size for _, size in first).most_common(1)[0][0]
    _check_size(path, (width, height))
    stated = ((name, stated_size(name)) for name in names)
    for name, size in (*first, *((name, size) for name, size in stated if size is not None)):
        _check_same_size(name, size, (width, height))
    counted = tuple(int(number - numbers[0]) for number in numbers)
    duration = (counted[-1] + 1) / frames_per_second
    return Video(
        path,
        (width, height),
        duration,
        frames_per_second,
        frames_per_second,
        tuple(names),
        counted,
        words_of_images(path, names[0]),
    )


def _opened(path: Path) -> Any:
    av = required("av", _PURPOSE, "video")
    try:
        return av.open(f"file:{path}", options=_OPENING, metadata_errors="replace")
    except (av.error.FFmpegError, ValueError, OSError) as error:
        raise InputError(f"{path} cannot be read as a film ({_short(error)}); allowed: {_WHAT}") from error


def _check_size(path: Path, size: tuple[int, int]) -> None:
    if min(size) < SMALLEST_SIDE or size[0] * size[1] > MOST_PIXELS:
        raise InputError(
            f"{path} has pictures of {size[0]} x {size[1]} pixels; allowed: sides of at least {SMALLEST_SIDE} and at "
            f"most {MOST_PIXELS // 1_000_000} million pixels"
        )


def _check_same_size(image: Path, size: tuple[int, ...], expected: tuple[int, int]) -> None:
    """Pictures of one folder are of one camera, and of one part of what it sees: else no place can be compared."""
    if size != expected:
        raise InputError(
            f"{image} has {size[0]} x {size[1]} pixels, others in its folder {expected[0]} x {expected[1]}; allowed: "
            "images of one size"
        )


def _read_image(path: Path) -> np.ndarray | None:
    try:
        picture = read_image(path)
    except InputError:
        return None
    return None if picture is None else np.ascontiguousarray(picture[:, :, ::-1])


def _quarters(frame: Any) -> int:
    """Quarter turns against the clock by which a phone's film has to be turned to stand upright."""
    return round(getattr(frame, "rotation", 0) / 90.0) % 4


def _turn(frame: Any) -> int:
    """Step through (width, height) that gives them as shown."""
    return -1 if _quarters(frame) % 2 else 1


def converter() -> Callable[[Any], np.ndarray]:
    """A function that gives a decoded frame's picture, for one thread: what converts is set up once, not every time."""
    av = required("av", _PURPOSE, "video")
    reformatter = av.video.reformatter.VideoReformatter()

    def rgb(frame: Any) -> np.ndarray:
        picture: np.ndarray = reformatter.reformat(frame, format="rgb24").to_ndarray()
        quarters = _quarters(frame)
        return np.ascontiguousarray(np.rot90(picture, quarters)) if quarters else picture

    return rgb


def _between(start: float, end: float | None) -> str:
    return f"from {start:g} s on" if end is None else f"from {start:g} s to {end:g} s"


def _short(error: BaseException) -> str:
    return str(getattr(error, "strerror", None) or error)[:120]
