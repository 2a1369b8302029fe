"""Writing the robot for other programs: printers, Blender, ParaView, MuJoCo and robot simulators."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.answer_entries import answer_of, content_of
from spirillum.display import DisplayMixin
from spirillum.dynamics.axial_robot import axial_robot
from spirillum.dynamics.plant import Plant
from spirillum.envelope import as_json, quantity
from spirillum.errors import InputError, check_choice
from spirillum.exports.descriptions import (
    UnitedBody,
    check_inertia,
    is_watertight,
    is_watertight_file,
    link_masses,
    mesh_files,
    mjcf_text,
    sidecar_of,
    stl_bytes,
    united,
    urdf_text,
    vtp_bytes,
)
from spirillum.files import MARK, atomic_write_all, guard_inputs, output_folder, output_target
from spirillum.notes import Note, notes_in_answer
from spirillum.optional_dependencies import import_optional
from spirillum.robot.links import Links, links_of
from spirillum.robot.load import load
from spirillum.robot.mesh import RobotMesh, robot_mesh
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.surface import corner_normals, linear_light
from spirillum.swimming.preparation import AUTO
from spirillum.units import KINDS, parse_option

if TYPE_CHECKING:
    from spirillum.interfaces.fmu import FmuModel

_Y_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""glTF's y points up, where ours is z."""
_CREASE = np.deg2rad(40.0)  # angle between triangles above which an edge stays sharp, rad
_METAL = {"shaft": 0.9, "coupling": 0.9, "stub": 0.9, "arm": 0.9, "tail": 0.9}


def glb_bytes(name: str, pieces: Sequence[RobotMesh], phase: float) -> bytes:
    """A scene with the nodes robot, body and rotor, in metres; turning rotor about its x axis turns the tail."""
    import_optional("trimesh", "a coloured scene")
    from trimesh import Scene, Trimesh
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    cos, sin = np.cos(phase), np.sin(phase)
    turned = np.eye(4)
    turned[1:3, 1:3] = [[cos, -sin], [sin, cos]]
    scene = Scene(base_frame="world")
    scene.graph.update(frame_from="world", frame_to="robot", matrix=_Y_UP)
    scene.graph.update(frame_from="robot", frame_to="body", matrix=np.eye(4))
    scene.graph.update(frame_from="robot", frame_to="rotor", matrix=turned)
    for piece in pieces:
        normals = corner_normals(piece.vertices, piece.faces, _CREASE)
        for index, region in enumerate(piece.regions):
            chosen = piece.region == index
            if not chosen.any():
                continue
            corners = np.concatenate([piece.vertices[piece.faces[chosen]], normals[chosen]], axis=-1).reshape(-1, 6)
            unique, faces = np.unique(corners.astype(np.float32), axis=0, return_inverse=True)
            colour = linear_light(piece.colours[chosen][0])
            material = PBRMaterial(
                name=region,
                baseColorFactor=[*np.round(255.0 * colour).astype(np.uint8), 255],
                metallicFactor=_METAL.get(piece.name, 0.0),
                roughnessFactor=0.45,
            )
            label = f"{piece.name}: {region}" if len(piece.regions) > 1 else piece.name
            surface = Trimesh(
                unique[:, :3],
                faces.reshape(-1, 3),
                vertex_normals=unique[:, 3:],
                visual=TextureVisuals(material=material),
                process=False,
            )
            scene.add_geometry(surface, node_name=f"{label} surface", geom_name=label, parent_node_name=piece.part)
    scene.metadata |= {"robot": name, "unit": "m", "axes": "robot: x forward (nose), z up; joint: x axis of rotor"}
    return bytes(
        scene.export(
            file_type="glb", include_normals=True, tree_postprocessor=lambda tree: tree["asset"].update(generator=MARK)
        )
    )


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
STL_UNITS = {"mm": 1e-3, "um": 1e-6, "m": 1.0}  #: Units of STL files, m.


class ExportFile(NamedTuple):
    """One file."""

    data: bytes  #: Its bytes.
    holds: str  #: Description of the content.


