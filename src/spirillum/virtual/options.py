"""The options of a virtual trial, checked: one sentence for each that is wrong."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

from spirillum.errors import InputError
from spirillum.files import output_target
from spirillum.units import KINDS, parse_option

__all__ = [
    "DIRECTIONS",
    "VIEWS",
    "checked_fps",
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
