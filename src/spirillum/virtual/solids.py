"""Robot surfaces as triangles with colours and normals, with the interior of a glass cover.

Edges are short enough that refraction bends none visibly.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.kernels.core import shade
from spirillum.optional_dependencies import import_optional
from spirillum.robot.mesh import RobotMesh, robot_mesh
from spirillum.robot.robot import Robot
from spirillum.robot.surface import Faces, corner_normals, linear_light
from spirillum.virtual.artifacts import repainted

_BATTERY = (0.03, 0.58, 0.56, 0.30)
"""Start and end along the room before the seal; half the width and the height over the body's radius, as the bent light
shows them; assumed."""
_BOARD, _CHIP = (0.60, 0.64, 0.60, 0.60), (0.64, 0.69, 0.28, 0.17)
_WRAP, _BACK = (0.36, 0.43, 0.58), (0.80, 0.80, 0.78)
_GREEN, _BLACK, _GREY = (0.13, 0.40, 0.22), (0.16, 0.16, 0.17), (0.62, 0.62, 0.60)
"""sRGB of the battery's two faces, of the board, its chip and the seal's front wall; assumed."""


def covered_body(robot: Robot, body: RobotMesh) -> list[RobotMesh]:
    """The opaque pieces of a body under a glass cover: its seal, a battery, a board."""
    if robot.seal is None:
        raise InputError("glass_cover (--trouble glass-cover) requires a robot with a seal, which carries the cover")
    rear, nose, radius = robot.seal.length - 0.5 * robot.body.length, 0.5 * robot.body.length, 0.5 * robot.body.diameter
    low, high, width, height = _BATTERY
    start, end = rear + low * (nose - rear), rear + high * (nose - rear)
    half = radius * np.array([width, height])
    wall = 0.02 * radius
    return [
        part_of(body, body.region != 0),
        _box((rear, start - 2 * wall), 0.70 * radius * np.ones(2), _GREY),
        _box((start, end), half * (1.0, 0.5), _WRAP, 0.5 * half[1]),
        _box((start, end), half * (1.0, 0.5), _BACK, -0.5 * half[1]),
        *(
            _box((rear + a * (nose - rear), rear + b * (nose - rear)), radius * np.array([y, z]), colour)
            for (a, b, y, z), colour in ((_BOARD, _GREEN), (_CHIP, _BLACK))
        ),
    ]


def part_of(piece: RobotMesh, chosen: np.ndarray) -> RobotMesh:
    """Some triangles of a piece."""
    used, faces = np.unique(piece.faces[chosen], return_inverse=True)
    own = {"colours": piece.colours[chosen], "region": piece.region[chosen]}
    return replace(piece, vertices=piece.vertices[used], faces=faces.reshape(-1, 3), **own)


def _box(along: tuple[float, float], half: Samples, colour: tuple[float, float, float], z: float = 0.0) -> RobotMesh:
    """A box about the axis, or shifted to z."""
    import_optional("trimesh", "the contents of a glass cover")
    from trimesh.creation import box

    bounds = np.array([[along[0], -half[0], z - half[1]], [along[1], half[0], z + half[1]]])
    mesh = box(bounds=bounds)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    which = np.zeros(len(faces), dtype=np.int64)
    colours = np.tile(colour, (len(faces), 1))
    return RobotMesh("contents", "body", np.asarray(mesh.vertices), faces, colours, ("contents",), which)


_LONGEST = 5e-3  # longest edge of a triangle, m
_CREASE = float(np.radians(35.0))  # angle between triangles above which an edge is sharp, rad
MATERIALS: dict[str, tuple[float, float, float, float]] = {
    "body": (0.34, 0.70, 0.45, 60.0),
    "shaft": (0.25, 0.55, 0.70, 25.0),
    "coupling": (0.25, 0.55, 0.70, 25.0),
    "stub": (0.28, 0.60, 0.65, 18.0),
    "arm": (0.28, 0.60, 0.65, 18.0),
    "tail": (0.28, 0.60, 0.65, 18.0),
    "contents": (0.34, 0.60, 0.10, 20.0),
}
"""Ambient, diffuse and specular reflectance, and exponent of the specular one, by piece; assumed."""
_KINDS = tuple(MATERIALS)
_METALS = frozenset(_KINDS) - {"body", "contents"}


class Lamps(NamedTuple):
    """Lamps far away, in the camera's frame."""

    towards: Samples  #: Unit vector towards each lamp, (k, 3).
    halfway: Samples  #: Unit vector halfway between lamp and camera, (k, 3).
    strength: Samples  #: (k,).


class Shading(NamedTuple):
    """Colours of triangles, and the light on their corners."""

    colour: Samples  #: Linear colour of diffuse light, (m, 3).
    gloss: Samples  #: Linear colour of specular light, (m, 3).
    diffuse: Samples  #: Diffuse light of each corner, (m, 3).
    specular: Samples  #: Specular light of each corner, (m, 3).


