"""Apparent contour of a body from its polynomials, and its projection into the picture, compiled."""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.snell import pixels_of_points


@compiled
def edge_points(pose: Samples, factors: Samples, normals: Samples, reach: Samples, out: Samples) -> None:
    """Edge points in the plane through the axis, in the body's frame.

    Args:
        pose: x, y, heading.
        factors: Chebyshev coefficients of x and y with the upper rims of flat ends, and of x and y with the lower ones,
            (a, b, 4, n); the outer point of the two is taken.
        normals: outward normals, (n, 2).
        reach: largest distances of the lens along and across, m, (2,).
        out: the points, m, (n, 2).
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    place = (-(cos * pose[0] + sin * pose[1]), -(-sin * pose[0] + cos * pose[1]))
    a = min(max(place[0] / reach[0], -1.0), 1.0)
    b = min(max(place[1] / reach[1], -1.0), 1.0)
    turn_a, turn_b = math.acos(a), math.acos(b)
    count = out.shape[0]
    both = np.zeros((4, count))
    for i in range(factors.shape[0]):
        for j in range(factors.shape[1]):
            basis = math.cos(i * turn_a) * math.cos(j * turn_b)
            for k in range(4):
                for n in range(count):
                    both[k, n] += basis * factors[i, j, k, n]
    for n in range(count):
        rim = 2 if (both[2, n] - both[0, n]) * normals[n, 0] > 0.0 else 0
        out[n, 0], out[n, 1] = both[rim, n], both[rim + 1, n]


@compiled
def edge_places(
    pose: Samples,
    factors: Samples,
    normals: Samples,
    reach: Samples,
    axis_height: float,
    numbers: Samples,
    pixels: Samples,
    directions: Samples,
    size: Samples,
    slopes: Samples,
) -> None:
    """Project a body's apparent contour into the picture.

    Args:
        pose: x, y, heading.
        factors: Chebyshev coefficients of the edge points, as in `edge_points`, (a, b, 4, n).
        normals: outward normals in the body's frame, (n, 2).
        reach: largest distances of the lens along and across, m, (2,).
        axis_height: height of the axis, m.
        numbers: the camera's parameters, as of `Optics.numbers`.
        pixels: the edge points, (n, 2).
        directions: unit normals in the picture, (n, 2).
        size: pixels per m along them, (n,).
        slopes: Jacobian of the displacement along each normal by (x, y, heading), pixels per m and per rad, (n, 3).
    """
    count = normals.shape[0]
    local = np.empty((count, 2))
    edge_points(pose, factors, normals, reach, local)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    points, ends = np.empty((2 * count, 3)), np.empty((2 * count, 2))
    step = 1e-4
    for n in range(count):
        for k in range(2):
            x = local[n, 0] + k * step * normals[n, 0]
            y = local[n, 1] + k * step * normals[n, 1]
            points[k * count + n, 0] = pose[0] + cos * x - sin * y
            points[k * count + n, 1] = pose[1] + sin * x + cos * y
            points[k * count + n, 2] = axis_height
    pixels_of_points(points, numbers, ends)
    for n in range(count):
        d_u = (ends[count + n, 0] - ends[n, 0]) / step
        d_v = (ends[count + n, 1] - ends[n, 1]) / step
        far = math.sqrt(d_u * d_u + d_v * d_v)
        pixels[n, 0], pixels[n, 1] = ends[n, 0], ends[n, 1]
        directions[n, 0], directions[n, 1] = d_u / far, d_v / far
        size[n] = far
        slopes[n, 0] = far * (cos * normals[n, 0] - sin * normals[n, 1])
        slopes[n, 1] = far * (sin * normals[n, 0] + cos * normals[n, 1])
        slopes[n, 2] = far * (local[n, 0] * normals[n, 1] - local[n, 1] * normals[n, 0])
