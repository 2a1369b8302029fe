"""Pictures of a video with the times at which they were taken: from a video, or from a folder of images."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from queue import Full, Queue
from threading import Event, Thread
from typing import Any, TypeVar

import numpy as np

from spirillum.errors import InputError
from spirillum.files import checked_path, opened
from spirillum.files.limits import MOST_PIXELS, SMALLEST_SIDE
from spirillum.optional_dependencies import import_optional
from spirillum.vision.flag import Flag
from spirillum.vision.video.display import AS_STORED, Display, converter, display_flags, frame_display, stated_aspect
from spirillum.vision.video.pictures import STACKS, reduced
from spirillum.vision.video.streams import (
    UNSTATED,
    VIDEO,
    ImageSequence,
    Stated,
    frame_clock,
    image_folder,
    image_stack,
    main_video_stream,
    one_line,
    open_container,
    short_reason,
    stated_length,
    words_of_images,
)

T = TypeVar("T")


def ahead(items: Iterator[T], count: int) -> Iterator[T]:
    """Items of an iterable, taken by a thread of its own before they are requested."""
    queue: Queue[T | BaseException | None] = Queue(count)
    left = Event()

    def put(item: T | BaseException | None) -> None:
        while not left.is_set():
            with suppress(Full):
                queue.put(item, timeout=0.2)
                return

    def read() -> None:
        try:
            for item in items:
                put(item)
                if left.is_set():
                    return
            put(None)
        except BaseException as error:  # raised again in the thread that iterates
            put(error)

    thread = Thread(target=read, name="decoding", daemon=True)
    thread.start()
    try:
        while (item := queue.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        left.set()
        thread.join()


FILMS = (".mp4", ".avi", ".mov", ".mkv", ".m4v", ".webm")  #: Endings of videos.

_PURPOSE = "measuring a video"
_AHEAD, _FEWEST_AHEAD, _AHEAD_BYTES = 12, 2, 48_000_000
"""Most and fewest frames that wait between two threads, and the bytes that they may take between."""
_SAME_RATE = 0.01  # relative difference from which on two rates are not the same
_BATCH = 16  # most pages of a TIFF file that are decoded at a time
_FEW, _MISSING = 2, 0.02  # number and share of frames, and share of the length, that a video may lack of those stated
_NEAR = 10.0  # seconds that are rather decoded through than jumped over


@dataclass(frozen=True)
class Frame:
    """One picture."""

    index: int  #: Its number among those of the video, from 0.
    time: float  #: When it was taken, s.
    image: np.ndarray = field(repr=False)  #: 8-bit RGB, (height, width, 3).
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

    path: Path  #: The video, or the folder.
    size: tuple[int, int]  #: Width and height as shown, pixels.
    duration: float | None  #: Length as the file states it, s; with a given rate, that of the frames that it states.
    rate: float | None  #: Frames a second as the file states them, or as the setup gives them.
    given_rate: float | None = None  #: Frames a second that replace a video's own time stamps.
    images: ImageSequence | None = None  #: The images of a folder or stack; None for a video.
    display: Display = AS_STORED  #: How the stored pictures of a video or its images are shown.
    stated: Stated = UNSTATED  #: How long the file states a video to be.
    words: str = ""  #: Metadata of the file: title and comment of a video, texts of a folder's first image and README.
    flags: list[Flag] = field(default_factory=list)  #: What was found while reading.

    @property
    def stretch(self) -> tuple[float, float]:
        """Shown over stored pixels along the shown picture's rows and columns."""
        return self.display.stretch(self.display.stored(self.size))

    @property
    def name(self) -> str:
        """Name of the video or folder."""
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
        """The frames from one time to another, decoded ahead by a thread of its own."""
        return ahead(self._read(start, end), self.waiting)

    def samples(self, times: Sequence[float]) -> list[Frame]:
        """The first frames at or after some rising times; fewer where the video has ended."""
        if self.images is not None:
            stamps = self._stamps()
            chosen = sorted({int(np.searchsorted(stamps, time - 1e-9)) for time in times})
            pictures = ((index, self._noted(index, self.images.read(index))) for index in chosen if index < len(stamps))
            return [Frame(index, float(stamps[index]), one) for index, one in pictures if one is not None]
        return self._film_samples(list(times))

    def _read(self, start: float, end: float | None) -> Iterator[Frame]:
        first = True
        for index, time, image in self._film() if self.images is None else self._pictures(start):
            if time < start - 1e-9:
                continue
            if end is not None and time > end + 1e-9:
                break
            picture = image()
            if picture is not None:
                first = False
                yield Frame(index, time, picture)
        if first:
            until = "on" if end is None else f"to {end:g} s"
            raise InputError(f"{self.path} has no frame from {start:g} s {until}; allowed: {VIDEO}")

    def _pictures(self, start: float) -> Iterator[tuple[int, float, Any]]:
        assert self.images is not None  # noqa: S101 - checked by the caller
        stamps = self._stamps()
        first = int(np.searchsorted(stamps, start - 1e-9))
        read = self.images.read_from(first, self.frames_within(_AHEAD_BYTES, 1, _BATCH))
        for index, picture in enumerate(read, first):
            yield index, float(stamps[index]), partial(self._noted, index, picture)

    def _stamps(self) -> np.ndarray:
        assert self.images is not None and self.rate is not None  # noqa: S101, PT018 - open_video ensures it
        return np.array(self.images.numbers, dtype=float) / self.rate

    def _noted(self, index: int, picture: np.ndarray | None) -> np.ndarray | None:
        """An image, with a note where it could not be read."""
        if picture is None:
            assert self.images is not None  # noqa: S101
            self._note("image-unreadable", name=self.images.name(index))
        return picture

    def _note(self, name: str, /, **values: Any) -> None:
        flag = Flag.named(name, **values)
        if all(other.name != flag.name for other in self.flags):
            self.flags.append(flag)

    def _film(self) -> Iterator[tuple[int, float, Any]]:
        """Index, time and a function that gives the picture, of every frame that can be decoded."""
        before, last, origin, rgb = None, None, None, converter(self.display)
        index = -1
        for index, (frame, stamp) in enumerate(self._decoded()):
            if self.display.size((frame.width, frame.height)) != self.size:
                self._note("size-changes")
                continue
            if self.given_rate or stamp is None:
                time = index / (self.rate or 30.0)
            else:
                origin = stamp if origin is None else origin
                time = float(stamp - origin)
            if last is not None and time <= last:
                self._note("unordered-times")
                continue
            before, last = last, time
            yield index, time, partial(rgb, frame)
        if before is not None and last is not None:
            self._check_end(index + 1, last, last - before)

    def _check_end(self, frames: int, last: float, step: float) -> None:
        """Note what is missing of the length that the file states, in time or in frames."""
        duration, stated, tolerance = self.stated
        missing = 0.0 if duration is None else duration - (last + step)
        if duration is not None and missing > max(tolerance, _MISSING * duration):
            self._note("video-ends-early", reason=f"it ends at {last:.2f} s, {missing:.1f} s are missing")
        elif stated - frames > max(_FEW, _MISSING * stated):
            self._note("frames-hidden", stated=stated, frames=frames)

    def _decoded(self) -> Iterator[tuple[Any, float | None]]:
        """The video's frames, each with its time, until its end, or until it cannot be decoded any further."""
        av = import_optional("av", _PURPOSE, "video")
        count = 0
        with open_container(self.path) as container:
            stream = _threaded(container)
            time_of = frame_clock(container, stream)
            try:
                for frame in container.decode(stream):
                    count += 1
                    yield frame, time_of(frame)
            except (av.error.FFmpegError, ValueError) as error:
                reason = short_reason(error)
                if not count:
                    raise InputError(f"{self.path} cannot be decoded ({reason}); allowed: {VIDEO}") from error
                self._note("video-ends-early", reason=f"after {count} frames: {reason}")

    def _film_samples(self, times: list[float]) -> list[Frame]:
        if self.given_rate or not self.duration:  # its own time stamps do not count
            return self._some(self._passed(times))
        av = import_optional("av", _PURPOSE, "video")
        found: list[Frame] = []
        with open_container(self.path) as container, suppress(av.error.FFmpegError, ValueError):  # what can be read
            stream = _threaded(container)
            decoded, now, origin, rgb = container.decode(stream), -1.0, None, converter(self.display)
            time_of = frame_clock(container, stream)
            for wanted in times:
                if now >= wanted:
                    continue
                if origin is not None and wanted - now > _NEAR:
                    container.seek(int((wanted + origin) / stream.time_base), stream=stream)
                    decoded = container.decode(stream)
                for frame in decoded:
                    stamp = time_of(frame)
                    origin = stamp if origin is None else origin
                    now = now if stamp is None or origin is None else stamp - origin
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
            raise InputError(f"{self.path} has no frame that can be decoded; allowed: {VIDEO}")
        return found


