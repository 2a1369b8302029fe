"""Tracking results overlaid on frames: outline of the body, axis, stripe pointer, fitted wire, numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from fractions import Fraction
from itertools import chain
from pathlib import Path
from queue import Queue
from typing import TYPE_CHECKING

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.formats.h264 import h264_writer
from spirillum.optional_dependencies import import_optional
from spirillum.robot.links import outlines_of
from spirillum.robot.robot import Robot

if TYPE_CHECKING:
    from spirillum.vision.track.steps import FrameDetection

_BODY, _AXIS, _POINTER, _WIRE = (40, 220, 60), (255, 255, 255), (255, 40, 200), (0, 225, 255)
_INK = (255, 255, 255)
_TEXT, _SMALLEST_TEXT = 0.45, 0.4  # scale of the font in a picture 480 pixels high, and the least one that can be read
_DIAL = 16.0  # radius of a dial in a picture 480 pixels high, pixels
_MOST_OF_HEIGHT = 0.25  # largest share of a picture's height that text covers
_SHIFT = 4  # subpixel resolution of lines: sixteenths
_TICKS = 90_000
_QUALITY = {"crf": "23", "preset": "ultrafast"}
_LARGEST = 1920  # longest side of an annotated frame, pixels: a larger one is reduced by a whole number


class Annotator:
    """Overlay of tracking results on frames of one robot."""

    def __init__(self, robot: Robot, period: float = 2.0 * math.pi) -> None:
        from spirillum.robot.mesh import tail_line

        self._cv2 = import_optional("cv2", "an annotated video", "video")
        body = robot.body
        self._period = period
        self._half, self._radius = 0.5 * body.length, 0.5 * body.diameter
        x, radius = outlines_of(robot)["body"].line(np.linspace(0.0, 1.0, 24))
        edge = np.column_stack([x, radius, np.zeros_like(x)])
        self._outline = np.concatenate([edge, edge[::-1] * [1.0, -1.0, 1.0]])
        self._wire = np.asarray(tail_line(robot, fineness=0.6).points)
        self._seal = robot.seal.length if robot.seal else 0.3 * body.length
        self._first: float | None = None

    def draw(self, image: np.ndarray, seen: FrameDetection, *, in_place: bool = False) -> np.ndarray:
        """Return a frame with the tracking result, at most 1920 pixels wide; drawn `in_place` if its size allows."""
        picture, times = self._reduced(image, in_place=in_place)
        pose = seen.pose
        if pose is None:
            self._write(picture, (f"t = {seen.time:.2f} s", "robot not seen"))
            return picture
        from spirillum.vision.camera.optics import project as pixels_of

        def line(points: Samples, colour: tuple[int, int, int], *, closed: bool = False) -> None:
            pixels = (pixels_of(points, pose, seen.optics) + 0.5) / times - 0.5
            self._line(picture, pixels, colour, closed=closed)

        line(self._outline, _BODY, closed=True)
        line(np.array([[-self._half, 0.0, 0.0], [self._half, 0.0, 0.0]]), _AXIS)
        if math.isfinite(seen.tail_phase):
            line(_turned(self._wire, seen.tail_phase), _WIRE)
        if math.isfinite(seen.body_angle):
            self._pointer(line, seen.body_angle)
        self._dials(picture, seen)
        self._write(
            picture,
            (
                f"t = {seen.time:.2f} s",
                f"x = {1e3 * self._along(seen):.2f} mm",
                f"body {_degrees(seen.body_angle, self._period)}",
                f"tail {_degrees(seen.tail_phase)}",
            ),
        )
        return picture

    def _reduced(self, image: np.ndarray, *, in_place: bool) -> tuple[np.ndarray, int]:
        """A frame to draw on, reduced if it is large, and how many times."""
        times = -(-max(image.shape[:2]) // _LARGEST)
        if times == 1:
            own = in_place and image.flags.c_contiguous and image.flags.writeable
            return (image if own else image.copy(order="C")), 1
        height, width = (size // times for size in image.shape[:2])
        whole = np.ascontiguousarray(image[: height * times, : width * times])
        return self._cv2.resize(whole, (width, height), interpolation=self._cv2.INTER_AREA), times

    def _dials(self, picture: np.ndarray, seen: FrameDetection) -> None:
        """Body and tail as seen from the rear, in the upper right corner: the hand is stripe 1, or the wire's root."""
        # Where stripes repeat, the body has a hand for each that may be stripe 1.
        radius = _DIAL * _unit(picture)
        around = np.linspace(0.0, 2.0 * np.pi, 33)
        for position, angle, colour, period in (
            (3.4, seen.body_angle, _POINTER, self._period),
            (1.2, seen.tail_phase, _WIRE, 2.0 * math.pi),
        ):
            centre = np.array([picture.shape[1] - position * radius, 1.3 * radius])
            circle = centre + radius * np.stack([np.cos(around), np.sin(around)], axis=1)
            self._line(picture, circle, colour, closed=True)
            if math.isfinite(angle):
                # From the rear +y is to the left; stripe 1 starts at +z, the wire at +y.
                first = angle if colour is _POINTER else angle - 0.5 * math.pi
                for turned in first + np.arange(0.0, 2.0 * math.pi - 1e-9, period):
                    tip = centre + radius * np.array([math.sin(turned), -math.cos(turned)])
                    self._line(picture, np.stack([centre, tip]), colour, closed=False)

    def _pointer(self, line: Callable[..., None], angle: float) -> None:
        """A line along the middle of stripe 1 where it faces the camera, and a clock hand on the body's end."""
        rear = -self._half
        reach = np.array([rear, rear + self._seal])
        y, z = -self._radius * math.sin(angle), self._radius * math.cos(angle)
        if z > 0:
            line(np.stack([reach, np.full(2, y), np.full(2, z)], axis=1), _POINTER)
        else:  # behind: two short pieces
            for start in (0.0, 0.7):
                part = rear + self._seal * np.array([start, start + 0.3])
                line(np.stack([part, np.full(2, y), np.full(2, 0.0)], axis=1), _POINTER)

    def _along(self, seen: FrameDetection) -> float:
        assert seen.pose is not None  # noqa: S101 - called only where it was detected
        if self._first is None:
            self._first = seen.pose.x
        return seen.pose.x - self._first

    def _line(self, picture: np.ndarray, pixels: Samples, colour: tuple[int, int, int], *, closed: bool) -> None:
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        if len(pixels) < 2 or np.abs(pixels).max() > 1e5:
            return
        whole = np.round(pixels * 2**_SHIFT).astype(np.int32).reshape(-1, 1, 2)
        self._cv2.polylines(picture, [whole], closed, colour, 1, self._cv2.LINE_AA, _SHIFT)

    def _write(self, picture: np.ndarray, words: tuple[str, ...]) -> None:
        """Write text into the upper left corner, beside the dials, in a few lines; omit what does not fit."""
        unit = _unit(picture)
        font, size = self._cv2.FONT_HERSHEY_SIMPLEX, _TEXT * unit

        def width(text: str) -> int:
            return int(self._cv2.getTextSize(text, font, size, 1)[0][0])

        room = picture.shape[1] - (16.0 + 5.0 * _DIAL) * unit
        lines = _lines_of(words, width, room)[: max(int((_MOST_OF_HEIGHT * picture.shape[0] / unit - 6.0) / 18.0), 0)]
        if not lines:
            return
        longest = max(width(line) for line in lines)
        ground = picture[: round((6 + 18 * len(lines)) * unit), : round(longest + 16 * unit)]
        ground //= 3  # dark behind the words
        for row, line in enumerate(lines):
            position = (round(8 * unit), round((16 + 18 * row) * unit))
            self._cv2.putText(picture, line, position, font, size, _INK, 1, self._cv2.LINE_AA)


