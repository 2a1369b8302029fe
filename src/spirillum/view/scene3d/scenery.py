"""Camera of a three-dimensional scene and the glass tube in it: both sides, rims, a ruler on its floor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb

from spirillum.arrays import Samples

_LINE_OF_SIGHT: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "perspective": ((-0.36, 1.0, -0.32), (0.0, 0.0, 1.0)),
    "side": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "front": ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "rear": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}
VIEWS = tuple(_LINE_OF_SIGHT)  #: Views of a robot: all but the first are parallel projections, to scale.
_FIELD_OF_VIEW = np.radians(22.0)
_MAX_ITERATIONS = 60


@dataclass(frozen=True)
class SceneCamera:
    """A camera; lengths in m, the lab's axes."""

    focal: Samples  #: Point in the middle of the picture.
    sight: Samples  #: Unit vector of the line of sight, away from the camera.
    up: Samples  #: Unit vector upwards in the picture.
    distance: float  #: Distance of the camera from the focal point.
    half_height: float  #: Half of the height that the picture shows at the focal point.
    parallel: bool  #: Whether lines of sight are parallel: lengths are then to scale all over the picture.

    @property
    def right(self) -> Samples:
        """Unit vector to the right in the picture."""
        return np.asarray(np.cross(self.sight, self.up))

    @property
    def position(self) -> Samples:
        """Position of the camera, m."""
        return np.asarray(self.focal - self.distance * self.sight)

    def pixels(self, points: Samples, size: tuple[int, int]) -> Samples:
        """Pixels at which points are seen, (n, 2), to the right of and below the upper left corner."""
        away = np.asarray(points, dtype=float) - self.focal
        nearer = 1.0 if self.parallel else self.distance / (self.distance + away @ self.sight)
        scale = 0.5 * size[1] / self.half_height * nearer
        x, y = (away @ self.right) * scale, (away @ self.up) * scale
        return np.stack([0.5 * size[0] + x, 0.5 * size[1] - y], axis=-1)

    def on_plane(self, pixel: tuple[float, float], size: tuple[int, int], point: Samples, normal: Samples) -> Samples:
        """The point of a plane (a point, a normal) that is seen at a pixel, m."""
        unit = 2.0 * self.half_height / size[1]
        across = (pixel[0] - 0.5 * size[0]) * unit * self.right + (0.5 * size[1] - pixel[1]) * unit * self.up
        start = self.focal + across if self.parallel else self.position
        ray = self.sight if self.parallel else self.focal + across - self.position
        return np.asarray(start + ray * (((point - start) @ normal) / (ray @ normal)))

    def moved(self, shift: Samples) -> SceneCamera:
        """The camera translated by a vector, m."""
        return replace(self, focal=self.focal + shift)


def fitted(
    view: str, points: Samples, size: tuple[int, int], margins: tuple[float, float, float] = (0.05, 0.14, 0.14)
) -> SceneCamera:
    """The camera of a view that has all points in the picture, as near as `margins` at sides, top and foot allow."""
    sight, up = (np.array(vector) for vector in _LINE_OF_SIGHT[view])
    sight = sight / np.linalg.norm(sight)
    up = up - (up @ sight) * sight
    up = up / np.linalg.norm(up)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    reach = float(np.linalg.norm(np.ptp(points, axis=0)))
    camera = SceneCamera(middle, sight, up, reach / np.tan(0.5 * _FIELD_OF_VIEW), reach, view != "perspective")
    (width, height), (side, above, below) = size, margins
    left, right = side * width, (1.0 - side) * width
    top, bottom = above * height, (1.0 - below) * height
    for _ in range(_MAX_ITERATIONS):  # a fixed-point iteration, of one step without perspective
        pixels = camera.pixels(points, size)
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        unit = 2.0 * camera.half_height / height
        wanted = np.array([0.5 * (left + right), 0.5 * (top + bottom)])
        off = (0.5 * (low + high) - wanted) * unit
        zoom = float(np.max((high - low) / np.array([right - left, bottom - top])))
        camera = replace(
            camera,
            focal=camera.focal + off[0] * camera.right - off[1] * camera.up,
            distance=camera.distance * zoom,
            half_height=camera.half_height * zoom,
        )
        if abs(zoom - 1.0) < 1e-9 and float(np.abs(off).max()) < 1e-9 * camera.half_height:
            break
    return camera


WALL = 0.035  #: Displayed thickness of the glass, in radii: the true one is unknown.
_SIDES = 144
_MOST_MARKS = 300
_CLEAR = 0.004  # alpha below which a side of a tube is not rendered
_AROUND = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
_CEILING, _FLOOR, _BAND, _NEAR = "#cdd6dc", "#e3eef4", "#eaf1f5", "#f4fafd"
_RIM, _EDGE, _TICK = "#9dbfd1", "#5f8ba3", "#54788e"


