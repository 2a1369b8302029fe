"""The files of an export as bytes, before any is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from spirillum.answer import quantity
from spirillum.errors import InputError
from spirillum.exports.glb import glb_bytes
from spirillum.exports.mjcf import check_inertia, mjcf_text
from spirillum.exports.parts import mesh_files
from spirillum.exports.polydata import vtp_bytes
from spirillum.exports.solid import UnitedBody, is_watertight_file, stl_bytes, united
from spirillum.exports.urdf import urdf_text
from spirillum.robot.mesh import RobotMesh
from spirillum.robot.robot import Robot

__all__ = ["KINDS_OF_FILES", "STL_UNITS", "Content", "check_masses", "contents_of", "printable_solid"]

KINDS_OF_FILES = {
    ".stl": "one closed body for a 3D printer",
    ".glb": "a coloured scene",
    ".vtp": "a surface for ParaView",
    ".urdf": "a robot description",
    ".mjcf": "a MuJoCo model",
    ".xml": "a MuJoCo model",
    ".fmu": "a co-simulation unit (FMI 3.0)",
}
"""Endings of the files that can be written."""
STL_UNITS = {"mm": 1e-3, "um": 1e-6, "m": 1.0}
"""Units of STL files, m."""


class Content(NamedTuple):
    """One file."""

    data: bytes
    """Its bytes."""
    holds: str
    """What it holds, in words."""


def check_masses(robot: Robot, target: Path) -> None:
    """The masses that a robot description needs are known.

    Raises:
        InputError: if one is not known, or too small for the program that reads the file.
    """
    for table, name in (("body", "mass"), ("tail", "density")):
        if getattr(getattr(robot, table), name) is None:
            raise InputError(
                f"{robot.name}: {table}.{name} is missing; allowed: body.mass and tail.density, from which "
                f"{target.suffix} takes masses and inertias"
            )
    if target.suffix != ".urdf":
        check_inertia(robot)


def contents_of(robot: Robot, target: Path, pieces: Sequence[RobotMesh], phase: float) -> dict[str, Content]:
    """Files by name relative to the target's folder, the target first; an STL file is `printable_solid`.

    Args:
        robot: a checked robot.
        target: its ending is the format.
        pieces: surfaces of the robot; at phase 0 but for `.vtp`.
        phase: phase of the tail, rad.

    Raises:
        InputError: if a mesh has more triangles than the program takes.
    """
    holds = f"{KINDS_OF_FILES[target.suffix]}, in m"
    if target.suffix == ".glb":
        return {target.name: Content(glb_bytes(robot.name, pieces, phase), holds)}
    if target.suffix == ".vtp":
        return {target.name: Content(vtp_bytes(pieces, {"robot": robot.name, "phase": phase}), holds)}
    folder, meshes = f"{target.stem}-meshes", mesh_files(pieces)
    text = urdf_text if target.suffix == ".urdf" else mjcf_text
    found = {target.name: Content(text(robot, meshes, folder, phase).encode(), holds)}
    for mesh in meshes:
        kind = "closed body of the whole part" if mesh.colour is None else "surface to look at"
        found[f"{folder}/{mesh.name}.stl"] = Content(mesh.data, f"{mesh.part}: {kind}, in mm")
    return found


def printable_solid(
    robot: Robot, pieces: Sequence[RobotMesh], unit: str | None
) -> tuple[Content, dict[str, Any], list[str]]:
    """An STL file of the whole robot, the numbers of its solid, and what to be careful about.

    Args:
        robot: a checked robot.
        pieces: its surfaces.
        unit: of the file, a key of `STL_UNITS`; None: mm, or um where the file would not be watertight in mm.
    """
    body = united(pieces)
    files = {name: _stl_of(robot, body, name) for name in ([unit] if unit else ["mm", "um"])}
    chosen = next((name for name, data in files.items() if is_watertight_file(data)), next(iter(files)))
    watertight = is_watertight_file(files[chosen])
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    found = {
        "unit": chosen,
        "triangles": len(body.faces),
        "bodies": body.bodies,
        "watertight": watertight,
        "volume": quantity(body.volume, "m^3"),
        "size": quantity(high - low, "m"),
    }
    return Content(files[chosen], f"{KINDS_OF_FILES['.stl']}, in {chosen}"), found, _cautions(robot, body, found)


def _stl_of(robot: Robot, body: UnitedBody, unit: str) -> bytes:
    return stl_bytes(body.vertices / STL_UNITS[unit], body.faces, f"{robot.name}, unit {unit}")


def _cautions(robot: Robot, body: UnitedBody, found: Mapping[str, Any]) -> list[str]:
    """Why a program may refuse an STL file, a sentence each."""
    unit = found["unit"]
    sentences = []
    if found["bodies"] != 1:
        sentences.append(f"the STL file holds {found['bodies']} separate bodies; a printer may refuse it")
    if not found["watertight"]:
        better = next((name for name in STL_UNITS if is_watertight_file(_stl_of(robot, body, name))), None)
        remedy = f"use --unit {better}" if better else "repair it before printing"
        sentences.append(
            f"the STL file is not watertight in {unit}: programs that read it merge vertices closer than 1e-8 {unit}; "
            f"{remedy}"
        )
    return sentences
