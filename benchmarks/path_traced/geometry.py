"""The robot of the package as meshes with materials, and where it is on every frame; mm."""

from __future__ import annotations

from typing import Any

import numpy as np
from path_traced.scenes import Scene

import spirillum as sp
from spirillum.robot.mesh import RobotMesh, robot_mesh

__all__ = ["meshes_of", "poses_of", "robot_of"]

_FINENESS = 2.0
_AIR_FRONT = 0.05
"""Between the seal's front wall and what lies before it, mm."""
_AROUND = 96
_ROUGHNESS = {"body": 0.5, "seal": 0.35, "shaft": 0.3, "coupling": 0.35, "stub": 0.3, "arm": 0.3, "tail": 0.3}
_METALS = ("shaft", "stub", "arm", "tail")
Mesh = dict[str, Any]


def robot_of(scene: Scene) -> Any:
    """The robot of a scene: the paper's in its wide tube, with a tail of the scene's hand."""
    return sp.load("biorob2012-wide", **{"tail.handedness": scene.handedness})


def meshes_of(scene: Scene, robot: Any) -> list[Mesh]:
    """Meshes of a scene's robot in its own axes: `part`, `vertices`, `faces`, `colours`, `material`.

    Args:
        scene: says what the body is made of.
        robot: of `robot_of`.
    """
    if scene.cover == "none":
        return []
    pieces = robot_mesh(robot, fineness=_FINENESS)
    found = [_opaque(piece) for piece in pieces if piece.name != "body"]
    body = next(piece for piece in pieces if piece.name == "body")
    cover = body.region == body.regions.index("body")
    found.append(_opaque(body, ~cover))
    if scene.cover == "painted":
        paint = _opaque(body, cover)
        paint["colours"] = np.full((int(cover.sum()), 3), scene.contents["paint"])
        return [*found, paint]
    return [*found, *_covered(scene, body, cover, robot)]


def _opaque(piece: RobotMesh, chosen: np.ndarray | None = None) -> Mesh:
    which = np.ones(len(piece.faces), dtype=bool) if chosen is None else chosen
    return {
        "part": piece.part,
        "vertices": 1e3 * piece.vertices,
        "faces": piece.faces[which],
        "colours": _linear(piece.colours[which]),
        "material": {
            "kind": "opaque",
            "roughness": _ROUGHNESS[piece.name],
            "metallic": 1.0 if piece.name in _METALS else 0.0,
        },
    }


def _covered(scene: Scene, body: RobotMesh, cover: np.ndarray, robot: Any) -> list[Mesh]:
    """A glass cover, the seal's front wall, and what is inside."""
    contents = scene.contents
    vertices, faces = _compact(1e3 * body.vertices, body.faces[cover])
    wall = contents["wall"]
    inner = vertices - wall * _vertex_normals(vertices, faces)
    white = np.ones((len(faces), 3))
    rear = float(vertices[:, 0].min())
    radius, nose = 0.5e3 * robot.body.diameter, 0.5e3 * robot.body.length
    front_wall = _lathe(np.array([[rear, radius], [rear + _AIR_FRONT, radius - 0.01], [rear + _AIR_FRONT, 0.0]]))
    found = [
        _mesh(vertices, faces, white, {"kind": "glass", "index": 1.49, "outside": "oil"}),
        _mesh(inner, faces[:, ::-1], white, {"kind": "glass", "index": 1.49, "outside": "air"}),
        _painted(front_wall, (0.55, 0.55, 0.53)),
    ]
    room = radius - wall
    if scene.cover == "liner":
        liner = inner - 0.3 * _vertex_normals(vertices, faces)
        dark = np.full((len(faces), 3), contents["liner"])
        return [*found, _mesh(liner, faces, dark, {"kind": "opaque", "roughness": 0.6, "metallic": 0.0})]
    start = rear + 0.4
    end = start + contents["length"]
    if contents["box"]:
        found += _battery_box(start, end, room, contents)
    else:
        can = np.array([[start, 0.0], [start, 0.9 * room], [end, 0.9 * room], [end, 0.0]])
        found.append(_painted(_lathe(can), contents["back"]))
    board = 0.93 * min(room, float(np.sqrt(max(room**2 - max(end + 1.6 - (nose - radius), 0.0) ** 2, 1.0))))
    disc = np.array([[end + 0.5, 0.0], [end + 0.5, board], [end + 1.6, board], [end + 1.6, 0.0]])
    found.append(_painted(_lathe(disc), (0.03, 0.17, 0.07)))
    found.append(_box((end + 1.6, -2.6, -1.6), (end + 2.9, 2.6, 1.6), (0.03, 0.03, 0.035)))
    return found


