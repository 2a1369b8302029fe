"""The commands `spirillum show` and `spirillum film`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.function_command import Request, from_function
from spirillum.cli.shared_options import Json, starting

_VIEWS = ("front", "perspective", "rear", "side", "top")


def _complete_views(incomplete: str) -> list[str]:
    return starting(_VIEWS, incomplete)


def _complete_cameras(incomplete: str) -> list[str]:
    return starting(("auto", "fixed", "follow"), incomplete)


_View = Annotated[
    str, typer.Option(autocompletion=_complete_views, help="perspective, or to scale: side, top, front, rear.")
]


@from_function("spirillum.view.scene3d.show:show", without={"path": "-o FILE"}, complete={"view": _complete_views})
def show(
    request: Request,
    *,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The picture (PNG); else robot.png.")
    ] = None,
    window: Annotated[bool, typer.Option("--window", help="Open an interactive window.")] = False,
    json: Json = False,
) -> None:
    """Draw a robot in three dimensions: a picture of its shape. Needs the extra `3d`.

    Example: `spirillum show biorob2012-wide -o robot.png --view side`
    """
    from spirillum.cli import renderer

    target = output if output is not None or window else Path("robot.png")
    with renderer.at_work("drawing the robot", quiet=json):
        found = request(target, window=window)
    renderer.show(found.to_dict(), json=json)


def film(
    run: Annotated[Path, typer.Argument(help="A run (NetCDF), written by `spirillum simulate`.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The film: .mp4 or .gif.")],
    view: _View = "perspective",
    size: Annotated[str, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels of the film, even numbers.")] = "1280x720",
    fps: Annotated[int, typer.Option(help="Frames a second.")] = 30,
    speed: Annotated[
        float | None,
        typer.Option(help="Seconds of the run in a second of film; else 1, or slower where the tail turns fast."),
    ] = None,
    camera: Annotated[
        str,
        typer.Option(autocompletion=_complete_cameras, help="fixed, follow, or auto (follow a robot that swims far)."),
    ] = "auto",
    json: Json = False,
) -> None:
    """Film a run of `simulate` in three dimensions, to show to people. Needs the extra `3d`.

    Example: `spirillum film run.nc -o run.mp4 --speed 0.5`
    """
    from spirillum.cli import renderer
    from spirillum.dynamics.run_file import open_run
    from spirillum.files import output_target
    from spirillum.view.scene3d.film import film as answer
    from spirillum.view.scene3d.rendering import FILMS

    output_target(output, FILMS, "run.mp4")
    dataset = open_run(run)
    with renderer.progress_bar(quiet=json) as progress:
        found = answer(dataset, output, view=view, size=size, fps=fps, speed=speed, camera=camera, progress=progress)
    renderer.show(found.to_dict(), json=json)
