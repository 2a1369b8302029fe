"""Tables of `design`: the best values, what they give, what they are compared with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, add_bands, add_quantities, friendly, grid, show_reason
from spirillum.designs.improvement import ALTERNATIVES
from spirillum.display import percent
from spirillum.units import display_unit, in_unit

_SHOWN = (
    "forward_velocity",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_current",
    "shaft_power",
    "hydrodynamic_efficiency",
)
"""Quantities that stand in the table; all are in the JSON."""


def table(answer: Answer, console: Console) -> None:
    """Tables of `design`."""
    objective = answer["objective"]
    best = _text(objective)
    model = f"model {answer['model']}{', calibrated' if answer['calibrated'] else ''}"
    title = f"{answer['robot']}, {model}: {objective['words']} {best}"
    console.print(f"[bold]{escape(title)}[/bold]", highlight=False, soft_wrap=True)
    show_reason(answer, console)
    fields = grid("", "field", "best", "within 1 %", "unit", "today")
    today = next(item for item in answer["alternatives"] if item["name"] == "today")
    for path, item in answer["design"].items():
        unit = display_unit(item["value"], item["unit"])
        ends = answer["sensitivity"][path]["within_one_per_cent"]["value"]
        low, high = (in_unit(end, item["unit"], unit) for end in ends)
        now = today["design"][path]["value"]
        value, was = (in_unit(number, item["unit"], unit) for number in (item["value"], now))
        fields.add_row(escape(path), value, f"{low} to {high}", "" if unit == "1" else unit, was)
    console.print(fields)
    _quantities(answer, console)
    for words in (*_compared(answer), *_uncertain(answer)):
        console.print(escape(words), highlight=False, soft_wrap=True)
    wound = [f"{name.replace('_', ' ')} {_text(item)}" for name, item in answer["winding"].items()]
    console.print(f"to wind: {', '.join(wound)}", highlight=False, soft_wrap=True)
    if answer["bound_by"]:
        console.print(f"bound by: {escape('; '.join(answer['bound_by']))}", highlight=False, soft_wrap=True)
    if "front" in answer:
        _front(answer["front"], console)
    if "learned" in answer:
        known = answer["learned"]
        best, rest = (percent(known[name]["value"]) for name in ("error_of_the_best", "error_left_out"))
        words = f"learned from {known['solves']} designs that were solved for: the objective of the best was missed by "
        console.print(
            f"{words}{best}, those of the better half, each left out, by {rest}",
            highlight=False,
            soft_wrap=True,
        )
    counts = answer["designs"]
    console.print(
        f"{counts['swum']} designs: {counts['refused']} cannot be built or swum, "
        f"{counts['breaking_a_condition']} break a condition",
        highlight=False,
    )
    for name, what in (("file", "robot file"), ("picture", "picture"), ("stl", "body for a printer")):
        if answer.get(name):
            console.print(f"{what} in {escape(answer[name])}", highlight=False, soft_wrap=True)


def _quantities(answer: Answer, console: Console) -> None:
    shown = {name: answer["quantities"][name] for name in _SHOWN}
    if "uncertainty" in answer:
        rows = grid("what it gives: means, and 95 % intervals", "quantity", "value", "low", "high", "unit")
        add_bands(rows, shown)
    else:
        rows = grid("what it gives", "quantity", "value", "unit", "SI")
        add_quantities(rows, shown)
    console.print(rows)


def _compared(answer: Answer) -> list[str]:
    found = []
    for other in answer["alternatives"]:
        fields = ", ".join(f"{path} {_text(item)}" for path, item in other["design"].items())
        value = _text(other["objective"])
        words = f"{ALTERNATIVES[other['name']]} ({fields}): {value}"
        if not other["keeps_conditions"]:
            words += ", does not keep all conditions"
        if "uncertainty" in answer:
            words += f"; the best is better with probability {_share(other['probability_that_the_design_is_better'])}"
        found.append(words)
    return found


def _uncertain(answer: Answer) -> list[str]:
    known = answer.get("uncertainty")
    if known is None:
        return []
    found = []
    if "probability" in known:
        found.append(f"probability that the target is met: {_share(known['probability'])}")
    if known["deciding"]:
        shares = [f"{name} {100 * share:.0f} %" for name, share in known["deciding"].items()]
        found.append(f"the spread goes with: {', '.join(shares)}")
    return found


def _text(item: Mapping[str, Any]) -> str:
    return " ".join(friendly(item["value"], item["unit"])).strip()


def _share(item: Mapping[str, Any]) -> str:
    return f"{item['value']:.2f} ({item['low']:.2f} to {item['high']:.2f})"


def _front(front: Mapping[str, Any], console: Console) -> None:
    units = {name: display_unit(max(map(abs, item["value"])), item["unit"]) for name, item in front.items()}
    names = [f"{name.replace('_', ' ')}{'' if units[name] == '1' else f' ({units[name]})'}" for name in front]
    rows = grid("designs of which none is better in both", *names)
    for row in zip(*(item["value"] for item in front.values()), strict=True):
        cells = zip(row, front, strict=True)
        rows.add_row(*(in_unit(value, front[name]["unit"], units[name]) for value, name in cells))
    console.print(rows)