def check_masses(robot: Robot, target: Path) -> None:
    """Require the masses that a robot description needs."""
    robot.check_body(target.suffix.lower())
    for table, name in (("body", "mass"), ("tail", "density")):
        if getattr(getattr(robot, table), name) is None:
            raise InputError(
                f"{robot.name}: {table}.{name} is missing; allowed: body.mass and tail.density, from which "
                f"{target.suffix.lower()} takes masses and inertias"
            )
    if target.suffix.lower() != ".urdf":
        check_inertia(robot)


def contents_of(robot: Robot, target: Path, pieces: Sequence[RobotMesh], phase: float) -> dict[str, ExportFile]:
    """Files by name relative to the target's folder, the target first; an STL file is `printable_solid`."""
    holds = f"{KINDS_OF_FILES[target.suffix.lower()]}, in m"
    if target.suffix.lower() == ".glb":
        return {target.name: ExportFile(glb_bytes(robot.name, pieces, phase), holds)}
    if target.suffix.lower() == ".vtp":
        return {target.name: ExportFile(vtp_bytes(pieces, {"robot": robot.name, "phase": phase}), holds)}
    folder, meshes = f"{target.stem}-meshes", mesh_files(pieces)
    text = urdf_text if target.suffix.lower() == ".urdf" else mjcf_text
    found = {target.name: ExportFile(text(robot, meshes, folder, phase).encode(), holds)}
    for mesh in meshes:
        kind = "closed body of the whole part" if mesh.colour is None else "surface to look at"
        found[f"{folder}/{mesh.name}.stl"] = ExportFile(mesh.data, f"{mesh.part}: {kind}, in mm")
    return found


def printable_solid(
    robot: Robot, pieces: Sequence[RobotMesh], unit: str | None
) -> tuple[ExportFile, dict[str, Any], list[Note]]:
    """An STL file of the whole robot, the numbers of its solid, and what to be careful about."""
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
    return ExportFile(files[chosen], f"{KINDS_OF_FILES['.stl']}, in {chosen}"), found, _cautions(robot, body, found)


def _stl_of(robot: Robot, body: UnitedBody, unit: str) -> bytes:
    return stl_bytes(body.vertices / STL_UNITS[unit], body.faces, f"{robot.name}, unit {unit}")


def _cautions(robot: Robot, body: UnitedBody, found: Mapping[str, Any]) -> list[Note]:
    """Why a program may refuse an STL file, a sentence each."""
    unit = found["unit"]
    notes = []
    if found["bodies"] != 1:
        notes.append(Note.named("separate-bodies", count=found["bodies"]))
    if not found["watertight"]:
        better = next((name for name in STL_UNITS if is_watertight_file(_stl_of(robot, body, name))), None)
        remedy = f"use --unit {better}" if better else "repair it before printing"
        notes.append(Note.named("stl-not-watertight", unit=unit, remedy=remedy))
    return notes


_DESCRIPTIONS = (".urdf", ".mjcf", ".xml")


@dataclass(frozen=True)
class Written:
    """One file that was written."""

    path: Path  #: Path of the file.
    holds: str  #: Description of the content.


@dataclass(frozen=True, repr=False)
class Export(DisplayMixin):
    """Summary of the exported files and their geometry."""

    robot: Robot  #: The robot.
    phase: float  #: Phase of the tail, rad.
    files: tuple[Written, ...]  #: Files, the requested one first.
    pieces: tuple[RobotMesh, ...]  #: Pieces of the robot, before they were joined or coloured.
    links: Links  #: Mass, centre, inertia and displaced volume of body and rotor.
    solid: Mapping[str, Any] | None
    """Of an STL file: its unit, volume, number of triangles and of bodies, and whether it is watertight."""
    warnings: tuple[Note, ...]  #: What to be careful about, a sentence each.
    unit: FmuModel | None = None  #: Of an FMU: the equations in it.

    def to_dict(self) -> dict[str, Any]:
        """Content of `spirillum export --json`."""
        numbers = () if self.unit is None else self.unit.parameters.values()
        return answer_of(
            self,
            links={
                name: {key: value for key, value in link_masses(link).items() if key != "inertia"}
                for name, link in zip(("body", "rotor"), self.links, strict=True)
            },
            pieces=[content_of(one, watertight=is_watertight(one.vertices, one.faces)) for one in self.pieces],
            inputs=["remote", "duty", *(["mean_flow"] if self.unit and self.unit.flow is not None else [])],
            parameters={item.name: quantity(item.value, item.unit, meaning=item.meaning) for item in numbers},
        )


