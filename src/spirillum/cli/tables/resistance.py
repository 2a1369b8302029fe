"""Table of `resistance`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from spirillum.cli.tables.parts import Answer, show_placement

__all__ = ["table"]


def table(answer: Answer, console: Console) -> None:
    """Table of `resistance`."""
    title = f"{answer['robot']}: resistance of {answer['part']}, model {answer['model']}, about {answer['about']}"
    names = ("U_x", "U_y", "U_z", "Omega_x", "Omega_y", "Omega_z")
    rows = Table(
        title=escape(title), title_justify="left", title_style="bold", header_style="bold", show_edge=False, padding=0
    )
    rows.add_column("", no_wrap=True)
    for name in names:
        rows.add_column(name, justify="right", no_wrap=True, min_width=10)
    for name, row in zip(("F_x", "F_y", "F_z", "T_x", "T_y", "T_z"), answer["matrix"]["value"], strict=True):
        rows.add_row(name, *("-" if entry is None else f"{entry:.4g}" for entry in row))
    console.print(rows)
    console.print("N s/m (upper left), N s, N m s (lower right); F = -B V", highlight=False)
    show_placement(answer["placement"], console)
