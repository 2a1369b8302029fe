"""Rates of two rigid links on which dry friction acts: the root of a balance of forces, compiled.

    A q + sum_c mu_c N_c J_c' J_c q/sqrt(|J_c q|^2 + v_r^2) = f

for seven rates q, with N_c the loads at contacts and J_c q their sliding velocities (2,). Where A is symmetric the left
side is the gradient of a convex function. A joint friction as printed in (15) makes A unsymmetric, still with a
positive definite symmetric part.
"""

from __future__ import annotations

import math

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.rigid_links import solved

__all__ = ["balanced", "residual", "sliding_force"]

_ROUNDS = 80
"""Steps of the iteration at most."""
_BALANCED = 1e-13
"""What may be left of the forces."""


@compiled
def sliding_force(rows: Samples, q: Samples, load: float, slow: float) -> tuple[float, float, float]:
    """Sliding velocity at a contact (2 numbers, m/s), and its dry friction over it, N s/m.

    Args:
        rows: J_c, (2, 7).
        q: rates.
        load: mu_c N_c, N.
        slow: v_r, m/s.
    """
    u, v = 0.0, 0.0
    for i in range(7):
        u += rows[0, i] * q[i]
        v += rows[1, i] * q[i]
    return u, v, load / math.sqrt(u * u + v * v + slow * slow)


@compiled
def residual(
    a: Samples, force: Samples, loads: Samples, rows: Samples, slow: float, skipped: int, q: Samples, r: Samples
) -> float:
    """What rates leave of the balance, into `r`; its size, in the measure of A's diagonal, without the skipped row.

    Args:
        a: A, (7, 7).
        force: f, (7,).
        loads: mu_c N_c, (n,).
        rows: J_c, (n, 2, 7).
        slow: v_r, m/s.
        skipped: a row that does not count, or -1.
        q: rates, (7,).
        r: result, (7,).
    """
    for i in range(7):
        r[i] = -force[i]
        for j in range(7):
            r[i] += a[i, j] * q[j]
    for c in range(loads.size):
        u, v, k = sliding_force(rows[c], q, loads[c], slow)
        for i in range(7):
            r[i] += k * (rows[c, 0, i] * u + rows[c, 1, i] * v)
    size = 0.0
    for i in range(7):
        if i != skipped:
            size += r[i] * r[i] / a[i, i]
    return math.sqrt(size)


@compiled
def _scale(a: Samples, force: Samples, loads: Samples, rows: Samples, q: Samples) -> float:
    """Size of the forces that balance, in the measure of A's diagonal."""
    found = 0.0
    for i in range(7):
        row = abs(force[i])
        for c in range(loads.size):
            row += loads[c] * (abs(rows[c, 0, i]) + abs(rows[c, 1, i]))
        for j in range(7):
            row = max(row, abs(a[i, j] * q[j]))
        found += row * row / a[i, i]
    return math.sqrt(found)


@compiled
def _tangent(
    a: Samples,
    loads: Samples,
    rows: Samples,
    slow: float,
    newton: bool,  # noqa: FBT001 - compiled
    q: Samples,
    h: Samples,
) -> None:
    """The derivative of the balance in q; without `newton` that of dry friction at its present coefficient."""
    for i in range(7):
        for j in range(7):
            h[i, j] = a[i, j]
    for c in range(loads.size):
        u, v, k = sliding_force(rows[c], q, loads[c], slow)
        less = k / (u * u + v * v + slow * slow) if newton else 0.0
        for i in range(7):
            s, t = rows[c, 0, i], rows[c, 1, i]
            w = less * (s * u + t * v)
            for j in range(7):
                h[i, j] += k * (s * rows[c, 0, j] + t * rows[c, 1, j]) - w * (rows[c, 0, j] * u + rows[c, 1, j] * v)


@compiled
def _direction(h: Samples, r: Samples, along: int, constrained: bool, b: Samples) -> None:  # noqa: FBT001 - compiled
    """The step -H^-1 r into the first column of `b`; where the spin is prescribed, with a torque that keeps it."""
    for i in range(7):
        b[i, 0], b[i, 1] = -r[i], 0.0
    b[along, 1] = 1.0
    solved(h, b)
    if constrained:
        torque = -(b[3, 0] + b[6, 0]) / (b[3, 1] + b[6, 1])
        for i in range(7):
            b[i, 0] += torque * b[i, 1]


@compiled
def balanced(
    a: Samples,
    force: Samples,
    loads: Samples,
    rows: Samples,
    slow: float,
    along: int,
    constrained: bool,  # noqa: FBT001 - compiled
    q: Samples,
    r: Samples,
    work: Samples,
) -> float:
    """Find the rates.

    Newton's step where it lessens the residual; else one with dry friction at its present coefficient, which always
    lessens the convex function. Where the spin q_3 + q_6 is prescribed, q has it at first and keeps it, and a torque
    along one rate is left as that row's residual.

    Args:
        a: A, (7, 7).
        force: f, (7,).
        loads: mu_c N_c, (n,).
        rows: J_c, (n, 2, 7).
        slow: v_r, m/s.
        along: the rate along which a torque keeps a prescribed spin.
        constrained: whether the spin is prescribed.
        q: first guess, and the result, (7,).
        r: result, the residual, (7,).
        work: (70,).

    Returns:
        What is left of the forces, over them.
    """
    h, b, trial = work[0:49].reshape(7, 7), work[49:63].reshape(7, 2), work[63:70]
    skipped = along if constrained else -1
    size = residual(a, force, loads, rows, slow, skipped, q, r)
    scale = max(_scale(a, force, loads, rows, q), 1e-300)
    newton = True
    for _ in range(_ROUNDS):
        if size <= _BALANCED * scale:
            break
        _tangent(a, loads, rows, slow, newton, q, h)
        _direction(h, r, along, constrained, b)
        step, found = 1.0, math.inf
        for _ in range(3 if newton else 1):
            for i in range(7):
                trial[i] = q[i] + step * b[i, 0]
            found = residual(a, force, loads, rows, slow, skipped, trial, r)
            if found <= (1.0 - 0.3 * step) * size:
                break
            step *= 0.5
        if newton and found > 0.9 * size:
            if size <= 1e3 * _BALANCED * scale:
                break  # rounding
            newton = False
            residual(a, force, loads, rows, slow, skipped, q, r)
            continue
        newton, size = True, found
        for i in range(7):
            q[i] = trial[i]
    return residual(a, force, loads, rows, slow, skipped, q, r) / scale
