"""What tables share: grids, rows of quantities, bands, placement, errors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from spirillum.display import percent, rows_of
from spirillum.units import display_unit, in_unit

Answer = Mapping[str, Any]
_NUMBERS = ("value", "low", "high", "SI", "last 2/3", "while on", "while steady")
"""Columns of numbers."""


def grid(title: str, *columns: str) -> Table:
    """An empty table in the look of all answers."""
    table = Table(title=escape(title), title_justify="left", title_style="bold", header_style="bold", show_edge=False)
    for column in columns:
        table.add_column(column, justify="right" if column in _NUMBERS else "left", overflow="fold")
    return table


def friendly(value: float | None, unit: str) -> tuple[str, str]:
    """An SI value as people read it, and its unit."""
    shown = display_unit(value, unit)
    return in_unit(value, unit, shown), "" if value is None or shown == "1" else shown


def add_quantities(table: Table, items: Mapping[str, Any], only: Iterable[str] | None = None) -> None:
    """A row for each quantity that has a value, or of `only` these: name, value, unit, SI."""
    for row in rows_of(items, only):
        table.add_row(row.name, row.value, row.unit, row.si)


def add_bands(table: Table, items: Mapping[str, Any], only: Iterable[str] | None = None) -> None:
    """A row for each quantity that has a value, or of `only` these: name, value, low and high of its band, unit."""
    for row in rows_of(items, only):
        table.add_row(row.name, row.value, row.low or "-", row.high or "-", row.unit)


def show_placement(placement: Answer, console: Console, head: str = "placement") -> None:
    """Where the model places the robot, unless nothing is around it; `head` begins the line."""
    if len(placement) == 1:
        return
    said = [escape(str(placement["kind"]))]
    for name, item in placement.items():
        if isinstance(item, Mapping) and item.get("value") is not None:
            value, unit = friendly(item["value"], item["unit"])
            said.append(f"{name.replace('_', ' ')} {value} {unit}".rstrip() + _band_words(item))
        elif name != "kind" and isinstance(item, str):
            said.append(f"{name.replace('_', ' ')} {escape(str(item))}")
    console.print(f"{head}: {', '.join(said)}", highlight=False, soft_wrap=True)


LAID_DOWN = "laid down"
"""Head of the line on the placement of a robot that is let go there."""


def show_unsteady(answer: Answer, console: Console) -> None:
    """Before all numbers, why a free robot has reached no steady motion; nothing where it has."""
    if "lying" in answer and answer["lying"]["state"] != "steady":
        console.print(escape(answer["lying"]["statement"]), style="bold", highlight=False, soft_wrap=True)


def show_lying(lying: Answer, console: Console) -> None:
    """How a free robot moves in the end; the line before it says where it was laid down."""
    said = []
    for name, item in lying.items():
        if name != "followed_time" and isinstance(item, Mapping) and item["value"] not in (None, 0.0):
            value = " ".join(friendly(item["value"], item["unit"]))
            said.append(f"{_WORDS.get(name, name.replace('_', ' '))} {value}{_range_words(item)}".rstrip())
    time = " ".join(friendly(lying["followed_time"]["value"], lying["followed_time"]["unit"]))
    words = f"{_STATES[lying['state']].format(time=time)}: {', '.join(said)}"
    console.print(words, highlight=False, soft_wrap=True)


_WORDS = {
    "approach_time": "approached with a time constant of",
    "contact_force": "borne by asperities with a contact force of",
}
_STATES = {
    "steady": "steady motion (fixed point of a turn, found from the run at {time})",
    "orbits": "orbit around the tube's axis (fixed point of a turn, found from the run at {time})",
    "goes around": "goes around the tube, followed for {time}",
    "changing": "still changing after {time}, in its last turn",
}


def _range_words(item: Mapping[str, Any]) -> str:
    """Over what a value of a steady motion is a mean, and its least value there."""
    if item.get("kind") != "range" or item["low"] is None:
        return ""
    return f" (mean over {item['over']}, at least {' '.join(friendly(item['low'], item['unit']))})"


def _band_words(item: Mapping[str, Any]) -> str:
    """Over what a field of the placement is left open."""
    if "low" not in item:
        return ""
    unit = display_unit(item["high"], item["unit"])
    low, high = (in_unit(item[key], item["unit"], unit) for key in ("low", "high"))
    return f" (open: band over {low} to {high} {unit})"


def show_reason(answer: Answer, console: Console) -> None:
    """Why this model answers, where nobody named one."""
    if "model_reason" in answer:
        console.print(f"model {answer['model']}: {escape(answer['model_reason'])}", highlight=False, soft_wrap=True)


def show_error(error: Answer, console: Console) -> None:
    """A model's own estimate, where it has one, and its known error in words."""
    if error["value"] is not None:
        share = percent(error["value"])
        against = error.get("against", "another resolution")
        said = f"error estimate: {share} of the forward velocity, against {against}"
        console.print(said, highlight=False, soft_wrap=True)
    console.print(f"known error: {escape(error['statement'])}", highlight=False, soft_wrap=True)
