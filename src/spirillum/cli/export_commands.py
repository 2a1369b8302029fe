"""The command `spirillum export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.function_command import Request, from_function
from spirillum.cli.inputs import refuse_conflicts
from spirillum.cli.shared_options import Json, complete_robots, starting


def _complete_units(incomplete: str) -> list[str]:
    return starting(("m", "mm", "um"), incomplete)


@from_function(
    "spirillum.exports.write:export",
    without={
        "path": "an argument of the command",
        **dict.fromkeys(
            ("placement.eccentricity", "placement.yaw", "placement.tail_drop", "placement.ends"),
            "a unit is held at a gap and pitch, with a flow as its input",
        ),
    },
    complete={"unit": _complete_units},
    robot=Annotated[
        str,
        typer.Argument(
            autocompletion=complete_robots, help="A preset's name or a TOML file; for .mcap a run of `simulate` (.nc)."
        ),
    ],
)
def export(
    request: Request,
    *,
    context: typer.Context,
    target: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="File to write: .stl, .glb, .vtp, .urdf, .mjcf (also .xml), .fmu, or .mcap."
        ),
    ],
    sidecar: Annotated[
        bool,
        typer.Option("--sidecar", help="Masses and 12x12 resistance in a JSON file beside .stl, .glb and .vtp too."),
    ] = False,
    no_sidecar: Annotated[bool, typer.Option("--no-sidecar", help="Leave it out beside .urdf and .mjcf.")] = False,
    film: Annotated[Path | None, typer.Option(metavar="FILE", help="For .mcap: a video of the run to include.")] = None,
    speed: Annotated[float, typer.Option(help="For .mcap: time of the run over time of that film.")] = 1.0,
    json: Json = False,
) -> None:
    """Write the robot for a printer, Blender, ParaView, MuJoCo, a simulator of robots or systems; a run for Foxglove.

    Example: `spirillum export biorob2012-wide robot.stl`
    """
    from spirillum.cli import renderer
    from spirillum.errors import InputError

    if target.suffix == ".mcap":
        from spirillum.exports.recording import export_run

        refuse_conflicts(context, "recording")
        renderer.show(export_run(str(request.named_robot), target, film=film, speed=speed).to_dict(), json=json)
        return
    refuse_conflicts(context, "no recording", ending=target.suffix or "no ending")
    if sidecar and no_sidecar:
        raise InputError("--sidecar with --no-sidecar; allowed: one of them")
    with renderer.at_work("making the files", quiet=json):
        found = request(target, sidecar=sidecar if sidecar or no_sidecar else None)
    renderer.show(found.to_dict(), json=json)
