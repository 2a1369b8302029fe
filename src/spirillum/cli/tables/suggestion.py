"""Table of `suggest`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid

__all__ = ["table"]


def table(answer: Answer, console: Console, rows: int = 10) -> None:
    """Table of `suggest`."""
    title = (
        f"{answer['posterior']}, model {answer['model']}: what {answer['trials']} trials of one more tail would tell"
    )
    console.print(f"[bold]{escape(title)}[/bold]", highlight=False, soft_wrap=True)
    found = grid("", "channel (mm)", "tail (mm)", "information (bit)", "narrows most")
    for item in answer["candidates"][:rows]:
        sizes = [f"{1e3 * item[name]['value']:g}" for name in ("channel_diameter", "wavelength", "amplitude")]
        name, share = min(item["narrowing"].items(), key=lambda pair: pair[1]["value"])
        told = f"{name} to {100 * share['value']:.0f} %"
        found.add_row(
            sizes[0], f"{sizes[1]} x {sizes[2]}", f"{item['expected_information']['value']:.3f}", escape(told)
        )
    console.print(found)
