"""Rays of a pinhole camera through a flat refracting surface, exact by Snell's law, compiled."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

_STEPS = 30
_LAST = 1e-9
"""Relative step after which Newton's method is exact to rounding, as its convergence is quadratic."""


@compiled
def surface_crossing(distance: float, above: float, below: float, index: float) -> float:
    """Horizontal distance from the lens at which the ray to a point crosses the surface, m.

    Solves s / sqrt(s^2 + a^2) = n (d - s) / sqrt((d - s)^2 + b^2) by Newton's method; the left side increases and
    the right side decreases with s, so that there is one root between 0 and d.

    Args:
        distance: horizontal distance d of the point from the lens, m.
        above: height a of the lens above the surface, m.
        below: depth b of the point below the surface, m; 0 or less: the ray does not reach the surface.
        index: refractive index n below the surface over that above.
    """
    if distance <= 0.0 or below <= 0.0 or index == 1.0:
        return distance * above / (above + below) if below > 0.0 else distance
    low, high = 0.0, distance
    s = distance * above / (above + below / index)
    for _ in range(_STEPS):
        rest = distance - s
        up, down = np.sqrt(s * s + above * above), np.sqrt(rest * rest + below * below)
        value = s / up - index * rest / down
        if value > 0.0:
            high = s
        else:
            low = s
        step = value / (above * above / up**3 + index * below * below / down**3)
        s -= step
        if abs(step) < _LAST * distance:
            break
        if s <= low or s >= high:
            s = 0.5 * (low + high)
    return s


@compiled
def pixels_of_points(points: Samples, numbers: Samples, out: Samples) -> None:
    """Project points (k, 3), m, to pixels (k, 2); `numbers` are the camera's parameters, as of `Optics.numbers`."""
    focal, centre_u, centre_v, k1, k2 = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    height, surface, index = numbers[5], numbers[6], numbers[7]
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        across = np.sqrt(x * x + y * y)
        above, below = height - surface, surface - z
        if below <= 0.0:  # no refraction
            d_x, d_y, d_z = x, y, z - height
        else:
            s = surface_crossing(across, above, below, index)
            share = s / across if across > 0.0 else 0.0
            d_x, d_y, d_z = x * share, y * share, -above
        right = numbers[8] * d_x + numbers[9] * d_y + numbers[10] * d_z
        up = numbers[11] * d_x + numbers[12] * d_y + numbers[13] * d_z
        ahead = -(numbers[14] * d_x + numbers[15] * d_y + numbers[16] * d_z)
        if ahead <= 0.0:
            out[i, 0] = out[i, 1] = np.nan
            continue
        a, b = right / ahead, up / ahead
        square = a * a + b * b
        stretch = 1.0 + square * (k1 + square * k2)
        out[i, 0] = centre_u + focal * a * stretch
        out[i, 1] = centre_v - focal * b * stretch


@compiled
def points_of_pixels(pixels: Samples, level: float, numbers: Samples, out: Samples) -> None:
    """Points (k, 3) at the height `level` on the rays of pixels (k, 2), m; NaN where a ray does not reach it."""
    focal, centre_u, centre_v, k1, k2 = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    height, surface, index = numbers[5], numbers[6], numbers[7]
    for i in range(pixels.shape[0]):
        a_d, b_d = (pixels[i, 0] - centre_u) / focal, (centre_v - pixels[i, 1]) / focal
        a, b = a_d, b_d
        if k1 != 0.0 or k2 != 0.0:
            far = np.sqrt(a_d * a_d + b_d * b_d)
            r = far
            for _ in range(_STEPS):
                square = r * r
                step = (r * (1.0 + square * (k1 + square * k2)) - far) / (1.0 + square * (3.0 * k1 + 5.0 * square * k2))
                r -= step
                if abs(step) < 1e-14:
                    break
            if far > 0.0:
                a, b = a_d * r / far, b_d * r / far
        d_x = numbers[8] * a + numbers[11] * b - numbers[14]
        d_y = numbers[9] * a + numbers[12] * b - numbers[15]
        d_z = numbers[10] * a + numbers[13] * b - numbers[16]
        out[i, 2] = level
        if d_z >= 0.0:
            out[i, 0] = out[i, 1] = np.nan
            continue
        if level >= surface:
            far = (level - height) / d_z
            out[i, 0], out[i, 1] = d_x * far, d_y * far
            continue
        length = np.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
        sine_x, sine_y = d_x / (length * index), d_y / (length * index)
        cosine = np.sqrt(1.0 - sine_x * sine_x - sine_y * sine_y)
        far, deep = (surface - height) / d_z, (surface - level) / cosine
        out[i, 0], out[i, 1] = d_x * far + sine_x * deep, d_y * far + sine_y * deep
