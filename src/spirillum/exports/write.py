"""The robot written for other programs: printers, Blender, ParaView, MuJoCo and robot simulators."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spirillum.answer import as_json, envelope, quantity
from spirillum.errors import InputError
from spirillum.exports.sidecar import sidecar_of
from spirillum.files import output_target
from spirillum.robot.links import Links, links_of
from spirillum.robot.load import load
from spirillum.robot.mesh import RobotMesh, robot_mesh
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option

__all__ = ["KINDS_OF_FILES", "Export", "Written", "export"]

KINDS_OF_FILES = {
    ".stl": "one closed body for a 3D printer",
    ".glb": "a coloured scene",
    ".vtp": "a surface for ParaView",
    ".urdf": "a robot description",
    ".mjcf": "a MuJoCo model",
    ".xml": "a MuJoCo model",
}
"""Endings of the files that can be written."""
_DESCRIPTIONS = (".urdf", ".mjcf", ".xml")
_UNITS = {"mm": 1e-3, "m": 1.0}


@dataclass(frozen=True)
class Written:
    """One file that was written."""

    path: Path
    """Where it lies."""
    holds: str
    """What it is, in words."""


@dataclass(frozen=True)
class Export:
    """What was written, and the numbers of its geometry."""

    robot: Robot
    """The robot."""
    phase: float
    """Phase of the tail, rad."""
    files: tuple[Written, ...]
    """Files, the asked one first."""
    pieces: tuple[RobotMesh, ...]
    """Pieces of the robot, before they were joined or coloured."""
    links: Links
    """Mass, centre, inertia and displaced volume of body and rotor."""
    solid: Mapping[str, Any] | None
    """Of an STL file: its unit, volume, number of triangles and of bodies, and whether it is watertight."""
    warnings: tuple[str, ...]
    """What to be careful about, a sentence each."""

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum export --json`."""
        from spirillum.exports.solid import is_watertight

        content: dict[str, Any] = {
            "robot": self.robot.name,
            "phase": quantity(self.phase, "rad"),
            "files": [{"file": str(item.path), "holds": item.holds} for item in self.files],
            "links": {
                name: {
                    "mass": quantity(link.mass, "kg"),
                    "centre_of_mass": quantity(link.centre, "m"),
                    "displaced_volume": quantity(link.volume, "m^3"),
                    "centre_of_buoyancy": quantity(link.centroid, "m"),
                }
                for name, link in zip(("body", "rotor"), self.links, strict=True)
            },
            "pieces": [
                {
                    "name": piece.name,
                    "part": piece.part,
                    "triangles": len(piece.faces),
                    "volume": quantity(piece.volume, "m^3"),
                    "watertight": is_watertight(piece.vertices, piece.faces),
                }
                for piece in self.pieces
            ],
        }
        if self.solid is not None:
            content["solid"] = dict(self.solid)
        return envelope("export", content, self.warnings)


def export(
    robot: str | Path | Mapping[str, Any] | Robot,
    path: str | Path,
    *,
    phase: str | float = 0.0,
    fineness: float = 1.0,
    unit: str | None = None,
    sidecar: bool | None = None,
    model: str = "slender",
) -> Export:
    """Write the robot for another program; the ending of the file says for which.

    `.stl` is one closed body in mm for a printer, `.glb` a coloured scene, `.vtp` a surface for ParaView. `.urdf` and
    `.mjcf` (or `.xml`) are descriptions of two links with mesh files beside them in a folder `<name>-meshes`, and
    with the resistance in `<name>.resistance.json`. All files are made before the first takes its place.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        path: the file to write.
        phase: phase phi of the tail, with its unit (``"90 deg"``) or a float in rad.
        fineness: number of triangles along every line, relative to the normal one, 0.1 to 20.
        unit: of an STL file, `mm` (as None) or `m`.
        sidecar: whether to write the resistance beside the file; None: with `.urdf` and `.mjcf` only.
        model: whose resistance, `slender` or `rft`.

    Raises:
        InputError: for wrong input, a file that cannot be written, masses that a description needs and the robot
            lacks, or a robot outside the model's domain.
    """
    target = output_target(path, KINDS_OF_FILES, "robot.stl")
    described = target.suffix in _DESCRIPTIONS
    if unit is not None and (unit not in _UNITS or target.suffix != ".stl"):
        raise InputError(f"unit = {unit!r} for {target.suffix}; allowed: mm or m, only for .stl (the others are in m)")
    wanted = described if sidecar is None else sidecar
    if model != "slender" and not wanted:
        raise InputError(f"model = {model!r} without a file for the resistance; allowed: only with the sidecar")
    ready, angle = load(robot), parse_option("phase", phase, KINDS["angle"])
    if described:
        _check_masses(ready, target)
    # Descriptions and scenes turn the rotor by its joint, so its own shape stays at phase 0.
    still = described or target.suffix == ".glb"
    pieces = robot_mesh(ready, phase=0.0 if still else angle, fineness=fineness)
    beside = sidecar_of(ready, model, angle if described else 0.0) if wanted else {}
    contents, solid = _contents(ready, target, pieces, angle, unit or "mm")
    if beside:
        contents[f"{target.stem}.resistance.json"] = as_json(beside).encode(), "masses, joint and 12x12 resistance"
    _commit(target, {name: data for name, (data, _) in contents.items()})
    files = tuple(Written(target.parent / name, holds) for name, (_, holds) in contents.items())
    warnings = [*ready.warnings, *beside.get("warnings", [])]
    if solid is not None and not (solid["watertight"] and solid["bodies"] == 1):
        warnings.append(f"{target.name} is not one watertight body; a printer may refuse it")
    if target.suffix in (".mjcf", ".xml"):
        from spirillum.exports.mjcf import FLUID_WARNING

        warnings.append(FLUID_WARNING)
    return Export(ready, angle, files, pieces, links_of(ready), solid, tuple(warnings))


