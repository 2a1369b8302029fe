"""Text of `robot check`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer


def table(answer: Answer, console: Console) -> None:
    """Text of `robot check`."""
    for problem in answer["problems"]:
        console.print(f"[red]problem:[/red] {escape(problem)}", highlight=False, soft_wrap=True)
    if answer["valid"]:
        console.print(f"{escape(answer['robot'])}: valid", highlight=False)