def open_video(
    path: str | Path, frames_per_second: float | None = None, pixel_aspect_ratio: float | None = None
) -> Video:
    """Open a video, a TIFF file of several pages, or a folder of images in their natural order."""
    # Pictures are given as they are shown, with square pixels and upright, by what the file states, and a flag says so.
    path = checked_path(path, VIDEO)
    try:
        if path.is_dir():
            return _images(path, frames_per_second, pixel_aspect_ratio)
        with opened(path, VIDEO, sys.maxsize) as stream:
            if not stream.read(1):
                raise InputError(f"{path} is empty; allowed: {VIDEO}")
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); allowed: {VIDEO}") from error
    if path.suffix.lower() in STACKS:
        return _images(path, frames_per_second, pixel_aspect_ratio)
    return _film(path, frames_per_second, pixel_aspect_ratio)


def _film(path: Path, frames_per_second: float | None, aspect: float | None) -> Video:
    av = import_optional("av", _PURPOSE, "video")
    with open_container(path) as container:
        if not container.streams.video:
            raise InputError(f"{path} has no pictures; allowed: {VIDEO}")
        stream, flags = main_video_stream(container)
        if stream.codec_context is not None and stream.width and stream.height:
            _check_size(path, (stream.width, stream.height))
        stated = stated_length(container, stream)
        own_rate = float(stream.average_rate or 0.0)
        try:
            frame = next(container.decode(stream), None)
        except (av.error.FFmpegError, ValueError) as error:
            raise InputError(f"{path} cannot be decoded ({short_reason(error)}); allowed: {VIDEO}") from error
        if frame is None:
            raise InputError(f"{path} has no frames; allowed: {VIDEO}")
        ratio = float(stream.sample_aspect_ratio or 0.0) or None
        display, slant = frame_display(frame, stated_aspect(str(path), ratio, aspect))
        stored = frame.width, frame.height
        words = [str(container.metadata.get(key, "")) for key in ("title", "comment", "description")]
    size = display.size(stored)
    _check_size(path, size)
    if frames_per_second:  # its own length is in its own times, which do not count
        duration = stated.frames / frames_per_second if stated.frames else None
        stated = stated._replace(duration=duration, tolerance=3.0 / frames_per_second)
    flags += [*_replaced(frames_per_second, own_rate), *display_flags(display, stored, ratio, aspect, slant)]
    return Video(
        path, size, stated.duration, frames_per_second or own_rate or None, frames_per_second,
        display=display, stated=stated, words=one_line(" ".join(words)), flags=flags,
    )  # fmt: skip


