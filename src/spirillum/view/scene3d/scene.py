"""VTK scene of a robot in its pose: rigid solids, the tube around them, light, a camera.

VTK clips scenes of micrometres, so that everything is rendered in units of the robot's length.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.run_file import RobotPose
from spirillum.optional_dependencies import import_optional
from spirillum.robot.links import outlines_of
from spirillum.robot.robot import Robot
from spirillum.view.figures.scene import round_length
from spirillum.view.scene3d.rendering import new_plotter
from spirillum.view.scene3d.scenery import SceneCamera, add_glass

_ALONG, _AROUND = 160, 49
_HALF_ANGLE = 0.9
_DARKEST = 0.5
_REACH = 0.30  # distance from the floor over which the shadow fades, in radii of the channel


def shade(robot: Robot, radius: float, height: float, x: Samples, angle: Samples) -> Samples:
    """Darkness, 0 to 1, (n, m), of a tube below a level robot, by vertical distance; no computation of light."""
    from scipy.ndimage import gaussian_filter

    y, floor = radius * np.sin(angle), -radius * np.cos(angle)
    dark = np.zeros((x.size, angle.size))
    for outline in outlines_of(robot).values():
        around = np.nan_to_num(np.fmax.reduce([piece.radius(x) for piece in outline.pieces]), nan=0.0)
        below = np.sqrt(np.maximum(around[:, None] ** 2 - y**2, 0.0))
        distance = height - below - floor
        covered = np.abs(y) < around[:, None]
        dark = np.maximum(dark, np.where(covered, np.exp(-np.maximum(distance, 0.0) / (_REACH * radius)), 0.0))
    spread = 0.10 * radius
    steps = (spread / (x[1] - x[0]), spread / (radius * (angle[1] - angle[0])))
    return np.asarray(gaussian_filter(dark, steps, mode="constant"))


def add_shade(plotter: Any, pyvista: Any, robot: Robot, unit: float, height: float) -> Any:
    """Add the shadow of a robot whose body's mid-length is at x = 0; the actor moves along the tube with it."""
    assert robot.channel is not None  # noqa: S101 - the caller's promise
    radius = 0.5 * robot.channel.diameter
    reach = 0.5 * robot.body.length + 0.5 * radius
    x = np.linspace(-reach - robot.coupling.length, reach, _ALONG)
    angle = np.linspace(-_HALF_ANGLE, _HALF_ANGLE, _AROUND)
    along, around = np.meshgrid(x, angle, indexing="ij")
    near = 0.9985 * radius
    points = np.stack([along, near * np.sin(around), -near * np.cos(around)], axis=-1).reshape(-1, 3) / unit
    i, j = (index.ravel() for index in np.meshgrid(np.arange(_ALONG - 1), np.arange(_AROUND - 1), indexing="ij"))
    corner = i * _AROUND + j
    faces = np.stack([np.full(i.size, 4), corner, corner + 1, corner + _AROUND + 1, corner + _AROUND], axis=-1)
    mesh = pyvista.PolyData(points, faces.ravel())
    colour = np.zeros((len(points), 4), dtype=np.uint8)
    colour[:, :3] = (28, 48, 62)
    dark = shade(robot, radius, height, x, angle)
    colour[:, 3] = np.round(255 * _DARKEST * np.clip(dark, 0.0, 1.0)).ravel()
    mesh.point_data["shade"] = colour
    return plotter.add_mesh(mesh, scalars="shade", rgb=True, lighting=False, show_scalar_bar=False)


_LAMPS = (  # position about the camera (right, up, towards it), strength
    ((-0.6, 0.9, 0.8), 0.9),
    ((0.9, 0.3, 0.7), 0.35),
    ((0.1, 0.9, -0.6), 0.4),
)


def surroundings() -> Samples:
    """(64, 128, 3) brightness of the surroundings by latitude and longitude: a pale room, a bright lamp above."""
    up = np.linspace(1.0, -1.0, 64)[:, None, None]
    around = np.linspace(-np.pi, np.pi, 128)[None, :, None]
    room = 0.42 + 0.26 * up + 0.10 * np.cos(around)
    lamp = 1.9 * np.exp(-(((up - 0.72) / 0.16) ** 2)) * (0.75 + 0.25 * np.cos(2.0 * around))
    window = 0.7 * np.exp(-(((up - 0.25) / 0.22) ** 2) - ((np.abs(around) - 1.6) / 0.35) ** 2)
    tint = np.array([1.0, 0.995, 0.985])
    return np.asarray(np.maximum(room + lamp + window, 0.12) * tint)


