"""The mesh files that robot descriptions refer to: coloured surfaces to look at, closed bodies to collide with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.exports.solid import stl_bytes, united
from spirillum.robot.mesh import STRIPE_COLOURS, RobotMesh
from spirillum.robot.surface import Faces

MESH_SCALE = 1e-3
"""Mesh files are in mm: a program that merges vertices closer than some fixed length then spares a small robot."""

_SHARED = {"stub": "wire", "arm": "wire", "tail": "wire"}


class MeshFile(NamedTuple):
    """One STL file beside a robot description."""

    name: str
    """Name without ending, such as `body-seal`."""
    part: str
    """`body` or `rotor`."""
    colour: tuple[float, float, float] | None
    """sRGB of a surface to look at; None for the closed body of the whole part."""
    triangles: int
    """Number of triangles."""
    data: bytes
    """Contents."""


def mesh_files(pieces: Sequence[RobotMesh]) -> list[MeshFile]:
    """Surfaces of one colour each, then one closed body for each part.

    Args:
        pieces: of the robot at phase 0.
    """
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
