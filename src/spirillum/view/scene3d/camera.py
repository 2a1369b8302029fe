"""The camera of a three-dimensional scene, and its projection of points of the lab to pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError, did_you_mean

View = Literal["perspective", "side", "top", "front", "rear"]
VIEWS: tuple[View, ...] = ("perspective", "side", "top", "front", "rear")
"""Views of a robot: all but the first are parallel projections, to scale."""

_LINE_OF_SIGHT: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "perspective": ((-0.36, 1.0, -0.32), (0.0, 0.0, 1.0)),
    "side": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "front": ((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "rear": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}
_FIELD_OF_VIEW = np.radians(22.0)
_MAX_ITERATIONS = 60


@dataclass(frozen=True)
class Margins:
    """Room between picture and edge, as shares of width and height."""

    side: float = 0.05
    top: float = 0.14
    bottom: float = 0.14


@dataclass(frozen=True)
class SceneCamera:
    """A camera; lengths in m, the lab's axes."""

    focal: Samples
    """Point in the middle of the picture."""
    sight: Samples
    """Unit vector of the line of sight, away from the camera."""
    up: Samples
    """Unit vector upwards in the picture."""
    distance: float
    """Distance of the camera from the focal point."""
    half_height: float
    """Half of the height that the picture shows at the focal point."""
    parallel: bool
    """Whether lines of sight are parallel: lengths are then to scale all over the picture."""

    @property
    def right(self) -> Samples:
        """Unit vector to the right in the picture."""
        return np.asarray(np.cross(self.sight, self.up))

    @property
    def position(self) -> Samples:
        """Position of the camera, m."""
        return np.asarray(self.focal - self.distance * self.sight)

    def pixels(self, points: Samples, size: tuple[int, int]) -> Samples:
        """Pixels at which points are seen.

        Args:
            points: (n, 3) in the lab, m.
            size: width and height of the picture.

        Returns:
            (n, 2) pixels to the right of and below the upper left corner.
        """
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


def checked_view(view: str) -> View:
    """The view of that name."""
    for name in VIEWS:
        if view == name:
            return name
    raise InputError(f"view = {str(view)[:40]!r}{did_you_mean(str(view), VIEWS)}; allowed: {', '.join(VIEWS)}")


def fitted(view: View, points: Samples, size: tuple[int, int], margins: Margins | None = None) -> SceneCamera:
    """The camera of a view that has all points within the margins, as near as they allow.

    Args:
        view: the view.
        points: (n, 3) points to show, m.
        size: width and height of the picture.
        margins: room around them.
    """
    sight, up = (np.array(vector) for vector in _LINE_OF_SIGHT[view])
    sight = sight / np.linalg.norm(sight)
    up = up - (up @ sight) * sight
    up = up / np.linalg.norm(up)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    reach = float(np.linalg.norm(np.ptp(points, axis=0)))
    camera = SceneCamera(middle, sight, up, reach / np.tan(0.5 * _FIELD_OF_VIEW), reach, view != "perspective")
    return _framed(camera, lambda c: c.pixels(points, size), size, margins or Margins())


def _framed(
    camera: SceneCamera, seen: Callable[[SceneCamera], Samples], size: tuple[int, int], margins: Margins
) -> SceneCamera:
    """Shift and approach until the margins are touched: a fixed-point iteration, one step without perspective."""
    width, height = size
    left, right = margins.side * width, (1.0 - margins.side) * width
    top, bottom = margins.top * height, (1.0 - margins.bottom) * height
    for _ in range(_MAX_ITERATIONS):
        low, high = seen(camera).min(axis=0), seen(camera).max(axis=0)
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
