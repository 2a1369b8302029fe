"""Text of `remote`."""

from __future__ import annotations

from rich.console import Console

from spirillum.cli.tables.parts import Answer


def table(answer: Answer, console: Console) -> None:
    """Text of `remote`."""
    told = f"duty {answer['duty']['value']:g} for {answer['time_on']['value']:g} s, now off"
    line = f"{answer['port']}: {answer['name']}, {told}"
    console.print(line, highlight=False, markup=False, soft_wrap=True)
