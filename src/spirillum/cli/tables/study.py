"""Text of `study`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer

__all__ = ["table"]


def table(answer: Answer, console: Console) -> None:
    """Text of `study`."""
    sizes = " x ".join(f"{size} {name}" for name, size in answer["dimensions"].items())
    console.print(f"[bold]{escape(answer['title'])}[/bold]: {sizes}", highlight=False)
    if answer["unanswered"]:
        console.print(f"{answer['unanswered']} results are empty: variable `outside` says why", highlight=False)
    if any(answer["claims"].values()):
        claims = ", ".join(f"{count} {verdict}" for verdict, count in answer["claims"].items())
        console.print(f"statements of the paper: {claims}", highlight=False)
    if answer.get("predictions"):
        counts = ", ".join(f"{count} {verdict.replace('-', ': ')}" for verdict, count in answer["predictions"].items())
        console.print(f"laid down and let go, nothing fitted: {counts}", highlight=False)
    console.print(f"observations: {escape(answer['observations'])}", highlight=False)
    console.print(f"open {escape(answer['folder'])}/report.html", highlight=False, soft_wrap=True)
