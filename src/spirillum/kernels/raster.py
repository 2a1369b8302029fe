"""Triangles into pixels, and light into bytes: the loops of the virtual camera.

A pixel has its centre at whole numbers and reaches half a pixel to every side. Colours are linear light.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spirillum.kernels.compiled import compiled
from spirillum.kernels.sightlines import Backdrop, RefractingCamera

_EMPTY = -1e30
"""Height of a sample that has met nothing."""


class Lamps(NamedTuple):
    """Lamps far away, in the camera's frame."""

    towards: np.ndarray
    """Unit vector towards each lamp, (k, 3)."""
    strength: np.ndarray
    """(k,)."""
    halfway: np.ndarray
    """Unit vector halfway between lamp and camera, (k, 3)."""


class Materials(NamedTuple):
    """Reflection of light by each material (Blinn-Phong), (kinds,) each."""

    ambient: np.ndarray
    diffuse: np.ndarray
    specular: np.ndarray
    exponent: np.ndarray
    """Of the specular reflection."""


class Shading(NamedTuple):
    """Colours of triangles, and the light on their corners."""

    colour: np.ndarray
    """Linear colour of diffuse light, (m, 3)."""
    gloss: np.ndarray
    """Linear colour of specular light, (m, 3)."""
    diffuse: np.ndarray
    """Diffuse light of each corner, (m, 3)."""
    specular: np.ndarray
    """Specular light of each corner, (m, 3)."""


class Shadow(NamedTuple):
    """A soft shadow on the floor, a rounded bar; m."""

    x: float
    """Its centre."""
    y: float
    axis_x: float
    """Unit vector along it."""
    axis_y: float
    half_length: float
    """Without the rounded ends."""
    radius: float
    softness: float
    """Width of its edge."""
    darkness: float
    """Relative loss of light."""


@compiled
def project(points: np.ndarray, camera: RefractingCamera, turn: np.ndarray, seen: np.ndarray) -> None:
    """Pixels at which a camera above a flat surface of oil sees points, by Snell's law.

    Args:
        points: x, y, z with z towards the camera, which stands at x = y = 0; those above the surface are seen
            straight, (n, 3).
        camera: above the surface.
        turn: rotation from the frame of the points to that of the tilted camera, (3, 3).
        seen: filled with pixel u, v and the height z, (n, 3).
    """
    surface, index = camera.surface, camera.refractive_index
    above = camera.eye - surface
    n2 = index * index
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        across = math.hypot(x, y)
        down = camera.eye - z
        if z < surface:
            deep = surface - z
            # r: where the ray crosses the surface; r + deep tan(angle in the oil) = across, a concave rising function.
            r = across * above / (above + deep / index)
            for _ in range(20):
                root = 1.0 / math.sqrt(n2 * (above * above + r * r) - r * r)
                miss = r + deep * r * root - across
                step = miss / (1.0 + deep * n2 * above * above * root * root * root)
                r -= step
                if abs(step) <= 1e-15 * across:
                    break
            bent = r / across if across > 0.0 else 0.0
            x, y, down = x * bent, y * bent, above
        a = turn[0, 0] * x + turn[0, 1] * y - turn[0, 2] * down
        b = turn[1, 0] * x + turn[1, 1] * y - turn[1, 2] * down
        away = -(turn[2, 0] * x + turn[2, 1] * y - turn[2, 2] * down)
        a, b = a / away, b / away
        r2 = a * a + b * b
        stretch = camera.focal * (1.0 + r2 * (camera.k1 + r2 * camera.k2))
        seen[i, 0] = camera.centre_u + stretch * a
        seen[i, 1] = camera.centre_v - stretch * b
        seen[i, 2] = z


