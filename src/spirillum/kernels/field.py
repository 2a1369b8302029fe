"""Velocity and pressure at points, from a single layer on solids of revolution and from blobs along wires.

Both come without factors: velocity times 8 pi mu, pressure times 8 pi. All cores share the points.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Amplitudes, Samples
from spirillum.kernels.compiled import compiled, compiled_by_rows
from spirillum.kernels.panels import Panel, cardinals, is_near, next_piece
from spirillum.kernels.rings import ring_b_v, ring_modes


@compiled_by_rows(0, 4)
def add_blobs(points: Samples, sources: Samples, forces: Samples, e2: Samples, field: Samples) -> None:
    """Add the flow of regularised Stokeslets; p = (x.f)(2 r^2 + 3 e^2)/r^5 (Cortez, 2001).

    Args:
        points: (n, 3).
        sources: (s, 3).
        forces: (s, 3).
        e2: square of the blob radius of each source.
        field: velocity and pressure to add to, (n, 4).
    """
    for i in range(points.shape[0]):
        u, v, w, pressure = field[i, 0], field[i, 1], field[i, 2], field[i, 3]
        for j in range(sources.shape[0]):
            x = points[i, 0] - sources[j, 0]
            y = points[i, 1] - sources[j, 1]
            z = points[i, 2] - sources[j, 2]
            r2 = x * x + y * y + z * z + e2[j]
            cube = 1.0 / (r2 * math.sqrt(r2))
            dot = x * forces[j, 0] + y * forces[j, 1] + z * forces[j, 2]
            diagonal = (r2 + e2[j]) * cube
            u += diagonal * forces[j, 0] + dot * cube * x
            v += diagonal * forces[j, 1] + dot * cube * y
            w += diagonal * forces[j, 2] + dot * cube * z
            pressure += dot * cube * (2.0 + 3.0 * e2[j] / r2)
        field[i, 0], field[i, 1], field[i, 2], field[i, 3] = u, v, w, pressure


@compiled_by_rows(0, 4)
def add_moments(points: Samples, sources: Samples, moments: Samples, e2: Samples, field: Samples) -> None:
    """Add the flow of first moments m of forces: u_a = -m[b, k] d_k G[a, b], and the pressure that goes with it.

    Args:
        points: (n, 3).
        sources: (s, 3).
        moments: trace-free, force by displacement, (s, 3, 3).
        e2: square of the blob radius of each source.
        field: velocity and pressure to add to, (n, 4).
    """
    for i in range(points.shape[0]):
        for j in range(sources.shape[0]):
            x = (points[i, 0] - sources[j, 0], points[i, 1] - sources[j, 1], points[i, 2] - sources[j, 2])
            r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + e2[j]
            i3 = 1.0 / (r2 * math.sqrt(r2))
            i5 = i3 / r2
            along = 0.0
            for c in range(3):
                mx, xm = 0.0, 0.0
                for d in range(3):
                    mx += moments[j, c, d] * x[d]
                    xm += moments[j, d, c] * x[d]
                along += mx * x[c]
                field[i, c] += (i3 + 3.0 * e2[j] * i5) * mx - i3 * xm
            for c in range(3):
                field[i, c] += 3.0 * i5 * along * x[c]
            field[i, 3] += along * (6.0 + 15.0 * e2[j] / r2) * i5


@compiled
def _add_ring(
    dx: float,
    delta: float,
    rho: float,
    rho_s: float,
    theta: float,
    weight: float,
    density: Amplitudes,
    work: tuple[Samples, Samples, Samples],
    out: Samples,
) -> None:
    """Add the flow of one ring with complex densities (modes, 3): cylindrical velocity and pressure."""
    a, b, k = work
    near2 = dx * dx + delta * delta
    zeta = math.acosh(1.0 + near2 / (2.0 * max(rho * rho_s, 1e-300)))
    modes = min(density.shape[0], 3 + int(25.0 / max(zeta, 1e-3)))  # the others are below exp(-25)
    ring_modes(dx, delta, rho, rho_s, 0.0, modes, a, b, k)
    rho, rho_s = max(rho, 1e-14 * (abs(dx) + rho + rho_s)), max(rho_s, 1e-14 * (abs(dx) + rho + rho_s))
    p = rho * rho_s
    for m in range(modes):
        c, s = math.cos(m * theta), math.sin(m * theta)
        for d in range(3):
            real = density[m, d].real * c - density[m, d].imag * s
            quadrature = -(density[m, d].real * s + density[m, d].imag * c)
            out[0] += weight * k[m, 0, d] * real
            out[1] += weight * k[m, 1, d] * real
            out[2] += weight * k[m, 2, d] * quadrature
            if d == 0:
                push = dx * b[m]
            elif d == 1:
                push = delta * b[m] - rho * ring_b_v(m, a, b, near2, p)
            else:
                push = m * a[m] / rho_s
            out[3] += 2.0 * weight * push * real


@compiled
def _panel_field(
    point: tuple[float, float, float], panel: Panel, density: Amplitudes, rule: tuple[Samples, ...], out: Samples
) -> None:
    """Add the flow of one panel, halved until each piece is shorter than its distance from the point."""
    x, rho, theta = point
    x_p, rho_p = panel
    nodes, barycentric, abscissas, weights, panel_weights = rule
    p, modes = nodes.size, density.shape[1]
    cardinal, local = np.empty(p), np.empty((modes, 3), dtype=np.complex128)
    work = (np.empty(modes + 1), np.empty(modes + 1), np.empty((modes, 3, 3)))
    near = (nodes, barycentric, abscissas, weights)
    target = (x, rho, 0.0)
    if not is_near(-1.0, 1.0, target, panel, near, cardinal):
        for j in range(p):
            weight = panel_weights[j] * rho_p[j]
            _add_ring(x - x_p[j], rho - rho_p[j], rho, rho_p[j], theta, weight, density[j], work, out)
        return
    stack = np.empty((64, 2))
    stack[0, 0], stack[0, 1] = -1.0, 1.0
    depth = int(1.0)  # no literal, see `panels`
    while depth > 0:
        depth = next_piece(stack, depth, 1e-6, target, panel, near, cardinal)
        low, high = stack[depth, 0], stack[depth, 1]
        for q in range(abscissas.size):
            u = low + 0.5 * (high - low) * (1.0 + abscissas[q])
            cardinals(u, nodes, barycentric, cardinal)
            dx, delta = 0.0, 0.0
            for j in range(p):
                dx += cardinal[j] * (x - x_p[j])
                delta += cardinal[j] * (rho - rho_p[j])
            for m in range(modes):
                for d in range(3):
                    local[m, d] = 0.0
                    for j in range(p):
                        local[m, d] += cardinal[j] * density[j, m, d]
            weight = 0.5 * weights[q] * (high - low) * (rho - delta)
            _add_ring(dx, delta, rho, rho - delta, theta, weight, local, work, out)


@compiled_by_rows(0, 5)
def add_layer(
    points: Samples, x_p: Samples, rho_p: Samples, density: Amplitudes, rule: tuple[Samples, ...], field: Samples
) -> None:
    """Add the flow of a single layer on panels.

    Args:
        points: (n, 3).
        x_p: nodes of the panels, (panels, p).
        rho_p: nodes of the panels, (panels, p).
        density: complex modes (f_x, f_rho, g) ds/du on the nodes, (panels, p, modes, 3).
        rule: nodes, barycentric weights, finer abscissas and weights, Gauss weights of the nodes.
        field: velocity and pressure to add to, (n, 4).
    """
    for i in range(points.shape[0]):
        theta = math.atan2(points[i, 2], points[i, 1])
        point = (points[i, 0], math.hypot(points[i, 1], points[i, 2]), theta)
        out = np.zeros(4)
        for q in range(x_p.shape[0]):
            _panel_field(point, (x_p[q], rho_p[q]), density[q], rule, out)
        c, s = math.cos(theta), math.sin(theta)
        field[i, 0] += out[0]
        field[i, 1] += out[1] * c - out[2] * s
        field[i, 2] += out[1] * s + out[2] * c
        field[i, 3] += out[3]
