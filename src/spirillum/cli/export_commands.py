"""The command `spirillum export`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spirillum.cli.inputs import loaded_robot
from spirillum.cli.options import Json, RobotArgument, Settings, starting

if TYPE_CHECKING:
    from rich.console import Console

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
    from spirillum.cli import text
    from spirillum.errors import InputError
    from spirillum.exports.write import export as answer

    if sidecar and no_sidecar:
        raise InputError("--sidecar with --no-sidecar; allowed: one of them")
    found = answer(
        loaded_robot(robot, settings),
        target,
        phase=text.angle(phase),
        fineness=fineness,
        unit=unit,
        sidecar=sidecar if sidecar or no_sidecar else None,
        model=model,
    )
    text.show(found.to_dict(), _table, json=json)


def _table(answer: Mapping[str, Any], console: Console) -> None:
    """Files, then the numbers of the geometry."""
    from spirillum.cli.text import add_quantities, grid

    first, *others = (Path(item["file"]) for item in answer["files"])
    meshes = [path for path in others if path.parent != first.parent]
    lines = [f"{item['file']}: {item['holds']}" for item in answer["files"] if Path(item["file"]) not in meshes]
    if meshes:
        lines.insert(1, f"{meshes[0].parent}: {len(meshes)} mesh files, in mm")
    for line in lines:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if "solid" in answer:
        solid = answer["solid"]
        state = "watertight" if solid["watertight"] else "not watertight"
        bodies = "one body" if solid["bodies"] == 1 else f"{solid['bodies']} bodies"
        console.print(f"{bodies}, {state}, {solid['triangles']} triangles", highlight=False)
        size = " x ".join(f"{1e3 * value:.4g}" for value in solid["size"]["value"])
        console.print(f"{size} mm, {1e6 * solid['volume']['value']:.4g} ml", highlight=False)
        return
    table = grid(f"{answer['robot']}: links", "quantity", "value", "unit", "SI")
    for name, link in answer["links"].items():
        add_quantities(table, {f"{name} {key}": link[key] for key in ("mass", "displaced_volume")})
    console.print(table)
