"""Answers as tables for people, or as JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from spirillum.answer import as_json, envelope, quantity
from spirillum.errors import InputError
from spirillum.robot.fields import field_values
from spirillum.units import KINDS, display_unit, in_unit, parse_option

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.robot.robot import Robot

Answer = Mapping[str, Any]
_NARROWEST = 80
_NUMBERS = ("value", "low", "high", "SI")
"""Columns of numbers."""


class _PipedConsole(Console):
    """A console that leaves a reader who has gone, as `| head` does, to the caller."""

    def on_broken_pipe(self) -> None:
        """Hand the error on: the library would end the program with exit code 1."""
        raise BrokenPipeError


def show(answer: Answer, table: Callable[[Answer, Console], None], *, json: bool) -> None:
    """Print an answer as JSON, or as the table of its kind followed by its warnings."""
    if json:
        try:
            typer.echo(as_json(answer))
        except BrokenPipeError as error:
            raise BrokenPipeError from error  # without its number, by which the library would end with exit code 1
        return
    console = _PipedConsole()
    if console.width < _NARROWEST:
        console = _PipedConsole(width=_NARROWEST)  # a narrow terminal wraps; it must not lose numbers
    table(answer, console)
    for warning in answer["warnings"]:
        console.print(f"[yellow]warning:[/yellow] {escape(warning)}", highlight=False, soft_wrap=True)


def grid(title: str, *columns: str) -> Table:
    """An empty table in the look of all answers."""
    table = Table(title=escape(title), title_justify="left", title_style="bold", header_style="bold", show_edge=False)
    for column in columns:
        table.add_column(column, justify="right" if column in _NUMBERS else "left")
    return table


def _friendly(value: float | None, unit: str) -> tuple[str, str]:
    shown = display_unit(value, unit)
    return in_unit(value, unit, shown), "" if value is None or shown == "1" else shown


def add_quantities(table: Table, items: Mapping[str, Any]) -> None:
    """A row for each quantity that has a value: name, value, unit, SI."""
    for name, item in items.items():
        if isinstance(item, Mapping) and "unit" in item and item["value"] is not None:
            value, unit = _friendly(item["value"], item["unit"])
            si = "" if unit in ("", item["unit"]) else f"{item['value']:.6g} {item['unit']}"
            table.add_row(name.replace("_", " "), value, unit, si)


def prediction(answer: Answer, console: Console) -> None:
    """Table of `predict`."""
    calibrated = "calibrated" if answer["calibrated"] else "not calibrated"
    free = ", free motion" if answer["motion"] == "free" else ""
    title = f"{answer['robot']}: model {answer['model']}, friction {answer['friction']}, {calibrated}{free}"
    quantities = {name: item for name, item in answer.items() if name != "error_estimate"}
    if "band" in answer or "kind" in answer["forward_velocity"]:
        table = grid(title, "quantity", "value", "low", "high", "unit")
        _add_bands(table, quantities)
    else:
        table = grid(title, "quantity", "value", "unit", "SI")
        add_quantities(table, quantities)
    console.print(table)
    _show_placement(answer["placement"], console)
    if answer["forward_velocity"].get("kind") == "interval":
        level = answer["forward_velocity"]["level"]
        console.print(f"low and high: {100 * level:g} % interval of the robot's own motion", highlight=False)
    if "band" in answer:
        places = len(answer["band"]["gap"]["value"])
        console.print(
            f"band: low and high are the least and the largest of {places + 1} places, none of them likelier than "
            "another; value: the place above",
            highlight=False,
            soft_wrap=True,
        )
    show_error(answer["error_estimate"], console)


def _add_bands(table: Table, items: Mapping[str, Any]) -> None:
    """A row for each quantity that has a value: name, value, low and high of its band, unit."""
    for name, item in items.items():
        if isinstance(item, Mapping) and "unit" in item and item["value"] is not None:
            unit = display_unit(item["value"], item["unit"])
            numbers = [in_unit(item.get(key), item["unit"], unit) for key in ("value", "low", "high")]
            table.add_row(name.replace("_", " "), *numbers, "" if unit == "1" else unit)


def _show_placement(placement: Answer, console: Console) -> None:
    """Where the model places the robot, unless nothing is around it."""
    if len(placement) == 1:
        return
    said = [escape(str(placement["kind"]))]
    for name, item in placement.items():
        if isinstance(item, Mapping) and item.get("value") is not None:
            value, unit = _friendly(item["value"], item["unit"])
            said.append(f"{name.replace('_', ' ')} {value} {unit}".rstrip() + _band_words(item))
        elif name != "kind" and isinstance(item, str):
            said.append(f"{name.replace('_', ' ')} {escape(str(item))}")
    console.print(f"placement: {', '.join(said)}", highlight=False, soft_wrap=True)


def _band_words(item: Mapping[str, Any]) -> str:
    """Over what a field of the placement is left open."""
    if "low" not in item:
        return ""
    unit = display_unit(item["high"], item["unit"])
    low, high = (in_unit(item[key], item["unit"], unit) for key in ("low", "high"))
    return f" (open: band over {low} to {high} {unit})"


def show_error(error: Answer, console: Console) -> None:
    """A model's own estimate, where it has one, and its known error in words."""
    if error["value"] is not None:
        share = f"{100 * error['value']:.2g} %"
        console.print(f"error estimate: {share} of the forward velocity, against another resolution", highlight=False)
    console.print(f"known error: {escape(error['statement'])}", highlight=False, soft_wrap=True)