def add_light(plotter: Any, pyvista: Any, *, surrounded: bool = True) -> None:
    """Light a scene; `surrounded` by bright surroundings, which surfaces with `pbr` reflect."""
    for position, strength in _LAMPS:
        lamp = pyvista.Light(position=position, focal_point=(0, 0, 0), color="white", intensity=strength)
        lamp.positional = False
        lamp.set_camera_light()
        plotter.add_light(lamp)
    if not surrounded:
        return
    image = np.asarray(surroundings(), dtype=np.float32)
    rows, columns, _ = image.shape
    grid = pyvista.ImageData(dimensions=(columns, rows, 1))
    grid.point_data["light"] = image[::-1].reshape(-1, 3)
    grid.set_active_scalars("light")
    texture = pyvista.Texture(grid)
    texture.SetColorModeToDirectScalars()
    texture.MipmapOn()
    texture.InterpolateOn()
    renderer = plotter.renderer
    renderer.UseImageBasedLightingOn()
    renderer.SetEnvironmentTexture(texture)
    # Smooth surroundings need few samples; as VTK has it, their preparation takes seconds without a graphics card.
    table, blurred = renderer.GetEnvMapLookupTable(), renderer.GetEnvMapPrefiltered()
    table.SetLUTSize(128)
    table.SetLUTSamples(128)
    blurred.SetPrefilterMaxSamples(64)
    renderer.SetEnvironmentUp(0.0, 0.0, 1.0)
    renderer.SetEnvironmentRight(1.0, 0.0, 0.0)


_COLOUR = "#c3d3dd"
_MOST_LINES = 400
_BEYOND = 8  # lines beyond what is to be seen, on every side
_WIDTH = 0.014  # width of a line, in distances of lines
_ACROSS_GRID: dict[str, int] = {"perspective": 2, "top": 2, "side": 1}
"""Axis across the grid, by view; along x there is none, for the robot swims through it."""


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
"""Shading of a video's solids: reflected surroundings would double the time of a frame."""
_QUICK_METAL: _Material = {"ambient": 0.34, "diffuse": 0.62, "specular": 0.75, "specular_power": 16.0}
_SHARP = 35.0  # angle between faces above which an edge is sharp, deg


@dataclass(frozen=True)
class DrawnRobot:
    """The pieces of a robot with its tail at phase 0, and how far they reach."""

    robot: Robot
    pieces: tuple[Any, ...]
    length: float  #: Largest extent, m.
    radius: float  #: Largest distance of any point from the motor axis, m.

    @classmethod
    def of(cls, robot: Robot, *, fineness: float = 1.0) -> DrawnRobot:
        """The pieces of a robot."""
        from spirillum.robot.mesh import robot_mesh

        pieces = tuple(robot_mesh(robot, phase=0.0, fineness=fineness))
        points = np.concatenate([piece.vertices for piece in pieces])
        return cls(
            robot, pieces, float(np.ptp(points, axis=0).max()), float(np.hypot(points[:, 1], points[:, 2]).max())
        )

    def points(self, pose: RobotPose) -> Samples:
        """(n, 3) all vertices in the lab, m."""
        placed = []
        for piece in self.pieces:
            matrix = pose.body if piece.part == "body" else pose.rotor
            placed.append(piece.vertices @ matrix[:3, :3].T + matrix[:3, 3])
        return np.concatenate(placed)

    def corners(self, pose: RobotPose) -> Samples:
        """Points around the robot that hold it at any angle of its tail, m."""
        x = np.concatenate([piece.vertices[:, 0] for piece in self.pieces])
        angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        ring = np.stack([np.zeros(24), self.radius * np.cos(angle), self.radius * np.sin(angle)], axis=-1)
        points = np.concatenate([ring + np.array([end, 0.0, 0.0]) for end in (x.min(), x.max())])
        return np.asarray(points @ pose.body[:3, :3].T + pose.position)


def level_height(solids: DrawnRobot) -> float:
    """Height of the motor axis of a level robot above its channel's axis, m; 0 without a channel."""
    # It is negative: the lowest at which body and tail, at any phase, do not cut into the glass.
    channel = solids.robot.channel
    return 0.0 if channel is None else -max(0.5 * channel.diameter - solids.radius, 0.0)


def resting(solids: DrawnRobot, phase: float = 0.0) -> RobotPose:
    """Pose of a robot that is level on its channel's floor, its tail at a phase."""
    height = level_height(solids)
    return RobotPose(np.array([0.0, 0.0, height]), np.array([1.0, 0.0, 0.0, 0.0]), phase)


