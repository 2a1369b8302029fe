"""Table of `magnetic-sweep`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid
from spirillum.quantities import QUANTITIES
from spirillum.units import in_unit

_COLUMNS = {
    "field_rate": "field",
    "tail_rotation_rate": "tail",
    "forward_velocity": "speed",
    "wobble_angle": "wobble",
    "phase_lag": "lag",
}
"""Quantities and the heads of their columns."""


def table(answer: Answer, console: Console) -> None:
    """Table of `magnetic-sweep`."""
    title = f"{answer['robot']}: rotating field, model {answer['model']}, free motion"
    rows = grid(title, *(f"{word}, {QUANTITIES[name].display_unit}" for name, word in _COLUMNS.items()))
    columns = [(answer[name], QUANTITIES[name].display_unit) for name in _COLUMNS]
    for index in range(len(answer["field_rate"]["value"])):
        rows.add_row(*(in_unit(item["value"][index], item["unit"], unit) for item, unit in columns))
    console.print(rows)
    step_out = in_unit(answer["step_out_rate"]["value"], "rad/s", "Hz")
    console.print(f"step-out of the held robot at {step_out} Hz; no lag where the robot slips", highlight=False)
    if "plot" in answer:
        console.print(f"plot in {escape(answer['plot'])}", highlight=False, soft_wrap=True)
    console.print(f"sweep in {escape(answer['file'])}", highlight=False, soft_wrap=True)
