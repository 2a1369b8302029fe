"""The command `spirillum export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.inputs import angle, loaded_robot
from spirillum.cli.options import Json, RobotArgument, Settings, starting

__all__ = ["export"]


def _complete_models(incomplete: str) -> list[str]:
    return starting(("rft", "slender"), incomplete)


def _complete_units(incomplete: str) -> list[str]:
    return starting(("m", "mm"), incomplete)


def export(
    robot: RobotArgument,
    target: Annotated[
        Path, typer.Argument(metavar="FILE", help="File to write: .stl, .glb, .vtp, .urdf, or .mjcf (also .xml).")
    ],
    phase: Annotated[str, typer.Option(metavar="ANGLE", help="Phase of the tail, such as 90deg.")] = "0rad",
    fineness: Annotated[float, typer.Option(help="Triangles along every line, relative to the normal ones.")] = 1.0,
    unit: Annotated[
        str | None, typer.Option(autocompletion=_complete_units, help="Unit of an STL file: mm, or m.")
    ] = None,
    sidecar: Annotated[
        bool,
        typer.Option("--sidecar", help="Masses and 12x12 resistance in a JSON file beside .stl, .glb and .vtp too."),
    ] = False,
    no_sidecar: Annotated[bool, typer.Option("--no-sidecar", help="Leave it out beside .urdf and .mjcf.")] = False,
    model: Annotated[
        str, typer.Option(autocompletion=_complete_models, help="Model of that resistance: slender or rft.")
    ] = "slender",
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Write the robot's shape, masses and resistance for a printer, Blender, ParaView, MuJoCo or another simulator.

    Example: `spirillum export biorob2012-wide robot.stl`
    """
    from spirillum.cli import renderer
    from spirillum.errors import InputError
    from spirillum.exports.write import export as answer

    if sidecar and no_sidecar:
        raise InputError("--sidecar with --no-sidecar; allowed: one of them")
    found = answer(
        loaded_robot(robot, settings),
        target,
        phase=angle(phase),
        fineness=fineness,
        unit=unit,
        sidecar=sidecar if sidecar or no_sidecar else None,
        model=model,
    )
    renderer.show(found.to_dict(), json=json)
