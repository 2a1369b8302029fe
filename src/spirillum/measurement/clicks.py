"""What an experimenter points at in a picture, as fields of the setup: scale, direction, order of the stripes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError, clipped
from spirillum.measurement.setup_template import apparent_distance
from spirillum.robot.geometry import StripeColour
from spirillum.vision.camera.ruler import Lines
from spirillum.vision.setup import INDICES
from spirillum.vision.track.colours import colours_named

_SURE = 0.25  # largest distance of the number of spacings between two clicks from a whole number
_FEWEST = 4  # fewest spacings between two clicks: a pixel beside the mark then matters little
_SHORTEST = 20.0  # shortest distance of two clicks that give a length per pixel, pixels
_AROUND = 2  # pixels on each side of a click over which a colour is averaged

_RIGHT = {"right": (0, 1), "left": (0, -1), "up": (1, 0), "down": (-1, 0)}
"""Direction, in (u, v), of a robot's right-hand side, given that of its nose."""


def spacing_between(lines: Lines, one: tuple[float, float], other: tuple[float, float], length: float) -> float:
    """Spacing of a ruler's lines, m, from two of its marks and the length between them."""
    # The detected lines between the clicks are counted, so that a click need not be exact.
    labels = np.unique(lines.strip)
    away = [
        min(float(np.hypot(*(lines.pixels[lines.strip == k] - click).T).min()) for click in (one, other))
        for k in labels
    ]
    mine = lines.strip == labels[int(np.argmin(away))]
    terms, clicks = (_terms(places, lines) for places in (lines.pixels[mine], np.array([one, other])))
    numbers = clicks @ np.linalg.lstsq(terms, lines.number[mine], rcond=None)[0]
    between = abs(float(numbers[1] - numbers[0]))
    if between < _FEWEST - 0.5:
        raise InputError(f"{between:.1f} spacings of the ruler lie between the clicks; allowed: at least {_FEWEST}")
    if abs(between - round(between)) > _SURE:
        raise InputError(
            f"{between:.1f} spacings of the ruler lie between the clicks; allowed: a whole number: click on two marks "
            "of the same kind"
        )
    return length / round(between)


def _terms(pixels: Samples, lines: Lines) -> Samples:
    """Terms of a smooth surface over the picture, (n, 6)."""
    u, v = ((pixels - lines.pixels.mean(axis=0)) / 100.0).T
    return np.stack([np.ones_like(u), u, v, u * u, u * v, u**3], axis=1)


def length_per_pixel_between(
    one: tuple[float, float],
    other: tuple[float, float],
    length: float,
    *,
    heights: tuple[float, float],
    camera: float,
    surface: float | None,
    index: float,
) -> float:
    """Length that a pixel shows at the height of the robot's axis, m, from two marks where no ruler is detected."""
    pixels = float(np.hypot(other[0] - one[0], other[1] - one[1]))
    if pixels < _SHORTEST:
        raise InputError(f"the clicks are {pixels:.0f} pixels apart; allowed: at least {_SHORTEST:.0f}")
    least, largest = INDICES
    if not least <= index <= largest:
        raise InputError(f"tank.index = {index:g}; allowed: from {least:g} to {largest:g}")
    above = max(*heights, 0.0 if surface is None else surface)
    if not above < camera:
        raise InputError(
            f"camera.height = {1e3 * camera:g} mm, with marks, axis or surface at {1e3 * above:g} mm; allowed: a lens "
            "above all of them"
        )
    marks, axis = (apparent_distance(height, camera, surface, index) for height in heights)
    return length / pixels * axis / marks


def nose_side(nose: tuple[float, float], rear: tuple[float, float]) -> str:
    """`right`, `left`, `up` or `down`: where in the picture the nose points, to an eighth of a turn."""
    along, down = nose[0] - rear[0], nose[1] - rear[1]
    if max(abs(along), abs(down)) < _SHORTEST:
        raise InputError(f"nose and rear are {max(abs(along), abs(down)):.0f} pixels apart; allowed: {_SHORTEST:.0f}")
    if abs(along) >= abs(down):
        return "right" if along > 0 else "left"
    return "down" if down > 0 else "up"


def across(points: Sequence[tuple[float, float]], direction: str) -> list[tuple[float, float]]:
    """Points in the order of stripes: from the left of a robot that looks along `direction` to its right."""
    right = _RIGHT.get(str(direction))
    if right is None:
        raise InputError(f"robot.direction = {clipped(direction)}; allowed: {', '.join(_RIGHT)}")
    return sorted(points, key=lambda point: right[0] * point[0] + right[1] * point[1])


def stripe_names(image: np.ndarray, clicks: Sequence[tuple[float, float]], allowed: Sequence[str] = ()) -> list[str]:
    """Names of the colours at some pixels, from those allowed, or from all."""
    if not clicks:
        return []
    height, width = image.shape[:2]
    found = []
    for u, v in clicks:
        column, row = (int(np.clip(round(x), 0, size - 1)) for x, size in ((u, width), (v, height)))
        part = image[max(row - _AROUND, 0) : row + _AROUND + 1, max(column - _AROUND, 0) : column + _AROUND + 1]
        found.append(np.median(part.reshape(-1, 3).astype(float), axis=0))
    return colours_named(np.array(found), list(dict.fromkeys(allowed)) or list(get_args(StripeColour)))


def stripes_in_order(seen: Sequence[str], stated: Sequence[str]) -> tuple[tuple[str, ...], str]:
    """Order of all stripes from those that are in view.

    Whichever side of the body is seen, they follow each other as `across` puts their places.

    Returns:
        The stripes in their order, empty where those of the robot file are right, and that in a sentence.
    """
    seen = [name for k, name in enumerate(seen) if k == 0 or name != seen[k - 1]]
    if not stated:
        raise InputError("the robot file has no seal.stripes; allowed: a robot file that names them")
    if len(set(seen)) < 2:
        raise InputError("fewer than two colours were clicked; allowed: two at least, across the body")
    if set(seen) <= set(stated):
        forward, backward = _follows(seen, stated), _follows(seen, stated[::-1])
        if forward and backward:
            raise InputError("these stripes follow each other in both directions; allowed: one more stripe")
        if forward:
            return (), "the stripes follow each other as in the robot file"
        if backward:
            return tuple(reversed(stated)), "the stripes follow each other in the opposite order of the robot file"
    period = list(dict.fromkeys(seen))
    whole = set(period) == set(stated) or len(seen) > len(period)
    if not whole or len(stated) % len(period) or not _follows(seen, period):
        raise InputError(
            f"{', '.join(seen)} do not say the order of {len(stated)} stripes; allowed: every colour, or until the "
            "first comes again"
        )
    return tuple(period * (len(stated) // len(period))), f"the stripes are {', '.join(period)}, and again"


def _follows(some: Sequence[str], whole: Sequence[str]) -> bool:
    """Whether some names follow each other in a closed ring of names."""
    ring = len(whole)
    return any(all(whole[(first + k) % ring] == name for k, name in enumerate(some)) for first in range(ring))
