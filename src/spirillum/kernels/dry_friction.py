"""Rates of two rigid links on which dry friction acts: the root of a balance of forces, compiled.

    A q + sum_c mu_c N_c J_c' J_c q/sqrt(q' J_c' J_c q + v_r^2) = f

for seven rates q, with N_c the loads at contacts and J_c q their sliding velocities (2,). Where A is symmetric the left
side is the gradient of a convex function. A joint friction as printed in (15) makes A unsymmetric, still with a
positive definite symmetric part.
"""

from __future__ import annotations

import math

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.rigid_links import solved

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
def _tangent(a: Samples, loads: Samples, rows: Samples, slow: float, duals: Samples, q: Samples, h: Samples) -> None:
    """The derivative of the balance in q, with the direction of sliding replaced by the duals w in one place.

    mu_c N_c J_c' (1 - (w v' + v w')/(2 s)) J_c/s with v = J_c q, s = sqrt(|v|^2 + v_r^2), |w| <= 1: positive definite,
    and the derivative itself where w = v/s.
    """
    for i in range(7):
        for j in range(7):
            h[i, j] = a[i, j]
    for c in range(loads.size):
        u, v, k = sliding_force(rows[c], q, loads[c], slow)
        less = 0.5 * k / math.sqrt(u * u + v * v + slow * slow)
        w_u, w_v = duals[2 * c], duals[2 * c + 1]
        uu, uv, vv = k - 2.0 * less * w_u * u, -less * (w_u * v + w_v * u), k - 2.0 * less * w_v * v
        for i in range(7):
            x = rows[c, 0, i] * uu + rows[c, 1, i] * uv
            z = rows[c, 0, i] * uv + rows[c, 1, i] * vv
            for j in range(7):
                h[i, j] += x * rows[c, 0, j] + z * rows[c, 1, j]


@compiled
def _duals_moved(loads: Samples, rows: Samples, slow: float, q: Samples, step: Samples, duals: Samples) -> None:
    """Newton's step of the duals, s w = v at the step of q, kept in the unit circle."""
    for c in range(loads.size):
        u, v, _ = sliding_force(rows[c], q, loads[c], slow)
        du, dv = 0.0, 0.0
        for i in range(7):
            du += rows[c, 0, i] * step[i]
            dv += rows[c, 1, i] * step[i]
        s = math.sqrt(u * u + v * v + slow * slow)
        change = (u * du + v * dv) / s
        w_u, w_v = duals[2 * c], duals[2 * c + 1]
        more_u, more_v = (u + du - w_u * change) / s - w_u, (v + dv - w_v * change) / s - w_v
        # The largest share of the step that stays in the unit circle.
        square, product = more_u * more_u + more_v * more_v, w_u * more_u + w_v * more_v
        room = max(1.0 - w_u * w_u - w_v * w_v, 0.0)
        share = 1.0
        if square > 0.0:
            share = min(1.0, (math.sqrt(product * product + square * room) - product) / square)
        duals[2 * c], duals[2 * c + 1] = w_u + share * more_u, w_v + share * more_v


@compiled
def _along(r: Samples, step: Samples, skipped: int) -> float:
    """Residual along a step: the derivative of the convex function."""
    found = 0.0
    for i in range(7):
        if i != skipped:
            found += r[i] * step[i]
    return found


@compiled
def _stepped(
    a: Samples,
    force: Samples,
    loads: Samples,
    rows: Samples,
    slow: float,
    skipped: int,
    step: Samples,
    q: Samples,
    r: Samples,
    trial: Samples,
) -> float:
    """Move q along a step to where the residual along it is small; the residual's size. It grows along the step."""
    begin = _along(r, step, skipped)
    low, high, share, size = 0.0, math.inf, 1.0, 0.0
    for _ in range(60):
        for i in range(7):
            trial[i] = q[i] + share * step[i]
        size = residual(a, force, loads, rows, slow, skipped, trial, r)
        here = _along(r, step, skipped)
        if here <= -0.5 * abs(begin):
            low = share
        elif here > 0.5 * abs(begin):
            high = share
        else:
            break
        if math.isinf(high):
            break
        share = 0.5 * (low + high)
    for i in range(7):
        q[i] = trial[i]
    return size


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

    Newton's method for rates and duals w, the directions of sliding (T. F. Chan, G. H. Golub, P. Mulet, SIAM J. Sci.
    Comput. 20:1964, 1999), which converges for any v_r. Where the spin q_3 + q_6 is prescribed, q has it at first and
    keeps it, and a torque along one rate is left as that row's residual.

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
        work: (77 + 2 n,) or more.

    Returns:
        What is left of the forces, over them.
    """
    h, b, step, trial = work[0:49].reshape(7, 7), work[49:63].reshape(7, 2), work[63:70], work[70:77]
    duals = work[77:]
    skipped = along if constrained else -1
    size = residual(a, force, loads, rows, slow, skipped, q, r)
    scale = max(_scale(a, force, loads, rows, q), 1e-300)
    for c in range(loads.size):
        u, v, _ = sliding_force(rows[c], q, loads[c], slow)
        s = math.sqrt(u * u + v * v + slow * slow)
        duals[2 * c], duals[2 * c + 1] = u / s, v / s
    for _ in range(_ROUNDS):
        if size <= _BALANCED * scale:
            break
        _tangent(a, loads, rows, slow, duals, q, h)
        _direction(h, r, along, constrained, b)
        for i in range(7):
            step[i] = b[i, 0]
        _duals_moved(loads, rows, slow, q, step, duals)
        before = size
        size = _stepped(a, force, loads, rows, slow, skipped, step, q, r, trial)
        if size > 0.5 * before and size <= 1e4 * _BALANCED * scale:
            break  # rounding
    return size / scale
