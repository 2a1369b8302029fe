"""Resistance of a robot anywhere in its tube from its table, compiled: film plus interpolated rest.

A place is the offset e of the body's mid-length from the tube's axis, pitch p (nose up), yaw psi (nose to the side) and
phase phi of the tail. The rest is interpolated over

    t = 1 - e/e_c(p), 0 where a robot without yaw touches the floor of the tube, 1 on its axis,
    f = p/p_hi(t) nose up or p/p_lo(t) nose down, 1 at the largest pitch of the table.

Its Cholesky factor, logarithms on the diagonal, is a polynomial in sqrt(t) and in log(1.3 - f) between the nodes,
linear in t below the first, quadratic in yaw, and a Fourier sum in the phase: the rest is positive definite everywhere.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.film_table import film_at

__all__ = [
    "INSIDE",
    "MIRROR",
    "MOTIONS",
    "PARAMETERS",
    "TOO_FAR_PITCHED",
    "TOO_FAR_YAWED",
    "YAW_SLACK",
    "Parts",
    "Range",
    "contact_offset",
    "cut_of_film",
    "film_start",
    "mean_resistance_at",
    "mirror_image",
    "packed",
    "parts_of",
    "range_of",
    "resistance_at",
    "rest_coefficients",
    "shapes_of",
    "yaw_of",
]

MOTIONS = 8
"""U and Omega of the body, omega_m of the rotor against it, and the mean flow."""
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
"""Sign of each motion in a mirror to the side."""
PARAMETERS = MOTIONS * (MOTIONS + 1) // 2
"""Entries of a Cholesky factor."""
INSIDE, TOO_FAR_PITCHED, TOO_FAR_YAWED = 0, 1, 2
_PITCH_SLACK = 1.1  # of the largest pitch: the tail's tip touches the glass a little beyond it
_BEYOND = 1.3  # beyond the largest pitch, so that the logarithm stays finite at contact
YAW_SLACK = 2.0  # of the yaw at which the rest was computed

# Header of a packed table: radius of the tube, yaw of the yawed places, rows, and the lengths of what follows.
_RADIUS, _YAW, _RINGS, _GAPS, _UP, _DOWN, _PHASES, _YAW_GAPS, _YAW_PITCHES = 0, 1, 2, 3, 4, 5, 6, 7, 8
_HEADER = 9
_MOST = 12  # nodes in one direction


def packed(
    radius: float,
    yaw: float,
    rings: Samples,
    gaps: Samples,
    up: Samples,
    down: Samples,
    most: Samples,
    rest: Samples,
    yaw_gaps: Samples,
    yaw_pitches: Samples,
    yawed: Samples,
    film: Samples,
) -> Samples:
    """One array for `resistance_at`.

    Args:
        radius: R of the tube, m.
        yaw: at which yawed places were computed, rad.
        rings: of `contact_offset`, (n, 4).
        gaps: nodes t, increasing, the last is 1.
        up: nodes f nose up, the first is 0.
        down: nodes f nose down, the first is 0.
        most: largest pitches nose up and nose down (positive) at the nodes t, (gaps, 2), rad.
        rest: parameters of the factor, (gaps, up + down - 1, phases, 36): Fourier coefficients 1, cos, sin, cos 2, ...;
            pitches in the order of `up`, then `down` without its first.
        yaw_gaps: nodes t of the yawed places.
        yaw_pitches: nodes of signed f of the yawed places.
        yawed: first and second derivatives (halved) with yaw, (yaw gaps, yaw pitches, 2, phases, 36).
        film: packed film.
    """
    header = [radius, yaw, len(rings), gaps.size, up.size, down.size, rest.shape[2], yaw_gaps.size, yaw_pitches.size]
    parts = (np.array(header, dtype=float), rings, gaps, up, down, most, yaw_gaps, yaw_pitches, rest, yawed, film)
    return np.concatenate([np.ravel(part) for part in parts])


class Range(NamedTuple):
    """Where a table holds."""

    gaps: Samples
    """Gaps of a level robot at which the next two are stated, (n,), m."""
    up: Samples
    """Largest pitch nose up, (n,), rad."""
    down: Samples
    """Largest pitch nose down, positive, (n,), rad."""
    yaw: float
    """Largest yaw to either side, rad."""


def range_of(table: Samples) -> Range:
    """Where a packed table holds."""
    at_gaps = _HEADER + 4 * int(table[_RINGS])
    gaps = int(table[_GAPS])
    at_most = at_gaps + gaps + int(table[_UP] + table[_DOWN])
    most = table[at_most : at_most + 2 * gaps].reshape(gaps, 2)
    room = contact_offset(table[_HEADER:at_gaps].reshape(-1, 4), float(table[_RADIUS]), 0.0)
    return Range(table[at_gaps : at_gaps + gaps] * room, most[:, 0], most[:, 1], YAW_SLACK * yaw_of(table))


class Parts(NamedTuple):
    """What a packed table is made of."""

    nodes: Samples
    """Head, rings and nodes."""
    rest: Samples
    """(gaps, up + down - 1, phases, 36)."""
    yawed: Samples
    """(yaw gaps, yaw pitches, 2, phases, 36)."""
    film: Samples
    """Packed film."""

    def packed(self) -> Samples:
        """All in one array again."""
        return np.concatenate([self.nodes, self.rest.ravel(), self.yawed.ravel(), self.film])


def shapes_of(table: Samples) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Shapes of `rest` and `yawed` of a packed table, or of its nodes."""
    gaps, pitches = int(table[_GAPS]), int(table[_UP] + table[_DOWN]) - 1
    yaw_gaps, yaw_pitches, phases = int(table[_YAW_GAPS]), int(table[_YAW_PITCHES]), int(table[_PHASES])
    return (gaps, pitches, phases, PARAMETERS), (yaw_gaps, yaw_pitches, 2, phases, PARAMETERS)


