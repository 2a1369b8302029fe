"""Table of `rank-models`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.calibration.fit_warnings import CALLED
from spirillum.cli.tables.parts import Answer, grid
from spirillum.display import counted, percent


def table(answer: Answer, console: Console) -> None:
    """Table of `rank-models`."""
    synthetic = " (synthetic)" if answer["synthetic"] else ""
    title = (
        f"{answer['observations']}{synthetic}: {counted(len(answer['models']), 'model')}, "
        f"{counted(answer['robots'], 'robot')}"
    )
    console.print(f"[bold]{escape(title)}[/bold]", highlight=False, soft_wrap=True)
    compared = [name for name in CALLED if any(name in item["discrepancy"] for item in answer["models"])]
    rows = grid("", "model", "log density", "difference", *(f"misses {CALLED[name]} by" for name in compared))
    for item in answer["models"]:
        apart = _apart(item["difference"])
        one = answer["robots"] == 1  # a single tail does not tell by how much a model misses others
        misses = [None if one else item["discrepancy"].get(name) for name in compared]
        shares = ["-" if miss is None else percent(miss["value"]) for miss in misses]
        rows.add_row(item["model"], f"{item['expected_log_density']['value']:.1f}", apart, *shares)
    console.print(rows)
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


def _apart(difference: Answer) -> str:
    """A difference with its standard error; a dash for that of the best model, and for an error that is withheld."""
    if difference["value"] == 0:
        return "-"
    error = difference["standard_error"]
    return f"{difference['value']:.1f} (error: -)" if error is None else f"{difference['value']:.1f} +- {error:.1f}"
