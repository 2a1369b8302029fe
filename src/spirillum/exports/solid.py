"""One watertight body from pieces that overlap, and its STL file."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.costs import check_memory
from spirillum.files import MARK
from spirillum.robot.mesh import RobotMesh
from spirillum.robot.surface import Faces, mass_properties

_TRIANGLE = 900.0
"""Memory of a triangle while pieces are united, bytes."""
_MERGED = (1e-6, 1e-5, 1e-4)
"""Edges shorter than this fraction of the robot's length are collapsed, since single precision merges their ends. The
first value that leaves a watertight body is used."""

_READ_AS_ONE = 1e-8
"""Programs that read STL files merge vertices that are closer than this, in the unit of the file (trimesh does)."""
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
_HEAD = 80
"""Bytes of a binary STL file before the number of its triangles."""


class UnitedBody(NamedTuple):
    """The union of pieces as one closed surface, m."""

    vertices: Samples
    """(n, 3), m."""
    faces: Faces
    """Outward oriented, (m, 3)."""
    bodies: int
    """Number of separate bodies; 1 where all pieces are connected."""

    @property
    def volume(self) -> float:
        """Volume, m^3."""
        return mass_properties(self.vertices, self.faces)[0]


def united(pieces: Iterable[RobotMesh]) -> UnitedBody:
    """The union of closed pieces; what lies inside another piece is gone."""
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
    """Whether each edge belongs to two triangles that run along it in opposite directions.

    Vertices at the same place in single precision count as one, as a reader of the file has to take them.
    """
    return _is_closed(vertices.astype(np.float32), faces)


def is_watertight_file(data: bytes) -> bool:
    """Whether an STL file is watertight as programs read it: in single precision, close vertices taken as one."""
    corners = np.frombuffer(data, _RECORD, offset=_HEAD + 4)["corners"].reshape(-1, 3).astype(float)
    faces = np.arange(len(corners)).reshape(-1, 3)
    grids = (np.floor(corners / _READ_AS_ONE + shift) for shift in (0.0, 0.5))  # a program rounds one way or the other
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
    """A binary STL file.

    Args:
        vertices: in the unit of the file, (n, 3).
        faces: outward oriented, (m, 3).
        title: for the head of the file, which has room for 80 characters with the mark of this program.
    """
    corners = vertices.astype(np.float32)[faces]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    record = np.zeros(len(faces), dtype=_RECORD)
    record["normal"] = normal / np.where(length > 0, length, 1.0)
    record["corners"] = corners
    head = f"{MARK}: {title}".encode("ascii", "replace")[:_HEAD].ljust(_HEAD)
    return head + np.uint32(len(faces)).tobytes() + record.tobytes()
