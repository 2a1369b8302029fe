"""Tables of `settle`: the steady motion, where the robot lies, and the film on the way."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import (
    LAID_DOWN,
    Answer,
    add_quantities,
    grid,
    show_error,
    show_lying,
    show_placement,
    show_unsteady,
)
from spirillum.quantities import QUANTITIES
from spirillum.units import in_unit

_COLUMNS = ("gap", "normal_resistance", "over_lubrication", "sideways_force")
"""Quantities of the film under the level robot."""


def table(answer: Answer, console: Console) -> None:
    """Tables of `settle`: the steady motion, where the robot lies, and the film on the way."""
    show_unsteady(answer, console)
    rows = grid(f"{answer['robot']}: settling in its tube", "quantity", "value", "unit", "SI")
    add_quantities(rows, {name: item for name, item in answer.items() if name != "error_estimate"})
    console.print(rows)
    show_placement(answer["placement"], console, LAID_DOWN)
    show_lying(answer["lying"], console)
    drainage = answer["drainage_time"]
    if drainage["value"] is not None:
        gap = in_unit(drainage["until"]["value"], "m", "mm")
        passing = grid(f"on the way, as the gap first falls to {gap} mm", "quantity", "value", "unit", "SI")
        add_quantities(passing, answer["passing"])
        console.print(passing)
    if answer["film"]["gap"]["value"]:
        film = grid("film under it, level")
        for name in _COLUMNS:
            shown = QUANTITIES[name].display_unit
            film.add_column(f"{name.replace('_', ' ')}{f' ({shown})' if shown != '1' else ''}", justify="right")
        columns = [(answer["film"][name]["value"], QUANTITIES[name]) for name in _COLUMNS]
        for index in range(len(answer["film"]["gap"]["value"])):
            film.add_row(*(in_unit(values[index], item.unit, item.display_unit) for values, item in columns))
        console.print(film)
    show_error(answer["error_estimate"], console)
    if answer["file"]:
        console.print(f"picture in {escape(answer['file'])}", highlight=False, soft_wrap=True)
