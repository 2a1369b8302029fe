"""Tables of `settle`: forces and rest where the robot was placed, the film at its gaps."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, add_quantities, grid
from spirillum.quantities import QUANTITIES
from spirillum.units import in_unit

__all__ = ["table"]


_COLUMNS = ("gap", "normal_resistance", "over_lubrication", "exponent", "sideways_force", "azimuth")
"""Quantities of the film under the robot."""


def table(answer: Answer, console: Console) -> None:
    """Tables of `settle`: forces and rest at the placement, the film at its gaps."""
    gap = in_unit(answer["placement"]["gap"]["value"], "m", "mm")
    rows = grid(f"{answer['robot']}: level at a gap of {gap} mm", "quantity", "value", "unit", "SI")
    add_quantities(rows, {name: item for name, item in answer.items() if name != "error_estimate"})
    console.print(rows)
    console.print(f"at rest on the wall: {escape(answer['rests'])}", highlight=False)
    film = grid("film under it")
    for name in _COLUMNS:
        shown = QUANTITIES[name].display_unit
        film.add_column(f"{name.replace('_', ' ')}{f' ({shown})' if shown != '1' else ''}", justify="right")
    drainage = answer["drainage"]
    columns = [(drainage[name]["value"], QUANTITIES[name]) for name in _COLUMNS]
    for index in range(len(drainage["gap"]["value"])):
        film.add_row(*(in_unit(values[index], item.unit, item.display_unit) for values, item in columns))
    console.print(film)
    error = answer["error_estimate"]
    if error["value"] is not None:
        console.print(
            f"error estimate: {100 * error['value']:.2g} % of the sideways force, against a coarser resolution",
            highlight=False,
        )
    console.print(f"known error: {escape(error['statement'])}", highlight=False, soft_wrap=True)
    if answer["file"]:
        console.print(f"picture in {escape(answer['file'])}", highlight=False, soft_wrap=True)
