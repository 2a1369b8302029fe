"""Answers of `calibrate`, `rank-models` and `suggest` as tables for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape

from spirillum.cli.text import friendly_unit, grid, in_unit

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["calibration", "calibration_content"]

Answer = Mapping[str, Any]


def calibration_content(answer: Mapping[str, Any], folder: Path, written: Sequence[Path]) -> dict[str, Any]:
    """The answer with the files that were written; warnings stay last."""
    content = {name: item for name, item in answer.items() if name != "warnings"}
    content |= {"folder": str(folder), "files": sorted(str(path.relative_to(folder)) for path in written)}
    return {**content, "warnings": answer["warnings"]}


def calibration(answer: Answer, console: Console) -> None:
    """Table of `calibrate`."""
    synthetic = " (synthetic)" if answer["synthetic"] else ""
    title = (
        f"{answer['observations']}{synthetic}: {answer['rows']} rows of {answer['robots']} robots, model "
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
    unit = "%" if name.startswith(("discrepancy", "error")) else friendly_unit(item["value"], item["unit"])
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
            f"B_eff of {len(values)} tails (friction reading {answer['friction']}): {min(values):.4g} to "
            f"{max(values):.4g} "
            "N m s/rad, tail by tail in predictions.csv",
            highlight=False,
            soft_wrap=True,
        )
