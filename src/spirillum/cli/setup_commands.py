"""The commands `spirillum setup new`, `setup propose` and `setup check`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.function_command import FunctionCommand, Request, from_function
from spirillum.cli.shared_options import Json

setup_app = typer.Typer(name="setup", help="Setup files: camera, tank, ruler and robot.", no_args_is_help=True)


@setup_app.command("new", cls=FunctionCommand)
@from_function("spirillum.measurement.setup_template:new_setup_file", without={"path": "the argument"}, robot=None)
def new(request: Request, *, file: Annotated[Path, typer.Argument(help="File to write (.toml).")]) -> None:
    """Write a setup file to fill in.

    Example: `spirillum setup new setup.toml`
    """
    request(file)
    typer.echo(f"{file}: fill in heights, their uncertainties and the robot; comments explain them")


@setup_app.command("propose", cls=FunctionCommand)
@from_function("spirillum.measurement.proposal:propose_setup", robot=None)
def propose(
    request: Request,
    *,
    film: Annotated[Path, typer.Argument(help="A film, or a folder of images.")],
    robot: Annotated[
        str | None, typer.Argument(help="Preset or robot file; else the paper's robot is looked for.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="File to write (.toml).")] = Path(
        "setup.toml"
    ),
    json: Json = False,
) -> None:
    """Inspect a video and write a setup file: detected values are filled in, the rest is marked.

    Example: `spirillum setup propose trial-1.mp4 my-robot.toml --spacing 2mm -o setup.toml`
    """
    from spirillum.cli import renderer

    with renderer.progress_bar(quiet=json) as progress:
        found = request(film, robot, output, progress=progress)
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
