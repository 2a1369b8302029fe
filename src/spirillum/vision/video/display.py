"""Display geometry of stored pictures: width over height of their pixels, and orientation."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from spirillum.errors import InputError
from spirillum.optional_dependencies import import_optional
from spirillum.vision.flag import Flag
from spirillum.vision.video import opencv as cv2

ASPECTS = (0.2, 5.0)  #: Least and largest width of a pixel over its height.
_SLANT = 0.02  # tangent of an angle to the next quarter turn from which on it is mentioned
_QUARTERS = (False, False, False), (True, False, True), (False, True, True), (True, True, False)
"""Transposed, mirrored across and mirrored down, for each number of quarter turns against the clock."""


class Display(NamedTuple):
    """How a stored picture is shown: stretched to square pixels, then transposed, then mirrored."""

    aspect: float = 1.0  #: Width of a stored pixel over its height.
    transposed: bool = False  #: Whether rows and columns are exchanged.
    across: bool = False  #: Whether left and right are exchanged afterwards.
    down: bool = False  #: Whether top and bottom are exchanged afterwards.

    def size(self, stored: tuple[int, int]) -> tuple[int, int]:
        """Width and height as shown of a picture by those that are stored, pixels."""
        width, height = max(1, round(stored[0] * self.aspect)), stored[1]
        return (height, width) if self.transposed else (width, height)

    def stored(self, shown: tuple[int, int]) -> tuple[int, int]:
        """Width and height as stored of a picture by those that are shown, pixels, about."""
        width, height = shown[::-1] if self.transposed else shown
        return round(width / self.aspect), height

    def stretch(self, stored: tuple[int, int]) -> tuple[float, float]:
        """Shown over stored pixels along the shown picture's rows and columns."""
        share = max(1, round(stored[0] * self.aspect)) / stored[0]
        return (1.0, share) if self.transposed else (share, 1.0)

    def display_picture(self, picture: np.ndarray) -> np.ndarray:
        """A stored 8-bit picture as it is shown."""
        height, stored = picture.shape[:2]
        width = max(1, round(stored * self.aspect))
        if width != stored:
            how = cv2.INTER_CUBIC if width > stored else cv2.INTER_AREA
            picture = cv2.resize(picture, (width, height), interpolation=how)
        if self.transposed:
            picture = picture.swapaxes(0, 1)
        return np.ascontiguousarray(self._mirrored(picture))

    def turned_back(self, picture: np.ndarray) -> np.ndarray:
        """A picture as it is stored, of one that a library has turned already."""
        picture = self._mirrored(picture)
        return picture.swapaxes(0, 1) if self.transposed else picture

    def _mirrored(self, picture: np.ndarray) -> np.ndarray:
        return picture[:: -1 if self.down else 1, :: -1 if self.across else 1]


AS_STORED = Display()  #: Display of pictures with square pixels that stand upright.


def frame_display(frame: Any, aspect: float) -> tuple[Display, float]:
    """Display of a video's frame, and the angle by which its display matrix is off a quarter turn, rad."""
    # The matrix maps stored to shown coordinates: x' = a x + c y, y' = b x + d y, y downwards.
    try:
        matrix = frame.side_data.get("DISPLAYMATRIX")
    except ValueError:  # side data of a kind that PyAV does not know hide all others
        return Display(aspect, *_QUARTERS[round(frame.rotation / 90.0) % 4]), 0.0
    if matrix is None:
        return Display(aspect), 0.0
    a, b, _, c, d = np.frombuffer(matrix, dtype=np.int32)[:5].astype(float).tolist()
    transposed = abs(b) + abs(c) > abs(a) + abs(d)
    along, slant = ((c, b), (a, d)) if transposed else ((a, d), (b, c))
    off = math.atan2(math.hypot(*slant), math.hypot(*along))
    return Display(aspect, transposed, along[0] < 0, along[1] < 0), off


def stated_aspect(name: str, stated: float | None, given: float | None) -> float:
    """Width of a pixel over its height: as the setup gives it, else as the file states it, else 1."""
    aspect = (stated or 1.0) if given is None else given
    if not ASPECTS[0] <= aspect <= ASPECTS[1]:
        raise InputError(
            f"{name} states a pixel aspect ratio of {aspect:.4g}; allowed: {ASPECTS[0]:g} to {ASPECTS[1]:g}, or "
            "camera.pixel_aspect_ratio in the setup (1: square pixels)"
        )
    return aspect


def display_flags(
    display: Display, stored: tuple[int, int], stated: float | None, given: float | None, slant: float = 0.0
) -> list[Flag]:
    """Corrections of the pictures, and where each was stated."""
    flags, width = [], round(stored[0] * display.aspect)
    if given is not None and stated is not None and round(stored[0] * stated) != width:
        flags.append(Flag.named("pixel-aspect-replaced", given=given, stated=stated))
    elif width != stored[0]:
        whose, wrong = ("the setup", "") if given else ("the file", "; if it is wrong, set camera.pixel_aspect_ratio")
        size = {"width": stored[0], "height": stored[1], "shown": width}
        flags.append(Flag.named("pixels-not-square", whose=whose, aspect=display.aspect, wrong=wrong, **size))
    if display[1:] != (False, False, False):
        flags.append(Flag.named("pictures-turned", turned=_turned(display)))
    if math.tan(slant) > _SLANT:
        flags.append(Flag.named("slant-left-out", slant=math.degrees(slant)))
    return flags


def _turned(display: Display) -> str:
    """An orientation in words, after "shown"."""
    _, transposed, across, down = display
    if transposed:
        return {
            (False, False): "mirrored at the diagonal", (True, False): "turned by 90 deg clockwise",
            (False, True): "turned by 90 deg counterclockwise", (True, True): "mirrored at the other diagonal",
        }[across, down]  # fmt: skip
    return "upside down" if across and down else f"with {'left and right' if across else 'top and bottom'} exchanged"


def converter(display: Display) -> Callable[[Any], np.ndarray]:
    """A function that gives a decoded frame's picture as shown, for one thread: its converter is set up once."""
    av = import_optional("av", "measuring a video", "video")
    reformatter = av.video.reformatter.VideoReformatter()

    def rgb(frame: Any) -> np.ndarray:
        return display.display_picture(reformatter.reformat(frame, format="rgb24").to_ndarray())

    return rgb
