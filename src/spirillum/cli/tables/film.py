"""Text of `film`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer


def table(answer: Answer, console: Console) -> None:
    """Text of `film`."""
    size, fps = f"{answer['width']}x{answer['height']} pixels", answer["frames_per_second"]
    length = f"{answer['duration']['value']:.3g} s at {fps} frames a second, speed x{answer['speed']:g}"
    said = f"{answer['frames']} frames of {size}, {length}"
    console.print(f"{escape(answer['file'])}: {escape(answer['robot'])}, {said}", highlight=False, soft_wrap=True)