@compiled
def shade(
    normals: np.ndarray, turn: np.ndarray, lamps: Lamps, materials: Materials, kind: np.ndarray, shading: Shading
) -> None:
    """Light that corners of triangles send to a camera far above them.

    Args:
        normals: unit normals in the frame of their solid, (m, 3, 3).
        turn: rotation of the solid, (3, 3).
        lamps: that light it.
        materials: of the robot.
        kind: index of each triangle's material, (m,).
        shading: its diffuse and specular light are filled.
    """
    for i in range(normals.shape[0]):
        exponent = materials.exponent[kind[i]]
        for j in range(3):
            nx, ny, nz = normals[i, j, 0], normals[i, j, 1], normals[i, j, 2]
            x = turn[0, 0] * nx + turn[0, 1] * ny + turn[0, 2] * nz
            y = turn[1, 0] * nx + turn[1, 1] * ny + turn[1, 2] * nz
            z = turn[2, 0] * nx + turn[2, 1] * ny + turn[2, 2] * nz
            diffuse, specular = materials.ambient[kind[i]], 0.0
            for k in range(lamps.strength.size):
                facing = x * lamps.towards[k, 0] + y * lamps.towards[k, 1] + z * lamps.towards[k, 2]
                if facing > 0.0:
                    diffuse += materials.diffuse[kind[i]] * lamps.strength[k] * facing
                half = x * lamps.halfway[k, 0] + y * lamps.halfway[k, 1] + z * lamps.halfway[k, 2]
                if half > 0.6:
                    specular += materials.specular[kind[i]] * lamps.strength[k] * half**exponent
            shading.diffuse[i, j], shading.specular[i, j] = diffuse, specular


@compiled
def draw(
    seen: np.ndarray,
    faces: np.ndarray,
    shading: Shading,
    spots: np.ndarray,
    which: np.ndarray,
    left: int,
    top: int,
    depth: np.ndarray,
    picture: np.ndarray,
) -> None:
    """Draw triangles that face the camera into samples, the highest in front.

    Args:
        seen: pixel u, v and height z of each vertex, (n, 3).
        faces: vertices of each triangle, outward oriented, (m, 3).
        shading: colours and light.
        spots: u and v of the drawn samples in a pixel, -0.5 to 0.5, for 4 x 4 neighbouring pixels, (16, 2, s).
        which: the numbers of the samples that are drawn, those of one moment, (s,).
        left: column of the picture's first pixel.
        top: row of the picture's first pixel.
        depth: height z of what each sample has met, (rows, columns, k).
        picture: its colour, (rows, columns, k, 3).
    """
    rows, columns, _ = depth.shape
    count = which.shape[0]
    heights = np.empty(count)
    for i in range(faces.shape[0]):
        a, b, c = faces[i, 0], faces[i, 1], faces[i, 2]
        u0, v0, u1, v1, u2, v2 = seen[a, 0], seen[a, 1], seen[b, 0], seen[b, 1], seen[c, 0], seen[c, 1]
        double = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
        if not double < 0.0:  # v runs downwards: outward triangles that are seen turn the other way
            continue
        first_u = max(math.ceil(min(u0, u1, u2) - 0.5), left)
        last_u = min(math.floor(max(u0, u1, u2) + 0.5), left + columns - 1)
        first_v = max(math.ceil(min(v0, v1, v2) - 0.5), top)
        last_v = min(math.floor(max(v0, v1, v2) + 0.5), top + rows - 1)
        inverse = 1.0 / double
        # Shares of the corners b and c as linear functions of the pixel.
        bu, bv = (v2 - v0) * inverse, -(u2 - u0) * inverse
        cu, cv = -(v1 - v0) * inverse, (u1 - u0) * inverse
        z0, zb, zc = seen[a, 2], seen[b, 2] - seen[a, 2], seen[c, 2] - seen[a, 2]
        zu, zv = zb * bu + zc * cu, zb * bv + zc * cv
        # A pixel in which a share falls short by more than this lies outside.
        spare_b, spare_c = -0.5 * (abs(bu) + abs(bv)), -0.5 * (abs(cu) + abs(cv))
        spare_a = 1.0 + 0.5 * (abs(bu + cu) + abs(bv + cv))
        for v in range(first_v, last_v + 1):
            for u in range(first_u, last_u + 1):
                share_b = (u - u0) * bu + (v - v0) * bv
                share_c = (u - u0) * cu + (v - v0) * cv
                if share_b < spare_b or share_c < spare_c or share_b + share_c > spare_a:
                    continue
                base = z0 + share_b * zb + share_c * zc
                variant = 4 * (v & 3) + (u & 3)
                for k in range(count):  # no branches: several samples at a time
                    du, dv = spots[variant, 0, k], spots[variant, 1, k]
                    sb = share_b + du * bu + dv * bv
                    sc = share_c + du * cu + dv * cv
                    inside = min(sb, sc, 1.0 - sb - sc)
                    heights[k] = base + du * zu + dv * zv if inside >= 0.0 else _EMPTY
                red = green = blue = -1.0
                for k in range(count):
                    at = which[k]
                    if heights[k] <= depth[v - top, u - left, at]:
                        continue
                    depth[v - top, u - left, at] = heights[k]
                    if red < 0.0:  # one colour a pixel and triangle, at the first sample inside it
                        du, dv = spots[variant, 0, k], spots[variant, 1, k]
                        sb, sc = share_b + du * bu + dv * bv, share_c + du * cu + dv * cv
                        sa = 1.0 - sb - sc
                        diffuse = sa * shading.diffuse[i, 0] + sb * shading.diffuse[i, 1] + sc * shading.diffuse[i, 2]
                        shine = sa * shading.specular[i, 0] + sb * shading.specular[i, 1] + sc * shading.specular[i, 2]
                        red = shading.colour[i, 0] * diffuse + shading.gloss[i, 0] * shine
                        green = shading.colour[i, 1] * diffuse + shading.gloss[i, 1] * shine
                        blue = shading.colour[i, 2] * diffuse + shading.gloss[i, 2] * shine
                    picture[v - top, u - left, at, 0] = red
                    picture[v - top, u - left, at, 1] = green
                    picture[v - top, u - left, at, 2] = blue


