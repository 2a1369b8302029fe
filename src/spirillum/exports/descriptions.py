"""Mesh files of a robot (STL, .vtp), and its descriptions for simulators: URDF, MuJoCo's MJCF, a sidecar."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.envelope import envelope, quantity
from spirillum.errors import InputError, check_memory
from spirillum.files import MARK, scratch_folder
from spirillum.fluid.registry import SWIMMER_MODELS, find_swimmer_model
from spirillum.formats.array_files import add_comment
from spirillum.formats.templates import numbers, rendered
from spirillum.notes import Note
from spirillum.optional_dependencies import import_optional
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.links import Link, links_of
from spirillum.robot.mesh import STRIPE_COLOURS, RobotMesh
from spirillum.robot.robot import STANDARD_GRAVITY, Robot
from spirillum.robot.surface import Faces, mass_properties


def vtp_bytes(pieces: Sequence[RobotMesh], attributes: Mapping[str, Any]) -> bytes:
    """All pieces as one surface; lengths in m."""
    # Cell arrays: `part` (0 body, 1 rotor), `piece` and `region` (numbers, named in the comment at the head of the
    # file), `colour` (sRGB, 0 to 255).
    offset = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    points = np.concatenate([piece.vertices for piece in pieces])
    faces = np.concatenate([piece.faces + start for piece, start in zip(pieces, offset[:-1], strict=True)])
    colours = np.round(255.0 * np.concatenate([piece.colours for piece in pieces])).astype(np.uint8)
    names = list(dict.fromkeys(name for piece in pieces for name in piece.regions))
    number = [np.array([names.index(name) for name in piece.regions])[piece.region] for piece in pieces]
    size = [len(piece.faces) for piece in pieces]
    cells: dict[str, Any] = {
        "part": np.repeat([0 if piece.part == "body" else 1 for piece in pieces], size).astype(np.uint8),
        "piece": np.repeat(np.arange(len(pieces)), size).astype(np.uint8),
        "region": np.concatenate(number).astype(np.uint8),
        "colour": tuple(np.ascontiguousarray(colours[:, channel]) for channel in range(3)),
    }
    place = tuple(np.ascontiguousarray(points[:, axis]) for axis in range(3))
    corners = np.ascontiguousarray(faces.ravel().astype(np.int32))
    ends = np.arange(3, corners.size + 1, 3, dtype=np.int32)
    words = {"unit": "m", "part": ["body", "rotor"], "piece": [piece.name for piece in pieces], "region": names}
    with scratch_folder() as folder:
        path = folder / "robot.vtp"
        _write(path, place, corners, ends, cells)
        add_comment(path, json.dumps({**words, **attributes}, sort_keys=True))
        return path.read_bytes()


def _write(
    path: Path, place: tuple[Samples, ...], corners: np.ndarray, ends: np.ndarray, cells: Mapping[str, Any]
) -> None:
    """The file as the library writes it: first what is where, then the data in the same order."""
    import_optional("pyevtk", "a file for ParaView")
    from pyevtk.vtk import VtkFile, VtkPolyData

    file = VtkFile(str(path.with_suffix("")), VtkPolyData)  # the library adds the suffix
    file.openGrid()
    file.openPiece(npoints=place[0].size, npolys=ends.size)
    file.openElement("Points")
    file.addData("points", place)
    file.closeElement("Points")
    file.openElement("Polys")
    file.addData("connectivity", corners)
    file.addData("offsets", ends)
    file.closeElement("Polys")
    file.openData("Cell")
    for name, values in cells.items():
        file.addData(name, values)
    file.closeData("Cell")
    file.closePiece()
    file.closeGrid()
    for values in (place, corners, ends, *cells.values()):
        file.appendData(values)
    file.save()


_TRIANGLE = 900.0  # memory of a triangle while pieces are united, bytes
_MERGED = (1e-6, 1e-5, 1e-4)
"""Edges shorter than this fraction of the robot's length are collapsed, since single precision merges their ends. The
first value that leaves a watertight body is used."""

_READ_AS_ONE = 1e-8
"""Programs that read STL files merge vertices that are closer than this, in the unit of the file (trimesh does)."""
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
_HEAD = 80  # bytes of a binary STL file before the number of its triangles


class UnitedBody(NamedTuple):
    """The union of pieces as one closed surface, m."""

    vertices: Samples  #: (n, 3), m.
    faces: Faces  #: Outward oriented, (m, 3).
    bodies: int  #: Number of separate bodies; 1 where all pieces are connected.

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        return mass_properties(self.vertices, self.faces)[0]


def united(pieces: Iterable[RobotMesh]) -> UnitedBody:
    """Union of closed pieces, without interior surfaces."""
    import_optional("manifold3d", "one watertight body for printing")
    from manifold3d import Manifold, Mesh64, OpType

    chosen = list(pieces)
    triangles = sum(len(piece.faces) for piece in chosen)
    check_memory("one closed body", triangles, "triangles", _TRIANGLE, "as with a smaller fineness")
    # Scaled to its own length: a robot of micrometres is then no smaller than one of metres.
    size = float(np.ptp(np.concatenate([piece.vertices for piece in chosen]), axis=0).max())
    solids = [
        Manifold(Mesh64(np.ascontiguousarray(piece.vertices / size), piece.faces.astype(np.uint64))) for piece in chosen
    ]
    union = Manifold.batch_boolean(solids, OpType.Add)
    for merged in _MERGED:
        simple = union.simplify(merged)
        mesh = simple.to_mesh64()
        vertices, faces = np.array(mesh.vert_properties[:, :3], dtype=float), np.array(mesh.tri_verts, dtype=np.int64)
        if is_watertight(vertices, faces):
            break
    return UnitedBody(size * vertices, faces, len(simple.decompose()))


def is_watertight(vertices: Samples, faces: Faces) -> bool:
    """Whether each edge belongs to two triangles that run along it in opposite directions."""
    # Vertices at the same place in single precision count as one, as a reader of the file has to take them.
    return _is_closed(vertices.astype(np.float32), faces)


def is_watertight_file(data: bytes) -> bool:
    """Whether an STL file is watertight as programs read it: in single precision, close vertices taken as one."""
    corners = np.frombuffer(data, _RECORD, offset=_HEAD + 4)["corners"].reshape(-1, 3).astype(float)
    faces = np.arange(len(corners)).reshape(-1, 3)
    grids = (np.floor(corners / _READ_AS_ONE + shift) for shift in (0.0, 0.5))  # a program rounds down or up
    return all(_is_closed(grid, faces) for grid in grids)


def _is_closed(vertices: np.ndarray, faces: Faces) -> bool:
    """Whether each edge belongs to two triangles that run along it in opposite directions; equal vertices are one."""
    _, merged = np.unique(vertices, axis=0, return_inverse=True)
    joined = merged.reshape(-1)[faces]
    edges = np.concatenate([joined[:, [0, 1]], joined[:, [1, 2]], joined[:, [2, 0]]])
    keys, back = edges @ [len(vertices), 1], edges @ [1, len(vertices)]
    keys.sort()
    once = bool(np.all(keys[1:] != keys[:-1]) and np.all(edges[:, 0] != edges[:, 1]))
    return once and np.array_equal(keys, np.sort(back))


def stl_bytes(vertices: Samples, faces: Faces, title: str) -> bytes:
    """A binary STL file; its title has room for 80 characters with the mark of this program."""
    corners = vertices.astype(np.float32)[faces]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    record = np.zeros(len(faces), dtype=_RECORD)
    record["normal"] = normal / np.where(length > 0, length, 1.0)
    record["corners"] = corners
    head = f"{MARK}: {title}".encode("ascii", "replace")[:_HEAD].ljust(_HEAD)
    return head + np.uint32(len(faces)).tobytes() + record.tobytes()


MESH_SCALE = 1e-3
"""Mesh files are in mm: a program that merges vertices closer than some fixed length then spares a small robot."""

_SHARED = {"stub": "wire", "arm": "wire", "tail": "wire"}


class MeshFile(NamedTuple):
    """One STL file beside a robot description."""

    name: str  #: Name without ending, such as `body-seal`.
    part: str  #: `body` or `rotor`.
    colour: tuple[float, float, float] | None  #: sRGB of a visual surface; None for the closed body of the whole part.
    triangles: int  #: Number of triangles.
    data: bytes  #: Contents.


def mesh_files(pieces: Sequence[RobotMesh]) -> list[MeshFile]:
    """Surfaces of one colour each, then one closed body for each part."""
    surfaces: dict[tuple[str, str], list[tuple[Samples, Faces]]] = {}
    colours: dict[tuple[str, str], tuple[float, float, float]] = {}
    for piece in pieces:
        for index, region in enumerate(piece.regions):
            chosen = piece.region == index
            if not chosen.any():
                continue
            colour = piece.colours[chosen][0]
            key = piece.part, _name(region, colour)
            surfaces.setdefault(key, []).append((piece.vertices, piece.faces[chosen]))
            colours[key] = (float(colour[0]), float(colour[1]), float(colour[2]))
    found = [
        MeshFile(name, part, colours[part, name], sum(len(faces) for _, faces in items), _joined(items, name))
        for (part, name), items in surfaces.items()
    ]
    for part in ("body", "rotor"):
        solid = united(piece for piece in pieces if piece.part == part)
        data = stl_bytes(solid.vertices / MESH_SCALE, solid.faces, f"{part}, closed, unit mm")
        found.append(MeshFile(f"{part}-solid", part, None, len(solid.faces), data))
    return found


def _name(region: str, colour: Samples) -> str:
    """Stripes of one colour share a file."""
    if region.startswith("stripe"):
        nearest = min(STRIPE_COLOURS, key=lambda name: float(np.sum((np.array(STRIPE_COLOURS[name]) - colour) ** 2)))
        return f"stripes-{nearest}"
    return _SHARED.get(region, region)


def _joined(items: list[tuple[Samples, Faces]], name: str) -> bytes:
    corners = np.concatenate([vertices[faces] for vertices, faces in items]).reshape(-1, 3)
    return stl_bytes(corners / MESH_SCALE, np.arange(len(corners)).reshape(-1, 3), f"{name}, unit mm")


FULL_MODELS = tuple(name for name, model in SWIMMER_MODELS.items() if not (model.axial_only or model.placed))
"""Models that give the whole 12x12 matrix in unbounded fluid, for any motion of the robot."""

_UNITS = [["N s/m", "N s"], ["N s", "N m s"]]
_CONVENTION = (
    "(F_body, T_body, F_rotor, T_rotor) = -R (U_body, Omega_body, U_rotor, Omega_rotor): force and torque of the fluid "
    "on each link against velocity and rotation of each link; torques and velocities at the origin, which is the "
    "body's mid-length on the motor axis; all in the axes of the body (x forward, z up) with the tail at phase 0; "
    "R is symmetric and positive definite, and units repeat in blocks of 3x3"
)
_TURNING = (
    "at joint angle q, positive about +x, the tail's phase is q + joint.phase_at_zero, and R is Q R Q' with Q four "
    "blocks of the rotation about x by that phase; the same without turning R: express all velocities in the axes of "
    "the rotor, and the wrenches come out in them. R does not change with place or attitude"
)


def sidecar_of(robot: Robot, model: str, phase: float) -> dict[str, Any]:
    """Masses, joint, buoyancy and 12x12 resistance of a robot, SI; the joint angle is zero at the tail's `phase`."""
    chosen = find_swimmer_model(model)
    if model not in FULL_MODELS:
        raise InputError(
            f"model = {model!r} does not give the whole resistance in unbounded fluid; allowed: "
            f"{', '.join(FULL_MODELS)}"
        )
    batch = RobotBatch.of(robot)
    outside = broken(chosen.domain(batch))
    if outside:
        raise InputError(f"{robot.name} with model '{model}': {outside[0].sentence()}")
    warnings = [limit.caution() for limit in broken(chosen.cautions(batch))]
    if robot.coupling.length > 0 and "coupling" not in chosen.parts:
        warnings.append(Note.named("links-without-coupling", model=model, models=", ".join(FULL_MODELS)))
    links = links_of(robot)
    content = {
        "robot": robot.name,
        "model": model,
        "known_error": chosen.stated_error(robot.model),
        "references": list(chosen.references),
        "viscosity": quantity(robot.fluid.viscosity, "Pa s"),
        "density": quantity(robot.fluid.density, "kg/m^3"),
        "gravity": quantity([0.0, 0.0, -STANDARD_GRAVITY], "m/s^2"),
        "joint": {
            "type": "fixed" if robot.drive is not None and robot.drive.joint == "fixed" else "revolute",
            "origin": quantity([0.0, 0.0, 0.0], "m"),
            "axis": [1.0, 0.0, 0.0],
            "phase_at_zero": quantity(phase, "rad"),
            "friction": quantity(joint_friction(robot), "N m s/rad"),
        },
        "links": {"body": link_masses(links.body), "rotor": link_masses(links.rotor)},
        "matrix": {**quantity(chosen.resistance(batch, np.zeros(1))[0], ""), "unit": _UNITS},
        "convention": _CONVENTION,
        "turning": _TURNING,
    }
    return envelope("links", content, warnings)