def _unit(picture: np.ndarray) -> float:
    """Size of text and dials over that in a picture 480 pixels high; letters stay legible."""
    return max(int(picture.shape[0]) / 480.0, _SMALLEST_TEXT / _TEXT)


def _lines_of(words: tuple[str, ...], width: Callable[[str], int], room: float) -> list[str]:
    """Break text into as few lines as possible; an entry wider than a line is omitted."""
    lines: list[str] = []
    for word in words:
        if lines and width(longer := f"{lines[-1]}  {word}") <= room:
            lines[-1] = longer
        elif width(word) <= room:
            lines.append(word)
    return lines


def _turned(points: Samples, angle: float) -> Samples:
    cos, sin = math.cos(angle), math.sin(angle)
    y, z = points[:, 1], points[:, 2]
    return np.stack([points[:, 0], cos * y - sin * z, sin * y + cos * z], axis=1)


def _degrees(angle: float, period: float = 2.0 * math.pi) -> str:
    """Format an angle in degrees, with its period if it is ambiguous."""
    if not math.isfinite(angle):
        return "not read"
    known = f"{math.degrees(angle % period):.1f} deg"
    return known if period > 2.0 * math.pi - 1e-9 else f"{known} + k {math.degrees(period):.4g}"


@contextmanager
def annotated_video(
    path: Path,
    robot: Robot,
    words: dict[str, str],
    thumbnail: Callable[[bytes], None] | None = None,
    *,
    period: float = 2.0 * math.pi,
    waiting: int = 8,
) -> Iterator[Callable[[int, np.ndarray, FrameDetection], None]]:
    """Video of annotated frames at their true times, rendered and encoded in a separate thread."""
    annotator = Annotator(robot, period)
    kept: list[np.ndarray] = []

    def drawn(index: int, image: np.ndarray, seen: FrameDetection) -> np.ndarray:
        picture = annotator.draw(image, seen, in_place=True)  # nobody looks at the frame any more
        if seen.pose is not None and (not kept or index & (index - 1) == 0):
            kept[:] = [picture]  # frames 1, 2, 4, 8 ...: the last of them lies in the second half
        return picture

    import_optional("av", "an annotated video", "video")  # raises here, before any frame is tracked
    queue: Queue[tuple[int, np.ndarray, FrameDetection] | None] = Queue(waiting)
    frames = iter(queue.get, None)

    def encode() -> None:
        try:
            _encode(path, words, ((drawn(*frame), frame[2].time) for frame in frames))
        finally:
            for _ in frames:  # after an error, so that nobody waits for the queue
                pass

    with ThreadPoolExecutor(1) as pool:
        encoded = pool.submit(encode)
        try:
            yield lambda index, image, seen: queue.put((index, image, seen))
        finally:
            queue.put(None)
    encoded.result()
    if thumbnail is not None and kept:
        thumbnail(_jpeg(kept[0]))


