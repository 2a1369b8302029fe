"""Streams of the live tracker: pictures in from a video, a camera or the network, and JSON lines out."""

from __future__ import annotations

import json
import re
import socket
import sys
import time
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from spirillum.argument_validation import as_number
from spirillum.errors import InputError, clipped
from spirillum.files.limits import MOST_PIXELS, SMALLEST_SIDE
from spirillum.notes import Note
from spirillum.optional_dependencies import import_optional
from spirillum.vision.flag import Flag
from spirillum.vision.setup import CameraSetup
from spirillum.vision.video.display import converter, display_flags, frame_display, stated_aspect
from spirillum.vision.video.frames import open_video

Kind = Literal["film", "camera", "stream"]

_ALLOWED = "a film, a folder of images, camera:0 (or another number or name), or rtsp://, http://, tcp://, udp://..."
_DEVICES = {"linux": ("v4l2", "/dev/video{}"), "darwin": ("avfoundation", "{}"), "win32": ("dshow", "video={}")}
"""Format and name of a camera on each system, as FFmpeg calls them."""
_PROTOCOLS = {"rtsp": "rtsp,rtp,udp,tcp", "http": "http,tcp", "https": "https,tls,tcp", "tcp": "tcp", "udp": "udp"}
"""What a stream may use: its own protocol, no files and no playlists."""
_FORMATS = "rtsp,mpegts,mpjpeg,mjpeg,matroska,webm,mov,mp4,h264,hevc,flv"
_FASTEST = 1e4
_SILENT = 5.0  # time without a picture after which a camera or stream has stopped, s


class Arrived(NamedTuple):
    """A picture that has come."""

    number: int  #: Its number, from 0.
    time: float  #: When it was taken, by the source's own clock, s from the first one.
    image: np.ndarray  #: 8-bit RGB, (height, width, 3).
    clock: float  #: When it came, by this computer's clock, s.


