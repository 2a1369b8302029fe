"""Text and table of `render`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, add_quantities, grid


def table(answer: Answer, console: Console) -> None:
    """Text and table of `render`."""
    lost = f", {answer['dropped']} lost" if answer["dropped"] else ""
    size = f"{answer['width']}x{answer['height']} pixels, {answer['frames_per_second']:g} frames a second"
    said = f"{answer['frames']} frames{lost}, {size}; setup and truth beside it"
    console.print(f"{escape(answer['video'])}: synthetic, {said}", highlight=False, soft_wrap=True)
    rows = grid(f"{answer['robot']}: true motion, {answer['model']}", "quantity", "value", "unit", "SI")
    names = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_rotation_rate")
    add_quantities(rows, {name: answer[name] for name in names})
    console.print(rows)
