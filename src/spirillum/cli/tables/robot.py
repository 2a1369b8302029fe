"""Table of `robot show`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, friendly, grid


def table(answer: Answer, console: Console) -> None:
    """Table of `robot show`."""
    fields = answer["fields"]
    console.print(f"[bold]{escape(fields['name'])}[/bold]  {escape(fields['description'])}", highlight=False)
    rows = grid("fields", "field", "value", "unit")
    for name, item in fields.items():
        word = "none" if name in ("tail.taper", "channel", "seal") and item is None else _word(item)
        value, unit = friendly(item["value"], item["unit"]) if isinstance(item, Mapping) else (word, "")
        if name not in ("name", "description", "reference"):
            rows.add_row(name, value, unit)
    console.print(rows)
    found = grid("what follows", "quantity", "value", "unit", "meaning")
    for name, item in answer["derived"].items():
        value, unit = friendly(item["value"], item["unit"])
        found.add_row(name.replace("_", " "), value, unit, item["meaning"])
    console.print(found)


def _word(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, tuple):
        return escape(", ".join(str(item) for item in value)) or "-"
    return f"{value:.6g}" if isinstance(value, float) else escape(str(value))
