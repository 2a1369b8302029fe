"""The commands `spirillum setup new` and `setup check`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from spirillum.cli.options import Json

if TYPE_CHECKING:
    from rich.console import Console

    from spirillum.cli.text import Answer

__all__ = ["setup_app"]

setup_app = typer.Typer(name="setup", help="Setup files: camera, tank, ruler and robot.", no_args_is_help=True)


@setup_app.command("new")
def new(
    file: Annotated[Path, typer.Argument(help="File to write (.toml).")],
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.")] = False,
) -> None:
    """Write a setup file to fill in.

    Example: `spirillum setup new setup.toml`
    """
    from spirillum.measurement.setup_template import new_setup_file

    new_setup_file(file, overwrite=force)
    typer.echo(f"{file}: fill in heights, their uncertainties and the robot; comments explain them")


@setup_app.command("check")
def check(
    file: Annotated[Path, typer.Argument(help="Setup file (TOML).")],
    json: Json = False,
) -> None:
    """Check a setup file, and say what its uncertain heights do to lengths.

    Example: `spirillum setup check setup.toml`
    """
    from spirillum.cli import text
    from spirillum.measurement.setup_template import setup_answer

    text.show(setup_answer(file), _table, json=json)


def _table(answer: Answer, console: Console) -> None:
    from rich.markup import escape

    console.print(f"{escape(answer['file'])}: valid, robot {escape(answer['robot'])}", highlight=False, soft_wrap=True)
    total = 100 * answer["scale_uncertainty"]
    parts = sorted(answer["scale_sources"].items(), key=lambda item: -item[1])
    words = ", ".join(f"{name} {100 * share:.2g} %" for name, share in parts)
    console.print(
        f"standard uncertainty of lengths from heights and scale: {total:.2g} %{': ' + words if words else ''}",
        highlight=False,
        soft_wrap=True,
    )