def _replaced(given: float | None, own: float) -> list[Flag]:
    """That a rate which the setup gives stands in place of another one, as of a camera for slow motion."""
    if given is None or own == 0.0 or abs(given / own - 1.0) < _SAME_RATE:
        return []
    return [Flag.named("rate-replaced", given=given, own=own)]


def _images(path: Path, frames_per_second: float | None, aspect: float | None) -> Video:
    sequence = image_folder(path, aspect) if path.is_dir() else image_stack(path, aspect)
    if frames_per_second is None:
        what = "a folder of images" if path.is_dir() else "a TIFF file"
        raise InputError(f"camera.frames_per_second is missing, but {path} is {what}; allowed: its rate, 0.01 to 1e5")
    size = sequence.display.size(sequence.header.size)
    _check_size(path, size)
    return Video(
        path, size, (sequence.numbers[-1] + 1) / frames_per_second, frames_per_second, frames_per_second, sequence,
        sequence.display, words=words_of_images(path if path.is_dir() else path.parent, sequence.files[0]),
        flags=list(sequence.flags),
    )  # fmt: skip


def _threaded(container: Any) -> Any:
    """The stream that is measured, decoded by several threads."""
    stream, _ = main_video_stream(container)
    stream.thread_type = "AUTO"
    return stream


def _check_size(path: Path, size: tuple[int, int]) -> None:
    if min(size) < SMALLEST_SIDE or size[0] * size[1] > MOST_PIXELS:
        raise InputError(
            f"{path} has pictures of {size[0]} x {size[1]} pixels; allowed: sides of at least {SMALLEST_SIDE} and at "
            f"most {MOST_PIXELS // 1_000_000} million pixels"
        )
