"""Text of `setup propose`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid


def table(answer: Answer, console: Console) -> None:
    """Text of `setup propose`: what was found and how sure it is, then what is left to be filled in."""
    rows = grid(f"{answer['film']}: what it shows", "what", "sure", "seen")
    for finding in answer["findings"]:
        rows.add_row(finding["name"].replace("_", " "), finding["confidence"], finding["sentence"])
    console.print(rows)
    fields = ", ".join(item["field"] for item in answer["to_fill"])
    if answer["file"] is not None:
        words = f"{answer['file']}: fill in what you know: {fields}"
        console.print(escape(words), highlight=False, soft_wrap=True)
