"""Table of `compare-models`: a row for each model, or with `--all` a row for each quantity."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid
from spirillum.display import percent
from spirillum.swimming.steady_quantities import headline
from spirillum.units import display_unit, in_unit

_LEFT_OUT = ("propulsive_power", "overall_efficiency", "cost_of_transport")
"""What follows from other rows, and stands in the JSON only."""
_SHORT = {
    "forward_velocity": "speed",
    "tail_rotation_rate": "tail",
    "body_rotation_rate": "body",
    "motor_current": "current",
    "step_out_rate": "step-out",
    "hydrodynamic_efficiency": "efficiency",
    "tail_torque": "torque",
}
"""Names for the heads of narrow columns."""


def table(answer: Answer, console: Console, *, all_of_it: bool = False) -> None:
    """Table of `compare-models`: the quantities that matter most, a row for each model, or all of them."""
    models = [item for item in answer["models"] if item["answered"]]
    if all_of_it:
        _all_quantities(answer, models, console)
    else:
        _side_by_side(answer, models, console)
    for item in answer["models"]:
        console.print(escape(_own_error(item)), highlight=False, soft_wrap=True)
    if answer["file"]:
        console.print(f"picture in {escape(answer['file'])}", highlight=False, soft_wrap=True)


def _side_by_side(answer: Answer, models: Sequence[Answer], console: Console) -> None:
    reference = answer["reference"]
    names = [name for name in headline(next(m for m in models if m["model"] == reference)) if _known(models, name)]
    rows = grid(f"{answer['robot']}: models side by side, friction {answer['friction']}", "model")
    for name in names:
        unit = _shown_unit(models, name)
        rows.add_column(_SHORT[name] + (f"\n{unit}" if unit != "1" else ""), justify="right")
        if name == names[0]:
            rows.add_column(f"against\n{reference}", justify="right")
    for item in models:
        cells = [in_unit(item[name]["value"], item[name]["unit"], _shown_unit(models, name)) for name in names]
        against = "" if item["model"] == reference else _difference(item["relative_difference"][names[0]]["value"])
        name = f"{item['model']}*" if item["calibrated"] else str(item["model"])
        rows.add_row(name, cells[0], against, *cells[1:])
    console.print(rows)
    if any(item["calibrated"] for item in models):
        console.print("*: with calibration factors", highlight=False)
    console.print("all quantities: --all", highlight=False)


def _all_quantities(answer: Answer, models: Sequence[Answer], console: Console) -> None:
    """A row for each quantity: first the values, then how far they are from the reference model's."""
    reference, names = answer["reference"], models[0]["relative_difference"]
    known = [name for name in names if name not in _LEFT_OUT and _known(models, name)]
    values = grid(f"{answer['robot']}: models side by side, friction {answer['friction']}", "quantity")
    others = grid(f"against {reference}", "quantity")
    for item in models:
        values.add_column(item["model"], justify="right", no_wrap=True)
        if item["model"] != reference:
            others.add_column(item["model"], justify="right", no_wrap=True)
    for name in known:
        unit = _shown_unit(models, name)
        cells = [in_unit(item[name]["value"], item[name]["unit"], unit) for item in models]
        words = name.replace("_", " ")
        values.add_row(words + (f", {unit}" if unit != "1" else ""), *cells)
        apart = [item["relative_difference"][name]["value"] for item in models if item["model"] != reference]
        others.add_row(words, *map(_difference, apart))
    values.add_row("calibrated", *("yes" if item["calibrated"] else "no" for item in models))
    console.print(values)
    if len(models) > 1:
        console.print(others)


def _known(models: Sequence[Answer], name: str) -> bool:
    return any(item[name]["value"] is not None for item in models)


def _shown_unit(models: Sequence[Answer], name: str) -> str:
    """The unit of a quantity for all models: that of the largest value."""
    sizes = [abs(item[name]["value"]) for item in models if item[name]["value"]]
    return display_unit(max(sizes, default=None), models[0][name]["unit"])


def _own_error(item: Answer) -> str:
    """A model's error in words, with its own estimate where it has one, or why there is no answer."""
    if not item["answered"]:
        return f"no answer by {item['model']}: {item['reason']}"
    error = item["error_estimate"]
    estimate = (
        ""
        if error["value"] is None
        else f"{percent(error['value'])} of the forward velocity, against "
        f"{error.get('against', 'another resolution')}; "
    )
    return f"known error of {item['model']}: {estimate}{error['statement']}"


def _difference(share: float | None) -> str:
    if share is None:
        return "-"
    percent = 100.0 * share
    text = f"{percent:+.1f}" if abs(percent) < 99.95 else f"{percent:+.0f}"
    return "0.0%" if float(text) == 0 else f"{text}%"
