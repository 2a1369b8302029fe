"""The answer of `settle` as tables for people."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

from spirillum.cli.text import Answer, add_quantities, grid
from spirillum.errors import InputError
from spirillum.units import in_unit

if TYPE_CHECKING:
    from spirillum.dynamics.settling import Settling

__all__ = ["gap_range", "settling", "settling_answer"]

_COLUMNS = (
    ("gap", "m", "mm"),
    ("normal_resistance", "N s/m", "N s/m"),
    ("over_lubrication", "1", "1"),
    ("exponent", "1", "1"),
    ("sideways_force", "N", "mN"),
    ("azimuth", "rad", "deg"),
)


def gap_range(text: str) -> tuple[str, str]:
    """FROM:TO, such as ``1mm:0.2mm``.

    Raises:
        InputError: if it is none.
    """
    largest, colon, smallest = text.partition(":")
    if not colon:
        raise InputError(f"drain = {text[:40]!r} is not FROM:TO, for example 1mm:0.2mm")
    return largest, smallest


def settling_answer(found: Settling, picture: Path | None) -> dict[str, Any]:
    """Answer of `settle`, which names the picture that was drawn."""
    answer = found.to_dict()
    warnings = answer.pop("warnings")
    return {**answer, "file": None if picture is None else str(picture), "warnings": warnings}


def settling(answer: Answer, console: Console) -> None:
    """Tables of `settle`: forces and rest at the placement, the film at its gaps."""
    gap = in_unit(answer["placement"]["gap"]["value"], "m", "mm")
    table = grid(f"{answer['robot']}: level at a gap of {gap} mm", "quantity", "value", "unit", "SI")
    add_quantities(table, {name: item for name, item in answer.items() if name != "error_estimate"})
    console.print(table)
    console.print(f"at rest on the wall: {escape(answer['rests'])}", highlight=False)
    film = grid("film under it")
    for name, _, shown in _COLUMNS:
        film.add_column(f"{name.replace('_', ' ')}{f' ({shown})' if shown != '1' else ''}", justify="right")
    drainage = answer["drainage"]
    for row in range(len(drainage["gap"]["value"])):
        film.add_row(*(in_unit(drainage[name]["value"][row], unit, shown) for name, unit, shown in _COLUMNS))
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
