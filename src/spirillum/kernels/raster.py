"""Triangles into pixels, and light into bytes: the loops of the virtual camera.

A pixel has its centre at whole numbers and reaches half a pixel to every side. Colours are linear light.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.kernels.compiled import compiled

__all__ = ["blend", "corner_normals", "develop", "draw", "project", "shade"]


@compiled
def project(points: np.ndarray, camera: np.ndarray, turn: np.ndarray, seen: np.ndarray) -> None:
    """Where a camera above a flat surface of oil sees points, by Snell's law.

    Args:
        points: x, y, z with z towards the camera, which stands at x = y = 0; those above the surface are seen
            straight, (n, 3).
        camera: height of the lens, of the surface, refractive index below it, focal length with its sign, centre u
            and v, coefficients k1 and k2 of radial distortion, (8,).
        turn: rotation from the frame of the points to that of the tilted camera, (3, 3).
        seen: filled with pixel u, v and the height z, (n, 3).
    """
    eye, surface, index = camera[0], camera[1], camera[2]
    above = eye - surface
    n2 = index * index
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        across = math.hypot(x, y)
        down = eye - z
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
        stretch = camera[3] * (1.0 + r2 * (camera[6] + r2 * camera[7]))
        seen[i, 0] = camera[4] + stretch * a
        seen[i, 1] = camera[5] - stretch * b
        seen[i, 2] = z


@compiled
def shade(
    normals: np.ndarray, turn: np.ndarray, lamps: np.ndarray, matter: np.ndarray, kind: np.ndarray, light: np.ndarray
) -> None:
    """Light that corners of triangles send to a camera far above them.

    Args:
        normals: unit normals in the frame of their solid, (m, 3, 3).
        turn: rotation of the solid, (3, 3).
        lamps: unit vector towards each lamp, its strength, and the unit vector halfway to the camera, (k, 7).
        matter: ambient, diffuse and mirrored share and its exponent, (kinds, 4).
        kind: row of `matter` of each triangle, (m,).
        light: filled with the diffuse and the mirrored light of each corner, (m, 3, 2).
    """
    for i in range(normals.shape[0]):
        for j in range(3):
            nx, ny, nz = normals[i, j, 0], normals[i, j, 1], normals[i, j, 2]
            x = turn[0, 0] * nx + turn[0, 1] * ny + turn[0, 2] * nz
            y = turn[1, 0] * nx + turn[1, 1] * ny + turn[1, 2] * nz
            z = turn[2, 0] * nx + turn[2, 1] * ny + turn[2, 2] * nz
            diffuse, mirrored = matter[kind[i], 0], 0.0
            for k in range(lamps.shape[0]):
                facing = x * lamps[k, 0] + y * lamps[k, 1] + z * lamps[k, 2]
                if facing > 0.0:
                    diffuse += matter[kind[i], 1] * lamps[k, 3] * facing
                half = x * lamps[k, 4] + y * lamps[k, 5] + z * lamps[k, 6]
                if half > 0.6:
                    mirrored += matter[kind[i], 2] * lamps[k, 3] * half ** matter[kind[i], 3]
            light[i, j, 0], light[i, j, 1] = diffuse, mirrored


@compiled
def corner_normals(
    area: np.ndarray, faces: np.ndarray, owner: np.ndarray, start: np.ndarray, sharp: float
) -> np.ndarray:
    """Unit normals at the corners of triangles: the mean over those around a vertex that meet smoothly, (m, 3, 3).

    Args:
        area: normal of each triangle with twice its area as length, (m, 3).
        faces: vertices of each triangle, (m, 3).
        owner: triangles around the vertices, one vertex after the other, (3 m,).
        start: where those of each vertex begin, (n + 1,).
        sharp: cosine of the angle between triangles above which an edge is sharp.
    """
    found = np.zeros((faces.shape[0], 3, 3))
    for i in range(faces.shape[0]):
        own = math.sqrt(area[i, 0] ** 2 + area[i, 1] ** 2 + area[i, 2] ** 2)
        for j in range(3):
            x = y = z = 0.0
            for place in range(start[faces[i, j]], start[faces[i, j] + 1]):
                k = owner[place]
                size = math.sqrt(area[k, 0] ** 2 + area[k, 1] ** 2 + area[k, 2] ** 2)
                dot = area[k, 0] * area[i, 0] + area[k, 1] * area[i, 1] + area[k, 2] * area[i, 2]
                if k == i or dot > sharp * size * own:
                    x, y, z = x + area[k, 0], y + area[k, 1], z + area[k, 2]
            size = math.sqrt(x * x + y * y + z * z)
            if size > 0.0:
                found[i, j, 0], found[i, j, 1], found[i, j, 2] = x / size, y / size, z / size
    return found


@compiled
def draw(
    seen: np.ndarray,
    faces: np.ndarray,
    colours: np.ndarray,
    light: np.ndarray,
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
        colours: of each triangle and of its mirrored light, (m, 6).
        light: of each corner, as `shade` fills it, (m, 3, 2).
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
                    heights[k] = base + du * zu + dv * zv if inside >= 0.0 else -1e30
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
                        diffuse = sa * light[i, 0, 0] + sb * light[i, 1, 0] + sc * light[i, 2, 0]
                        shine = sa * light[i, 0, 1] + sb * light[i, 1, 1] + sc * light[i, 2, 1]
                        red = colours[i, 0] * diffuse + colours[i, 3] * shine
                        green = colours[i, 1] * diffuse + colours[i, 4] * shine
                        blue = colours[i, 2] * diffuse + colours[i, 5] * shine
                    picture[v - top, u - left, at, 0] = red
                    picture[v - top, u - left, at, 1] = green
                    picture[v - top, u - left, at, 2] = blue


@compiled
def blend(
    depth: np.ndarray,
    samples: np.ndarray,
    left: int,
    top: int,
    over: np.ndarray,
    shine: np.ndarray,
    floor: np.ndarray,
    shadow: np.ndarray,
    tint: np.ndarray,
    picture: np.ndarray,
) -> None:
    """Put the samples of an exposure, and the shadow of the robot, before what stands still; clear the samples.

    Args:
        depth: height of what each sample has met; below -1e29 where nothing, (rows, columns, k); cleared.
        samples: colours of the samples, (rows, columns, k, 3).
        left: column of the whole picture at which the samples begin.
        top: row at which they begin.
        over: share of the robot's light that passes the glass above it, (whole rows, whole columns).
        shine: light mirrored by that glass, (whole rows, whole columns).
        floor: x, y of the floor behind each pixel, (whole rows, whole columns, 2).
        shadow: its middle x, y, the axis's direction x, y, half its length without the rounding, its radius, how soft
            and how dark it is, (8,).
        tint: share of red, green and blue that the oil lets pass, (3,).
        picture: what stands still; changed, (whole rows, whole columns, 3).
    """
    rows, columns, count = depth.shape
    for v in range(rows):
        for u in range(columns):
            red = green = blue = 0.0
            hits = 0
            for k in range(count):
                if depth[v, u, k] > -1e29:
                    hits += 1
                    red += samples[v, u, k, 0]
                    green += samples[v, u, k, 1]
                    blue += samples[v, u, k, 2]
                    depth[v, u, k] = -1e30
            i, j = top + v, left + u
            bare = 1.0 - hits / count
            if bare > 0.0:
                x, y = floor[i, j, 0] - shadow[0], floor[i, j, 1] - shadow[1]
                along = abs(x * shadow[2] + y * shadow[3])
                across = y * shadow[2] - x * shadow[3]
                far = math.hypot(max(along - shadow[4], 0.0), across) - shadow[5]
                bare *= 1.0 - shadow[7] / (1.0 + math.exp(min(far / shadow[6], 50.0)))
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
    """Bytes of a picture from its light: vignetting, lamp, the eye's scale of brightness, noise.

    Args:
        light: linear light, (rows, columns, 3).
        lens: share of light that the lens lets pass, (rows, columns).
        gain: brightness of the lamp, (3,).
        curve: bytes over linear light from 0 to 1 in equal steps, (n,).
        grain: normal noise of unit size, (g,).
        starts: where in it each row begins, (rows,).
        sigma: size of the noise, bytes.
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
