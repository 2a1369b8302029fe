"""What a glass cover holds: the body as its seal, a battery and a board."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.robot.mesh import RobotMesh
from spirillum.robot.robot import Robot

_BATTERY = (0.03, 0.58, 0.56, 0.30)
"""Start and end along the room before the seal; half the width and the height over the body's radius, as the bent light
shows them; assumed."""
_BOARD, _CHIP = (0.60, 0.64, 0.60, 0.60), (0.64, 0.69, 0.28, 0.17)
_WRAP, _BACK, _GREEN, _BLACK, _GREY = (
    (0.36, 0.43, 0.58),
    (0.80, 0.80, 0.78),
    (0.13, 0.40, 0.22),
    (0.16, 0.16, 0.17),
    (0.62, 0.62, 0.60),
)
"""sRGB of the battery's two faces, of the board, its chip and the seal's front wall; assumed."""


def covered_body(robot: Robot, body: RobotMesh) -> list[RobotMesh]:
    """The opaque pieces of a body under a glass cover: its seal, a battery, a board."""
    if robot.seal is None:
        raise InputError("glass_cover (--trouble glass-cover) requires a robot with a seal, which holds the cover")
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
    """Some triangles of a piece.

    Args:
        piece: of a robot's mesh.
        chosen: whether each triangle belongs to them, (m,).
    """
    used, faces = np.unique(piece.faces[chosen], return_inverse=True)
    return RobotMesh(
        piece.name,
        piece.part,
        piece.vertices[used],
        faces.reshape(-1, 3),
        piece.colours[chosen],
        piece.regions,
        piece.region[chosen],
    )


def _box(along: tuple[float, float], half: Samples, colour: tuple[float, float, float], z: float = 0.0) -> RobotMesh:
    """A box about the axis, or shifted to z."""
    from trimesh.creation import box

    bounds = np.array([[along[0], -half[0], z - half[1]], [along[1], half[0], z + half[1]]])
    mesh = box(bounds=bounds)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    which = np.zeros(len(faces), dtype=np.int64)
    colours = np.tile(colour, (len(faces), 1))
    return RobotMesh("contents", "body", np.asarray(mesh.vertices), faces, colours, ("contents",), which)
