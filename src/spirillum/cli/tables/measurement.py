"""Tables of `measure`: each trial, and the means over them; one trial has one table."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid
from spirillum.measurement.shown import ShownNumber, shown
from spirillum.measurement.trials import MEASURED, RATE_NAMES


def table(answer: Answer, console: Console) -> None:
    """Tables of `measure`: each trial, and the means over them; one trial has one table."""
    trials, summary = answer["trials"], answer["summary"]
    several = len(trials) > 1
    if several:
        _show_trials(answer, console)
    title = "means over trials" if several else f"{answer['robot']}: {trials[0]['name']}"
    rows = grid(title, "quantity", "value", "low", "high", "unit", *(["trials"] if several else []))
    for name, item in summary.items():
        if isinstance(item, dict) and (item["value"] is not None or name in RATE_NAMES):
            rows.add_row(name.replace("_", " "), *_numbers(item), *([str(item["n"])] if several else []))
    console.print(rows)
    _show_intervals(answer, console, several=several)
    if answer["files"]:
        listed = [name for name in answer["files"] if not name.startswith("figures/")]
        files = f"{len(answer['files'])} files, among them {', '.join(listed[-3:])}"
        console.print(escape(files), highlight=False, soft_wrap=True)


def _show_intervals(answer: Answer, console: Console, *, several: bool) -> None:
    """What the intervals are, and why there is none where there is none."""
    scale = 100 * answer["summary"]["scale_uncertainty"]
    known = [
        (name.replace("_", " "), item)
        for items in (answer["summary"], *answer["trials"])
        for name, item in items.items()
        if name in MEASURED and item["value"] is not None
    ]
    if any("low" in item for _, item in known):
        words = "Student's t over trials" if several else "from the trial's own residuals"
        share = f"; the scale's standard uncertainty of {scale:.2g} % is in lengths whole" if scale else ""
        console.print(f"low and high: 95 % interval, {words}{share}", highlight=False, soft_wrap=True)
    reasons = {item["reason"] for _, item in known if "low" not in item}
    for reason in sorted(reasons):
        names = dict.fromkeys(name for name, item in known if item.get("reason") == reason)
        console.print(f"no interval of {', '.join(names)}: {escape(reason)}", highlight=False, soft_wrap=True)


def _show_trials(answer: Answer, console: Console) -> None:
    trials = answer["trials"]
    title = f"{answer['robot']}: {len(trials)} trials"
    table = grid(title, "trial", "quantity", "value", "low", "high", "unit")
    for trial in trials:
        for row, name in enumerate(RATE_NAMES):
            table.add_row(escape(trial["name"]) if row == 0 else "", name.replace("_", " "), *_numbers(trial[name]))
    console.print(table)


def _numbers(item: Answer) -> ShownNumber:
    return shown(item["value"], item.get("low"), item.get("high"), item["unit"])
