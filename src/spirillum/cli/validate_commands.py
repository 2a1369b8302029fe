"""The command `spirillum validate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.shared_options import Json, starting


def complete_cases(incomplete: str) -> list[str]:
    """Names of validation cases."""
    cases = (Path(__file__).parent.parent / "papers").glob("*/case.toml")
    return starting(sorted(case.parent.name for case in cases), incomplete)


def validate(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", autocompletion=complete_cases, help="Cases that ship; else all."),
    ] = None,
    runs: Annotated[
        bool, typer.Option("--runs", help="Make the tables that runs in tubes lack (an hour; it can be resumed).")
    ] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder for a report with figures.")
    ] = None,
    json: Json = False,
) -> None:
    """Compute published experiments of other groups, with nothing fitted; exit code 1 if a row left its recorded range.

    Example: `spirillum validate rodenborn2013`
    """
    from spirillum.cli import renderer
    from spirillum.results.validation import validate as answer

    with renderer.progress_bar(quiet=json) as progress:
        found = answer(names or (), runs=runs, output=output, progress=progress)
    renderer.show(found.to_dict(), json=json)
    if found.outside:
        raise typer.Exit(1)
