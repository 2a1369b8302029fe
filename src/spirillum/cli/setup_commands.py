"""The commands `spirillum setup new`, `setup propose` and `setup check`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.shared_options import Json

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


@setup_app.command("propose")
def propose(
    film: Annotated[Path, typer.Argument(help="A film, or a folder of images.")],
    robot: Annotated[
        str | None, typer.Argument(help="Preset or robot file; else the paper's robot is looked for.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="File to write (.toml).")] = Path(
        "setup.toml"
    ),
    spacing: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="From each line of the ruler to the next, such as 2mm.")
    ] = None,
    fps: Annotated[float | None, typer.Option(help="Frames a second of a folder of images.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.")] = False,
    json: Json = False,
) -> None:
    """Inspect a video and write a setup file: detected values are filled in, the rest is marked.

    Example: `spirillum setup propose trial-1.mp4 my-robot.toml --spacing 2mm -o setup.toml`
    """
    from spirillum.cli import renderer
    from spirillum.measurement.proposal import propose_setup

    with renderer.progress_bar(quiet=json) as progress:
        found = propose_setup(film, robot, output, spacing=spacing, fps=fps, overwrite=force, progress=progress)
    renderer.show(found.to_dict(), json=json)


@setup_app.command("check")
def check(
    file: Annotated[Path, typer.Argument(help="Setup file (TOML).")],
    film: Annotated[Path | None, typer.Argument(help="A film that was taken with it, to look at too.")] = None,
    json: Json = False,
) -> None:
    """Check a setup file, the effect of its uncertain heights on lengths, and its agreement with a video.

    Example: `spirillum setup check setup.toml trial-1.mp4`
    """
    from spirillum.cli import renderer
    from spirillum.measurement.setup_template import setup_answer

    renderer.show(setup_answer(file, film), json=json)
