"""A robot in its place as a scene of VTK: solids that move rigidly, the glass around them, light, a camera.

VTK clips scenes of micrometres, so that everything is drawn in units of the robot's length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.poses import Pose
from spirillum.extras import required
from spirillum.robot.robot import Robot
from spirillum.view.scene3d.camera import Camera, View
from spirillum.view.scene3d.glass import add_glass, ruler_steps
from spirillum.view.scene3d.ground import add_grid
from spirillum.view.scene3d.light import add_light
from spirillum.view.scene3d.shadow import add_shade
from spirillum.view.scene3d.window import new_plotter

__all__ = ["DrawnRobot", "Scene", "level_height", "resting"]

_Material = dict[str, float]
_COPPER: _Material = {"metallic": 0.75, "roughness": 0.3}
_MATERIALS: dict[str, _Material] = {
    "body": {"metallic": 0.0, "roughness": 0.22},
    "coupling": {"metallic": 0.85, "roughness": 0.38},
    "shaft": {"metallic": 0.9, "roughness": 0.3},
    "tail": _COPPER,
    "stub": _COPPER,
    "arm": _COPPER,
}
_QUICK: _Material = {"ambient": 0.46, "diffuse": 0.58, "specular": 0.30, "specular_power": 40.0}
"""Shading of a film's solids: reflected surroundings would double the time of a frame."""
_QUICK_METAL: _Material = {"ambient": 0.34, "diffuse": 0.62, "specular": 0.75, "specular_power": 16.0}
_SHARP = 35.0
"""Angle between faces above which an edge is drawn sharp, deg."""


@dataclass(frozen=True)
class DrawnRobot:
    """The pieces of a robot with its tail at phase 0, and how far they reach."""

    robot: Robot
    pieces: tuple[Any, ...]
    length: float
    """Largest extent, m."""
    radius: float
    """Largest distance of any point from the motor axis, m."""

    @classmethod
    def of(cls, robot: Robot, *, fineness: float = 1.0) -> DrawnRobot:
        """The pieces of a robot.

        Args:
            robot: a loaded robot.
            fineness: of `spirillum.robot.mesh.robot_mesh`.
        """
        from spirillum.robot.mesh import robot_mesh

        pieces = tuple(robot_mesh(robot, phase=0.0, fineness=fineness))
        points = np.concatenate([piece.vertices for piece in pieces])
        return cls(
            robot, pieces, float(np.ptp(points, axis=0).max()), float(np.hypot(points[:, 1], points[:, 2]).max())
        )

    def points(self, pose: Pose) -> Samples:
        """(n, 3) all vertices in the lab, m."""
        placed = []
        for piece in self.pieces:
            matrix = pose.body if piece.part == "body" else pose.rotor
            placed.append(piece.vertices @ matrix[:3, :3].T + matrix[:3, 3])
        return np.concatenate(placed)

    def corners(self, pose: Pose) -> Samples:
        """Points around the robot that hold it at any angle of its tail, m."""
        x = np.concatenate([piece.vertices[:, 0] for piece in self.pieces])
        angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        ring = np.stack([np.zeros(24), self.radius * np.cos(angle), self.radius * np.sin(angle)], axis=-1)
        points = np.concatenate([ring + np.array([end, 0.0, 0.0]) for end in (x.min(), x.max())])
        return np.asarray(points @ pose.body[:3, :3].T + pose.position)


def level_height(solids: DrawnRobot) -> float:
    """Height of the motor axis of a level robot above its channel's axis, m; 0 without a channel.

    It is negative: the lowest at which body and tail, at any phase, do not cut into the glass.
    """
    channel = solids.robot.channel
    return 0.0 if channel is None else -max(0.5 * channel.diameter - solids.radius, 0.0)


def resting(solids: DrawnRobot, phase: float = 0.0) -> Pose:
    """The pose of a robot that lies level on its channel's floor, its tail at a phase."""
    height = level_height(solids)
    return Pose(np.array([0.0, 0.0, height]), np.array([1.0, 0.0, 0.0, 0.0]), phase)