def resistance(answer: Answer, console: Console) -> None:
    """Table of `resistance`."""
    title = f"{answer['robot']}: resistance of {answer['part']}, model {answer['model']}, about {answer['about']}"
    names = ("U_x", "U_y", "U_z", "Omega_x", "Omega_y", "Omega_z")
    table = Table(
        title=escape(title), title_justify="left", title_style="bold", header_style="bold", show_edge=False, padding=0
    )
    table.add_column("", no_wrap=True)
    for name in names:
        table.add_column(name, justify="right", no_wrap=True, min_width=10)
    for name, row in zip(("F_x", "F_y", "F_z", "T_x", "T_y", "T_z"), answer["matrix"]["value"], strict=True):
        table.add_row(name, *("-" if entry is None else f"{entry:.4g}" for entry in row))
    console.print(table)
    console.print("N s/m (upper left), N s, N m s (lower right); F = -B V", highlight=False)
    _show_placement(answer["placement"], console)


def robot_answer(robot: Robot) -> dict[str, Any]:
    """Answer of `robot show`."""
    derived = {name: quantity(item.value, item.unit, meaning=item.meaning) for name, item in robot.derived().items()}
    fields = {
        path: value if unit is None else quantity(value, unit.replace("**", "^"))
        for path, value, unit in field_values(robot)
    }
    content = {"robot": robot.name, "fields": fields, "derived": derived}
    return envelope("robot", content, robot.warnings)


def robot(answer: Answer, console: Console) -> None:
    """Table of `robot show`."""
    fields = answer["fields"]
    console.print(f"[bold]{escape(fields['name'])}[/bold]  {escape(fields['description'])}", highlight=False)
    table = grid("fields", "field", "value", "unit")
    for name, item in fields.items():
        word = "none" if name in ("tail.taper", "channel", "seal") and item is None else _word(item)
        value, unit = _friendly(item["value"], item["unit"]) if isinstance(item, Mapping) else (word, "")
        if name not in ("name", "description", "reference"):
            table.add_row(name, value, unit)
    console.print(table)
    found = grid("what follows", "quantity", "value", "unit", "meaning")
    for name, item in answer["derived"].items():
        value, unit = _friendly(item["value"], item["unit"])
        found.add_row(name.replace("_", " "), value, unit, item["meaning"])
    console.print(found)


def _word(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, tuple):
        return escape(", ".join(str(item) for item in value)) or "-"
    return f"{value:.6g}" if isinstance(value, float) else escape(str(value))


