"""The commands `spirillum setup new` and `setup check`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.options import Json

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
    from spirillum.cli import renderer
    from spirillum.measurement.setup_template import setup_answer

    renderer.show(setup_answer(file), json=json)