def yaw_of(table: Samples) -> float:
    """Yaw at which yawed places were computed, rad."""
    return float(table[_YAW])


def parts_of(table: Samples) -> Parts:
    """The parts of a packed table."""
    shapes, film = shapes_of(table), film_start(table)
    yawed = film - int(np.prod(shapes[1]))
    rest = yawed - int(np.prod(shapes[0]))
    return Parts(table[:rest], table[rest:yawed].reshape(shapes[0]), table[yawed:film].reshape(shapes[1]), table[film:])


def mirror_image(table: Samples) -> Samples:
    """The packed table of the mirror image to the side.

    Motions to the side and turns out of it change their signs, a yaw is one to the other side, and a tail at the phase
    phi is one at pi - phi.
    """
    parts = parts_of(table)
    row, column = np.tril_indices(MOTIONS)
    order = np.arange(parts.rest.shape[2])
    harmonic = (order + 1) // 2
    phases = np.where(order % 2 == 0, -1.0, 1.0) * (-1.0) ** harmonic  # of sin, of cos
    phases[0] = 1.0
    signs = phases[:, None] * (MIRROR[row] * MIRROR[column])
    yaws = np.array([-1.0, 1.0])[:, None, None]
    return parts._replace(rest=parts.rest * signs, yawed=parts.yawed * signs * yaws).packed()


@compiled
def contact_offset(rings: Samples, radius: float, pitch: float) -> float:
    """Offset e_c at which a body without yaw touches the floor of the tube, m.

    The body is the hull of rings about its axis, each the centre of an ellipse: (x, rho, semi-axis along, across), m.
    """
    return _contact_offset(rings.ravel(), 0, rings.shape[0], radius, pitch)


@compiled
def _contact_offset(data: Samples, start: int, count: int, radius: float, pitch: float) -> float:
    c, s = math.cos(pitch), math.sin(pitch)
    reach = -math.inf
    for i in range(count):
        x, rho = data[start + 4 * i], data[start + 4 * i + 1]
        along, across = data[start + 4 * i + 2] * s, data[start + 4 * i + 3] * c
        reach = max(reach, rho * c - x * s + math.sqrt(along * along + across * across))
    return float(radius - reach)


@compiled
def cut_of_film(t: float) -> float:
    """Share w of the film at t: 1 at contact, 0 on the axis, where no side is the nearer one."""
    if t >= 1.0:
        return 0.0
    left = 1.0 - max(t, 0.0) ** 2
    return left * left


@compiled
def _lagrange(data: Samples, start: int, count: int, x: float, out: Samples) -> None:
    """Lagrange weights of nodes at x."""
    for j in range(count):
        weight = 1.0
        for m in range(count):
            if m != j:
                weight *= (x - data[start + m]) / (data[start + j] - data[start + m])
        out[j] = weight


