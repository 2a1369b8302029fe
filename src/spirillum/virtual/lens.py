"""The optics of the virtual camera: a lens above a flat surface of oil, exact refraction, tilt, radial distortion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.raster import project
from spirillum.kernels.sightlines import RefractingCamera, sightline


@dataclass(frozen=True)
class VirtualLens:
    """The lens of the camera, in its frame: x along the channel towards the nose, z towards the camera, y = z x x.

    Lengths are in m, places in the picture in pixels.
    Heights z count from the reference plane (the tank's floor; for a view from the side its far wall). The lens stands
    at x = y = 0. Pixel centres are at whole numbers, u to the right, v downwards.
    """

    eye: float
    """Height of the lens, m."""
    surface: float
    """Height of the surface between air and oil, m."""
    index: float
    """Refractive index of the oil."""
    focal: float
    """Focal length, pixels."""
    size: tuple[int, int]
    """Width and height of the picture, pixels."""
    leftwards: bool = False
    """Whether the nose points to the left in the picture: the camera is rotated by half a turn about its axis."""
    tilt: tuple[float, float] = (0.0, 0.0)
    """Angle of the optical axis to the vertical about x, then about y, rad."""
    distortion: tuple[float, float] = (0.0, 0.0)
    """Coefficients k1, k2 of radial distortion, r -> r (1 + k1 r^2 + k2 r^4), r over the focal length."""
    turn: Samples = field(init=False, repr=False, compare=False)
    """Rotation from the frame to the tilted camera, (3, 3)."""

    def __post_init__(self) -> None:
        (cx, sx), (cy, sy) = ((np.cos(angle), np.sin(angle)) for angle in self.tilt)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
        about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
        object.__setattr__(self, "turn", about_y @ about_x)

    @property
    def centre(self) -> tuple[float, float]:
        """Pixel of the optical axis: the middle of the picture."""
        return 0.5 * (self.size[0] - 1), 0.5 * (self.size[1] - 1)

    @property
    def camera(self) -> RefractingCamera:
        """Its numbers, as the kernels take them."""
        focal = -self.focal if self.leftwards else self.focal
        return RefractingCamera(self.eye, self.surface, self.index, focal, *self.centre, *self.distortion)

    def seen(self, points: Samples) -> Samples:
        """Pixel u, v and height z of points.

        Returns:
            (n, 3): u, v in pixels, z in m.
        """
        points = np.ascontiguousarray(points, dtype=float)
        found = np.empty_like(points)
        project(points, self.camera, self.turn, found)
        return found

    def points(self, pixels: Samples, height: float) -> Samples:
        """Points that are seen at pixels, at a height below the surface.

        Args:
            pixels: (n, 2).
            height: z, m.

        Returns:
            (n, 3), m.
        """
        found = np.empty((len(pixels), 3))
        for place, (u, v) in enumerate(np.asarray(pixels, dtype=float)):
            ray = sightline(float(u), float(v), self.camera, self.turn)
            depth = (self.surface - height) / -ray.dz
            found[place] = ray.x + ray.dx * depth, ray.y + ray.dy * depth, height
        return found
