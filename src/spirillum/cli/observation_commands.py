"""The commands `spirillum observations new`, `observations check` and `observations join`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.shared_options import Json

observations_app = typer.Typer(name="observations", help="Files of observed speeds and rates.", no_args_is_help=True)


@observations_app.command("new")
def new(
    file: Annotated[Path, typer.Argument(help="File to write (.csv).")],
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.")] = False,
) -> None:
    """Write an empty observations file to fill in.

    Example: `spirillum observations new observations.csv`
    """
    from spirillum.measurement.observations import new_observations_file

    new_observations_file(file, overwrite=force)
    typer.echo(f"{file}: columns and their units are explained in its comments")


@observations_app.command("check")
def check(
    file: Annotated[Path, typer.Argument(help="Observations file (CSV or Parquet).")],
    json: Json = False,
) -> None:
    """Check an observations file and count what is in it.

    Example: `spirillum observations check observations.csv`
    """
    from spirillum.cli import renderer
    from spirillum.measurement.observations import observations_answer

    renderer.show(observations_answer(file), json=json)


@observations_app.command("join")
def join(
    files: Annotated[list[Path], typer.Argument(help="Observations files (CSV or Parquet), two or more.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="File to write (.csv).")],
) -> None:
    """Join several observations files, such as one of each robot, to one for `calibrate`.

    Example: `spirillum observations join measured/*/observations.csv -o all.csv`
    """
    from spirillum.measurement.observations import join_observations

    rows = join_observations(files, output)
    typer.echo(f"{output}: {rows} rows of {len(files)} files")
