"""Table of `calibrate`."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from spirillum.cli.tables.parts import Answer, grid
from spirillum.display import counted
from spirillum.units import display_unit, in_unit


def table(answer: Answer, console: Console) -> None:
    """Table of `calibrate`."""
    synthetic = " (synthetic)" if answer["synthetic"] else ""
    title = (
        f"{answer['observations']}{synthetic}: {counted(answer['rows'], 'row')} of "
        f"{counted(answer['robots'], 'robot')}, model "
        f"{answer['model']}, method {answer['method']}"
    )
    console.print(f"[bold]{escape(title)}[/bold]", highlight=False, soft_wrap=True)
    rows = grid("", "parameter", "value", "low", "high", "unit")
    for name, item in answer["parameters"].items():
        _add(rows, name, item)
    for name, item in answer["discrepancy"].items():
        _add(rows, f"discrepancy of the {name.replace('_', ' ')}", item)
    for name, item in answer["error_of_a_trial"].items():
        if item["value"] is not None:
            _add(rows, f"error of a trial, {name.replace('_', ' ')}", item)
    console.print(rows)
    _show_friction(answer, console)
    if answer["method"] != "paper":
        console.print("low and high: 95 % interval", highlight=False)
    if "sampler" in answer:
        sampler = answer["sampler"]
        worst, fewest = max(sampler["r_hat"].values()), min(sampler["effective_draws"].values())
        console.print(f"sampler: R-hat at most {worst:.3f}, at least {fewest:.0f} effective draws", highlight=False)
    folder = escape(answer["folder"])
    console.print(
        f"{len(answer['files'])} files in {folder}, among them calibration.toml", highlight=False, soft_wrap=True
    )


def _add(rows: Table, name: str, item: Answer) -> None:
    unit = "%" if name.startswith(("discrepancy", "error")) else display_unit(item["value"], item["unit"])
    factor = 100.0 if unit == "%" else 1.0
    numbers = []
    for key in ("value", "low", "high"):
        value = item.get(key)
        numbers.append(
            "-" if value is None else in_unit(factor * value, item["unit"], item["unit"] if unit == "%" else unit)
        )
    rows.add_row(escape(name), *numbers, "" if unit == "1" else unit)


def _show_friction(answer: Answer, console: Console) -> None:
    found = [tail["effective_friction"] for tail in answer["tails"] if "effective_friction" in tail]
    found = [item for item in found if item["value"] is not None]
    if found:
        values = [item["value"] for item in found]
        only = found[0] if len(found) == 1 and found[0].get("low") is not None else {}
        interval = f" ({only['low']:.4g} to {only['high']:.4g})" if only else ""
        console.print(
            f"B_eff of {counted(len(values), 'tail')} (friction reading {answer['friction']}): {_range(values)}"
            f"{interval} N m s/rad, tail by tail in predictions.csv",
            highlight=False,
            soft_wrap=True,
        )
        console.print(escape(answer.get("effective_friction_statement", "")), highlight=False, soft_wrap=True)


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.4g}", f"{max(values):.4g}"
    return low if low == high else f"{low} to {high}"