def joint_friction(robot: Robot) -> float:
    """Friction inside the joint, N m s/rad; what acts on body or rotor from outside is not in it."""
    own = robot.motor.joint_rotor_friction if robot.motor is not None else 0.0
    if robot.friction.reading == "rotor":
        return own if robot.friction.effective is None else robot.friction.effective
    return own if robot.friction.reading == "body" else 0.0


def link_masses(link: Link) -> dict[str, Any]:
    """Inertia of one link, at phase 0 of the tail; null for an unknown mass."""
    return {
        "mass": quantity(link.mass, "kg"),
        "centre_of_mass": quantity(link.centre, "m"),
        "inertia": quantity(link.inertia, "kg m^2", about="centre_of_mass"),
        "displaced_volume": quantity(link.volume, "m^3"),
        "centre_of_buoyancy": quantity(link.centroid, "m"),
    }


_PLACES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
_FULL_INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


_FILTERS: dict[str, Callable[..., str]] = {
    "rgba": lambda colour: numbers([*np.asarray(colour).round(4), 1.0]),
    "inertia": lambda link: numbers(link.inertia[_PLACES[name]] for name in _FULL_INERTIA),
}


def urdf_text(robot: Robot, meshes: Iterable[MeshFile], folder: str, phase: float) -> str:
    """The description; lengths in m, the origin of both links on the motor axis at the body's mid-length."""
    return rendered(
        "exports/robot.urdf.jinja",
        filters=_FILTERS,
        robot=robot,
        links=list(zip(("body", "rotor"), links_of(robot), strict=True)),
        meshes=list(meshes),
        folder=folder,
        places=_PLACES,
        scale=numbers([MESH_SCALE] * 3),
        fixed=robot.drive is not None and robot.drive.joint == "fixed",
        phase=phase,
        friction=joint_friction(robot),
    )


