"""Table of `simulate`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from spirillum.cli.tables.parts import (
    Answer,
    add_bands,
    add_quantities,
    friendly,
    grid,
    show_error,
    show_placement,
    show_reason,
)
from spirillum.dynamics.run_summary import told
from spirillum.envelope import quantity
from spirillum.units import display_unit, in_unit


def table(answer: Answer, console: Console) -> None:
    """Table of `simulate`."""
    title = f"{answer['robot']}: model {answer['model']}, friction {answer['friction']}, {answer['motion']} motion"
    console.print(_averages(title, answer))
    rows = grid("", "quantity", "value", "unit", "SI")
    add_quantities(rows, dict(_rows(answer)))
    console.print(rows)
    if "draws" in answer:
        bands = grid("", "mean", "value", "low", "high", "unit")
        add_bands(bands, {name: item for name, item in answer.items() if isinstance(item, Mapping) and "low" in item})
        console.print(bands)
        console.print(
            f"low and high: 95 % interval over {answer['draws']} draws, of a tail like those that were fitted, which "
            "the model may miss by as much as these",
            highlight=False,
            soft_wrap=True,
        )
    show_reason(answer, console)
    if "placement" in answer:
        show_placement(answer["placement"], console)
    if "in_tube" in answer:
        place = answer["in_tube"]
        shown = {
            name: " ".join(friendly(place[name]["value"], place[name]["unit"])) for name in place if name != "ends"
        }
        if place["wait"]["value"]:
            shown["gap"] += " after the wait, where the run begins"
        said = [f"{name.replace('_', ' ')} {words.strip()}" for name, words in shown.items()]
        console.print(f"in the tube: ends {place['ends']}, {', '.join(said)}", highlight=False, soft_wrap=True)
    for words in _events(answer["events"]):
        console.print(escape(words), highlight=False)
    show_error(answer["error_estimate"], console)
    whole = f"the part from {answer['begins']['value']:.4g} s on" if "begins" in answer else "the run"
    console.print(f"last 2/3: over the last two thirds of {whole}, on or off", highlight=False)
    console.print(f"steady: {answer['steady']}", highlight=False, soft_wrap=True)
    for name in ("plot", "movie"):
        if name in answer:
            console.print(f"{name} in {escape(answer[name])}", highlight=False, soft_wrap=True)
    console.print(f"trajectory in {escape(answer['file'])}", highlight=False, soft_wrap=True)


def _averages(title: str, answer: Answer) -> Table:
    """Means over the last two thirds, while the drive is on, and while the motion is steady."""
    table = grid(title, "mean", "last 2/3", "while on", "while steady", "unit")
    for name in (name.removesuffix("_on") for name in answer if name.endswith("_on")):
        items = [answer.get(name, _NONE), answer[f"{name}_on"], answer[f"{name}_steady"]]
        most = max((abs(item["value"]) for item in items if item["value"] is not None), default=None)
        unit = display_unit(most, items[1]["unit"])
        values = [in_unit(_rounded(item["value"], most), items[1]["unit"], unit) for item in items]
        table.add_row(name.removeprefix("mean_").replace("_", " "), *values, unit)
    return table


def _rounded(value: float | None, most: float | None) -> float | None:
    """A value without what is rounding error beside the largest one: a robot at rest has no speed of 1e-19 m/s."""
    return 0.0 if value is not None and most is not None and abs(value) <= _ROUNDING * most else value


_ROUNDING = 1e-12
_NONE: Answer = {"value": None}
"""Of the time, which has no mean."""


def _events(events: Sequence[Mapping[str, Any]]) -> list[str]:
    """What happened, a line each."""
    return [
        f"{event.time:.4g} s: {event.what}"
        + (f", {event.times} times until {event.last:.4g} s" if event.times > 1 else "")
        for event in told([(event["time"], event["what"]) for event in events])
    ]


def _rows(answer: Answer) -> list[tuple[str, Any]]:
    """Quantities of the answer, vectors by their parts."""
    found: list[tuple[str, Any]] = []
    for name, item in answer.items():
        averaged = name.endswith(("_on", "_steady")) or f"{name}_on" in answer
        if name == "error_estimate" or averaged or not isinstance(item, Mapping) or "unit" not in item:
            continue
        if isinstance(item["value"], list):
            parts = zip("xyz", item["value"], strict=True)
            found += [(f"{name} {part}", quantity(value, item["unit"])) for part, value in parts]
        else:
            found.append((name, item))
    return found
