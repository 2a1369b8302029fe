"""Table of `resistance`."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from spirillum.cli.tables.parts import Answer, show_placement


def table(answer: Answer, console: Console) -> None:
    """Table of `resistance`."""
    title = f"{answer['robot']}: resistance of {answer['part']}, model {answer['model']}, about {answer['about']}"
    if "links" in answer:
        console.print(f"[bold]{escape(title)}[/bold]", highlight=False, soft_wrap=True)
    matrix, links = answer["matrix"]["value"], answer.get("links", [answer["part"]])
    for number, on in enumerate(links):
        for other, of in enumerate(links):
            if other < number:
                continue  # the transpose
            block = [row[6 * other : 6 * other + 6] for row in matrix[6 * number : 6 * number + 6]]
            console.print(_block(title if len(links) == 1 else f"on the {on}, by motion of the {of}", block))
    console.print("N s/m (upper left), N s, N m s (lower right); F = -B V", highlight=False)
    show_placement(answer["placement"], console)


def _block(title: str, block: Sequence[Sequence[float | None]]) -> Table:
    """A 6x6 with its rows and columns named."""
    rows = Table(
        title=escape(title), title_justify="left", title_style="bold", header_style="bold", show_edge=False, padding=0
    )
    rows.add_column("", no_wrap=True)
    for name in ("U_x", "U_y", "U_z", "Omega_x", "Omega_y", "Omega_z"):
        rows.add_column(name, justify="right", no_wrap=True, min_width=10)
    for name, row in zip(("F_x", "F_y", "F_z", "T_x", "T_y", "T_z"), block, strict=True):
        rows.add_row(name, *("-" if entry is None else f"{entry:.4g}" for entry in row))
    return rows
