"""Velocity and pressure in a tube from many forces at once: what its wall reflects, wave by wave.

The waves are those of `tube_waves`. Here they stay in amplitudes of their three flows, which are summed over all
forces once and evaluated at any number of points; at a point, waves enter as far as their damping between forces, wall
and point lets them matter.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled, compiled_by_rows
from spirillum.kernels.tube_waves import _flows, _ratios, _wall_inverses, wall_layers

_TAPER = 0.4
"""Part of the waves over which they are faded out."""


@compiled
def _scaled_i0(z: float) -> float:
    """exp(-z) I_0(z), by its power series, and for large z by the asymptotic one (DLMF 10.25.2, 10.40.1)."""
    total, term = 1.0, 1.0
    for n in range(1, 60):
        factor = (0.5 * z / n) ** 2 if z < 15.0 else (2.0 * n - 1.0) ** 2 / (8.0 * n * z)
        term *= factor
        total += term
        if term < 1e-17 * total or (z >= 15.0 and factor > 1.0):
            break
    value: float = total * math.exp(-z) if z < 15.0 else total / math.sqrt(2.0 * math.pi * z)
    return value


@compiled
def _kept(k: float, radius: float, steepest: float, orders: int) -> int:
    """Number of orders up to which waves are no steeper than `steepest`."""
    return min(orders, int(radius * math.sqrt(max(steepest * steepest - k * k, 0.0))) + 3)


@compiled
def _taper(k: float, p: int, radius: float, steepest: float) -> float:
    """1 for flat waves, 0 beyond the steepest one, and smooth between: flows keep their derivatives."""
    around = max(p - 2.0, 0.0) / radius
    share = math.sqrt(k * k + around * around) / steepest
    left = min(max((1.0 - share) / _TAPER, 0.0), 1.0)
    return left * left * left * (10.0 - 15.0 * left + 6.0 * left * left)


@compiled
def _along(k: float, x: Samples, forces: Samples, real: Samples, imaginary: Samples) -> None:
    """Sum exp(i k x) times the forces of one column, even and odd, (2, 3) each."""
    for parity in range(2):
        for d in range(3):
            real[parity, d] = imaginary[parity, d] = 0.0
    for s in range(x.size):
        cos, sin = math.cos(k * x[s]), math.sin(k * x[s])
        for parity in range(2):
            for d in range(3):
                real[parity, d] += forces[s, parity, d] * cos
                imaginary[parity, d] += forces[s, parity, d] * sin


@compiled
def _pressed(layer: Samples, inverse: Samples, half: Samples, out: Samples) -> None:
    """Fill out (3, 3) with the inverse times the layer times the transposed inverse; `half` is work space."""
    for i in range(3):
        for j in range(3):
            half[i, j] = 0.0
            for c in range(3):
                half[i, j] += layer[i, c] * inverse[3 * j + c]
    for i in range(3):
        for j in range(3):
            out[i, j] = 0.0
            for c in range(3):
                out[i, j] += inverse[3 * i + c] * half[c, j]


@compiled
def _reflect(weight: float, layers: Samples, inverses: Samples, amplitudes: Samples) -> None:
    """Turn waves times forces, (2, 2, orders, 3), into the amplitudes of what the wall reflects of them."""
    half, pressed, wave = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for p in range(len(layers)):
        share = -weight if p == 0 else -2.0 * weight
        _pressed(layers[p], inverses[p], half, pressed)
        for parity in range(2):
            for phase in range(2):
                for i in range(3):
                    wave[i] = amplitudes[parity, phase, p, i]
                for i in range(3):
                    total = 0.0
                    for c in range(3):
                        total += pressed[i, c] * wave[c]
                    amplitudes[parity, phase, p, i] = share * total


@compiled_by_rows(0, 6, 7)
def wave_amplitudes(
    waves: tuple[Samples, Samples, np.ndarray, Samples],
    radius: float,
    columns: tuple[Samples, Samples, Samples],
    first: np.ndarray,
    x: Samples,
    forces: Samples,
    steps: Samples,
    amplitudes: Samples,
) -> None:
    """Amplitudes of the flows (`_flows`) of which each wave of the wall's reflection consists.

    Sources stand in columns along the tube. Of the forces the even part moves even waves, the odd part odd ones.

    Args:
        waves: k, weights, numbers of orders p, and K_1/K_0 at k radius, (K,) each.
        radius: of the tube.
        columns: distance from the axis, polar angle, and steepest wave that matters, (columns,) each.
        first: number of the first source of each column, and of all sources, (columns + 1,).
        x: of the sources, (n,).
        forces: even and odd part, along x, rho and theta, (n, 2, 3).
        steps: to be filled with I_{p+1}/I_p at the wall, (K, most orders).
        amplitudes: to be filled, (K, 2, 2, most orders, 3): even, odd; real, imaginary.
    """
    wave_k, weights, orders, bessel = waves
    rho, angle, steepest = columns
    for n in range(wave_k.size):
        k, count = wave_k[n], orders[n]
        wall = k * radius
        inverses, r, v = np.empty((count, 10)), np.empty(count + 2), np.empty((3, 3))
        _wall_inverses(wall, count, inverses)
        top = _scaled_i0(wall)
        real, imaginary = np.empty((2, 3)), np.empty((2, 3))
        for c in range(rho.size):
            if k > steepest[c]:
                continue
            _along(k, x[first[c] : first[c + 1]], forces[first[c] : first[c + 1]], real, imaginary)
            kept = _kept(k, radius, steepest[c], count)
            z = max(k * rho[c], 1e-12 * wall)
            scale = _scaled_i0(z) / top * math.exp(z - wall)
            _ratios(z, r[: kept + 2])
            for p in range(kept):
                _flows(p, z, wall, r, v)
                cos, sin = scale * math.cos(p * angle[c]), scale * math.sin(p * angle[c])
                for parity in range(2):
                    like, other = (cos, -sin) if parity == 0 else (-sin, -cos)
                    for w in range(3):
                        along, out, around = v[0, w] * like, v[1, w] * like, v[2, w] * other
                        amplitudes[n, parity, 0, p, w] += (
                            out * real[parity, 1] + around * real[parity, 2] - along * imaginary[parity, 0]
                        )
                        amplitudes[n, parity, 1, p, w] += (
                            out * imaginary[parity, 1] + around * imaginary[parity, 2] + along * real[parity, 0]
                        )
                scale *= r[p] / inverses[p, 9]
        for p in range(count):
            steps[n, p] = inverses[p, 9]
        _reflect(weights[n], wall_layers(wall, bessel[n], count), inverses, amplitudes[n])


@compiled_by_rows(0, 1, 6)
def add_waves(
    points: Samples,
    steepest: Samples,
    waves: tuple[Samples, np.ndarray],
    radius: float,
    steps: Samples,
    amplitudes: Samples,
    field: Samples,
) -> None:
    """Add velocity (times 8 pi mu) and pressure (times 8 pi) of waves.

    Of the flows in `_flows` those with u = rho d(grad phi)/d rho + e_x d phi/dx carry a pressure, 2 mu k^2 phi.

    Args:
        points: (x, y, z) about the tube's axis, no farther from it than the radius, (n, 3).
        steepest: wave from which on nothing is added at each point; they are faded out towards it, (n,).
        waves: k and numbers of orders p, (K,) each.
        radius: of the tube.
        steps: of `wave_amplitudes`.
        amplitudes: of `wave_amplitudes`.
        field: velocity (x, y, z) and pressure to add to, (n, 4).
    """
    wave_k, orders = waves
    for i in range(points.shape[0]):
        rho, angle = math.hypot(points[i, 1], points[i, 2]), math.atan2(points[i, 2], points[i, 1])
        r, v, push = np.empty(steps.shape[1] + 2), np.empty((3, 3)), np.zeros(3)
        total = np.zeros(4)
        for n in range(wave_k.size):
            k = wave_k[n]
            if k > steepest[i]:
                continue
            wall = k * radius
            kept = _kept(k, radius, steepest[i], orders[n])
            z = max(k * rho, 1e-12 * wall)
            scale = _scaled_i0(z) / _scaled_i0(wall) * math.exp(z - wall)
            _ratios(z, r[: kept + 2])
            real, imaginary = math.cos(k * points[i, 0]), math.sin(k * points[i, 0])
            for p in range(kept):
                _flows(p, z, wall, r, v)
                push[1] = 0.0 if p == 0 else -2.0 * k / wall
                push[2] = 2.0 * k / (wall * wall) if p == 0 else 2.0 * k
                here = scale * _taper(k, p, radius, steepest[i])
                cos, sin = here * math.cos(p * angle), here * math.sin(p * angle)
                for parity in range(2):
                    like, other = (cos, -sin) if parity == 0 else (-sin, -cos)
                    for w in range(3):
                        first, second = amplitudes[n, parity, 0, p, w], amplitudes[n, parity, 1, p, w]
                        across = real * first + imaginary * second
                        total[0] += like * v[0, w] * (real * second - imaginary * first)
                        total[1] += like * v[1, w] * across
                        total[2] += other * v[2, w] * across
                        total[3] += like * push[w] * across
                scale *= r[p] / steps[n, p]
        c, s = math.cos(angle), math.sin(angle)
        field[i, 0] += total[0]
        field[i, 1] += total[1] * c - total[2] * s
        field[i, 2] += total[1] * s + total[2] * c
        field[i, 3] += total[3]
