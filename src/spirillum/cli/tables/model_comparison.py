"""Table of `compare-models`: a row for each quantity, a column for each model with its difference."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid
from spirillum.units import display_unit, in_unit

__all__ = ["table"]


_LEFT_OUT = ("propulsive_power", "overall_efficiency", "cost_of_transport")
"""What follows from other rows, and stands in the JSON only."""


def table(answer: Answer, console: Console) -> None:
    """Table of `compare-models`: a row for each quantity, a column for each model with its difference."""
    reference = answer["reference"]
    models = [item for item in answer["models"] if item["answered"]]
    rows = grid(f"{answer['robot']}: models side by side, friction {answer['friction']}", "quantity")
    for item in models:
        name = item["model"]
        rows.add_column(name if name == reference else f"{name}, vs {reference}", justify="right")
    rows.add_column("unit", no_wrap=True)
    for name in models[0]["relative_difference"]:
        if name in _LEFT_OUT:
            continue
        values = [item[name]["value"] for item in models]
        known = [value for value in values if value is not None]
        if not known:
            continue
        unit = models[0][name]["unit"]
        shown = display_unit(max(known, key=abs), unit)
        cells = []
        for item, value in zip(models, values, strict=True):
            cell = in_unit(value, unit, shown)
            if item["model"] != reference:
                cell += f" {_difference(item['relative_difference'][name]['value']):>7}"
            cells.append(cell)
        rows.add_row(name.replace("_", " "), *cells, "" if shown == "1" else shown)
    rows.add_row("calibrated", *("yes" if item["calibrated"] else "no" for item in models), "")
    console.print(rows)
    for item in answer["models"]:
        console.print(escape(_own_error(item)), highlight=False, soft_wrap=True)
    if answer["file"]:
        console.print(f"picture in {escape(answer['file'])}", highlight=False, soft_wrap=True)


def _own_error(item: Answer) -> str:
    """A model's error in words, with its own estimate where it has one, or why there is no answer."""
    if not item["answered"]:
        return f"no answer: {item['reason']}"
    error = item["error_estimate"]
    estimate = (
        ""
        if error["value"] is None
        else f"{100 * error['value']:.2g} % of the forward velocity, against "
        f"{error.get('against', 'another resolution')}; "
    )
    return f"known error of {item['model']}: {estimate}{error['statement']}"


def _difference(share: float | None) -> str:
    if share is None:
        return "-"
    percent = 100.0 * share
    text = f"{percent:+.1f}" if abs(percent) < 99.95 else f"{percent:+.0f}"
    return "0.0%" if float(text) == 0 else f"{text}%"
