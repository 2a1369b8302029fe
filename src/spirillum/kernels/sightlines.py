"""Lines of sight of the virtual camera, and the still picture that they meet: floor, ruler and glass tube."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spirillum.kernels.compiled import compiled

_GROUND, _PAPER, _INK = 0, 1, 2
"""Rows of the colours."""


class RefractingCamera(NamedTuple):
    """A camera above a flat surface of oil, at x = y = 0 with z towards it; m and pixels."""

    eye: float
    """Height of the lens."""
    surface: float
    """Height of the oil's surface."""
    refractive_index: float
    """Of the oil."""
    focal: float
    """Focal length; negative for a camera that is turned by half a turn."""
    centre_u: float
    """Column of the optical axis."""
    centre_v: float
    """Row of the optical axis."""
    k1: float
    """Coefficients of radial distortion, r -> r (1 + k1 r^2 + k2 r^4), r over the focal length."""
    k2: float


class Ray(NamedTuple):
    """A line of sight below the surface."""

    x: float
    """Where it crosses the surface, m."""
    y: float
    dx: float
    """Unit vector in the oil, away from the camera."""
    dy: float
    dz: float


class Ruler(NamedTuple):
    """Two strips of paper with lines across, at both sides of y = 0; m."""

    paper_start: float
    """Smallest |y| of the paper."""
    line_start: float
    """Smallest |y| of the lines."""
    line_end: float
    paper_end: float
    spacing: float
    """From one line to the next."""
    width: float
    """Width of a line."""


class GlassTube(NamedTuple):
    """A glass tube along x; m."""

    height: float
    """Height of its axis."""
    inner: float
    """Inner radius."""
    outer: float
    """Outer radius."""
    half_length: float
    """Half its length; negative where there is no tube."""
    absorption: float
    """Absorption coefficient of the glass, 1/m."""


class FloorWaves(NamedTuple):
    """Sine waves of the floor's brightness, (w,) each."""

    kx: np.ndarray
    """Wavevector, 1/m."""
    ky: np.ndarray
    phase: np.ndarray
    """rad."""
    amplitude: np.ndarray
    """Relative."""


class Backdrop(NamedTuple):
    """The still parts as the camera sees them; linear light, single precision."""

    light: np.ndarray
    """Without the robot, (rows, columns, 3)."""
    over: np.ndarray
    """Transmission of the glass between robot and camera, (rows, columns)."""
    shine: np.ndarray
    """Light mirrored by the glass, (rows, columns)."""
    floor: np.ndarray
    """x and y of the floor behind each pixel, m, (rows, columns, 2)."""


@compiled
def sightline(u: float, v: float, camera: RefractingCamera, turn: np.ndarray) -> Ray:
    """Line of sight of a pixel.

    Args:
        u: column.
        v: row.
        camera: above the surface.
        turn: rotation from the frame to the tilted camera, (3, 3).
    """
    a, b = (u - camera.centre_u) / camera.focal, -(v - camera.centre_v) / camera.focal
    far = math.hypot(a, b)
    if far > 0.0 and (camera.k1 != 0.0 or camera.k2 != 0.0):
        true = far
        for _ in range(12):
            r2 = true * true
            bent = true * (1.0 + r2 * (camera.k1 + r2 * camera.k2))
            step = (bent - far) / (1.0 + r2 * (3.0 * camera.k1 + 5.0 * r2 * camera.k2))
            true -= step
            if abs(step) < 1e-15:
                break
        a, b = a * true / far, b * true / far
    x = a * turn[0, 0] + b * turn[1, 0] - turn[2, 0]
    y = a * turn[0, 1] + b * turn[1, 1] - turn[2, 1]
    z = a * turn[0, 2] + b * turn[1, 2] - turn[2, 2]
    size = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    down = (camera.eye - camera.surface) / -z
    dx, dy = x / camera.refractive_index, y / camera.refractive_index  # Snell's law keeps n sin(angle)
    return Ray(x * down, y * down, dx, dy, -math.sqrt(1.0 - dx * dx - dy * dy))


