"""Table of `simulate`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape

from spirillum.answer import quantity
from spirillum.cli.tables.parts import Answer, add_quantities, grid, show_error

__all__ = ["table"]


def table(answer: Answer, console: Console) -> None:
    """Table of `simulate`."""
    title = f"{answer['robot']}: model {answer['model']}, friction {answer['friction']}, {answer['motion']} motion"
    rows = grid(title, "quantity", "value", "unit", "SI")
    add_quantities(rows, dict(_rows(answer)))
    console.print(rows)
    for event in answer["events"]:
        console.print(f"{event['time']:.4g} s: {escape(event['what'])}", highlight=False)
    show_error(answer["error_estimate"], console)
    console.print("means are over the last two thirds of the run", highlight=False)
    for name in ("plot", "movie"):
        if name in answer:
            console.print(f"{name} in {escape(answer[name])}", highlight=False, soft_wrap=True)
    console.print(f"trajectory in {escape(answer['file'])}", highlight=False, soft_wrap=True)


def _rows(answer: Answer) -> list[tuple[str, Any]]:
    """Quantities of the answer, vectors by their parts."""
    found: list[tuple[str, Any]] = []
    for name, item in answer.items():
        if name == "error_estimate" or not isinstance(item, Mapping) or "unit" not in item:
            continue
        if isinstance(item["value"], list):
            parts = zip("xyz", item["value"], strict=True)
            found += [(f"{name} {part}", quantity(value, item["unit"])) for part, value in parts]
        else:
            found.append((name, item))
    return found