class Scene(AbstractContextManager["Scene"]):
    """Scene for rendering. Lengths in m, the lab's axes: those of the channel, its axis at y = z = 0."""

    def __init__(
        self,
        solids: DrawnRobot,
        size: tuple[int, int],
        *,
        glass: tuple[float, float] | None = None,
        live: bool = False,
        rows: int | None = None,
        quick: bool = False,
    ) -> None:
        """Build the scene, with a piece of glass (x of both ends, m); `rows` about the middle are rendered."""
        self.solids = solids
        self.unit = solids.length
        self._rows = size[1] if rows is None else min(rows, size[1])
        self.plotter = new_plotter((size[0], self._rows), live=live)
        self._pyvista = import_optional("pyvista", "a 3D picture")
        self._size = size
        self._pixels: Any = None
        self._shade: Any = None
        self.plotter.set_background("white")
        # What is translucent is added from back to front; VTK's own sorting ignores multisampling and is slow.
        self.plotter.renderer.UseOITOff()
        self._quick = quick
        add_light(self.plotter, self._pyvista, surrounded=not quick)
        if glass is not None and solids.robot.channel is not None:
            radius = 0.5 * solids.robot.channel.diameter
            step = round_length(0.11 * solids.length)
            lengths = (value / self.unit for value in (radius, *glass, step))
            add_glass(self.plotter, self._pyvista, *lengths)
            self._shade = add_shade(self.plotter, self._pyvista, solids.robot, self.unit, level_height(solids))
        self._actors = [(piece.part, self._added(piece)) for piece in solids.pieces]

    def _added(self, piece: Any) -> Any:
        faces = np.concatenate([np.full((len(piece.faces), 1), 3), piece.faces], axis=1)
        mesh = self._pyvista.PolyData(np.asarray(piece.vertices / self.unit, dtype=np.float32), faces.ravel())
        mesh.cell_data["colour"] = np.round(255 * np.asarray(piece.colours)).astype(np.uint8)
        edges = {"split_vertices": True, "feature_angle": _SHARP}
        smooth = mesh.compute_normals(cell_normals=False, auto_orient_normals=False, **edges)
        look: dict[str, Any] = {"scalars": "colour", "rgb": True, "show_scalar_bar": False}
        if self._quick:
            look |= _QUICK if piece.name == "body" else _QUICK_METAL
        else:
            look |= {"pbr": True, **_MATERIALS[piece.name]}
        actor = self.plotter.add_mesh(smooth, **look)
        if self._quick:
            actor.prop.interpolation = "Phong"
        return actor

    def add_grid(self, view: str, low: Samples, high: Samples) -> None:
        """Add a faint grid below the robot, or behind it where it is seen from the side; corners of the space, m."""
        if view not in _ACROSS_GRID:
            return
        across, step = _ACROSS_GRID[view], round_length(0.3 * self.solids.length)
        level = high[1] / step + 0.5 if across == 1 else low[2] / step - 0.5
        first = np.floor(low / step - _BEYOND).astype(int)
        last = np.ceil(high / step + _BEYOND).astype(int)
        in_plane = [axis for axis in range(3) if axis != across]
        points: list[Samples] = []
        for axis, other in (in_plane, in_plane[::-1]):
            for line in range(first[axis], min(last[axis], first[axis] + _MOST_LINES) + 1):
                corners = np.full((4, 3), level)
                corners[:, axis] = line + _WIDTH * np.array([-0.5, 0.5, 0.5, -0.5])
                corners[:, other] = [first[other], first[other], last[other], last[other]]
                points.append(corners)
        faces = np.insert(np.arange(4 * len(points)).reshape(-1, 4), 0, 4, axis=1)
        mesh = self._pyvista.PolyData(np.concatenate(points) * (step / self.unit), faces)
        self.plotter.add_mesh(mesh, color=_COLOUR, lighting=False, show_scalar_bar=False)

    def place(self, pose: RobotPose) -> None:
        """Move the robot: rigid motions of its two parts."""
        matrices = {"body": pose.body, "rotor": pose.rotor}
        for matrix in matrices.values():
            matrix[:3, 3] /= self.unit
        for part, actor in self._actors:
            actor.user_matrix = matrices[part]
        if self._shade is not None:
            self._shade.position = (float(pose.position[0]) / self.unit, 0.0, 0.0)

    def look(self, camera: SceneCamera) -> None:
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

    def __exit__(self, *_: object) -> None:
        self.plotter.close()  # which gives back the window's memory