def export(
    robot: str | Path | Mapping[str, Any] | Robot,
    path: str | Path,
    *,
    phase: str | float = 0.0,
    fineness: float = 1.0,
    unit: str | None = None,
    sidecar: bool | None = None,
    model: str | None = None,
    motion: str | None = None,
    friction: str | None = None,
    calibration: str | Path | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
) -> Export:
    """Export the robot for another program, selected by the ending of the file.

    `.stl` is one closed body for a printer, `.glb` a coloured scene, `.vtp` a surface for ParaView. `.urdf` and
    `.mjcf` (or `.xml`) are descriptions of two links with mesh files beside them in a folder `<name>-meshes`, and
    with the resistance in `<name>.resistance.json`. `.fmu` is a co-simulation unit of the robot held to its channel's
    axis, or released in its channel, compiled for this machine by its C compiler. All files are made before the first
    takes its place.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        path: the file to write.
        phase: phase phi of the tail, with its unit (``"90 deg"``) or a float in rad.
        fineness: number of triangles along every line, relative to the normal one, 0.1 to 20.
        unit: of an STL file, `mm`, `um` or `m`; None: mm, or um where the file would not be watertight in mm.
        sidecar: whether to write the resistance beside the file; None: with `.urdf` and `.mjcf` only.
        model: whose resistance, `slender` or `rft`; of an `.fmu` any model; None: `slender`, of an `.fmu` `auto`.
        motion: of an `.fmu`, `held` (axial motion) or `free` (released in the tube, without a wait); else `held`.
        friction: of an `.fmu`, friction model; None: the robot's own.
        calibration: of an `.fmu`, calibration file whose factors replace the robot's.
        placement: of an `.fmu` with `tube`, where the robot is held or starts; with a `flow`, also 0, the flow is an
            input.

    Raises:
        InputError: for wrong input, a file that cannot be written, masses that a description needs and the robot
            lacks, a robot outside the model's domain, or an `.fmu` without a C compiler.
    """
    inputs = [robot] if isinstance(robot, (str, Path)) else []
    with guard_inputs(*inputs, calibration):
        target = output_target(path, KINDS_OF_FILES, "robot.stl")
    angle, of_held = parse_option("phase", phase, KINDS["angle"]), (motion, friction, calibration, placement)
    if target.suffix.lower() == ".fmu":
        if angle or fineness != 1.0 or unit is not None or sidecar is not None:
            raise InputError("phase, fineness, unit or sidecar with .fmu; allowed: only for the robot's shape")
        check_choice("motion", motion or "held", ("held", "free"))
        options = {"friction": friction, "calibration": calibration, "placement": placement}
        return _unit_of(target, robot, free=motion == "free", model=model or AUTO, **options)
    if any(given is not None for given in of_held):
        raise InputError(
            f"motion, friction, calibration or a placement (gap, pitch, flow) with {target.suffix.lower()}; allowed: "
            "only with .fmu"
        )
    wanted = target.suffix.lower() in _DESCRIPTIONS if sidecar is None else sidecar
    if unit is not None and (unit not in STL_UNITS or target.suffix.lower() != ".stl"):
        raise InputError(
            f"unit = {unit!r} for {target.suffix.lower()}; allowed: mm, um or m, only for .stl (the others are in m)"
        )
    if model is not None and not wanted:
        raise InputError(f"model = {model!r} without a file for the resistance; allowed: only with the sidecar")
    return _shape_of(load(robot), target, angle, fineness, unit, (model or "slender") if wanted else None)


