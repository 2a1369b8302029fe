"""Stokes flow in a circular tube as waves exp(i p theta + i k x), each carried by the velocity that it has on the wall.

For each p and k the regular flow inside the tube follows from its velocity on the wall: a 3x3 matrix, the extension,
made of modified Bessel functions. The wall's reflection of a force is -U S U', with the extension U to target and
source, and the single layer S of a cylinder in unbounded fluid: a force on the wall moves nothing.

The flows are gradients and curls of the harmonic phi = I_p(k rho) exp(i p theta + i k x), and those that carry the
pressure, u = rho d(grad phi)/d rho + e_x d phi/dx (Happel and Brenner, Low Reynolds Number Hydrodynamics, 1965,
section 3.3), combined so that they stay apart as k -> 0. In the components u_+- = u_rho +- i u_theta they hold the
orders p +- 1. As in `rings`, f_theta = i g and u_theta = i v; with f_x = i F and u_x = i X all matrices are real.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled


@compiled
def _ratios(z: float, r: Samples) -> None:
    """Fill r[n] = I_{n+1}(z)/I_n(z), by backward recurrence (DLMF 10.29, 10.74(v)).

    It forgets where it starts in orders above z only.
    """
    last = max(r.size, int(z)) + 40
    ratio = z / (last + 1.0 + math.sqrt((last + 1.0) ** 2 + z * z))
    for n in range(last - 1, -1, -1):
        ratio = z / (2.0 * (n + 1.0) + z * ratio)
        if n < r.size:
            r[n] = ratio


@compiled
def _flows(p: int, z: float, wall: float, r: Samples, v: Samples) -> None:
    """Fill v with the velocities (X, rho, v) of three flows at k rho = z, columns, in units of I_p(z).

    Args:
        p: order, at least 0.
        z: k rho.
        wall: k R, which scales the columns.
        r: ratios of Bessel functions at z.
        v: to be filled, (3, 3).
    """
    up, up2 = r[p], r[p] * r[p + 1]
    if p == 0:
        columns = (
            (0.0, up / wall, -up / wall),
            (1.0, up, up),
            (z * up / wall**2, z * up2 / wall**2, z * up2 / wall**2),
        )
    else:
        columns = (
            (wall, 0.0, 2.0 * wall / r[p - 1]),
            (-z * up / wall, (2.0 * up - z * up2) / wall, -z / wall),
            (z * up + p + 2.0, z, z),
        )
    for c in range(3):
        x, plus, minus = columns[c]
        v[0, c], v[1, c], v[2, c] = x, 0.5 * (plus + minus), 0.5 * (minus - plus)


@compiled
def _invert(a: Samples, inverse: Samples) -> None:
    """Inverse of a 3x3 matrix by cofactors."""
    for i in range(3):
        for j in range(3):
            b, c, d, e = (j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3
            inverse[i, j] = a[b, d] * a[c, e] - a[b, e] * a[c, d]
    determinant = a[0, 0] * inverse[0, 0] + a[0, 1] * inverse[1, 0] + a[0, 2] * inverse[2, 0]
    for i in range(3):
        for j in range(3):
            inverse[i, j] /= determinant


@compiled
def _extension(
    scale: float, z: float, wall: float, first: int, inverses: Samples, r: Samples, v: Samples, out: Samples
) -> None:
    """Fill out (orders - first, 3, 3) with the extensions from the wall k R = `wall` to k rho = z.

    Args:
        scale: I_0(z)/I_0(wall).
        z: k rho.
        wall: k R.
        first: the first order p.
        inverses: of the flows at the wall, and ratios there in the last row: (orders, 10).
        r: work space, (orders + 2,).
        v: work space, (3, 3).
        out: to be filled.
    """
    z = max(z, 1e-12 * wall)
    _ratios(z, r)
    for p in range(first):
        scale *= r[p] / inverses[p, 9]
    for p in range(first, len(inverses)):
        _flows(p, z, wall, r, v)
        for i in range(3):
            for j in range(3):
                total = 0.0
                for c in range(3):
                    total += v[i, c] * inverses[p, 3 * c + j]
                out[p - first, i, j] = scale * total
        scale *= r[p] / inverses[p, 9]


@compiled
def _wall_inverses(wall: float, orders: int, inverses: Samples) -> None:
    """Fill the inverses of the flows at the wall and the ratios there, (orders, 10)."""
    r, v, inverse = np.empty(orders + 2), np.empty((3, 3)), np.empty((3, 3))
    _ratios(wall, r)
    for p in range(orders):
        _flows(p, wall, wall, r, v)
        _invert(v, inverse)
        for i in range(3):
            for j in range(3):
                inverses[p, 3 * i + j] = inverse[i, j]
        inverses[p, 9] = r[p]


@compiled
def wave_extensions(k: float, radius: float, rho: Samples, scale: Samples, orders: int, first: int = 0) -> Samples:
    """Velocities (X, u_rho, v) at rho for unit velocities at the radius, (n, orders - first, 3, 3).

    Args:
        k: wave number, above 0.
        radius: of the cylinder on which the waves are one.
        rho: where, (n,).
        scale: I_0(k rho)/I_0(k radius), (n,).
        orders: the order p after the last.
        first: the first order p.
    """
    inverses, r, v = np.empty((orders, 10)), np.empty(orders + 2), np.empty((3, 3))
    _wall_inverses(k * radius, orders, inverses)
    out = np.empty((rho.size, orders - first, 3, 3))
    for n in range(rho.size):
        _extension(scale[n], k * rho[n], k * radius, first, inverses, r, v, out[n])
    return out


@compiled
def _product(i: int, j: int, w: Samples, r: Samples, q: Samples) -> float:
    """I_i K_j for |i - j| at most 1, from w[n] = I_n K_n and the ratios of both; orders may be negative."""
    a, b = abs(i), abs(j)
    if a == b:
        value: float = w[a]
    elif a > b:
        value = r[b] * w[b]
    else:
        value = q[a] * w[a]
    return value


@compiled
def wall_layers(z: float, first: float, orders: int) -> Samples:
    """Single layer S on a cylinder in unbounded fluid: velocities (X, u_rho, v) from densities (F, f_rho, g).

    In units of 4 pi R/(8 pi mu), symmetric, (orders, 3, 3).
    """
    r, q, w = np.empty(orders + 3), np.empty(orders + 3), np.empty(orders + 3)
    _ratios(z, r)
    q[0] = first
    for n in range(1, orders + 3):
        q[n] = 2.0 * n / z + 1.0 / q[n - 1]
    for n in range(orders + 3):
        w[n] = 1.0 / (z * (r[n] + q[n]))
    s = np.empty((orders, 3, 3))
    for p in range(orders):
        below, above = w[abs(p - 1)], w[p + 1]
        s[p, 0, 0] = 2.0 * (1.0 + p) * w[p] + z * w[p] * (r[p] - q[p])
        s[p, 0, 1] = s[p, 1, 0] = 0.5 * z * (2.0 * w[p] - above - below)
        s[p, 0, 2] = s[p, 2, 0] = 0.5 * z * (above - below)
        up = _product(p + 1, p, w, r, q)
        down = _product(p - 1, p, w, r, q)
        plus = above + 0.5 * z * (up - _product(p + 2, p + 1, w, r, q))
        minus = below + 0.5 * z * (down - _product(p - 2, p - 1, w, r, q))
        mixed = 0.5 * z * (up - _product(p, p - 1, w, r, q))
        s[p, 1, 1] = 0.5 * (plus + minus) + mixed
        s[p, 2, 2] = 0.5 * (plus + minus) - mixed
        s[p, 1, 2] = s[p, 2, 1] = 0.5 * (minus - plus)
    return s


@compiled
def circle_waves(extensions: Samples, angle: Samples, turn: Samples, even: Samples, odd: Samples) -> None:
    """Velocities (x, rho, theta) of even and odd waves in cylindrical components about a second, parallel axis.

    The even wave of order p has X and u_rho as cos(p theta), the odd one as -sin(p theta); u_x comes times i.

    Args:
        extensions: at points, (n, orders, 3, 3).
        angle: polar angles of the points about the tube's axis, (n,).
        turn: those less the angles about the second axis, (n,).
        even: to be filled, (3, n, orders, 3).
        odd: to be filled, (3, n, orders, 3).
    """
    for n in range(angle.size):
        c, s = math.cos(turn[n]), math.sin(turn[n])
        for p in range(extensions.shape[1]):
            cos, sin = math.cos(p * angle[n]), math.sin(p * angle[n])
            for w in range(3):
                x, rho, v = extensions[n, p, 0, w], extensions[n, p, 1, w], extensions[n, p, 2, w]
                even[0, n, p, w] = x * cos
                even[1, n, p, w] = rho * cos * c + v * sin * s
                even[2, n, p, w] = rho * cos * s - v * sin * c
                odd[0, n, p, w] = -x * sin
                odd[1, n, p, w] = -rho * sin * c + v * cos * s
                odd[2, n, p, w] = -rho * sin * s - v * cos * c


@compiled
def station_waves(extensions: Samples, angle: Samples, phase: Samples, out: Samples, first: int = 0) -> None:
    """Velocities (x, y, z) of waves at points: real and imaginary part, even and odd, order and wall component.

    Args:
        extensions: at points, (n, orders, 3, 3).
        angle: polar angles of the points about the tube's axis, (n,).
        phase: k x, (n,).
        out: to be filled, (n, 3, 2, 2, orders, 3).
        first: the first order p.
    """
    for n in range(angle.size):
        c, s = math.cos(angle[n]), math.sin(angle[n])
        real, imaginary = math.cos(phase[n]), math.sin(phase[n])
        for p in range(extensions.shape[1]):
            cos, sin = math.cos((first + p) * angle[n]), math.sin((first + p) * angle[n])
            for w in range(3):
                x, rho, v = extensions[n, p, 0, w], extensions[n, p, 1, w], extensions[n, p, 2, w]
                for parity in range(2):
                    like, other = (cos, -sin) if parity == 0 else (-sin, -cos)
                    radial, around = rho * like, v * other
                    y, z = radial * c - around * s, radial * s + around * c
                    out[n, 0, 0, parity, p, w] = -x * like * imaginary
                    out[n, 0, 1, parity, p, w] = x * like * real
                    out[n, 1, 0, parity, p, w] = y * real
                    out[n, 1, 1, parity, p, w] = y * imaginary
                    out[n, 2, 0, parity, p, w] = z * real
                    out[n, 2, 1, parity, p, w] = z * imaginary


@compiled
def tilted_waves(
    extensions: Samples, angle: Samples, phase: Samples, theta: Samples, rotation: Samples, out: Samples, first: int
) -> None:
    """Velocities (x, rho, theta) of waves on rings about a tilted axis, in cylindrical components about it.

    Args:
        extensions: at the rings' points, (angles, n, orders, 3, 3).
        angle: polar angles of the points about the tube's axis, (angles, n).
        phase: k x there, (angles, n).
        theta: angles about the rings' axis, (angles,).
        rotation: from the rings' axes to the tube's, (3, 3).
        out: to be filled: component; even, odd; angle; ring; real, imaginary; order; wall component.
        first: the first order p.
    """
    for t in range(theta.size):
        cos_t, sin_t = math.cos(theta[t]), math.sin(theta[t])
        x_0, y_0, z_0 = rotation[0, 0], rotation[1, 0], rotation[2, 0]
        outward = rotation[:, 1] * cos_t + rotation[:, 2] * sin_t
        around = rotation[:, 2] * cos_t - rotation[:, 1] * sin_t
        x_1, y_1, z_1 = outward[0], outward[1], outward[2]
        x_2, y_2, z_2 = around[0], around[1], around[2]
        for n in range(angle.shape[1]):
            cos_a, sin_a = math.cos(angle[t, n]), math.sin(angle[t, n])
            real, imaginary = math.cos(phase[t, n]), math.sin(phase[t, n])
            for p in range(extensions.shape[2]):
                cos, sin = math.cos((first + p) * angle[t, n]), math.sin((first + p) * angle[t, n])
                for w in range(3):
                    u = extensions[t, n, p, 0, w]
                    rho, v = extensions[t, n, p, 1, w], extensions[t, n, p, 2, w]
                    for parity in range(2):
                        like, other = (cos, -sin) if parity == 0 else (-sin, -cos)
                        y, z = rho * like * cos_a - v * other * sin_a, rho * like * sin_a + v * other * cos_a
                        for part in range(2):
                            x = -u * like * imaginary if part == 0 else u * like * real
                            wave = real if part == 0 else imaginary
                            out[0, parity, t, n, part, p, w] = x_0 * x + (y_0 * y + z_0 * z) * wave
                            out[1, parity, t, n, part, p, w] = x_1 * x + (y_1 * y + z_1 * z) * wave
                            out[2, parity, t, n, part, p, w] = x_2 * x + (y_2 * y + z_2 * z) * wave
