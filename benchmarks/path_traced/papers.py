"""Printed papers under the tube, as pictures: ruler strips, 2 mm grid paper and millimetre paper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

__all__ = ["Paper", "papers_of"]

_PER_MM = 16
_SHEET = (0.90, 0.90, 0.88)
_RULER_LENGTH, _RULER_WIDTH, _RULER_DISTANCE = 260, 14, 3.0
_GRID = ((2.0, 0.22, (0.42, 0.55, 0.80)), (10.0, 0.32, (0.16, 0.17, 0.22)))
_MILLIMETRE = ((1.0, 0.13, (0.90, 0.62, 0.45)), (5.0, 0.22, (0.86, 0.50, 0.32)), (10.0, 0.34, (0.78, 0.36, 0.20)))
"""Spacing and width of lines, mm, and their colour."""


@dataclass(frozen=True)
class Paper:
    """A sheet on the floor."""

    picture: Image.Image
    centre: tuple[float, float]
    """mm."""
    size: tuple[float, float]
    """mm."""
    spacing: float
    """From one of its finest lines to the next, mm."""


def papers_of(kind: str, outside: float, angle_seed: int) -> list[Paper]:
    """The sheets of a scene.

    Args:
        kind: `ruler`, `grid` or `millimetre`.
        outside: outer radius of the tube, mm; ruler strips lie beside it.
        angle_seed: seed of where the sheet lies.
    """
    shift = np.random.default_rng([angle_seed, 7]).uniform(-1.0, 1.0, 2)
    if kind == "ruler":
        far = outside + _RULER_DISTANCE + 0.5 * _RULER_WIDTH
        strip = _ruler()
        return [Paper(strip, (float(shift[0]), side * far), (_RULER_LENGTH, _RULER_WIDTH), 2.0) for side in (1, -1)]
    lines = _GRID if kind == "grid" else _MILLIMETRE
    size = 260, 136
    return [Paper(_sheet(size, lines), (float(shift[0]), float(shift[1])), size, lines[0][0])]


def _bytes(colour: tuple[float, float, float]) -> tuple[int, int, int]:
    red, green, blue = (round(255 * value) for value in colour)
    return red, green, blue


def _sheet(size: tuple[int, int], sorts: tuple[tuple[float, float, tuple[float, float, float]], ...]) -> Image.Image:
    """Lines of several sorts in both directions, from the middle of the sheet."""
    width, height = (side * _PER_MM for side in size)
    picture = Image.new("RGB", (width, height), _bytes(_SHEET))
    draw = ImageDraw.Draw(picture)
    for spacing, thick, colour in sorts:
        half = 0.5 * thick * _PER_MM
        for vertical, across, along in ((True, width, height), (False, height, width)):
            reach = int(0.5 * across / (spacing * _PER_MM))
            for number in range(-reach, reach + 1):
                place = 0.5 * across + number * spacing * _PER_MM
                low, high = round(place - half), round(place + half) - 1
                box = (low, 0, high, along) if vertical else (0, low, along, high)
                draw.rectangle(box, fill=_bytes(colour))
    return picture


def _ruler() -> Image.Image:
    """A strip with a line every 2 mm, longer ones every 10 mm, and numbers every 20 mm."""
    picture = Image.new("RGB", (_RULER_LENGTH * _PER_MM, _RULER_WIDTH * _PER_MM), _bytes(_SHEET))
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(round(2.6 * _PER_MM))
    half = round(0.5 * 0.45 * _PER_MM)
    for number in range(_RULER_LENGTH // 2 + 1):
        place = 2 * number * _PER_MM
        long = 8.5 if number % 5 == 0 else 6.5
        draw.rectangle((place - half, 0, place + half - 1, long * _PER_MM), fill=(26, 26, 30))
        if number % 10 == 0 and 0 < number < _RULER_LENGTH // 2:
            text = str(number // 5 - 1)
            draw.text((place, 11.2 * _PER_MM), text, fill=(40, 40, 44), font=font, anchor="mm")
    return picture
