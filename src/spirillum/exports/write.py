"""Writing the robot for other programs: printers, Blender, ParaView, MuJoCo and robot simulators."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spirillum.answer import as_json, envelope, quantity
from spirillum.errors import InputError
from spirillum.exports.contents import KINDS_OF_FILES, STL_UNITS, Content, check_masses, contents_of, printable_solid
from spirillum.exports.mjcf import FLUID_WARNING
from spirillum.exports.sidecar import sidecar_of
from spirillum.exports.solid import is_watertight
from spirillum.files import output_folder, output_target, protected, whole_files
from spirillum.robot.links import Links, links_of
from spirillum.robot.load import load
from spirillum.robot.mesh import RobotMesh, robot_mesh
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option

__all__ = ["Export", "Written", "export"]

_DESCRIPTIONS = (".urdf", ".mjcf", ".xml")


@dataclass(frozen=True)
class Written:
    """One file that was written."""

    path: Path
    """Where it lies."""
    holds: str
    """What it holds, in words."""


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
    inputs = [robot] if isinstance(robot, (str, Path)) else []
    with protected(*inputs):
        target = output_target(path, KINDS_OF_FILES, "robot.stl")
    described = target.suffix in _DESCRIPTIONS
    if unit is not None and (unit not in STL_UNITS or target.suffix != ".stl"):
        raise InputError(f"unit = {unit!r} for {target.suffix}; allowed: mm or m, only for .stl (the others are in m)")
    wanted = described if sidecar is None else sidecar
    if model != "slender" and not wanted:
        raise InputError(f"model = {model!r} without a file for the resistance; allowed: only with the sidecar")
    ready, angle = load(robot), parse_option("phase", phase, KINDS["angle"])
    if described:
        check_masses(ready, target)
    # Descriptions and scenes turn the rotor by its joint, so its own shape stays at phase 0.
    still = described or target.suffix == ".glb"
    pieces = robot_mesh(ready, phase=0.0 if still else angle, fineness=fineness)
    beside = sidecar_of(ready, model, angle if described else 0.0) if wanted else {}
    solid = None
    if target.suffix == ".stl":
        printable, solid = printable_solid(ready, pieces, unit or "mm")
        contents = {target.name: printable}
    else:
        contents = contents_of(ready, target, pieces, angle)
    if beside:
        holds = "masses, joint and 12x12 resistance"
        contents[f"{target.stem}.resistance.json"] = Content(as_json(beside).encode(), holds)
    _commit(target, {name: content.data for name, content in contents.items()})
    files = tuple(Written(target.parent / name, content.holds) for name, content in contents.items())
    warnings = [*ready.warnings, *beside.get("warnings", [])]
    if solid is not None and not (solid["watertight"] and solid["bodies"] == 1):
        warnings.append(f"{target.name} is not one watertight body; a printer may refuse it")
    if target.suffix in (".mjcf", ".xml"):
        warnings.append(FLUID_WARNING)
    return Export(ready, angle, files, pieces, links_of(ready), solid, tuple(warnings))


def _commit(target: Path, contents: Mapping[str, bytes]) -> None:
    """Make all files, then put them in place; the target itself comes last, so that what it refers to is there.

    Raises:
        InputError: if one of them cannot be written.
    """
    target = target.resolve()
    final = {target if name == target.name else target.parent / name: data for name, data in contents.items()}
    for folder in dict.fromkeys(path.parent for path in final):
        if folder.exists() and not (folder.is_dir() and os.access(folder, os.W_OK)):
            raise InputError(f"{folder} cannot be written; allowed: a new name, or files to replace")
    made = [folder for folder in dict.fromkeys(path.parent for path in final) if not folder.exists()]
    try:
        for folder in made:
            output_folder(folder, target.parent)
        with whole_files(list(reversed(final))) as parts:
            for path, data in final.items():
                parts[path].write_bytes(data)
    finally:
        for folder in made:
            with suppress(OSError):
                folder.rmdir()  # only where it is empty: nothing was written
