"""Regularised Stokeslets at points, and their gradients: forces and first moments of forces to velocities.

The kernel is G = (1/r + e^2/r^3) I + x x'/r^3 with r^2 = |x|^2 + e^2 (Cortez, SIAM J. Sci. Comput. 23:1204, 2001);
factors 1/(8 pi mu) are left to the caller. A first moment m of the forces in a blob, m[b, k] = force along b times
displacement along k, moves the fluid by -m[b, k] d_k G[a, b], and feels the gradients of the velocity in turn.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

__all__ = ["force_matrix", "moment_matrices"]


@compiled
def force_matrix(points: Samples, e2: Samples) -> Samples:
    """Velocities at points from unit forces at the same points, symmetric, (3 n, 3 n).

    Args:
        points: (n, 3), m.
        e2: square of the blob radius of each point, (n,); a pair takes the mean.
    """
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
    my, ym, mx, xm = np.empty((q, 3)), np.empty((q, 3)), np.empty((q, 3)), np.empty((q, 3))
    ymy, xmx = np.empty(q), np.empty(q)
    for i in range(n):
        for j in range(n):
            for c in range(3):
                x[c] = points[i, c] - points[j, c]
            square = 0.5 * (e2[i] + e2[j])
            r2 = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + square
            i3 = 1.0 / (r2 * math.sqrt(r2))
            i5 = i3 / r2
            i7 = i5 / r2
            # G = a_0(r) I + b_0(r) x x'; a_1 is the derivative of a_0 over r, and so on
            a_1, a_2 = -i3 - 3.0 * square * i5, 3.0 * i5 + 15.0 * square * i7
            b_0, b_1, b_2 = i3, -3.0 * i5, 15.0 * i7
            for s in range(q):
                xmx[s] = _contract(moments[j, s], x, mx[s], xm[s])
                for c in range(3):
                    value = a_1 * mx[s, c] + b_0 * xm[s, c] + b_1 * xmx[s] * x[c]
                    velocities[3 * i + c, q * j + s] = -value
            if j > i:
                continue
            for t in range(q):
                ymy[t] = _contract(moments[i, t], x, my[t], ym[t])
            for t in range(q):
                for s in range(q):
                    same, crossed, mm, ss, ms, sm = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                    for c in range(3):
                        mm += my[t, c] * mx[s, c]
                        ss += ym[t, c] * xm[s, c]
                        ms += my[t, c] * xm[s, c]
                        sm += ym[t, c] * mx[s, c]
                        for d in range(3):
                            same += moments[i, t, c, d] * moments[j, s, c, d]
                            crossed += moments[i, t, c, d] * moments[j, s, d, c]
                    value = a_2 * mm + a_1 * same + b_2 * ymy[t] * xmx[s] + b_1 * (ss + ms + sm) + b_0 * crossed
                    gradients[q * i + t, q * j + s] = -value
                    gradients[q * j + s, q * i + t] = -value
    return velocities, gradients
