"""What the page draws of a robot: its meshes packed for the graphics card, its tube, the profile of its body."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.links import outlines_of
from spirillum.robot.mesh import COLOURS, RobotMesh, robot_mesh
from spirillum.robot.robot import Robot
from spirillum.robot.surface import corner_normals

_CREASE = np.radians(40.0)
"""Edges sharper than this stay sharp."""
_FINENESS = 0.75
_ALONG = np.linspace(0.0, 1.0, 7)
"""Places along each piece of the body's outline."""
_METALS = ("shaft", "coupling", "stub", "arm", "tail")


def shape_of(robot: Robot) -> dict[str, Any]:
    """Meshes of body and rotor, and the tube; lengths in m.

    `body` and `rotor` hold `vertices` (base64 of float32: place, normal, linear colour, metal; ten numbers each) and
    `triangles` (base64 of uint32). The rotor is at phase 0 and turns about the body's x axis.
    """
    pieces = robot_mesh(robot, fineness=_FINENESS)
    channel, tail = robot.channel, robot.tail
    half = 0.5 * robot.body.length
    return {
        **{part: _packed([piece for piece in pieces if piece.part == part]) for part in ("body", "rotor")},
        "nose": half,
        "tip": -half - robot.coupling.length - tail.length,
        "root": -half - robot.coupling.length,
        "radius": 0.5 * robot.body.diameter,
        "tail_radius": tail.amplitude + 0.5 * tail.wire_diameter,
        "tube_radius": None if channel is None else 0.5 * channel.diameter,
        "tube_length": None if channel is None else channel.length,
        "profile": _profile(robot),
    }


def _profile(robot: Robot) -> list[list[float]]:
    """Points (x, rho) along the body's outline, m: circles about its axis that together are its silhouette."""
    found = []
    for piece in outlines_of(robot)["body"].pieces:
        x, rho = piece.points(_ALONG)
        found += [[float(a), float(b)] for a, b in zip(x, rho, strict=True)]
    return found


def _packed(pieces: list[RobotMesh]) -> dict[str, Any]:
    """Pieces as one list of corners, those that are alike once."""
    corners: list[Samples] = []
    for piece in pieces:
        normals = corner_normals(piece.vertices, piece.faces, float(_CREASE)).reshape(-1, 3)
        metal = np.full((len(normals), 1), float(piece.name in _METALS and COLOURS[piece.name] != COLOURS["body"]))
        colours = _linear(np.repeat(piece.colours, 3, axis=0))
        corners.append(np.concatenate([piece.vertices[piece.faces].reshape(-1, 3), normals, colours, metal], axis=1))
    if not corners:
        corners = [np.zeros((0, 10))]
    unique, index = np.unique(np.concatenate(corners).astype("<f4"), axis=0, return_inverse=True)
    return {
        "vertices": base64.b64encode(np.ascontiguousarray(unique, dtype="<f4").tobytes()).decode(),
        "triangles": base64.b64encode(index.ravel().astype("<u4").tobytes()).decode(),
    }


def _linear(colour: Samples) -> Samples:
    """SRGB to linear light (IEC 61966-2-1)."""
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
