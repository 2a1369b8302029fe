"""Closed forms of the robot's geometry, over arrays of robots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Values, Vectors
from spirillum.robot.parts import End, Shape


def arc_fraction(wavelength: Values, amplitude: Values) -> Values:
    """Alpha = [1 + (2 pi B_o/lambda)^2]^(-1/2): axial over arc length of a plain helix (Section II-B)."""
    return 1.0 / np.sqrt(1.0 + (2.0 * np.pi * amplitude / wavelength) ** 2)


def coil_curvature(wavelength: Values, amplitude: Values) -> Values:
    """Curvature of a plain helix, B_o k^2 alpha^2 with k = 2 pi/lambda, 1/m."""
    return amplitude * (2.0 * np.pi / wavelength) ** 2 * arc_fraction(wavelength, amplitude) ** 2


def pitch_angle(wavelength: Values, amplitude: Values) -> Values:
    """Angle between the wire and the tail's axis, rad; its cosine is alpha."""
    return np.arctan(2.0 * np.pi * amplitude / wavelength)


def arc_length(wavelength: Values, amplitude: Values, length: Values) -> Values:
    """L = L_t/alpha: length of the wire of a plain helix, m."""
    return length / arc_fraction(wavelength, amplitude)


def amplitude_envelope(xi: Values, amplitude: Values, length: Values, taper: Values) -> tuple[Values, Values]:
    """Local amplitude of eq. (10), r = B_o (1 - exp(-c xi/L_t)), and its slope dr/dxi.

    Args:
        xi: axial distance from the tail's root, m.
        amplitude: B_o, m.
        length: L_t, m.
        taper: c; infinite for a plain helix.
    """
    with np.errstate(invalid="ignore"):
        decay = np.where(np.isinf(taper), 0.0, np.exp(-taper * xi / length))
        slope = np.where(np.isinf(taper), 0.0, amplitude * taper / length * decay)
    return amplitude * (1.0 - decay), slope


class Centreline(NamedTuple):
    """The wire's centreline in the frame of the body (origin at its mid-length on the motor axis)."""

    position: Vectors
    """Points, m."""
    tangent: Vectors
    """Unit tangents, pointing away from the root."""
    stretch: Values
    """Arc length per axial length, ds/dxi."""


def centreline(
    xi: Values,
    *,
    root: Values,
    wavelength: Values,
    amplitude: Values,
    length: Values,
    taper: Values,
    hand: Values,
    phase: Values,
) -> Centreline:
    """The wire of eq. (10): x = -x_r - xi, y = r cos(h k x + phi), z = r sin(h k x + phi).

    All arguments broadcast; `root` is x_r = L_b/2 + L_c, `hand` is h = +1 (right) or -1 (left).
    """
    wavenumber = 2.0 * np.pi / wavelength
    x = -root - xi
    r, slope = amplitude_envelope(xi, amplitude, length, taper)
    angle = hand * wavenumber * x + phase
    cos, sin = np.cos(angle), np.sin(angle)
    turning = -hand * wavenumber * r  # r d(angle)/dxi
    stretch = np.sqrt(1.0 + slope**2 + turning**2)
    position = np.stack(np.broadcast_arrays(x, r * cos, r * sin), axis=-1)
    direction = np.stack(
        np.broadcast_arrays(-np.ones_like(x), slope * cos - turning * sin, slope * sin + turning * cos), axis=-1
    )
    return Centreline(position, direction / stretch[..., None], stretch)


def coil_spacing(wavelength: Values, amplitude: Values) -> Values:
    """Smallest distance between neighbouring turns of the centreline, m; infinite if turns never come close.

    The distance between two points of a helix at an angle t apart is
    d(t)^2 = 2 b^2 (1 - cos t) + (lambda t/2 pi)^2; its minimum near t = 2 pi solves sin t + (p/b)^2 t = 0
    with p = lambda/2 pi (Przybyl and Pieranski, Eur. Phys. J. E 4:445, 2001).
    """
    ratio = (wavelength / (2.0 * np.pi * amplitude)) ** 2
    neighbours = ratio * 4.4934 < 0.9761  # sin t = -ratio t has a root beyond the tangent point tan t = t
    t = np.full(np.shape(ratio), 2.0 * np.pi)
    r = np.where(neighbours, ratio, 0.0)
    for _ in range(60):  # monotone from the right where convex; few steps are needed
        step = (np.sin(t) + r * t) / np.maximum(np.cos(t) + r, 1e-3)
        t = np.clip(t - step, 4.4934, 2.0 * np.pi)
        if np.all(np.abs(step) < 1e-9):
            break
    distance = np.sqrt(2.0 * amplitude**2 * (1.0 - np.cos(t)) + (wavelength * t / (2.0 * np.pi)) ** 2)
    return np.where(neighbours, distance, np.inf)


def _end_height(end: End | None, radius: Values, fillet: Values) -> Values:
    if end == "hemisphere":
        return radius
    return fillet if end == "fillet" else 0.0 * radius


def _end_volume(end: End | None, radius: Values, fillet: Values) -> Values:
    if end == "hemisphere":
        return 2.0 / 3.0 * np.pi * radius**3
    if end == "fillet":
        core = radius - fillet
        return np.pi * (core**2 * fillet + 0.5 * np.pi * core * fillet**2 + 2.0 / 3.0 * fillet**3)
    return 0.0 * radius


def shortest_body(diameter: Values, fillet: Values, front: End | None, rear: End | None) -> Values:
    """Sum of the heights of both ends: no capsule or cylinder can be shorter, m."""
    radius = 0.5 * diameter
    return _end_height(front, radius, fillet) + _end_height(rear, radius, fillet)


def body_volume(
    shape: Shape,
    diameter: Values,
    length: Values,
    fillet: Values,
    front: End | None,
    rear: End | None,
) -> Values:
    """Volume of the body, m^3."""
    radius = 0.5 * diameter
    if shape in ("sphere", "spheroid"):
        return 4.0 / 3.0 * np.pi * radius**2 * (0.5 * length)
    straight = length - shortest_body(diameter, fillet, front, rear)
    return np.pi * radius**2 * straight + _end_volume(front, radius, fillet) + _end_volume(rear, radius, fillet)
