"""Text of `study --store`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer
from spirillum.cli.tables.study import empty_results


def table(answer: Answer, console: Console) -> None:
    """Text of `study --store`."""
    sizes = " x ".join(f"{size} {name}" for name, size in answer["dimensions"].items())
    console.print(f"[bold]{escape(answer['title'])}[/bold]: {sizes}", highlight=False)
    if answer["unanswered"]:
        console.print(empty_results(answer), highlight=False)
    console.print(f"observations: {escape(answer['observations'])}", highlight=False)
    console.print(f"{answer['results']} results in {escape(answer['folder'])}", highlight=False, soft_wrap=True)