def _tube(pyvista: Any, radius: float, start: float, end: float, colours: Samples) -> Any:
    """An open cylinder about the x axis with a colour (with or without alpha, 0 to 1) at each of its sides."""
    ring = np.stack([np.zeros(_SIDES), np.cos(_AROUND), np.sin(_AROUND)], axis=-1)
    points = np.concatenate([radius * ring + np.array([x, 0.0, 0.0]) for x in (start, end)])
    j = np.arange(_SIDES)
    k = (j + 1) % _SIDES
    faces = np.stack([np.full(_SIDES, 4), j, k, k + _SIDES, j + _SIDES], axis=-1)
    if colours.shape[1] == 4:
        faces = faces[np.maximum(colours[j, 3], colours[k, 3]) > _CLEAR]
    mesh = pyvista.PolyData(points, faces.ravel())
    mesh.point_data["colour"] = np.round(255.0 * np.concatenate([colours, colours])).astype(np.uint8)
    return mesh


def _inner_colours() -> Samples:
    """Colours of the inner side: light from above on the floor, a soft streak along each side."""
    # They are fixed, and not worked out from lamps: the tube fills the picture, and lamps would double a frame's time.
    height = np.sin(_AROUND)[:, None]
    streak = np.exp(-(((height - 0.18) / 0.10) ** 2))
    shade = np.clip(0.5 - 0.5 * height, 0.0, 1.0) ** 0.8
    dark, light = (np.array(to_rgb(colour)) for colour in (_CEILING, _FLOOR))
    return np.asarray(np.clip(dark + (light - dark) * shade + 0.035 * streak, 0.0, 1.0))


def _outer_colours() -> Samples:
    """Colours and alpha of the outer side, which is seen in front of the robot: clear but for a streak of light."""
    left, right = (np.exp(-(((np.degrees(_AROUND) - middle) / 9.0) ** 2)) for middle in (128.0, 52.0))
    alpha = 0.32 * np.clip(left + 0.5 * right, 0.0, 1.0)
    return np.concatenate([np.broadcast_to(to_rgb(_NEAR), (_SIDES, 3)), alpha[:, None]], axis=1)


def _sheet(pyvista: Any, first: Samples, second: Samples) -> Any:
    """The strip between two lines of as many points."""
    count = len(first)
    j = np.arange(count - 1)
    faces = np.stack([np.full(count - 1, 4), j, j + 1, j + 1 + count, j + count], axis=-1)
    return pyvista.PolyData(np.concatenate([first, second]), faces.ravel())


def _arc(radius: float, x: float, half_angle: float = np.pi) -> Samples:
    """Points of an arc across the axis, its middle on the floor."""
    count = _SIDES + 1 if half_angle == np.pi else 13
    angle = -0.5 * np.pi + np.linspace(-half_angle, half_angle, count)
    return np.stack([np.full(count, x), radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def _marks(pyvista: Any, radius: float, width: float, positions: dict[float, float]) -> Any:
    """Marks of a ruler on the floor: half of the angle that each spans, by its x."""
    strips = [
        _sheet(pyvista, _arc(radius, x - 0.5 * width, half), _arc(radius, x + 0.5 * width, half))
        for x, half in positions.items()
    ]
    return pyvista.merge(strips) if len(strips) > 1 else strips[0]


def add_glass(plotter: Any, pyvista: Any, radius: float, start: float, end: float, step: float) -> None:
    """Add the tube to a scene, behind everything translucent that follows."""
    outer, line = radius * (1.0 + WALL), 0.008 * radius
    flat = {"lighting": False, "show_scalar_bar": False}
    shell = {"scalars": "colour", "rgb": True, **flat}
    # Culling faces that look at the camera leaves the far half, from wherever it is seen.
    band = np.broadcast_to(to_rgb(_BAND), (_SIDES, 3))
    plotter.add_mesh(_tube(pyvista, radius, start, end, _inner_colours()), culling="front", **shell)
    plotter.add_mesh(_tube(pyvista, outer, start, end, band), culling="front", **shell)
    step *= max(1.0, float(np.ceil((end - start) / step / _MOST_MARKS)))
    first, last = int(np.ceil(start / step)), int(np.floor(end / step))
    positions = {i * step: 0.11 if i % 5 else 0.26 for i in range(first, last + 1)}
    if positions:
        marks = _marks(pyvista, 0.997 * radius, line, positions)
        plotter.add_mesh(marks, color=_TICK, opacity=0.7, **flat)
    for x in (start, end):
        plotter.add_mesh(_sheet(pyvista, _arc(radius, x), _arc(outer, x)), color=_RIM, opacity=0.6, **flat)
        for edge in (radius, outer):
            rim = _sheet(pyvista, _arc(edge - 0.5 * line, x), _arc(edge + 0.5 * line, x))
            plotter.add_mesh(rim, color=_EDGE, **flat)
    plotter.add_mesh(_tube(pyvista, outer, start, end, _outer_colours()), culling="back", **shell)