def _check_masses(robot: Robot, target: Path) -> None:
    """A description needs masses.

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
        from spirillum.exports.mjcf import check_inertia

        check_inertia(robot)


_Contents = dict[str, tuple[bytes, str]]


def _contents(
    robot: Robot, target: Path, pieces: Sequence[RobotMesh], phase: float, unit: str
) -> tuple[_Contents, dict[str, Any] | None]:
    """Files by name, each with what it holds, the asked one first; and the numbers of an STL file's solid."""
    holds = KINDS_OF_FILES[target.suffix]
    if target.suffix == ".stl":
        data, solid = _printable(robot, pieces, unit)
        return {target.name: (data, f"{holds}, in {unit}")}, solid
    if target.suffix == ".glb":
        from spirillum.exports.glb import glb_bytes

        return {target.name: (glb_bytes(robot.name, pieces, phase), f"{holds}, in m")}, None
    if target.suffix == ".vtp":
        from spirillum.exports.polydata import vtp_bytes

        words = {"robot": robot.name, "phase": phase}
        return {target.name: (vtp_bytes(pieces, words), f"{holds}, in m")}, None
    from spirillum.exports.parts import mesh_files

    folder, meshes = f"{target.stem}-meshes", mesh_files(pieces)
    if target.suffix == ".urdf":
        from spirillum.exports.urdf import urdf_text as text
    else:
        from spirillum.exports.mjcf import mjcf_text as text
    found: _Contents = {target.name: (text(robot, meshes, folder, phase).encode(), f"{holds}, in m")}
    for mesh in meshes:
        kind = "closed body of the whole part" if mesh.colour is None else "surface to look at"
        found[f"{folder}/{mesh.name}.stl"] = mesh.data, f"{mesh.part}: {kind}, in mm"
    return found, None


def _printable(robot: Robot, pieces: Sequence[RobotMesh], unit: str) -> tuple[bytes, dict[str, Any]]:
    """An STL file of the whole robot, and its numbers."""
    from spirillum.exports.solid import is_watertight, stl_bytes, united

    body = united(pieces)
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    found = {
        "unit": unit,
        "triangles": len(body.faces),
        "bodies": body.bodies,
        "watertight": is_watertight(body.vertices / _UNITS[unit], body.faces),
        "volume": quantity(body.volume, "m^3"),
        "size": quantity(high - low, "m"),
    }
    return stl_bytes(body.vertices / _UNITS[unit], body.faces, f"{robot.name}, unit {unit}"), found


def _commit(target: Path, contents: Mapping[str, bytes]) -> None:
    """Make all files, then put them in place; the target itself comes last, so that what it refers to is there.

    Raises:
        InputError: if one of them cannot be written.
    """
    target = target.resolve()
    try:
        with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as folder:
            for name, data in contents.items():
                place = Path(folder) / name
                place.parent.mkdir(exist_ok=True)
                place.write_bytes(data)
            final = {name: target if name == target.name else target.parent / name for name in contents}
            for path in final.values():
                for place, kind in ((path.parent, Path.is_dir), (path, Path.is_file)):
                    if place.exists() and not (kind(place) and os.access(place, os.W_OK)):
                        raise InputError(f"{place} cannot be written; allowed: a new name, or files to replace")
            for path in final.values():
                path.parent.mkdir(exist_ok=True)
            for name, path in reversed(final.items()):
                (Path(folder) / name).replace(path)
    except OSError as error:
        where = error.filename2 or error.filename or target
        raise InputError(f"{where} cannot be written ({error.strerror}); allowed: a folder you may write to") from error