class Scene:
    """What is drawn. Lengths in m, the lab's axes: those of the channel, its axis at y = z = 0."""

    def __init__(
        self,
        solids: DrawnRobot,
        size: tuple[int, int],
        *,
        glass: tuple[float, float] | None = None,
        live: bool = False,
        samples: int = 4,
        rows: int | None = None,
        quick: bool = False,
    ) -> None:
        """Build the scene.

        Args:
            solids: the robot's pieces.
            size: width and height, pixels.
            glass: x of both ends of the channel's piece that is drawn, m; None: none of it.
            live: a window on the screen.
            samples: samples of each pixel.
            rows: rows about the middle that are drawn, an even number; what lies above and below stays white.
            quick: lamps alone, without surroundings that the solids reflect.

        Raises:
            InputError: if nothing here can draw, or PyVista is missing.
        """
        self.solids = solids
        self.unit = solids.length
        self._rows = size[1] if rows is None else min(rows, size[1])
        self.plotter = new_plotter((size[0], self._rows), live=live, samples=samples)
        self._pyvista = required("pyvista", "a 3D picture")
        self._size = size
        self._pixels: Any = None
        self._shade: Any = None
        self.plotter.set_background("white")
        # What is translucent is added from back to front; VTK's own sorting of it knows no samples, and takes long.
        self.plotter.renderer.UseOITOff()
        self._quick = quick
        add_light(self.plotter, self._pyvista, surrounded=not quick)
        if glass is not None and solids.robot.channel is not None:
            radius = 0.5 * solids.robot.channel.diameter
            step = ruler_steps(0.11 * solids.length)
            lengths = (value / self.unit for value in (radius, *glass, step))
            add_glass(self.plotter, self._pyvista, *lengths)
            self._shade = add_shade(self.plotter, self._pyvista, solids.robot, self.unit, level_height(solids))
        self._actors = [(piece.part, self._added(piece)) for piece in solids.pieces]

    def _added(self, piece: Any) -> Any:
        faces = np.concatenate([np.full((len(piece.faces), 1), 3), piece.faces], axis=1)
        mesh = self._pyvista.PolyData(np.asarray(piece.vertices / self.unit, dtype=np.float32), faces.ravel())
        mesh.cell_data["colour"] = np.round(255 * np.asarray(piece.colours)).astype(np.uint8)
        smooth = mesh.compute_normals(
            cell_normals=False, split_vertices=True, feature_angle=_SHARP, auto_orient_normals=False
        )
        look: dict[str, Any] = {"scalars": "colour", "rgb": True, "show_scalar_bar": False}
        if self._quick:
            look |= _QUICK if piece.name == "body" else _QUICK_METAL
        else:
            look |= {"pbr": True, **_MATERIALS[piece.name]}
        actor = self.plotter.add_mesh(smooth, **look)
        if self._quick:
            actor.prop.interpolation = "Phong"
        return actor

    def add_grid(self, view: View, low: Samples, high: Samples) -> None:
        """Add a faint grid behind or below what lies between two corners, m."""
        step = ruler_steps(0.3 * self.solids.length)
        add_grid(self.plotter, self._pyvista, view, low / self.unit, high / self.unit, step / self.unit)

    def place(self, pose: Pose) -> None:
        """Move the robot: rigid motions of its two parts."""
        matrices = {"body": pose.body, "rotor": pose.rotor}
        for matrix in matrices.values():
            matrix[:3, 3] /= self.unit
        for part, actor in self._actors:
            actor.user_matrix = matrices[part]
        if self._shade is not None:
            self._shade.position = (float(pose.position[0]) / self.unit, 0.0, 0.0)

    def look(self, camera: Camera) -> None:
        """Set the camera."""
        eye = self.plotter.camera
        eye.position = tuple(camera.position / self.unit)
        eye.focal_point = tuple(camera.focal / self.unit)
        eye.up = tuple(camera.up)
        eye.parallel_projection = camera.parallel
        half = camera.half_height * self._rows / self._size[1]
        eye.parallel_scale = half / self.unit
        eye.view_angle = np.degrees(2.0 * np.arctan(half / camera.distance))
        self.plotter.renderer.ResetCameraClippingRange()

    def image(self) -> np.ndarray:
        """(height, width, 3) the picture, sRGB bytes."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        read: Any = vtk_to_numpy

        width, height = self._size
        if self._pixels is None:
            self._pixels = vtkUnsignedCharArray()
        window = self.plotter.render_window
        window.Render()
        window.GetPixelData(0, 0, width - 1, self._rows - 1, 0, self._pixels, 0)
        drawn = read(self._pixels).reshape(self._rows, width, 3)[::-1]
        image = np.full((height, width, 3), 255, dtype=np.uint8)
        above = (height - self._rows) // 2
        image[above : above + self._rows] = drawn
        return image

    def close(self) -> None:
        """Give back the window's memory."""
        self.plotter.close()

    def __enter__(self) -> Scene:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
