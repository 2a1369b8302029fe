"""Text of `setup check`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer

__all__ = ["table"]


def table(answer: Answer, console: Console) -> None:
    """Text of `setup check`."""
    console.print(f"{escape(answer['file'])}: valid, robot {escape(answer['robot'])}", highlight=False, soft_wrap=True)
    total = 100 * answer["scale_uncertainty"]
    parts = sorted(answer["scale_sources"].items(), key=lambda item: -item[1])
    words = ", ".join(f"{name} {100 * share:.2g} %" for name, share in parts)
    console.print(
        f"standard uncertainty of lengths from heights and scale: {total:.2g} %{': ' + words if words else ''}",
        highlight=False,
        soft_wrap=True,
    )