@compiled
def _steep(data: Samples, start: int, count: int, f: float, out: Samples) -> None:
    """Lagrange weights in log(1.3 - f): what nears the glass varies as the logarithm of its clearance."""
    at = math.log(_BEYOND - f)
    for j in range(count):
        weight = 1.0
        for m in range(count):
            if m != j:
                other = math.log(_BEYOND - data[start + m])
                weight *= (at - other) / (math.log(_BEYOND - data[start + j]) - other)
        out[j] = weight


@compiled
def _rooted(data: Samples, start: int, count: int, t: float, out: Samples) -> None:
    """Lagrange weights in the square root of t, linear in t below the first node."""
    at = math.sqrt(max(t, data[start]))
    for j in range(count):
        node = math.sqrt(data[start + j])
        weight = 1.0
        for m in range(count):
            if m != j:
                other = math.sqrt(data[start + m])
                weight *= (at - other) / (node - other)
        out[j] = weight
    if t >= data[start]:
        return
    first = math.sqrt(data[start])
    slope = 0.5 / first * (t - data[start])
    for j in range(1, count):  # slopes of the Lagrange polynomials at the first node
        node = math.sqrt(data[start + j])
        factor = slope / (node - first)
        for m in range(1, count):
            if m != j:
                other = math.sqrt(data[start + m])
                factor *= (first - other) / (node - other)
        out[j] += factor
        out[0] -= factor


@compiled
def _coefficients(table: Samples, e: float, pitch: float, yaw: float, out: Samples) -> tuple[int, float]:
    """Fill the Fourier coefficients of the rest's factor, (phases, 36); how the range was left, and t."""
    rings, gaps, up, down = int(table[_RINGS]), int(table[_GAPS]), int(table[_UP]), int(table[_DOWN])
    at_gaps = _HEADER + 4 * rings
    at_up = at_gaps + gaps
    at_most = at_up + up + down
    at_rest = at_most + 2 * gaps + int(table[_YAW_GAPS] + table[_YAW_PITCHES])
    block = int(table[_PHASES]) * PARAMETERS

    left = INSIDE
    t = 1.0 - e / _contact_offset(table, _HEADER, rings, table[_RADIUS], pitch)
    t = min(max(t, 0.0), 1.0)
    of_gap, of_pitch = np.empty(_MOST), np.empty(_MOST)
    _rooted(table, at_gaps, gaps, t, of_gap)
    lowered = pitch < 0.0
    most = 0.0
    for i in range(gaps):
        most += of_gap[i] * table[at_most + 2 * i + (1 if lowered else 0)]
    f = abs(pitch) / most
    if f > _PITCH_SLACK:
        left, f = TOO_FAR_PITCHED, _PITCH_SLACK
    pitches = down if lowered else up
    _steep(table, at_up + up if lowered else at_up, pitches, f, of_pitch)
    flat = out.ravel()
    for n in range(block):
        flat[n] = 0.0
    for i in range(gaps):
        for j in range(pitches):
            column = up + j - 1 if lowered and j > 0 else j
            here = at_rest + (i * (up + down - 1) + column) * block
            share = of_gap[i] * of_pitch[j]
            for n in range(block):
                flat[n] += share * table[here + n]
    if yaw != 0.0 and table[_YAW_GAPS] > 0:
        most = YAW_SLACK * table[_YAW]
        if abs(yaw) > most:
            left, yaw = TOO_FAR_YAWED, math.copysign(most, yaw)
        at_yawed = at_rest + gaps * (up + down - 1) * block
        _add_yaw(table, at_most + 2 * gaps, at_yawed, t, -f if lowered else f, yaw, flat)
    return left, t


@compiled
def _add_yaw(table: Samples, at_nodes: int, at_yawed: int, t: float, f: float, yaw: float, out: Samples) -> None:
    """Add what a yaw makes of the coefficients."""
    gaps, pitches = int(table[_YAW_GAPS]), int(table[_YAW_PITCHES])
    of_gap, of_pitch = np.empty(_MOST), np.empty(_MOST)
    _rooted(table, at_nodes, gaps, max(t, table[at_nodes]), of_gap)
    _lagrange(table, at_nodes + gaps, pitches, f, of_pitch)
    for i in range(gaps):
        for j in range(pitches):
            here = at_yawed + (i * pitches + j) * 2 * out.size
            first = of_gap[i] * of_pitch[j] * yaw
            second = first * yaw
            for n in range(out.size):
                out[n] += first * table[here + n] + second * table[here + out.size + n]


