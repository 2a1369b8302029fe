"""Answers of `calibrate`, `rank-models` and `suggest` as tables for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from spirillum.cli.text import Answer, grid
from spirillum.units import display_unit, in_unit

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["calibration", "ranking", "suggestion"]


def _counted(number: int, word: str) -> str:
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def calibration(answer: Answer, console: Console) -> None:
    """Table of `calibrate`."""
    synthetic = " (synthetic)" if answer["synthetic"] else ""
    title = (
        f"{answer['observations']}{synthetic}: {_counted(answer['rows'], 'row')} of "
        f"{_counted(answer['robots'], 'robot')}, model "
        f"{answer['model']}, method {answer['method']}"
    )
    console.print(f"[bold]{escape(title)}[/bold]", highlight=False, soft_wrap=True)
    table = grid("", "parameter", "value", "low", "high", "unit")
    for name, item in answer["parameters"].items():
        _add(table, name, item)
    for name, item in answer["discrepancy"].items():
        _add(table, f"discrepancy of the {name.replace('_', ' ')}", item)
    for name, item in answer["error_of_a_trial"].items():
        if item["value"] is not None:
            _add(table, f"error of a trial, {name.replace('_', ' ')}", item)
    console.print(table)
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


def _add(table: Any, name: str, item: Answer) -> None:
    unit = "%" if name.startswith(("discrepancy", "error")) else display_unit(item["value"], item["unit"])
    factor = 100.0 if unit == "%" else 1.0
    numbers = []
    for key in ("value", "low", "high"):
        value = item.get(key)
        numbers.append(
            "-" if value is None else in_unit(factor * value, item["unit"], item["unit"] if unit == "%" else unit)
        )
    table.add_row(escape(name), *numbers, "" if unit == "1" else unit)


def _show_friction(answer: Answer, console: Console) -> None:
    values = [
        tail["effective_friction"]["value"]
        for tail in answer["tails"]
        if "effective_friction" in tail and tail["effective_friction"]["value"] is not None
    ]
    if values:
        console.print(
            f"B_eff of {_counted(len(values), 'tail')} (friction reading {answer['friction']}): {_range(values)} "
            "N m s/rad, tail by tail in predictions.csv",
            highlight=False,
            soft_wrap=True,
        )


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.4g}", f"{max(values):.4g}"
    return low if low == high else f"{low} to {high}"


def ranking(answer: Answer, console: Console) -> None:
    """Table of `rank-models`."""
    synthetic = " (synthetic)" if answer["synthetic"] else ""
    title = (
        f"{answer['observations']}{synthetic}: {_counted(len(answer['models']), 'model')}, "
        f"{_counted(answer['robots'], 'robot')}"
    )
    console.print(f"[bold]{escape(title)}[/bold]", highlight=False, soft_wrap=True)
    from spirillum.calibration.judgement import CALLED

    compared = [name for name in CALLED if any(name in item["discrepancy"] for item in answer["models"])]
    table = grid("", "model", "log density", "difference", *(f"misses {CALLED[name]} by" for name in compared))
    for item in answer["models"]:
        difference = item["difference"]
        apart = "-" if difference["value"] == 0 else f"{difference['value']:.1f} +- {difference['standard_error']:.1f}"
        misses = [item["discrepancy"].get(name) for name in compared]
        shares = ["-" if miss is None else f"{100 * miss['value']:.2g} %" for miss in misses]
        table.add_row(item["model"], f"{item['expected_log_density']['value']:.1f}", apart, *shares)
    console.print(table)
    console.print(f"{escape(answer['verdict'])}", highlight=False, soft_wrap=True)
    for item in answer["models"]:
        console.print(escape(_failures(item)), highlight=False, soft_wrap=True)


_STANDS_OUT = 2.5
"""Standard deviations below which the worst of some tens of means is as far off as chance makes it."""


def _failures(item: Answer) -> str:
    """Where a model fails, on the scale of what its own fit expects of a tail."""
    rows = item["fails_most_at"]
    places = [
        f"{row['tail']} ({row['quantity'].replace('_', ' ')}: observed "
        f"{100 * (row['observed_over_predicted']['value'] - 1):+.0f} %, "
        f"{abs(row['standard_deviations']['value']):.1f} standard deviations)"
        for row in rows
    ]
    largest = max((abs(row["standard_deviations"]["value"]) for row in rows), default=0.0)
    words = f"{item['model']} is furthest off at {'; '.join(places)}"
    if largest < _STANDS_OUT:
        return f"{words}: no tail stands out from what it misses everywhere"
    return words


def suggestion(answer: Answer, console: Console, rows: int = 10) -> None:
    """Table of `suggest`."""
    title = (
        f"{answer['posterior']}, model {answer['model']}: what {answer['trials']} trials of one more tail would tell"
    )
    console.print(f"[bold]{escape(title)}[/bold]", highlight=False, soft_wrap=True)
    table = grid("", "channel (mm)", "tail (mm)", "information (bit)", "narrows most")
    for item in answer["candidates"][:rows]:
        sizes = [f"{1e3 * item[name]['value']:g}" for name in ("channel_diameter", "wavelength", "amplitude")]
        name, share = min(item["narrowing"].items(), key=lambda pair: pair[1]["value"])
        told = f"{name} to {100 * share['value']:.0f} %"
        table.add_row(
            sizes[0], f"{sizes[1]} x {sizes[2]}", f"{item['expected_information']['value']:.3f}", escape(told)
        )
    console.print(table)
