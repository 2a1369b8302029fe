"""Text of `observations check`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer


def table(answer: Answer, console: Console) -> None:
    """Text of `observations check`."""
    seen = ", ".join(f"{name} {count}" for name, count in answer["measured"].items())
    counts = [(answer[name], name[: -1 if answer[name] == 1 else None]) for name in ("rows", "tails", "channels")]
    rows, tails, channels = (f"{count} {name}" for count, name in counts)
    console.print(
        f"{escape(answer['file'])}: valid, {rows} of {tails} in {channels}",
        highlight=False,
        soft_wrap=True,
    )
    console.print(f"measured: {seen}", highlight=False, soft_wrap=True)
