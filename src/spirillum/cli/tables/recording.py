"""The file of a recording, and its topics."""

from __future__ import annotations

from rich.console import Console

from spirillum.cli.tables.parts import Answer, grid


def table(answer: Answer, console: Console) -> None:
    """The file, then its topics."""
    line = f"{answer['file']}: a recording for Foxglove, {answer['robot']}, {answer['duration']['value']:.3g} s"
    console.print(line, highlight=False, markup=False, soft_wrap=True)
    rows = grid("topics", "topic", "messages")
    for topic, count in answer["topics"].items():
        rows.add_row(topic, str(count))
    console.print(rows)