@compiled
def blend(
    depth: np.ndarray,
    samples: np.ndarray,
    left: int,
    top: int,
    still: Backdrop,
    shadow: Shadow,
    tint: np.ndarray,
    picture: np.ndarray,
) -> None:
    """Composite the samples of an exposure and the robot's shadow with the still parts, and clear the samples.

    Args:
        depth: height of what each sample has met, (rows, columns, k); cleared.
        samples: colours of the samples, (rows, columns, k, 3).
        left: column of the whole picture at which the samples begin.
        top: row at which they begin.
        still: what stands still.
        shadow: of the robot on the floor.
        tint: transmission of red, green and blue by the oil, (3,).
        picture: light of the still parts; changed, (whole rows, whole columns, 3).
    """
    _, over, shine, floor = still
    rows, columns, count = depth.shape
    for v in range(rows):
        for u in range(columns):
            red = green = blue = 0.0
            hits = 0
            for k in range(count):
                if depth[v, u, k] > _EMPTY:
                    hits += 1
                    red += samples[v, u, k, 0]
                    green += samples[v, u, k, 1]
                    blue += samples[v, u, k, 2]
                    depth[v, u, k] = _EMPTY
            i, j = top + v, left + u
            bare = 1.0 - hits / count
            if bare > 0.0:
                x, y = floor[i, j, 0] - shadow.x, floor[i, j, 1] - shadow.y
                along = abs(x * shadow.axis_x + y * shadow.axis_y)
                across = y * shadow.axis_x - x * shadow.axis_y
                far = math.hypot(max(along - shadow.half_length, 0.0), across) - shadow.radius
                bare *= 1.0 - shadow.darkness / (1.0 + math.exp(min(far / shadow.softness, 50.0)))
            through, mirrored = over[i, j] / count, shine[i, j] * hits / count
            picture[i, j, 0] = bare * picture[i, j, 0] + through * tint[0] * red + mirrored
            picture[i, j, 1] = bare * picture[i, j, 1] + through * tint[1] * green + mirrored
            picture[i, j, 2] = bare * picture[i, j, 2] + through * tint[2] * blue + mirrored


@compiled
def develop(
    light: np.ndarray,
    lens: np.ndarray,
    gain: np.ndarray,
    curve: np.ndarray,
    grain: np.ndarray,
    starts: np.ndarray,
    sigma: float,
    image: np.ndarray,
) -> None:
    """Bytes of a picture from its light: vignetting, lamp, gamma curve, noise.

    Args:
        light: linear light, (rows, columns, 3).
        lens: transmission of the lens, (rows, columns).
        gain: brightness of the lamp, (3,).
        curve: bytes over linear light from 0 to 1 in equal steps, (n,).
        grain: a pool of standard normal noise, (g,).
        starts: start of each row in it, (rows,).
        sigma: standard deviation of the noise, bytes.
        image: filled, (rows, columns, 3).
    """
    last = curve.size - 1
    noisy = sigma > 0.0
    for v in range(light.shape[0]):
        at = starts[v]
        for u in range(light.shape[1]):
            for k in range(3):
                place = light[v, u, k] * lens[v, u] * gain[k] * last + 0.5
                value = curve[int(min(max(place, 0.0), last))] + 0.5
                if noisy:
                    value += sigma * grain[at]
                    at += 1
                    if at == grain.size:
                        at = 0
                    value = min(max(value, 0.0), 255.0)
                image[v, u, k] = np.uint8(value)