@dataclass(frozen=True)
class Source:
    """A source of pictures that was opened once, to see that it is there."""

    name: str  #: For sentences.
    kind: Kind  #: `film`, `camera` or `stream`.
    options: Mapping[str, Any] = field(repr=False)  #: How it is opened: see `source_of`.
    words: str = ""  #: Metadata of a video, such as that it is synthetic.
    flags: list[Flag] = field(default_factory=list, repr=False)  #: What was odd about its pictures while they were read

    def frames(self) -> Generator[Arrived, None, None]:
        """Its pictures until it ends."""
        if self.kind == "film":
            start, end = self.options["between"]
            for number, frame in enumerate(self.options["video"].frames(start, end)):
                yield Arrived(number, frame.time, frame.image, time.perf_counter())
            return
        yield from _pictures(self)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Notes on its pictures: for example, that a video breaks off."""
        return tuple(flag.note for flag in self.flags)


def source_of(
    word: str,
    *,
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    camera: CameraSetup | None = None,
    between: tuple[float, float | None] = (0.0, None),
) -> Source:
    """The source of a word: a video, a folder, `camera:0` or `/dev/video0` at a size and rate, or a stream address."""
    pace, aspect = (None, None) if camera is None else (camera.frames_per_second, camera.pixel_aspect_ratio)
    scheme = word.partition("://")[0].lower() if "://" in word else ""
    device = re.fullmatch(r"camera:(.+)", word) or re.fullmatch(r"/dev/video(\d+)", word)
    if device is None and not (size is None and fps is None):
        raise InputError(f"size or fps is given with {word[:80]}; allowed: only with a camera")
    if device is not None:
        if fps is not None and not 0.0 < as_number(fps) <= _FASTEST:
            raise InputError(f"fps = {clipped(fps)}; allowed: above 0, at most {_FASTEST:g} frames a second")
        kind, place = _DEVICES.get(sys.platform, _DEVICES["linux"])
        wanted = {} if size is None else {"video_size": f"{size[0]}x{size[1]}"}
        wanted |= {} if fps is None else {"framerate": f"{fps:g}"}
        options = {"file": place.format(device[1]), "format": kind, "options": wanted, "size": size, "aspect": aspect}
        return Source(word, "camera", options)
    if scheme:
        if scheme not in _PROTOCOLS:
            raise InputError(f"source = {word[:80]!r}; allowed: {_ALLOWED}")
        quick = {"flags": "low_delay", "analyzeduration": "1000000"}  # in microseconds
        wanted = {"protocol_whitelist": _PROTOCOLS[scheme], "format_whitelist": _FORMATS, **quick}
        address = scheme + word[len(scheme) :]
        options = {"file": address, "format": None, "options": wanted, "size": None, "aspect": aspect}
        return Source(re.sub(r"//[^/]*@", "//", word)[:120], "stream", options)
    video = open_video(word, pace, aspect)  # raises for a bad video
    return Source(video.name, "film", {"video": video, "between": between}, video.words, video.flags)


def _pictures(source: Source) -> Generator[Arrived, None, None]:
    """Pictures of a camera or stream, with the least delay."""
    av = import_optional("av", "tracking a camera", "video")
    count, last, origin, size = 0, -1.0, None, source.options["size"]
    rgb, start = None, 0.0
    try:
        with av.open(
            source.options["file"],
            format=source.options["format"],
            options=dict(source.options["options"]),
            timeout=(2.0 * _SILENT, _SILENT),
        ) as container:
            if not container.streams.video:
                raise InputError(f"{source.name} has no pictures; allowed: {_ALLOWED}")
            stream = container.streams.video[0]
            for packet in container.demux(stream):
                came = time.perf_counter()
                for frame in packet.decode():
                    size = _checked_size(source.name, (frame.width, frame.height), size)
                    rgb = rgb or _shown(source, stream, frame)
                    start = start or came
                    stamp = came - start if frame.time is None else float(frame.time)
                    origin = stamp if origin is None else origin
                    if stamp - origin > last:
                        last = stamp - origin
                        yield Arrived(count, last, rgb(frame), came)
                    count += 1
    except (av.error.FFmpegError, ValueError, OSError) as error:
        reason = str(getattr(error, "strerror", None) or error)[:120]
        reason = f"no picture for {_SILENT:g} s" if isinstance(error, av.error.ExitError) else reason
        if not count:
            raise InputError(f"{source.name} cannot be opened ({reason}); allowed: {_ALLOWED}") from error
        raise InputError(f"{source.name} stopped after {count} frames ({reason}): what was tracked is kept") from error
    if not count:
        raise InputError(f"{source.name} gave no picture; allowed: {_ALLOWED}")
    if source.kind == "camera":
        raise InputError(f"{source.name} stopped after {count} frames: what was tracked is kept")


def _shown(source: Source, stream: Any, frame: Any) -> Callable[[Any], np.ndarray]:
    """The decoder of shown pictures, by the first one; flags of the source state its corrections."""
    stated, given = float(stream.sample_aspect_ratio or 0.0) or None, source.options["aspect"]
    display, slant = frame_display(frame, stated_aspect(source.name, stated, given))
    source.flags.extend(display_flags(display, (frame.width, frame.height), stated, given, slant))
    return converter(display)


def _checked_size(name: str, size: tuple[int, int], expected: tuple[int, int] | None) -> tuple[int, int]:
    if size == expected:
        return size
    if expected is not None:
        raise InputError(
            f"{name} gives pictures of {size[0]} x {size[1]} pixels in place of {expected[0]} x {expected[1]}: what "
            "was tracked is kept"
        )
    if min(size) < SMALLEST_SIDE or size[0] * size[1] > MOST_PIXELS:
        raise InputError(
            f"{name} has pictures of {size[0]} x {size[1]} pixels; allowed: sides of at least {SMALLEST_SIDE} and at "
            f"most {MOST_PIXELS // 1_000_000} million pixels"
        )
    return size


_LOOPBACK = "127.0.0.1"
_DIGITS = 5
_WHAT = "PORT or HOST:PORT, a port from 1 to 65535; without a host, this computer"


def line_of(answer: Mapping[str, Any]) -> str:
    """An answer as JSON in one line; refuses NaN."""
    return json.dumps(answer, allow_nan=False, ensure_ascii=False, separators=(",", ":"))


class Datagrams:
    """Sends each line as one datagram; a lost one is not repeated, as the next one is newer."""

    def __init__(self, address: str) -> None:
        """Find the receiver."""
        host, colon, port = address.rpartition(":")
        number = port.isascii() and port.isdigit() and len(port) <= _DIGITS
        if not number or not 1 <= int(port) <= 65535 or (colon and not host):
            raise InputError(f"udp = {address[:60]!r}; allowed: {_WHAT}")
        try:
            found = socket.getaddrinfo(host.strip("[]") or _LOOPBACK, int(port), type=socket.SOCK_DGRAM)[0]
        except (OSError, UnicodeError) as error:  # the latter for a name that can be none
            raise InputError(f"udp = {address[:60]!r}: the host is not known ({error}); allowed: {_WHAT}") from error
        self._socket, self._to = socket.socket(found[0], socket.SOCK_DGRAM), found[4]
        self._address, self._lines, self._unsent, self._reason = address, 0, 0, ""

    def send(self, line: str) -> None:
        """Send a line."""
        self._lines += 1
        try:
            self._socket.sendto(line.encode(), self._to)
        except OSError as error:
            self._unsent, self._reason = self._unsent + 1, error.strerror or str(error)

    @property
    def notes(self) -> tuple[Note, ...]:
        """A sentence if the network took some of the lines not."""
        if not self._unsent:
            return ()
        counts = {"unsent": self._unsent, "lines": self._lines}
        return (Note.named("lines-lost", address=self._address, reason=self._reason, **counts),)

    def close(self) -> None:
        """No more lines."""
        self._socket.close()
