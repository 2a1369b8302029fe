"""Text and table of `virtual-experiment`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid
from spirillum.units import in_unit


def table(answer: Answer, console: Console) -> None:
    """Text and table of `virtual-experiment`."""
    kept = f", {answer['kept']} of them there before" if answer["kept"] else ""
    videos = answer["trials"] * len(answer["robots"])
    console.print(
        f"{escape(answer['folder'])}: synthetic, {videos} videos{kept}; truth in {escape(answer['observations'])}",
        highlight=False,
        soft_wrap=True,
    )
    title = f"without the planted spread of {100 * answer['spread']:g} %"
    rows = grid(title, "robot", "forward velocity (mm/s)", "tail rate (Hz)", "body rate (Hz)")
    for robot in answer["robots"]:
        names = {"forward_velocity": "mm/s", "tail_rotation_rate": "Hz", "body_rotation_rate": "Hz"}
        cells = [in_unit(robot[name]["value"], robot[name]["unit"], unit) for name, unit in names.items()]
        rows.add_row(escape(robot["robot"]), *cells)
    console.print(rows)