def checked(robot: str, overrides: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Problems and warnings of a robot file.

    Raises:
        InputError: if there is no such file, or it is not TOML.
    """
    from spirillum.robot.load import load, raw_table

    raw_table(robot)
    try:
        return (), load(robot, **overrides).warnings
    except InputError as error:
        return error.problems, ()


def check_answer(robot: str, problems: Sequence[str], warnings: Sequence[str]) -> dict[str, Any]:
    """Answer of `robot check`."""
    return envelope("check", {"robot": robot, "valid": not problems, "problems": list(problems)}, warnings)


def check(answer: Answer, console: Console) -> None:
    """Text of `robot check`."""
    for problem in answer["problems"]:
        console.print(f"[red]problem:[/red] {escape(problem)}", highlight=False, soft_wrap=True)
    if answer["valid"]:
        console.print(f"{escape(answer['robot'])}: valid", highlight=False)


def study_answer(dataset: xr.Dataset, output: Path) -> dict[str, Any]:
    """Answer of `study`."""
    import numpy as np

    from spirillum.papers.registry import claims_of

    claims = claims_of(dataset)
    verdicts = {
        verdict: sum(c.verdict == verdict for c in claims) for verdict in ("agrees", "disagrees", "undecidable")
    }
    content = {
        "title": dataset.attrs["title"],
        "folder": str(output),
        "files": sorted(str(path.relative_to(output)) for path in output.rglob("*") if path.is_file()),
        "dimensions": {str(name): int(size) for name, size in dataset.sizes.items()},
        "unanswered": int(np.count_nonzero(dataset["outside"].values)),
        "claims": verdicts,
        "observations": dataset.attrs["observations"],
    }
    return envelope("study", content, [line for line in dataset.attrs["warnings"].split("\n") if line])


def study(answer: Answer, console: Console) -> None:
    """Text of `study`."""
    sizes = " x ".join(f"{size} {name}" for name, size in answer["dimensions"].items())
    console.print(f"[bold]{escape(answer['title'])}[/bold]: {sizes}", highlight=False)
    if answer["unanswered"]:
        console.print(f"{answer['unanswered']} results are empty: variable `outside` says why", highlight=False)
    if any(answer["claims"].values()):
        claims = ", ".join(f"{count} {verdict}" for verdict, count in answer["claims"].items())
        console.print(f"statements of the paper: {claims}", highlight=False)
    console.print(f"observations: {escape(answer['observations'])}", highlight=False)
    console.print(f"open {escape(answer['folder'])}/report.html", highlight=False, soft_wrap=True)


def angle(text: str) -> float:
    """An angle with its unit, rad.

    Raises:
        InputError: if it is none.
    """
    return parse_option("phase", text, KINDS["angle"])


def time_window(text: str) -> tuple[float, float]:
    """FROM:TO, such as ``0s:2s``, in s.

    Raises:
        InputError: if it is none.
    """
    start, colon, stop = text.partition(":")
    if not colon or ":" in stop:
        raise InputError(f"on = {text[:40]!r} is not FROM:TO, for example 0s:2s")
    return parse_option("on", start, KINDS["time"]), parse_option("on", stop, KINDS["time"])


@contextmanager
def patience(model: str, *, quiet: bool) -> Iterator[None]:
    """A sign of life on standard error while a model solves; its first run on a machine compiles for some seconds."""
    from spirillum.fluid.registry import MODELS

    console = Console(stderr=True)
    if quiet or not console.is_terminal or model not in MODELS or MODELS[model].closed_form:
        yield
        return
    with console.status("solving for the flow (the first time, compiling takes some seconds)"):
        yield


@contextmanager
def progress_bar(*, quiet: bool) -> Iterator[Callable[[str, int, int], None]]:
    """A progress bar on standard error; silent for `--json` and where nobody watches."""
    if quiet:
        yield lambda _what, _done, _total: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
    task = bar.add_task("starting", total=None)

    def tell(what: str, done: int, total: int) -> None:
        bar.start()  # not before there is work: an error in the input leaves nothing on the screen
        bar.update(task, description=escape(what), completed=done, total=total)

    try:
        yield tell
    finally:
        bar.stop()