def _battery_box(start: float, end: float, room: float, contents: dict[str, Any]) -> list[Mesh]:
    """A flat cell whose two faces differ, with a red tape at one edge."""
    half_width, half_height = 0.86 * room, 0.42 * room
    top = _box((start, -half_width, 0.0), (end, half_width, half_height), contents["wrap"])
    bottom = _box((start, -half_width, -half_height), (end, half_width, 0.0), contents["back"])
    tape = _box((start + 1, half_width - 0.2, -0.6), (end - 1, half_width + 0.1, 0.6), (0.55, 0.05, 0.05))
    return [top, bottom, tape]


def _mesh(vertices: np.ndarray, faces: np.ndarray, colours: np.ndarray, material: dict[str, Any]) -> Mesh:
    return {"part": "body", "vertices": vertices, "faces": faces, "colours": colours, "material": material}


def _painted(surface: tuple[np.ndarray, np.ndarray], colour: tuple[float, float, float]) -> Mesh:
    vertices, faces = surface
    opaque = {"kind": "opaque", "roughness": 0.45, "metallic": 0.0}
    return _mesh(vertices, faces, np.tile(colour, (len(faces), 1)), opaque)


def _box(low: tuple[float, ...], high: tuple[float, ...], colour: tuple[float, float, float]) -> Mesh:
    corners = np.array([[(low, high)[k][0], (low, high)[j][1], (low, high)[i][2]] for i in (0, 1) for j in (0, 1)
                        for k in (0, 1)])  # fmt: skip
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    faces = np.array([corner for a, b, c, d in quads for corner in ((a, b, c), (a, c, d))])
    return _painted((corners, faces), colour)


def _lathe(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Surface of revolution of points (x, radius) about x; (vertices, faces)."""
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    x, radius = profile.T
    rings = np.stack(
        [np.repeat(x[:, None], _AROUND, 1), radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)], axis=-1
    )
    number = np.arange(len(profile) * _AROUND).reshape(len(profile), _AROUND)
    a, b = number[:-1], number[1:]
    a1, b1 = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    faces = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, b1), (a, b1, a1))])
    return rings.reshape(-1, 3), faces


def _compact(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Only the vertices that faces have."""
    used, renumbered = np.unique(faces, return_inverse=True)
    return vertices[used], renumbered.reshape(faces.shape)


def _vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], across)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _linear(colours: np.ndarray) -> np.ndarray:
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)


def poses_of(scene: Scene, times: np.ndarray, axis_height: float) -> dict[str, np.ndarray]:
    """Where the robot is at times: `position` (n, 3) mm, `heading`, `body_angle` and `tail_phase` (n,) rad.

    Args:
        scene: says how it swims.
        times: from the first frame, s.
        axis_height: height of the body's axis, mm.
    """
    motion = scene.motion
    turn = 2.0 * np.pi * times
    tail = np.radians(motion.tail_phase) + motion.tail_rate * turn
    along = motion.start + motion.speed * (times - 0.5 * scene.duration)
    position = np.stack([along, motion.wobble * np.cos(tail), np.full_like(times, axis_height)], axis=-1)
    position[:, :2] *= scene.sign
    heading = np.radians(motion.heading + motion.heading_wobble * np.sin(tail))
    return {
        "position": position,
        "heading": heading + (0.0 if scene.sign > 0 else np.pi),
        "body_angle": np.radians(motion.body_angle) + motion.body_rate * turn,
        "tail_phase": tail,
    }