@compiled
def rest_coefficients(table: Samples, e: float, pitch: float, out: Samples) -> None:
    """Fill the Fourier coefficients of the rest's factor at a place without yaw, (phases, 36)."""
    _coefficients(table, e, pitch, 0.0, out)


@compiled
def film_start(table: Samples) -> int:
    """Where in a packed table the film begins."""
    gaps, pitches = int(table[_GAPS]), int(table[_UP] + table[_DOWN])
    yaw_gaps, yaw_pitches = int(table[_YAW_GAPS]), int(table[_YAW_PITCHES])
    block = int(table[_PHASES]) * PARAMETERS
    nodes = 4 * int(table[_RINGS]) + 3 * gaps + pitches + yaw_gaps + yaw_pitches
    return _HEADER + nodes + (gaps * (pitches - 1) + 2 * yaw_gaps * yaw_pitches) * block


@compiled
def resistance_at(table: Samples, e: float, pitch: float, yaw: float, phase: float, out: Samples) -> int:
    """Fill the symmetric 8x8 of a place, viscosity 1, in the robot's axes without roll; how the table's range was left.

    Args:
        table: from `packed`.
        e: offset of the body's mid-length from the tube's axis, m.
        pitch: nose up, away from the near wall, rad.
        yaw: nose to the side, rad.
        phase: of the tail, rad.
        out: to be filled, (8, 8).

    Returns:
        `INSIDE`, or which range was left; then the answer is that of the nearest place inside.
    """
    coefficients = np.empty((int(table[_PHASES]), PARAMETERS))
    left, t = _coefficients(table, e, pitch, yaw, coefficients)
    _set_film(table, e, pitch, yaw, cut_of_film(t), out)
    _add_rest(coefficients, phase, 1.0, out)
    return left


@compiled
def mean_resistance_at(table: Samples, e: float, pitch: float, yaw: float, count: int, out: Samples) -> int:
    """Fill the 8x8 of a place, averaged over phases of the tail; arguments as `resistance_at`.

    Args:
        table: from `packed`.
        e: offset of the body's mid-length from the tube's axis, m.
        pitch: nose up, away from the near wall, rad.
        yaw: nose to the side, rad.
        count: number of phases, evenly spaced.
        out: to be filled, (8, 8).
    """
    coefficients = np.empty((int(table[_PHASES]), PARAMETERS))
    left, t = _coefficients(table, e, pitch, yaw, coefficients)
    _set_film(table, e, pitch, yaw, cut_of_film(t), out)
    for n in range(count):
        _add_rest(coefficients, 2.0 * math.pi * n / count, 1.0 / count, out)
    return left


@compiled
def _set_film(table: Samples, e: float, pitch: float, yaw: float, share: float, out: Samples) -> None:
    """Fill the 8x8 with a share of the film's resistance."""
    film = np.empty((6, 6))
    film_at(table[film_start(table) :], e, pitch, yaw, film)
    for i in range(MOTIONS):
        for j in range(i + 1):
            out[i, j] = out[j, i] = share * film[i, j] if i < 6 else 0.0


@compiled
def _add_rest(coefficients: Samples, phase: float, share: float, out: Samples) -> None:
    """Add a share of what is left without the film at a phase, from the Fourier coefficients of its factor."""
    factor = np.empty(PARAMETERS)
    for k in range(PARAMETERS):
        factor[k] = coefficients[0, k]
    for m in range(1, coefficients.shape[0]):
        harmonic = (m + 1) // 2
        wave = math.cos(harmonic * phase) if m % 2 == 1 else math.sin(harmonic * phase)
        for k in range(PARAMETERS):
            factor[k] += wave * coefficients[m, k]
    for i in range(MOTIONS):
        diagonal = i * (i + 1) // 2 + i
        factor[diagonal] = math.exp(factor[diagonal])
    for i in range(MOTIONS):
        of_i = i * (i + 1) // 2
        for j in range(i + 1):
            of_j = j * (j + 1) // 2
            total = 0.0
            for k in range(j + 1):
                total += factor[of_i + k] * factor[of_j + k]
            out[i, j] += share * total
            if j < i:
                out[j, i] += share * total
