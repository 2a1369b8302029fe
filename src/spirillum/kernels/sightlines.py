"""What stands still before the virtual camera, pixel by pixel: lines of sight to floor, ruler and glass."""

from __future__ import annotations

import math

import numpy as np

from spirillum.kernels.compiled import compiled

__all__ = ["sightline", "still_picture"]


@compiled
def sightline(u: float, v: float, camera: np.ndarray, turn: np.ndarray, ray: np.ndarray) -> None:
    """Line of sight of a pixel, below the surface.

    Args:
        u: column.
        v: row.
        camera: height of the lens, of the surface, refractive index, focal length with its sign, centre u and v,
            coefficients k1 and k2 of radial distortion, (8,).
        turn: rotation to the tilted camera, (3, 3).
        ray: filled with the point of the surface x, y and the unit vector in the oil, (5,).
    """
    a, b = (u - camera[4]) / camera[3], -(v - camera[5]) / camera[3]
    far = math.hypot(a, b)
    if far > 0.0 and (camera[6] != 0.0 or camera[7] != 0.0):
        true = far
        for _ in range(12):
            r2 = true * true
            step = (true * (1.0 + r2 * (camera[6] + r2 * camera[7])) - far) / (
                1.0 + r2 * (3.0 * camera[6] + 5.0 * r2 * camera[7])
            )
            true -= step
            if abs(step) < 1e-15:
                break
        a, b = a * true / far, b * true / far
    x = a * turn[0, 0] + b * turn[1, 0] - turn[2, 0]
    y = a * turn[0, 1] + b * turn[1, 1] - turn[2, 1]
    z = a * turn[0, 2] + b * turn[1, 2] - turn[2, 2]
    size = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    down = (camera[0] - camera[1]) / -z
    ray[0], ray[1] = x * down, y * down
    ray[2], ray[3] = x / camera[2], y / camera[2]
    ray[4] = -math.sqrt(1.0 - ray[2] * ray[2] - ray[3] * ray[3])


@compiled
def _glass(ray: np.ndarray, height: float, tube: np.ndarray) -> tuple[float, float]:
    """Share of light that passes half of a tube, and the light that it mirrors; long ways through the wall are dark."""
    slant = math.hypot(ray[3], ray[4])
    away = (ray[1] * ray[4] - height * ray[3]) / slant
    nearest = -(ray[1] * ray[3] + height * ray[4]) / (slant * slant)
    if abs(away) > 1.1 * tube[2] or abs(ray[0] + ray[2] * nearest) > tube[3]:
        return 1.0, 0.0
    inner = math.sqrt(max(tube[1] ** 2 - away * away, 0.0))
    outer = math.sqrt(max(tube[2] ** 2 - away * away, 0.0))
    share = away / tube[2]
    sheen = 0.20 * math.exp(-(((share - 0.62) / 0.018) ** 2)) + 0.10 * math.exp(-(((share + 0.70) / 0.03) ** 2))
    sheen += 0.06 * math.exp(-(((abs(away) - tube[1]) / 0.0005) ** 2))
    return math.exp(-tube[4] * (outer - inner) / slant), sheen


@compiled
def still_picture(
    camera: np.ndarray,
    turn: np.ndarray,
    spots: np.ndarray,
    colours: np.ndarray,
    ruler: np.ndarray,
    tube: np.ndarray,
    waves: np.ndarray,
    oil: np.ndarray,
    light: np.ndarray,
    over: np.ndarray,
    shine: np.ndarray,
    floor: np.ndarray,
) -> None:
    """Fill the picture of the still parts: floor with its ruler, seen through oil and a tube of glass.

    Args:
        camera: as `sightline` takes it, (8,).
        turn: rotation to the tilted camera, (3, 3).
        spots: places of the samples, for 4 x 4 neighbouring pixels, (16, k, 2); the first quarter sees the glass too.
        colours: of the ground, the ruler's paper and its ink, (3, 3).
        ruler: |y| at which paper, lines, lines and paper begin and end, spacing and width of the lines, (6,).
        tube: its height, inner and outer radius, half its length (negative: no tube), absorption of glass, (5,).
        waves: of the floor's fine structure: vector and phase, strength, (w, 4).
        oil: absorption of red, green and blue, (3,).
        light: of the whole, (rows, columns, 3).
        over: share of light that the near half of the glass lets pass, (rows, columns).
        shine: light that the glass mirrors, (rows, columns).
        floor: x, y behind the middle of each pixel, (rows, columns, 2).
    """
    count = spots.shape[1]
    few = max(count // 4, 1)
    ray = np.empty(5)
    for v in range(light.shape[0]):
        for u in range(light.shape[1]):
            sightline(float(u), float(v), camera, turn, ray)
            way = camera[1] / -ray[4]
            x, y = ray[0] + way * ray[2], ray[1] + way * ray[3]
            floor[v, u, 0], floor[v, u, 1] = x, y
            mottle = 1.0
            for k in range(waves.shape[0]):
                mottle += waves[k, 3] * math.sin(waves[k, 0] * x + waves[k, 1] * y + waves[k, 2])
            paper = ink = 0
            variant = 4 * (v & 3) + (u & 3)
            once = both = mirrored = 0.0
            for k in range(count):
                sightline(u + spots[variant, k, 0], v + spots[variant, k, 1], camera, turn, ray)
                deep = camera[1] / -ray[4]
                x, y = ray[0] + deep * ray[2], abs(ray[1] + deep * ray[3])
                if ruler[0] < y < ruler[3]:
                    off = abs(x - ruler[4] * math.floor(x / ruler[4] + 0.5))
                    if ruler[1] < y < ruler[2] and off < 0.5 * ruler[5]:
                        ink += 1
                    else:
                        paper += 1
                if k < few:
                    through, sheen = _glass(ray, camera[1] - tube[0], tube)
                    once += through
                    both += through * through
                    mirrored += sheen
            over[v, u], shine[v, u] = once / few, mirrored / few
            share_paper, share_ink = paper / count, ink / count
            ground = (1.0 - share_paper - share_ink) * mottle
            for k in range(3):
                seen = ground * colours[0, k] + share_paper * colours[1, k] + share_ink * colours[2, k]
                light[v, u, k] = seen * math.exp(-oil[k] * way) * both / few + shine[v, u]