@dataclass(frozen=True)
class RenderedSolid:
    """A rigid part of the robot, in its own axes, m."""

    vertices: Samples = field(repr=False)  #: (n, 3), m.
    faces: Faces = field(repr=False)  #: Triangles, outward oriented, (m, 3).
    colours: Samples = field(repr=False)  #: Linear colour of each triangle, (m, 3).
    gloss: Samples = field(repr=False)  #: Linear colour of its specular light, (m, 3).
    normals: Samples = field(repr=False)  #: Unit normals at the corners of each triangle, (m, 3, 3).
    kind: Faces = field(repr=False)  #: Index of each triangle's material in `MATERIALS`, (m,).

    def shading(self, turn: Samples, lamps: Lamps) -> Shading:
        """Colours, and light on the corners."""
        shading = Shading(self.colours, self.gloss, *(np.empty((len(self.faces), 3)) for _ in range(2)))
        materials = np.array(list(MATERIALS.values()))
        shade(self.normals, turn, *lamps, materials, self.kind, shading.diffuse, shading.specular)
        return shading


def solids_of(
    robot: Robot, edges: Samples | None = None, *, covered: bool = False
) -> tuple[RenderedSolid, RenderedSolid]:
    """Body and rotor of a robot, the rotor with its tail at phase 0."""
    robot.check_body("the virtual camera")
    pieces = robot_mesh(robot, phase=0.0)
    if edges is not None:
        pieces = tuple(
            replace(piece, vertices=repainted(robot, piece.vertices, edges)) if piece.name == "body" else piece
            for piece in pieces
        )
    body, rotor = ([piece for piece in pieces if piece.part == part] for part in ("body", "rotor"))
    return joined(covered_body(robot, body[0]) if covered else body), joined(rotor)


def joined(pieces: list[RobotMesh]) -> RenderedSolid:
    """One solid of pieces that move together."""
    vertices, faces, colours, gloss, normals, kind, count = [], [], [], [], [], [], 0
    for piece in pieces:
        points, triangles, origin = _shortened(np.asarray(piece.vertices), np.asarray(piece.faces))
        own = linear_light(piece.colours)[origin]
        vertices.append(points)
        faces.append(triangles + count)
        colours.append(own)
        gloss.append(own if piece.name in _METALS else np.ones_like(own))
        normals.append(corner_normals(points, triangles, _CREASE))
        kind.append(np.full(len(triangles), _KINDS.index(piece.name)))
        count += len(points)
    return RenderedSolid(
        np.ascontiguousarray(np.concatenate(vertices)),
        np.ascontiguousarray(np.concatenate(faces), dtype=np.int64),
        np.concatenate(colours),
        np.concatenate(gloss),
        np.concatenate(normals),
        np.concatenate(kind).astype(np.int64),
    )


def _shortened(points: Samples, faces: Faces) -> tuple[Samples, Faces, Faces]:
    """Triangles without long edges, on the same surface; and the original triangle of each."""
    origin = np.arange(len(faces))
    while True:
        edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)  # (m, 3, 2)
        key, index = np.unique(edges[..., 0] * len(points) + edges[..., 1], return_inverse=True)  # one number an edge
        unique, index = np.stack(np.divmod(key, len(points)), axis=-1), index.reshape(-1, 3)
        long = np.linalg.norm(points[unique[:, 0]] - points[unique[:, 1]], axis=1) > _LONGEST
        if not long.any():
            return points, faces, origin
        middle = np.full(len(unique), -1)
        middle[long] = len(points) + np.arange(int(long.sum()))
        points = np.concatenate([points, 0.5 * (points[unique[long, 0]] + points[unique[long, 1]])])
        halves = middle[index]  # new vertex on each edge of each triangle, or -1
        parts, sources = [], []
        for number in range(4):
            chosen = (halves >= 0).sum(axis=1) == number
            for corners in _split(faces[chosen], halves[chosen], number):
                parts.append(corners)
                sources.append(origin[chosen])
        faces, origin = np.concatenate(parts), np.concatenate(sources)


def _split(faces: Faces, halves: Faces, number: int) -> list[Faces]:
    """Triangles of which `number` edges are halved, as parts oriented as before."""
    if number == 0:
        return [faces]
    if number == 3:
        (a, b, c), (ab, bc, ca) = faces.T, halves.T
        return [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    # Turn each triangle so that its first edge is halved (one), or its third is whole (two).
    first = np.argmax(halves >= 0, axis=1) if number == 1 else (np.argmax(halves < 0, axis=1) + 1) % 3
    order = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, order, axis=1).T
    ab, bc, _ = np.take_along_axis(halves, order, axis=1).T
    if number == 1:
        return [np.stack([a, ab, c], axis=1), np.stack([ab, b, c], axis=1)]
    return [np.stack([ab, b, bc], axis=1), np.stack([a, ab, bc], axis=1), np.stack([a, bc, c], axis=1)]