def _shape_of(
    robot: Robot, target: Path, angle: float, fineness: float, unit: str | None, resistance: str | None
) -> Export:
    """A file of the robot's shape, written, with the resistance of a model beside it unless that is None."""
    described = target.suffix.lower() in _DESCRIPTIONS
    if described:
        check_masses(robot, target)
    # Descriptions and scenes turn the rotor by its joint, so its own shape stays at phase 0.
    still = described or target.suffix.lower() == ".glb"
    pieces = robot_mesh(robot, phase=0.0 if still else angle, fineness=fineness)
    beside = {} if resistance is None else sidecar_of(robot, resistance, angle if described else 0.0)
    solid: Mapping[str, Any] | None = None
    cautions: list[Note] = []
    if target.suffix.lower() == ".stl":
        printable, solid, cautions = printable_solid(robot, pieces, unit)
        contents = {target.name: printable}
    else:
        contents = contents_of(robot, target, pieces, angle)
    if beside:
        holds = "masses, joint and 12x12 resistance"
        contents[f"{target.stem}.resistance.json"] = ExportFile(as_json(beside).encode(), holds)
    _commit(target, {name: content.data for name, content in contents.items()})
    files = tuple(Written(target.parent / name, content.holds) for name, content in contents.items())
    cautions += [
        Note.named("part-not-watertight", name=name)
        for name, content in contents.items()
        if name.endswith("-solid.stl") and not is_watertight_file(content.data)
    ]
    warnings = [*robot.warnings, *notes_in_answer(beside), *cautions]
    if target.suffix.lower() in (".mjcf", ".xml"):
        warnings.append(Note.named("fluid-of-mujoco"))
    return Export(robot, angle, files, pieces, links_of(robot), solid, tuple(warnings))


def _unit_of(target: Path, robot: str | Path | Mapping[str, Any] | Robot, *, free: bool, **options: Any) -> Export:
    """An FMU, written: of the robot held to its channel's axis, or released in its channel."""
    from spirillum.interfaces.fmu import axial_model, fmu_bytes, free_model

    notes: Iterable[Note]
    if not free:
        axial = axial_robot(robot, **options)
        notes = axial.check_steady(1.0, axial.flow or 0.0)  # the duty is an input of the unit
        model = axial_model(axial)
    elif options["model"] in (AUTO, "tube"):
        plant = Plant(robot, **options)
        model, notes = free_model(plant), plant.warnings
    else:
        raise InputError(
            f"model = {str(options['model'])[:40]!r} with motion = 'free' and .fmu; allowed: 'tube', or 'auto'"
        )
    _commit(target, {target.name: fmu_bytes(model)})
    own, warnings = model.prediction.robot, tuple(dict.fromkeys((*model.prediction.warnings, *notes)))
    files = (Written(target, f"{KINDS_OF_FILES['.fmu']} with its C source"),)
    return Export(own, 0.0, files, (), links_of(own), None, warnings, model)


def _commit(target: Path, contents: Mapping[str, bytes]) -> None:
    """Write all files and rename them at the end; the target comes last, so that the files it refers to exist."""
    target = target.resolve()
    final = {target if name == target.name else target.parent / name: data for name, data in contents.items()}
    for folder in dict.fromkeys(path.parent for path in final):
        if folder.exists() and not (folder.is_dir() and os.access(folder, os.W_OK)):
            raise InputError(f"{folder} cannot be written; allowed: a new name, or files to replace")
    made = [folder for folder in dict.fromkeys(path.parent for path in final) if not folder.exists()]
    try:
        for folder in made:
            output_folder(folder, target.parent)
        with atomic_write_all(list(reversed(final))) as parts:
            for path, data in final.items():
                parts[path].write_bytes(data)
    finally:
        for folder in made:
            with suppress(OSError):
                folder.rmdir()  # only where it is empty: nothing was written
