"""The command `spirillum design`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.inputs import loaded_robot, pairs_of
from spirillum.cli.shared_options import Json, Posterior, RobotArgument, Settings, TailRate

_Pairs = Annotated[
    list[str],
    typer.Option(
        metavar="FIELD=LOW:HIGH",
        help="A field to choose, with its range, such as tail.wavelength=5mm:40mm or tail.turns=2:6; repeatable.",
    ),
]


def design(
    robot: RobotArgument,
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
    maximise: Annotated[
        list[str] | None,
        typer.Option(
            metavar="QUANTITY",
            help="Quantity to make large, such as forward_velocity, or a condition to make likely; two: a front.",
        ),
    ] = None,
    minimise: Annotated[list[str] | None, typer.Option(metavar="QUANTITY", help="Quantity to make small.")] = None,
    subject_to: Annotated[
        list[str] | None,
        typer.Option(metavar="CONDITION", help="Condition, such as 'motor_current <= 0.4 A'; repeatable."),
    ] = None,
    unknown: Annotated[
        list[str] | None,
        typer.Option(metavar="FIELD=LOW:HIGH", help="A field that is not known, uniform over its range; repeatable."),
    ] = None,
    posterior: Posterior = None,
    model: Annotated[
        str,
        typer.Option(
            help="Hydrodynamic model: sbt, rft, slender or tube; auto: tube for a robot in a channel, slender without "
            "one, learned from some fifteen tails in about a minute of one core; sbt where they cannot be learned."
        ),
    ] = "auto",
    tail_rate: TailRate = None,
    statistic: Annotated[
        str | None,
        typer.Option(metavar="mean|quantile", help="Of the objective over what is not known; else its mean."),
    ] = None,
    level: Annotated[
        float | None, typer.Option(help="Of the quantile: share of the draws that are worse; else 0.1.")
    ] = None,
    confidence: Annotated[
        float | None, typer.Option(help="Share of the draws in which a condition has to hold; else 0.95.")
    ] = None,
    draws: Annotated[
        int | None, typer.Option(help="Draws of what is not known under which designs are compared; else 256.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of draws and search.")] = 1,
    mandrel: Annotated[
        float, typer.Option(help="Least diameter around which the wire is bent, in wire diameters.")
    ] = 1.0,
    clearance: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Least distance of tail and glass; else a wire diameter.")
    ] = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Find the tail to build: the best values of some fields, under conditions and what is not known.

    Example: `spirillum design biorob2012-wide --vary tail.wavelength=5mm:40mm --maximise forward_velocity`
    """
    from spirillum.cli import renderer
    from spirillum.designs.design import design as answer
    from spirillum.files import PICTURES, atomic_write_all, guard_inputs, output_target
    from spirillum.robot.toml_writer import robot_text

    with guard_inputs(robot, posterior):
        target = None if output is None else output_target(output, {".toml": "a robot file"}, "design.toml")
        picture = None if plot is None else output_target(plot, PICTURES, "design.png")
        printed = None if stl is None else output_target(stl, {".stl": "a body for a printer"}, "design.stl")
    loaded = loaded_robot(robot, settings, posterior=posterior)
    judged = {
        "statistic": statistic,
        "level": level,
        "confidence": confidence,
        "draws": draws,
        "seed": seed,
    }
    with renderer.progress_bar(quiet=json) as progress:
        found = answer(
            loaded,
            pairs_of(vary, "--vary"),
            maximise=maximise or (),
            minimise=minimise or (),
            subject_to=subject_to or (),
            unknown=pairs_of(unknown or [], "--unknown"),
            posterior=posterior,
            judged=judged,
            bench={"mandrel": mandrel, "clearance": clearance},
            model=model,
            tail_rate=tail_rate,
            progress=progress,
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
            words = f"Best design of {loaded.name}: {found.objectives[0].words}, model {found.model}."
            parts[target].write_text(robot_text(found.robot, words), encoding="utf-8")
    files = {"file": None if output is None else str(output), "picture": None if plot is None else str(plot)}
    files |= {"stl": None if stl is None else str(stl)}
    renderer.show(renderer.with_files(found.to_dict(), **files), json=json)
