"""Text of `show`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer


def table(answer: Answer, console: Console) -> None:
    """Text of `show`."""
    size = f"{answer['width']}x{answer['height']} pixels, view {answer['view']}"
    where = "shown in a window" if answer["file"] is None else escape(answer["file"])
    console.print(f"{where}: {escape(answer['robot'])}, {size}", highlight=False, soft_wrap=True)