@compiled
def _glass(ray: Ray, height: float, tube: GlassTube) -> tuple[float, float]:
    """Transmission of half of a tube, and the light that it mirrors.

    Args:
        ray: a line of sight.
        height: of the surface above the tube's axis, m.
        tube: absorbs along the path through its wall, longest at the edges.
    """
    slant = math.hypot(ray.dy, ray.dz)
    away = (ray.y * ray.dz - height * ray.dy) / slant
    nearest = -(ray.y * ray.dy + height * ray.dz) / (slant * slant)
    if abs(away) > 1.1 * tube.outer or abs(ray.x + ray.dx * nearest) > tube.half_length:
        return 1.0, 0.0
    inner = math.sqrt(max(tube.inner**2 - away * away, 0.0))
    outer = math.sqrt(max(tube.outer**2 - away * away, 0.0))
    share = away / tube.outer
    sheen = 0.20 * math.exp(-(((share - 0.62) / 0.018) ** 2)) + 0.10 * math.exp(-(((share + 0.70) / 0.03) ** 2))
    sheen += 0.06 * math.exp(-(((abs(away) - tube.inner) / 0.0005) ** 2))
    return math.exp(-tube.absorption * (outer - inner) / slant), sheen


@compiled
def still_picture(
    camera: RefractingCamera,
    turn: np.ndarray,
    spots: np.ndarray,
    colours: np.ndarray,
    ruler: Ruler,
    tube: GlassTube,
    waves: FloorWaves,
    oil: np.ndarray,
    still: Backdrop,
) -> None:
    """Fill the picture of the still parts: floor with its ruler, seen through oil and a tube of glass.

    Args:
        camera: above the surface.
        turn: rotation to the tilted camera, (3, 3).
        spots: samples of a pixel, for 4 x 4 neighbouring pixels, (16, k, 2); the first quarter also sees the glass.
        colours: of the ground, the ruler's paper and its ink, (3, 3).
        ruler: on the floor.
        tube: around the robot.
        waves: of the floor's brightness.
        oil: absorption coefficients of red, green and blue, 1/m, (3,).
        still: filled.
    """
    light, over, shine, floor = still
    count = spots.shape[1]
    few = max(count // 4, 1)
    for v in range(light.shape[0]):
        for u in range(light.shape[1]):
            ray = sightline(float(u), float(v), camera, turn)
            path = camera.surface / -ray.dz
            x, y = ray.x + path * ray.dx, ray.y + path * ray.dy
            floor[v, u, 0], floor[v, u, 1] = x, y
            mottle = 1.0
            for k in range(waves.kx.size):
                mottle += waves.amplitude[k] * math.sin(waves.kx[k] * x + waves.ky[k] * y + waves.phase[k])
            paper = ink = 0
            variant = 4 * (v & 3) + (u & 3)
            once = both = mirrored = 0.0
            for k in range(count):
                ray = sightline(u + spots[variant, k, 0], v + spots[variant, k, 1], camera, turn)
                deep = camera.surface / -ray.dz
                x, y = ray.x + deep * ray.dx, abs(ray.y + deep * ray.dy)
                if ruler.paper_start < y < ruler.paper_end:
                    off = abs(x - ruler.spacing * math.floor(x / ruler.spacing + 0.5))
                    if ruler.line_start < y < ruler.line_end and off < 0.5 * ruler.width:
                        ink += 1
                    else:
                        paper += 1
                if k < few:
                    through, sheen = _glass(ray, camera.surface - tube.height, tube)
                    once += through
                    both += through * through
                    mirrored += sheen
            over[v, u], shine[v, u] = once / few, mirrored / few
            share_paper, share_ink = paper / count, ink / count
            ground = (1.0 - share_paper - share_ink) * mottle
            for k in range(3):
                seen = ground * colours[_GROUND, k] + share_paper * colours[_PAPER, k] + share_ink * colours[_INK, k]
                light[v, u, k] = seen * math.exp(-oil[k] * path) * both / few + shine[v, u]
