"""Integrals of the ring modes over panels of an outline.

A panel is a polynomial through Gauss nodes, and so is the density on it. Where a target is close, the panel is halved
until every piece is shorter than its distance; on the target's own panel, pieces double away from it, and nodes crowd
towards the logarithm.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.rings import ring_modes

Target: TypeAlias = tuple[float, float, float]
"""x, rho, and the square of the blob radius."""
Panel: TypeAlias = tuple[Samples, Samples]
"""x and rho of the nodes."""
Rule: TypeAlias = tuple[Samples, Samples, Samples, Samples]
"""Nodes on [-1, 1], their barycentric weights, and a finer Gauss rule (abscissas, weights)."""
Work: TypeAlias = tuple[Samples, Samples, Samples, Samples]
"""Work space: cardinal functions, A_n, B_n, blocks of the modes."""


@compiled
def cardinals(u: float, nodes: Samples, barycentric: Samples, out: Samples) -> None:
    """Lagrange polynomials of the nodes at u, in barycentric form."""
    total = 0.0
    for j in range(nodes.size):
        difference = u - nodes[j]
        if difference == 0.0:
            out[:] = 0.0
            out[j] = 1.0
            return
        out[j] = barycentric[j] / difference
        total += out[j]
    for j in range(nodes.size):
        out[j] /= total


@compiled
def _add_piece(
    low: float,
    high: float,
    power: int,
    centre: float,
    target: Target,
    panel: Panel,
    rule: Rule,
    work: Work,
    block: Samples,
) -> None:
    """Add the integral over u in [low, high] of one panel to `block` (modes, 3, 3 nodes).

    With power > 1, u = centre + (low or high - centre) w^power: nodes crowd at a logarithm at `centre`.
    """
    x, rho, e2 = target
    x_p, rho_p = panel
    nodes, barycentric, abscissas, weights = rule
    cardinal, a, b, k = work
    modes = k.shape[0]
    for q in range(abscissas.size):
        w = 0.5 * (1.0 + abscissas[q])
        if power > 1:
            reach = high - low if centre == low else low - high
            u = centre + reach * w**power
            weight = 0.5 * weights[q] * (high - low) * power * w ** (power - 1)
        else:
            u = low + (high - low) * w
            weight = 0.5 * weights[q] * (high - low)
        cardinals(u, nodes, barycentric, cardinal)
        dx, delta = 0.0, 0.0  # of differences: they keep their digits where the target is a node
        for j in range(nodes.size):
            dx += cardinal[j] * (x - x_p[j])
            delta += cardinal[j] * (rho - rho_p[j])
        ring_modes(dx, delta, rho, rho - delta, e2, modes, a, b, k)
        weight *= rho - delta
        for m in range(modes):
            for c in range(3):
                for d in range(3):
                    value = weight * k[m, c, d]
                    for j in range(nodes.size):
                        block[m, c, 3 * j + d] += value * cardinal[j]


@compiled
def _position(u: float, panel: Panel, rule: Rule, cardinal: Samples) -> tuple[float, float]:
    cardinals(u, rule[0], rule[1], cardinal)
    x, rho = 0.0, 0.0
    for j in range(cardinal.size):
        x += cardinal[j] * panel[0][j]
        rho += cardinal[j] * panel[1][j]
    return x, rho


@compiled
def is_near(low: float, high: float, target: Target, panel: Panel, rule: Rule, cardinal: Samples) -> bool:
    """Whether the target is closer to a piece of a panel than the piece is long."""
    x_a, rho_a = _position(low, panel, rule, cardinal)
    x_m, rho_m = _position(0.5 * (low + high), panel, rule, cardinal)
    x_b, rho_b = _position(high, panel, rule, cardinal)
    length = math.hypot(x_m - x_a, rho_m - rho_a) + math.hypot(x_b - x_m, rho_b - rho_m)
    distance = math.hypot(x_m - target[0], rho_m - target[1])
    return distance * distance + target[2] < 2.25 * length * length


@compiled
def _own_panel(u_0: float, target: Target, panel: Panel, rule: Rule, work: Work, block: Samples) -> None:
    """Integrals over the panel that the target lies on: towards both ends, in pieces that double."""
    shorter = min(1.0 - u_0, 1.0 + u_0, 0.2)
    for side in (-1.0, 1.0):
        reach = 1.0 - side * u_0
        step = min(shorter, reach)
        done = 0.0
        while done < reach * (1.0 - 1e-12):
            upto = step if done == 0.0 else min(2.0 * done, reach)
            if reach - upto < 0.3 * (upto - done):
                upto = reach
            low, high = (u_0 + done, u_0 + upto) if side > 0 else (u_0 - upto, u_0 - done)
            _add_piece(low, high, 6 if done == 0.0 else 1, u_0, target, panel, rule, work, block)
            done = upto


@compiled
def next_piece(
    stack: Samples, depth: int, smallest: float, target: Target, panel: Panel, rule: Rule, cardinal: Samples
) -> int:
    """Halve the piece on top of a stack of pieces (low, high) until it is shorter than its distance from the target.

    Returns:
        Place of that piece, which is also how many are left below it.
    """
    depth -= 1
    while depth < 60 and stack[depth, 1] - stack[depth, 0] > smallest:
        low, high = stack[depth, 0], stack[depth, 1]
        if not is_near(low, high, target, panel, rule, cardinal):
            break
        middle = 0.5 * (low + high)
        stack[depth, 0], stack[depth, 1] = middle, high
        depth += 1
        stack[depth, 0], stack[depth, 1] = low, middle
    return depth


@compiled
def _other_panel(target: Target, panel: Panel, rule: Rule, work: Work, block: Samples) -> None:
    """Integrals over a panel that the target lies off: halved until each piece is shorter than its distance."""
    stack = np.empty((64, 2))
    stack[0, 0], stack[0, 1] = -1.0, 1.0
    one = int(1.0)  # no literal: for each value of a literal, callees are compiled once more
    depth = one
    while depth > 0:
        depth = next_piece(stack, depth, 1e-9, target, panel, rule, work[0])
        low, high = stack[depth, 0], stack[depth, 1]
        _add_piece(low, high, one, low, target, panel, rule, work, block)


@compiled
def _far_panel(target: Target, panel: Panel, weights: Samples, work: Work, block: Samples) -> None:
    """Integrals over a panel by its own nodes."""
    x, rho, e2 = target
    x_p, rho_p = panel
    _, a, b, k = work
    for j in range(x_p.size):
        ring_modes(x - x_p[j], rho - rho_p[j], rho, rho_p[j], e2, k.shape[0], a, b, k)
        weight = weights[j] * rho_p[j]
        for m in range(k.shape[0]):
            for c in range(3):
                for d in range(3):
                    block[m, c, 3 * j + d] = weight * k[m, c, d]


@compiled
def layer_blocks(
    x: Samples,
    rho: Samples,
    own: np.ndarray,
    x_p: Samples,
    rho_p: Samples,
    e2: float,
    modes: int,
    rule: Rule,
    panel_weights: Samples,
) -> Samples:
    """Velocities of every mode at rings, from a single layer on the panels of outlines.

    The density is interpolated between the panel's nodes and multiplied by the length of du, so that the integrals
    are over rho du.

    Args:
        x: targets, (t,).
        rho: targets, (t,).
        own: index of the node that a target is, panel by panel; -1 for a target off the outline.
        x_p: nodes of the panels, (panels, p).
        rho_p: nodes of the panels, (panels, p).
        e2: square of the blob radius.
        modes: number of modes.
        rule: nodes on [-1, 1], their barycentric weights, and a finer Gauss rule (abscissas, weights).
        panel_weights: Gauss weights of the nodes.

    Returns:
        (modes, 3 t, 3 panels p).
    """
    panels, p = x_p.shape
    blocks = np.zeros((modes, 3 * x.size, 3 * panels * p))
    a, b, k = np.empty(modes + 1), np.empty(modes + 1), np.empty((modes, 3, 3))
    work = (np.empty(p), a, b, k)
    block = np.empty((modes, 3, 3 * p))
    for i in range(x.size):
        target = (x[i], rho[i], e2)
        for q in range(panels):
            panel = (x_p[q], rho_p[q])
            start = 3 * p * q
            is_own = own[i] >= 0 and own[i] // p == q
            block[:] = 0.0
            if is_own:
                _own_panel(rule[0][own[i] % p], target, panel, rule, work, block)
            elif is_near(-1.0, 1.0, target, panel, rule, work[0]):
                _other_panel(target, panel, rule, work, block)
            else:
                _far_panel(target, panel, panel_weights, work, block)
            for m in range(modes):
                for c in range(3):
                    for j in range(3 * p):
                        blocks[m, 3 * i + c, start + j] = block[m, c, j]
    return blocks
