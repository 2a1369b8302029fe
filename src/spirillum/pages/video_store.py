"""Uploads to the page: declared sizes and limits, videos in a temporary folder, messages without its path."""

from __future__ import annotations

import math
import re
import shutil
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from starlette.requests import Request

from spirillum.errors import InputError
from spirillum.files import scratch_folder
from spirillum.optional_dependencies import import_optional

if TYPE_CHECKING:
    import numpy as np

    from spirillum.vision.video.frames import Video

_Read = TypeVar("_Read")


def plain(sentence: str, folder: Path) -> str:
    """A sentence without the folder, or one of the folders in it, before the names of files."""
    return re.sub(re.escape(str(folder)) + r"(/[a-z]+-\d+(?=/))?/", "", sentence)


@contextmanager
def plain_names(folder: Path) -> Iterator[None]:
    """Remove the folder from the messages of errors."""
    try:
        yield
    except InputError as error:
        raise InputError(plain(str(error), folder), [plain(one, folder) for one in error.problems]) from error


def read_upload(content: bytes, name: str, read: Callable[[Path], _Read]) -> _Read:
    """Content of an uploaded file; error messages call it the file."""
    with scratch_folder() as folder:
        path = folder / name
        path.write_bytes(content)
        try:
            return read(path)
        except InputError as error:
            raise InputError(str(error).replace(str(path), "the file")) from error


_LARGEST_TOGETHER = 128 << 20  # bytes of all files and messages in memory at once. Videos are written to the disk.


class TooLargeError(InputError):
    """More is sent than there is room for."""


def stated_size(request: Request) -> int:
    """Bytes that a request is about to send; the server takes no more of it."""
    size = request.headers.get("content-length", "")
    if not size.isdecimal():
        raise InputError("a request without its size; allowed: one with a Content-Length")
    return int(size)


class Uploads:
    """Files and messages from when they are announced until they are read; used by the server's one thread."""

    def __init__(self) -> None:
        self._left = _LARGEST_TOGETHER

    @asynccontextmanager
    async def received(self, request: Request, largest: int) -> AsyncIterator[bytes]:
        """Yield the body of a request; its bytes count until the block ends."""
        size = stated_size(request)
        if size > largest:
            raise TooLargeError(f"{size} bytes are too much; allowed: {largest} bytes")
        if size > self._left:
            raise TooLargeError(
                f"too much is sent at once; allowed: {_LARGEST_TOGETHER >> 20} MB in all, so try again soon"
            )
        self._left -= size
        try:
            yield await request.body()
        finally:
            self._left += size


_LARGEST_FILM = 4 << 30  # bytes of one video
_LARGEST_ALL = 16 << 30  # bytes of all videos
_MOST_FILMS = 50
_SPARE = 512 << 20  # bytes that stay free on the disk
_QUALITY = 92


class VideoStore:
    """Videos by the names of their trials; its methods are thread-safe."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.RLock()
        self._decoding = threading.Lock()  # one film at a time: a frame of many pixels takes much memory
        self._films: dict[str, Video] = {}
        self._stated: dict[Path, int] = {}
        self._count = 0

    def room_for(self, kind: str, size: int) -> Path:
        """Reserve an empty file for an upload; its declared bytes count while it exists."""
        from spirillum.vision.video.frames import FILMS

        import_optional("av", "measuring a video", "video")
        import_optional("cv2", "measuring a video", "video")
        if f".{kind}" not in FILMS:
            raise InputError(f"a file of kind {kind[:20]!r}; allowed: {', '.join(FILMS)}")
        with self._lock:
            written = self._written()
            self._stated = {path: self._stated[path] for path in written}
            if len(written) >= _MOST_FILMS:
                raise TooLargeError(f"{_MOST_FILMS} videos are uploaded already; allowed: to remove some first")
            stated = sum(self._stated.values())
            free = shutil.disk_usage(self._folder).free - (stated - sum(written.values())) - _SPARE
            if size > min(_LARGEST_FILM, _LARGEST_ALL - stated, free):
                limits = f"{_LARGEST_FILM >> 30} GB per video, {_LARGEST_ALL >> 30} GB in all, and room on the disk"
                raise TooLargeError(f"a video of {size / (1 << 30):.3g} GB is too large; allowed: {limits}")
            self._count += 1
            path = self._folder / f"trial-{self._count}.{kind}"
            path.touch()
            self._stated[path] = size
            return path

    def _written(self) -> dict[Path, int]:
        """Complete and incomplete videos, with their received bytes."""
        found = {}
        for path in self._stated:
            with suppress(FileNotFoundError):
                found[path] = path.stat().st_size
        return found

    def add(self, path: Path) -> str:
        """Add an uploaded video; return its name."""
        from spirillum.vision.video.frames import open_video

        try:
            with self._decoding, plain_names(self._folder):
                video = open_video(path)
        except InputError:
            path.unlink(missing_ok=True)
            raise
        with self._lock:
            self._films[path.stem] = video
        return path.stem

    def remove(self, name: str) -> None:
        """Remove a video."""
        with self._lock:
            video = self._films.pop(name, None)
        if video is not None:
            video.path.unlink(missing_ok=True)

    def video(self, name: str) -> Video:
        """Open a video."""
        with self._lock:
            video = self._films.get(name)
        if video is None:
            raise InputError(f"film {name[:40]!r}; allowed: an uploaded video")
        return video

    def paths(self) -> list[Path]:
        """Files of the videos, in the order of their upload."""
        with self._lock:
            return [video.path for video in self._films.values()]

    def describe(self) -> list[dict[str, Any]]:
        """Videos as the page lists them."""
        with self._lock:
            return [
                {
                    "name": name,
                    "size": list(video.size),
                    "duration": video.duration,
                    "rate": video.rate,
                    "synthetic": "synthetic" in video.words.lower(),
                }
                for name, video in self._films.items()
            ]

    def picture(self, name: str, time: float) -> bytes:
        """A frame of a video as JPEG."""
        cv2 = import_optional("cv2", "measuring a video", "video")
        frame = self.frame(name, time)
        return bytes(cv2.imencode(".jpg", frame[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1])

    def frame(self, name: str, time: float) -> np.ndarray:
        """A frame of a video, 8-bit RGB, (h, w, 3)."""
        if not (math.isfinite(time) and time >= 0.0):
            raise InputError(f"time = {time:g} s; allowed: 0 s or later")
        video = self.video(name)
        with self._decoding, plain_names(self._folder):
            return video.samples([0.0, min(time, max(0.0, (video.duration or time) - 0.1))])[-1].image
