"""The command `spirillum export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.inputs import angle, given_options, loaded_robot, placement_from
from spirillum.cli.shared_options import (
    Calibration,
    Friction,
    Gap,
    ImposedFlow,
    Json,
    Pitch,
    Settings,
    complete_auto_models,
    complete_robots,
    starting,
)

_OF_ROBOTS = (
    *("phase", "fineness", "unit", "sidecar", "no_sidecar", "model", "friction", "calibration", "gap", "pitch", "flow"),
    "settings",
)
_OF_RECORDINGS = ("film", "speed")
"""Options of either kind of export alone: of a robot, and of a run for Foxglove."""


def _complete_units(incomplete: str) -> list[str]:
    return starting(("m", "mm", "um"), incomplete)


def export(
    context: typer.Context,
    robot: Annotated[
        str,
        typer.Argument(
            autocompletion=complete_robots, help="A preset's name or a TOML file; for .mcap a run of `simulate` (.nc)."
        ),
    ],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="File to write: .stl, .glb, .vtp, .urdf, .mjcf (also .xml), .fmu, or .mcap."
        ),
    ],
    phase: Annotated[str, typer.Option(metavar="ANGLE", help="Phase of the tail, such as 90deg.")] = "0rad",
    fineness: Annotated[float, typer.Option(help="Triangles along every line, relative to the normal ones.")] = 1.0,
    unit: Annotated[
        str | None,
        typer.Option(
            autocompletion=_complete_units,
            help="Unit of an STL file: mm, um or m; else mm, or um where the file is not watertight in mm.",
        ),
    ] = None,
    sidecar: Annotated[
        bool,
        typer.Option("--sidecar", help="Masses and 12x12 resistance in a JSON file beside .stl, .glb and .vtp too."),
    ] = False,
    no_sidecar: Annotated[bool, typer.Option("--no-sidecar", help="Leave it out beside .urdf and .mjcf.")] = False,
    model: Annotated[
        str | None,
        typer.Option(
            autocompletion=complete_auto_models,
            help="Model of that resistance: slender or rft; of an .fmu any model; else slender, and auto for .fmu.",
        ),
    ] = None,
    friction: Friction = None,
    calibration: Calibration = None,
    gap: Gap = None,
    pitch: Pitch = None,
    flow: ImposedFlow = None,
    film: Annotated[
        Path | None, typer.Option(metavar="FILE", help="For .mcap: a film of the run, whose frames it holds too.")
    ] = None,
    speed: Annotated[float, typer.Option(help="For .mcap: time of the run over time of that film.")] = 1.0,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Write the robot for a printer, Blender, ParaView, MuJoCo, a simulator of robots or systems; a run for Foxglove.

    Example: `spirillum export biorob2012-wide robot.stl`
    """
    from spirillum.cli import renderer
    from spirillum.errors import InputError
    from spirillum.exports.write import export as answer

    if target.suffix == ".mcap":
        from spirillum.exports.recording import export_run

        if given := given_options(context, *_OF_ROBOTS):
            raise InputError(f"{given[0]} with .mcap; allowed: --film and --speed, for the run has its robot")
        renderer.show(export_run(robot, target, film=film, speed=speed).to_dict(), json=json)
        return
    if given := given_options(context, *_OF_RECORDINGS):
        raise InputError(f"{given[0]} with {target.suffix or 'no ending'}; allowed: only with .mcap")
    if sidecar and no_sidecar:
        raise InputError("--sidecar with --no-sidecar; allowed: one of them")
    with renderer.at_work("making the files", quiet=json):
        found = answer(
            loaded_robot(robot, settings, calibration),
            target,
            phase=angle(phase),
            fineness=fineness,
            unit=unit,
            sidecar=sidecar if sidecar or no_sidecar else None,
            model=model,
            friction=friction,
            calibration=calibration,
            placement=placement_from(gap, None, pitch, None, None, flow) or None,
        )
    renderer.show(found.to_dict(), json=json)