_LEAST = 1e-15  # MuJoCo takes no smaller mass or moment of inertia, in its own unit-free numbers
_MOST_TRIANGLES = 200_000
_STEP = 1e-4


def check_inertia(robot: Robot) -> None:
    """Both links are heavy enough for MuJoCo."""
    for name, link in zip(("body", "rotor"), links_of(robot), strict=True):
        least = min(link.mass, float(np.min(np.linalg.eigvalsh(link.inertia))))
        if not least > _LEAST:
            raise InputError(
                f"{robot.name}: {name} has a mass of {link.mass:.3g} kg and a moment of inertia of "
                f"{np.min(np.linalg.eigvalsh(link.inertia)):.3g} kg m^2; allowed: more than {_LEAST:g} in both, the "
                "least that MuJoCo takes; .urdf has no such bound"
            )


def check_triangles(meshes: Iterable[MeshFile]) -> None:
    """No mesh has more triangles than MuJoCo reads."""
    most = max(meshes, key=lambda item: item.triangles)
    if most.triangles > _MOST_TRIANGLES:
        raise InputError(
            f"{most.name}.stl would have {most.triangles} triangles; allowed: at most {_MOST_TRIANGLES}, which is all "
            "that MuJoCo reads (a smaller fineness)"
        )


def mjcf_text(robot: Robot, meshes: Iterable[MeshFile], folder: str, phase: float) -> str:
    """The model; lengths in m, the origin of both bodies on the motor axis at the robot body's mid-length."""
    files = list(meshes)
    check_triangles(files)
    return rendered(
        "exports/robot.mjcf.jinja",
        filters=_FILTERS,
        robot=robot,
        links=links_of(robot),
        meshes=files,
        folder=folder,
        scale=numbers([MESH_SCALE] * 3),
        step=_STEP,
        gravity=STANDARD_GRAVITY,
        turns=robot.drive is None or robot.drive.joint == "revolute",
        phase=phase,
        friction=joint_friction(robot),
    )
