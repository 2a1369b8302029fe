"""The robot as a coloured scene in glTF's binary form (.glb), which Blender, browsers and slides show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from spirillum.files import MARK
from spirillum.robot.mesh import RobotMesh
from spirillum.robot.surface import corner_normals

__all__ = ["glb_bytes"]

_Y_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""glTF's y points up, where ours is z."""
_CREASE = np.deg2rad(40.0)
"""Angle between triangles above which an edge stays sharp, rad."""
_METAL = {"shaft": 0.9, "coupling": 0.9, "stub": 0.9, "arm": 0.9, "tail": 0.9}


def glb_bytes(name: str, pieces: Sequence[RobotMesh], phase: float) -> bytes:
    """A scene with the nodes robot, body and rotor, in metres; turning rotor about its x axis turns the tail.

    Args:
        name: of the robot.
        pieces: at phase 0 of the tail.
        phase: phase of the tail, rad, to which the node of the rotor is turned.
    """
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
            colour = _linear(piece.colours[chosen][0])
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
    return bytes(scene.export(file_type="glb", include_normals=True, tree_postprocessor=_signed))


def _linear(colour: np.ndarray) -> np.ndarray:
    """Linear light from sRGB, both 0 to 1 (IEC 61966-2-1)."""
    return np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)


def _signed(tree: dict[str, Any]) -> None:
    tree["asset"]["generator"] = MARK
