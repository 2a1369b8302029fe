"""Regularised Stokeslets at points, and their gradients: forces and first moments of forces to velocities.

The kernel is G = (1/r + e^2/r^3) I + x x'/r^3 with r^2 = |x|^2 + e^2 (Cortez, SIAM J. Sci. Comput. 23:1204, 2001);
factors 1/(8 pi mu) are left to the caller. A first moment m of the forces in a blob, m[b, k] = force along b times
displacement along k, moves the fluid by -m[b, k] d_k G[a, b], and feels the gradients of the velocity in turn.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

Contracted: TypeAlias = tuple[Samples, Samples, Samples]
"""Of each moment m and a vector x: m x, x m, and x m x."""


@compiled
def force_matrix(points: Samples, e2: Samples) -> Samples:
    """Velocities at points from unit forces at the same points, symmetric, (3 n, 3 n)."""
    n = points.shape[0]
    matrix = np.empty((3 * n, 3 * n))
    x = np.empty(3)
    for i in range(n):
        for j in range(i + 1):
            for c in range(3):
                x[c] = points[i, c] - points[j, c]
            square = 0.5 * (e2[i] + e2[j])
            r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + square
            cube = 1.0 / (r2 * math.sqrt(r2))
            diagonal = (r2 + square) * cube
            for c in range(3):
                for d in range(3):
                    value = x[c] * x[d] * cube
                    if c == d:
                        value += diagonal
                    matrix[3 * i + c, 3 * j + d] = value
                    matrix[3 * j + d, 3 * i + c] = value
    return matrix


@compiled
def _contract(moment: Samples, x: Samples, mx: Samples, xm: Samples) -> float:
    """Fill mx[b] = m[b, k] x_k and xm[k] = m[b, k] x_b; return x m x."""
    total = 0.0
    for c in range(3):
        mx[c], xm[c] = 0.0, 0.0
        for d in range(3):
            mx[c] += moment[c, d] * x[d]
            xm[c] += moment[d, c] * x[d]
        total += mx[c] * x[c]
    return total


@compiled
def _moment_velocities(x: Samples, square: float, r2: float, there: Contracted, block: Samples) -> None:
    """Fill block (3, q) with the velocities at x from unit moments."""
    mx, xm, xmx = there
    i3 = 1.0 / (r2 * math.sqrt(r2))
    i5 = i3 / r2
    # G = a_0(r) I + b_0(r) x x'; a_1 is the derivative of a_0 over r, and so on
    a_1, b_0, b_1 = -i3 - 3.0 * square * i5, i3, -3.0 * i5
    for s in range(block.shape[1]):
        for c in range(3):
            block[c, s] = -(a_1 * mx[s, c] + b_0 * xm[s, c] + b_1 * xmx[s] * x[c])


@compiled
def _moment_gradients(
    square: float,
    r2: float,
    here: Contracted,
    there: Contracted,
    moments_here: Samples,
    moments_there: Samples,
    block: Samples,
) -> None:
    """Fill block (q, q) with the velocity gradients along moments here from unit moments there."""
    my, ym, ymy = here
    mx, xm, xmx = there
    i3 = 1.0 / (r2 * math.sqrt(r2))
    i5 = i3 / r2
    i7 = i5 / r2
    a_1, a_2 = -i3 - 3.0 * square * i5, 3.0 * i5 + 15.0 * square * i7
    b_0, b_1, b_2 = i3, -3.0 * i5, 15.0 * i7
    q = block.shape[0]
    for t in range(q):
        for s in range(q):
            same, crossed, outer, mixed = 0.0, 0.0, 0.0, 0.0
            for c in range(3):
                outer += my[t, c] * mx[s, c]
                mixed += ym[t, c] * xm[s, c] + my[t, c] * xm[s, c] + ym[t, c] * mx[s, c]
                for d in range(3):
                    same += moments_here[t, c, d] * moments_there[s, c, d]
                    crossed += moments_here[t, c, d] * moments_there[s, d, c]
            value = a_2 * outer + a_1 * same + b_2 * ymy[t] * xmx[s] + b_1 * mixed + b_0 * crossed
            block[t, s] = -value


@compiled
def moment_matrices(points: Samples, e2: Samples, moments: Samples) -> tuple[Samples, Samples]:
    """What unit first moments at points do.

    Args:
        points: (n, 3), m.
        e2: square of the blob radius of each point, (n,); a pair takes the mean.
        moments: trace-free tensors of the moments at each point, (n, q, 3, 3).

    Returns:
        Velocities, (3 n, q n), and velocity gradients along the moments, symmetric, (q n, q n).
    """
    n, q = moments.shape[:2]
    velocities, gradients = np.empty((3 * n, q * n)), np.empty((q * n, q * n))
    x = np.empty(3)
    here, there = (np.empty((q, 3)), np.empty((q, 3)), np.empty(q)), (np.empty((q, 3)), np.empty((q, 3)), np.empty(q))
    for i in range(n):
        for j in range(n):
            for c in range(3):
                x[c] = points[i, c] - points[j, c]
            square = 0.5 * (e2[i] + e2[j])
            r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + square
            for s in range(q):
                there[2][s] = _contract(moments[j, s], x, there[0][s], there[1][s])
            _moment_velocities(x, square, r2, there, velocities[3 * i : 3 * i + 3, q * j : q * j + q])
            if j > i:
                continue
            for t in range(q):
                here[2][t] = _contract(moments[i, t], x, here[0][t], here[1][t])
            block = gradients[q * i : q * i + q, q * j : q * j + q]
            _moment_gradients(square, r2, here, there, moments[i], moments[j], block)
            if j < i:
                for s in range(q):
                    for t in range(q):
                        gradients[q * j + s, q * i + t] = block[t, s]
    return velocities, gradients
