"""The command `spirillum design`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.function_command import Request, from_function
from spirillum.cli.inputs import pairs_of
from spirillum.cli.shared_options import Json

_Pairs = Annotated[
    list[str],
    typer.Option(
        metavar="FIELD=LOW:HIGH",
        help="A design variable with its range, such as tail.wavelength=5mm:40mm or tail.turns=2:6; repeatable.",
    ),
]


@from_function("spirillum.designs.design:design")
def design(
    request: Request,
    *,
    vary: _Pairs,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Robot file of the best design (.toml).")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw objective, sensitivity and front: .png, .pdf or .svg.")
    ] = None,
    stl: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The best design as one closed body for a printer (.stl, in mm)."),
    ] = None,
    unknown: Annotated[
        list[str] | None,
        typer.Option(metavar="FIELD=LOW:HIGH", help="An unknown field, uniform over its range; repeatable."),
    ] = None,
    model: Annotated[
        str,
        typer.Option(
            help="Hydrodynamic model: sbt, rft, slender or tube; auto: tube for a robot in a channel, slender without "
            "one, by a surrogate in about a minute."
        ),
    ] = "auto",
    json: Json = False,
) -> None:
    """Find the tail to build: the best values of some fields, under conditions and what is not known.

    Example: `spirillum design biorob2012-wide --vary tail.wavelength=5mm:40mm --maximise forward_velocity`
    """
    from spirillum.cli import renderer
    from spirillum.files import PICTURES, atomic_write_all, guard_inputs, output_target
    from spirillum.robot.toml_writer import robot_text

    with guard_inputs(request.named_robot, request.typed.get("posterior")):
        target = None if output is None else output_target(output, {".toml": "a robot file"}, "design.toml")
        picture = None if plot is None else output_target(plot, PICTURES, "design.png")
        printed = None if stl is None else output_target(stl, {".stl": "a body for a printer"}, "design.stl")
    with renderer.progress_bar(quiet=json) as progress:
        found = request(
            pairs_of(vary, "--vary"), unknown=pairs_of(unknown or [], "--unknown"), model=model, progress=progress
        )
    with atomic_write_all([path for path in (picture, printed, target) if path is not None]) as parts:
        if picture is not None:
            from spirillum.view.figures.design import design_figure
            from spirillum.view.figures.style import save_as

            save_as(design_figure(found), parts[picture])
        if printed is not None:
            from spirillum.exports.write import export

            export(found.robot, parts[printed])
        if target is not None:
            words = f"Best design of {request.robot.name}: {found.objectives[0].words}, model {found.model}."
            parts[target].write_text(robot_text(found.robot, words), encoding="utf-8")
    files = {"file": None if output is None else str(output), "picture": None if plot is None else str(plot)}
    files |= {"stl": None if stl is None else str(stl)}
    renderer.show(renderer.with_files(found.to_dict(), **files), json=json)
