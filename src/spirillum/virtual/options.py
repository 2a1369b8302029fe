"""The options of a virtual trial, checked: one sentence for each that is wrong."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

from spirillum.errors import InputError
from spirillum.files import output_target
from spirillum.units import KINDS, parse_option

__all__ = [
    "DIRECTIONS",
    "VIEWS",
    "checked_axis",
    "checked_distortion",
    "checked_fps",
    "checked_heading",
    "checked_seed",
    "checked_size",
    "one_of",
    "signed_length",
    "video_target",
    "whole_number",
]

VIEWS = ("top", "side")
"""Where the camera is: above, or level beside the tank."""
DIRECTIONS = ("right", "left")
"""Where the nose points in the picture."""

_SMALLEST, _LARGEST = 64, 4096
_BENT = 0.5
"""Largest coefficient of distortion: with more, the corners of a wide picture come out near its middle."""
_OBLIQUE = 45.0
"""Largest heading, degrees: the setup knows only right and left."""
_THIN = 1e-6
"""Least depth of floor and surface below and above the axis that a setup states, m."""


def video_target(path: str | Path) -> Path:
    """The video to write, or the folder for its frames.

    Raises:
        InputError: if it has another ending, or cannot be written.
    """
    path = Path(path)
    if path.suffix:
        return output_target(path, {".mp4": "a video, or a folder without an ending"}, "trial.mp4")
    if not path.parent.is_dir():
        raise InputError(f"{path} cannot be written (no such folder); allowed: a folder you may write to")
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise InputError(f"{path} is there and not empty; allowed: a new folder for the frames, or a .mp4")
    return path


def one_of(name: str, value: str, allowed: tuple[str, ...]) -> str:
    """A word that is allowed.

    Raises:
        InputError: if it is not.
    """
    if value not in allowed:
        raise InputError(f"{name} = {str(value)[:40]!r}; allowed: {', '.join(allowed)}")
    return value


def whole_number(name: str, value: object, low: int, high: int) -> int:
    """A whole number in a range.

    Raises:
        InputError: if it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise InputError(f"{name} = {value!r}; allowed: a whole number from {low} to {high}")
    return value


def checked_seed(seed: object) -> int:
    """The seed of all random numbers.

    Raises:
        InputError: if it is none.
    """
    return whole_number("seed", seed, 0, 2**31 - 1)


def signed_length(name: str, value: str | float) -> float:
    """A length of either sign, with its unit or in m.

    Raises:
        InputError: if it is none.
    """
    if isinstance(value, str):
        text = value.strip()
        if text.startswith("-"):
            return -parse_option(name, text[1:], KINDS["length or zero"])
        return parse_option(name, text, KINDS["length or zero"])
    return parse_option(name, abs(value), KINDS["length or zero"]) * (-1.0 if value < 0 else 1.0)


def checked_fps(fps: float) -> float:
    """Frames a second, as the nearest fraction that a video can hold.

    Raises:
        InputError: if they are out of range.
    """
    if isinstance(fps, bool) or not 1.0 <= fps <= 1000.0:
        raise InputError(f"fps = {fps!r}; allowed: 1 to 1000 frames a second")
    return float(Fraction(fps).limit_denominator(1001))


def checked_size(size: str | tuple[int, int]) -> tuple[int, int]:
    """Width and height in pixels, even numbers, from ``640x480`` or a pair.

    Raises:
        InputError: if it is neither, odd, or out of range.
    """
    allowed = f"WIDTHxHEIGHT in pixels, even numbers from {_SMALLEST} to {_LARGEST}, for example 640x480"
    parts = size.lower().replace("×", "x").split("x") if isinstance(size, str) else [str(value) for value in size]
    if len(parts) != 2 or not all(part.strip().isdecimal() and len(part) <= 6 for part in parts):
        raise InputError(f"size = {str(size)[:40]!r}; allowed: {allowed}")
    width, height = (int(part) for part in parts)
    if not all(_SMALLEST <= value <= _LARGEST and value % 2 == 0 for value in (width, height)):
        raise InputError(f"size = {width}x{height}; allowed: {allowed}")
    return width, height


def checked_distortion(value: float) -> float:
    """The coefficient k1 of radial distortion.

    Raises:
        InputError: if it is no number, or out of range.
    """
    if isinstance(value, bool) or not abs(value) <= _BENT:
        raise InputError(f"distortion = {value!r}; allowed: {-_BENT:g} to {_BENT:g}")
    return float(value)


def checked_heading(value: str | float) -> float:
    """The angle of the robot's axis to the channel, with its unit or in rad.

    Raises:
        InputError: if it is none, or so oblique that the nose points neither right nor left.
    """
    angle = parse_option("heading", value, KINDS["angle"])
    if abs(angle) > math.radians(_OBLIQUE) * (1.0 + 1e-9):
        raise InputError(f"heading = {math.degrees(angle):.4g} deg; allowed: {-_OBLIQUE:g} to {_OBLIQUE:g} deg")
    return angle


def checked_axis(height: float, error: str | float, surface: float) -> float:
    """The height of the robot's axis as the setup states it, m: wrong by an error, but between floor and surface.

    Args:
        height: the true height, m.
        error: by which it is wrong, with its unit or in m.
        surface: height of the oil's surface, m.

    Raises:
        InputError: if the error is no length, or a setup with it would not be valid.
    """
    wrong = signed_length("depth_error", error)
    if not _THIN <= height + wrong <= surface - _THIN:
        low, high = -1e3 * height, 1e3 * (surface - height)
        raise InputError(
            f"depth_error = {1e3 * wrong:.4g} mm; allowed: between {low:.4g} and {high:.4g} mm, "
            "an axis above the floor and below the oil's surface"
        )
    return height + wrong