def video_frame(path: Path, index: int) -> bytes:
    """A frame of an annotated film as JPEG, by its order from 0; empty where there is none."""
    av = import_optional("av", "an annotated video", "video")
    with av.open(str(path)) as film:
        for number, frame in enumerate(film.decode(video=0)):
            if number == index:
                return _jpeg(frame.to_ndarray(format="rgb24"))
    return b""


def _jpeg(picture: np.ndarray) -> bytes:
    cv2 = import_optional("cv2", "an annotated video", "video")
    good, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    return bytes(data) if good else b""


def _encode(path: Path, words: dict[str, str], pictures: Iterator[tuple[np.ndarray, float]]) -> None:
    """Encode pictures with their times (H.264); the video starts with the first one's."""
    first = next(pictures, None)
    if first is None:
        raise InputError(f"{path.name} has no frames; allowed: a video with at least one")
    height, width = (even - even % 2 for even in first[0].shape[:2])
    last = -1
    with h264_writer(
        path,
        (width, height),
        Fraction(30),
        words,
        quality=_QUALITY,
        tick=Fraction(1, _TICKS),
        threads=1,
        instead="--no-annotated",
        extra="video",
    ) as film:
        for picture, time in chain([first], pictures):
            last = max(last + 1, round((time - first[1]) * _TICKS))
            film.add(picture[:height, :width], last)
