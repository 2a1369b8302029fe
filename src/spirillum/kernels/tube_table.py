"""Resistance of a robot anywhere in its tube from its table, compiled: film plus interpolated rest.

A place is the offset e of the body's mid-length from the tube's axis, pitch p (nose up), yaw psi (nose to the side) and
phase phi of the tail. The rest is interpolated over

    t = 1 - e/e_c(p), 0 where a robot without yaw touches the floor of the tube, 1 on its axis,
    f = p/p_hi(t) nose up or p/p_lo(t) nose down, 1 at the largest pitch of the table,
    g = psi/psi_c(e, p), 1 at the largest yaw of the table there, at which the tail is near the glass.

The end of a tail of length L is off the axis by L sin(psi) across the plane of the offset and by L sin(p) - e along it,
so that sin(psi_c)^2 is a quadratic polynomial of sin(p) and e.

Its Cholesky factor, logarithms on the diagonal, is a polynomial in sqrt(t) and in log(1.3 - |f|) between the nodes, one
nose up and one nose down, linear in t below the first, a polynomial of degree six in artanh(g/1.2), linear beyond the
last node, and a Fourier sum in the phase: the rest is positive definite everywhere.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.film_table import film_at, film_is_whole, has_head

MOTIONS = 8
"""U and Omega of the body, omega_m of the rotor against it, and the mean flow."""
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
"""Sign of each motion in a mirror to the side."""
PARAMETERS = MOTIONS * (MOTIONS + 1) // 2
"""Entries of a Cholesky factor."""
INSIDE, TOO_FAR_PITCHED, TOO_FAR_YAWED = 0, 1, 2
STEEPEST = (math.radians(12.0), math.radians(8.0))
"""Largest pitch of a table nose up and nose down, rad: in a narrow tube the glass holds a robot long before."""
_PITCH_SLACK = 1.1  # of the largest pitch: where the glass sets it, the tail's tip touches a little beyond it
_ROUNDING = 1e-9  # of angles given in degrees
_BEYOND = 1.3  # beyond the largest pitch, so that the logarithm stays finite at contact
_BEYOND_YAWED = 2.5  # of what a yaw adds: its largest one is less at such pitches, so that the tail is no nearer there
YAW_SLACK = 1.1  # of the largest yaw: the tail touches the glass a little beyond it
YAW_SHARES = (0.6, 0.8, 0.95)
"""Yaws of yawed nodes, to both sides, over the largest one at their place."""
YAW_ORDERS = 2 * len(YAW_SHARES)
"""Powers of the stretched yaw, from the first."""
_LAST_YAW = YAW_SHARES[-1]
_BEYOND_YAW = 1.2  # beyond the largest yaw, so that the inverse tangent stays finite at contact

# Header of a packed table: radius of the tube, rows, and the lengths of what follows.
_RADIUS, _RINGS, _GAPS, _UP, _DOWN, _PHASES, _YAW_GAPS, _YAW_PITCHES = 0, 1, 2, 3, 4, 5, 6, 7
_HEADER = 8
_MOST, _MANY = 12, 99  # nodes in one direction; rings, and Fourier coefficients
_YAW_LIMIT = 7  # numbers of `largest_yaw`
_LEAST_YAW = 1e-3  # rad, where the tail nearly touches the glass without a yaw


def packed(
    radius: float,
    rings: Samples,
    gaps: Samples,
    up: Samples,
    down: Samples,
    most: Samples,
    rest: Samples,
    yaw_gaps: Samples,
    yaw_pitches: Samples,
    yaw_limit: Samples,
    yawed: Samples,
    film: Samples,
) -> Samples:
    """One array for `resistance_at`.

    Args:
        radius: R of the tube, m.
        rings: of `contact_offset`, (n, 4).
        gaps: nodes t, increasing, the last is 1.
        up: nodes f nose up, the first is 0.
        down: nodes f nose down, the first is 0.
        most: largest pitches nose up and nose down (positive) at the nodes t, (gaps, 2), rad.
        rest: parameters of the factor, (gaps, up + down - 1, phases, 36): Fourier coefficients 1, cos, sin, cos 2, ...;
            pitches in the order of `up`, then `down` without its first.
        yaw_gaps: nodes t of the yawed places.
        yaw_pitches: nodes of signed f of the yawed places, increasing, 0 one of them.
        yaw_limit: of `yaw_limit_of`, (7,).
        yawed: coefficients of the powers of the stretched yaw, (yaw gaps, yaw pitches, `YAW_ORDERS`, phases, 36).
        film: packed film.
    """
    header = [radius, len(rings), gaps.size, up.size, down.size, rest.shape[2], yaw_gaps.size, yaw_pitches.size]
    nodes = (np.array(header, dtype=float), rings, gaps, up, down, most, yaw_gaps, yaw_pitches, yaw_limit)
    return np.concatenate([np.ravel(part) for part in (*nodes, rest, yawed, film)])


def is_whole(table: Samples, radius: float) -> bool:
    """Whether an array is a packed table of a tube of this radius: the loops below check no index.

    Args:
        table: of any numbers.
        radius: R of the tube, m.
    """
    if not has_head(table, _HEADER, radius):
        return False
    rings, gaps, up, down, phases, yaw_gaps, yaw_pitches = table[1:_HEADER]
    counts = np.array([rings, gaps, up, down, phases])
    turned = np.array([yaw_gaps, yaw_pitches])
    sizes = np.append(counts, turned)
    if np.any(sizes % 1.0) or counts.min() < 1 or max(gaps, up, down, *turned) > _MOST or max(rings, phases) > _MANY:
        return False
    if phases % 2.0 == 0.0 or (turned.min() < 1 and turned.max() != 0):
        return False
    start = film_start(table)
    return start < table.size and bool(np.isfinite(table[:start]).all()) and film_is_whole(table[start:], radius)


class Range(NamedTuple):
    """Where a table holds."""

    gaps: Samples
    """Gaps of a level robot at which the next three are stated, (n,), m."""
    up: Samples
    """Largest pitch nose up, (n,), rad."""
    down: Samples
    """Largest pitch nose down, positive, (n,), rad."""
    yaw: Samples
    """Largest yaw of a level robot to either side, (n,), rad."""


def range_of(table: Samples) -> Range:
    """Where a packed table holds."""
    at_gaps = _HEADER + 4 * int(table[_RINGS])
    gaps = int(table[_GAPS])
    at_most = at_gaps + gaps + int(table[_UP] + table[_DOWN])
    most = table[at_most : at_most + 2 * gaps].reshape(gaps, 2)
    room = contact_offset_of(table, 0.0)
    levels = table[at_gaps : at_gaps + gaps] * room
    return Range(levels, most[:, 0], most[:, 1], np.array([largest_yaw(table, room - gap, 0.0) for gap in levels]))


class Parts(NamedTuple):
    """What a packed table is made of."""

    nodes: Samples
    """Head, rings and nodes."""
    rest: Samples
    """(gaps, up + down - 1, phases, 36)."""
    yawed: Samples
    """(yaw gaps, yaw pitches, `YAW_ORDERS`, phases, 36)."""
    film: Samples
    """Packed film."""

    def packed(self) -> Samples:
        """All in one array again."""
        return np.concatenate([self.nodes, self.rest.ravel(), self.yawed.ravel(), self.film])


def shapes_of(table: Samples) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Shapes of `rest` and `yawed` of a packed table, or of its nodes."""
    gaps, pitches = int(table[_GAPS]), int(table[_UP] + table[_DOWN]) - 1
    yaw_gaps, yaw_pitches, phases = int(table[_YAW_GAPS]), int(table[_YAW_PITCHES]), int(table[_PHASES])
    return (gaps, pitches, phases, PARAMETERS), (yaw_gaps, yaw_pitches, YAW_ORDERS, phases, PARAMETERS)


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
    yaws = ((-1.0) ** np.arange(1, YAW_ORDERS + 1))[:, None, None]
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
def contact_offset_of(table: Samples, pitch: float) -> float:
    """Offset at which the body of a packed table touches the floor of the tube without a yaw, m."""
    return _contact_offset(table, _HEADER, int(table[_RINGS]), table[_RADIUS], pitch)


@compiled
def cut_of_film(t: float) -> float:
    """Share w of the film at t: 1 at contact, 0 on the axis, where no side is the nearer one."""
    if t >= 1.0:
        return 0.0
    left = 1.0 - max(t, 0.0) ** 2
    return left * left


@compiled
def _steep(data: Samples, start: int, count: int, f: float, beyond: float, out: Samples) -> None:
    """Lagrange weights in log(beyond - f): what nears the glass varies as the logarithm of its clearance."""
    at = math.log(beyond - f)
    for j in range(count):
        weight = 1.0
        for m in range(count):
            if m != j:
                other = math.log(beyond - data[start + m])
                weight *= (at - other) / (math.log(beyond - data[start + j]) - other)
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
def _place(table: Samples, e: float, pitch: float, of_gap: Samples) -> tuple[float, float, bool]:
    """Fill the weights of the nodes in t; t and signed f of a place, and whether it is within the range of pitch."""
    rings, gaps = int(table[_RINGS]), int(table[_GAPS])
    at_gaps = _HEADER + 4 * rings
    at_most = at_gaps + gaps + int(table[_UP] + table[_DOWN])
    t = 1.0 - e / _contact_offset(table, _HEADER, rings, table[_RADIUS], pitch)
    t = min(max(t, 0.0), 1.0)
    _rooted(table, at_gaps, gaps, t, of_gap)
    most = 0.0
    for i in range(gaps):
        most += of_gap[i] * table[at_most + 2 * i + (1 if pitch < 0.0 else 0)]
    f, steepest = pitch / most, STEEPEST[1 if pitch < 0.0 else 0]
    if abs(f) > _PITCH_SLACK or abs(pitch) > steepest * (1.0 + _ROUNDING):
        return t, math.copysign(min(_PITCH_SLACK, steepest / most), f), False
    return t, f, True


@compiled
def _add(weight: float, values: Samples, out: Samples) -> None:
    """Add weighted values: an index from 0, which cannot be negative, lets several be added at a time."""
    for n in range(out.size):
        out[n] += weight * values[n]


@compiled
def _coefficients(table: Samples, e: float, pitch: float, yaw: float, out: Samples) -> tuple[int, float]:
    """Fill the Fourier coefficients of the rest's factor, (phases, 36); how the range was left, and t."""
    gaps, up, down = int(table[_GAPS]), int(table[_UP]), int(table[_DOWN])
    at_up = _HEADER + 4 * int(table[_RINGS]) + gaps
    block = int(table[_PHASES]) * PARAMETERS
    at_rest = _rest_start(table)

    of_gap, of_pitch = np.empty(_MOST), np.empty(_MOST)
    t, f, within = _place(table, e, pitch, of_gap)
    left = INSIDE if within else TOO_FAR_PITCHED
    lowered = pitch < 0.0
    pitches = down if lowered else up
    _steep(table, at_up + up if lowered else at_up, pitches, abs(f), _BEYOND, of_pitch)
    flat = out.ravel()
    for n in range(block):
        flat[n] = 0.0
    for i in range(gaps):
        for j in range(pitches):
            column = up + j - 1 if lowered and j > 0 else j
            here = at_rest + (i * (up + down - 1) + column) * block
            _add(of_gap[i] * of_pitch[j], table[here : here + block], flat)
    if yaw != 0.0 and not (table[_YAW_GAPS] > 0 and _add_yaw(table, t, f, yaw / largest_yaw(table, e, pitch), flat)):
        left = TOO_FAR_YAWED
    return left, t


@compiled
def largest_yaw(table: Samples, e: float, pitch: float) -> float:
    """Largest yaw to either side at a place, rad: the table's nodes reach up to 0.95 of it."""
    start = _rest_start(table) - _YAW_LIMIT
    return limited_yaw(table[start : start + _YAW_LIMIT], e / table[_RADIUS], pitch)


@compiled
def limited_yaw(limit: Samples, x: float, pitch: float) -> float:
    """Largest yaw at a place, rad.

    Args:
        limit: of `yaw_limit_of`.
        x: offset of the body's mid-length over R.
        pitch: nose up, rad.
    """
    p = math.sin(pitch)
    square = limit[0] + p * (limit[1] + p * limit[2]) + x * (limit[3] + p * limit[4] + x * limit[5])
    return min(math.asin(math.sqrt(min(max(square, _LEAST_YAW * _LEAST_YAW), 1.0))), float(limit[6]))


def yaw_limit_of(x: Samples, pitches: Samples, yaws: Samples, most: float) -> Samples:
    """The numbers of `limited_yaw`, (7,), from largest yaws at some places.

    Args:
        x: offsets of the body's mid-length over R, (n,).
        pitches: nose up, (n,), rad.
        yaws: at which the tail is near the glass, (n,), rad.
        most: largest yaw anywhere, rad.
    """
    p = np.sin(pitches)
    terms = np.stack([np.ones_like(x), p, p**2, x, x * p, x**2], axis=1)
    return np.append(np.linalg.lstsq(terms, np.sin(yaws) ** 2, rcond=None)[0], most)


@compiled
def stretched_yaw(share: float) -> float:
    """What the rest is a polynomial of: what nears the glass varies as the logarithm of its clearance."""
    return math.atanh(share / _BEYOND_YAW)


def yaw_parts_at_nodes() -> Samples:
    """Odd and then even part of what a yaw adds at its nodes, from the coefficients of its powers, (orders, orders).

    The parts have the size of what is added; coefficients of so high powers cancel each other, and need more digits.
    """
    s = np.array([stretched_yaw(share) for share in YAW_SHARES])[:, None]
    order = np.arange(1, YAW_ORDERS + 1)
    odd = order % 2 == 1
    found: Samples = np.concatenate([np.where(odd, s**order, 0.0), np.where(odd, 0.0, s**order)])
    return found


@compiled
def _stretched_powers(share: float, out: Samples) -> None:
    """Fill the powers of the stretched yaw from the first; beyond the last node their tangents there."""
    s, last = stretched_yaw(share), stretched_yaw(math.copysign(_LAST_YAW, share))
    beyond = s - last if abs(share) > _LAST_YAW else 0.0
    s -= beyond
    power = 1.0
    for n in range(out.size):
        out[n] = power * (s + beyond * (n + 1))
        power *= s


@compiled
def _add_yaw(table: Samples, t: float, f: float, share: float, out: Samples) -> bool:
    """Add what a share of the largest yaw makes of the coefficients; whether it is within the range."""
    gaps, pitches = int(table[_YAW_GAPS]), int(table[_YAW_PITCHES])
    start = _rest_start(table) - _YAW_LIMIT - gaps - pitches
    of_gap, of_pitch, nodes = np.empty(_MOST), np.empty(_MOST), np.empty(_MOST)
    _rooted(table, start, gaps, max(t, table[start]), of_gap)
    level = 0
    while table[start + gaps + level] < 0.0:
        level += 1
    step = -1 if f < 0.0 else 1  # nose up and nose down apart: which end is the nearer one changes where it is level
    count = level + 1 if f < 0.0 else pitches - level
    for j in range(count):
        nodes[j] = abs(table[start + gaps + level + step * j])
    _steep(nodes, 0, count, abs(f), _BEYOND_YAWED, of_pitch)
    within = abs(share) <= YAW_SLACK
    powers = np.empty(YAW_ORDERS)
    _stretched_powers(share if within else math.copysign(YAW_SLACK, share), powers)
    at_yawed = film_start(table) - gaps * pitches * YAW_ORDERS * out.size
    for i in range(gaps):
        for j in range(count):
            here = at_yawed + (i * pitches + level + step * j) * YAW_ORDERS * out.size
            weight = of_gap[i] * of_pitch[j]
            for order in range(YAW_ORDERS):
                _add(weight * powers[order], table[here : here + out.size], out)
                here += out.size
    return within


@compiled
def rest_coefficients(table: Samples, e: float, pitch: float, out: Samples) -> None:
    """Fill the Fourier coefficients of the rest's factor at a place without yaw, (phases, 36)."""
    _coefficients(table, e, pitch, 0.0, out)


@compiled
def _rest_start(table: Samples) -> int:
    """Where in a packed table the rest begins."""
    yaw_gaps, yaw_pitches = int(table[_YAW_GAPS]), int(table[_YAW_PITCHES])
    own = 4 * int(table[_RINGS]) + 3 * int(table[_GAPS]) + int(table[_UP] + table[_DOWN])
    return _HEADER + own + yaw_gaps + yaw_pitches + _YAW_LIMIT


@compiled
def film_start(table: Samples) -> int:
    """Where in a packed table the film begins."""
    pitches, yawed = int(table[_UP] + table[_DOWN]) - 1, int(table[_YAW_GAPS] * table[_YAW_PITCHES])
    block = int(table[_PHASES]) * PARAMETERS
    return _rest_start(table) + (int(table[_GAPS]) * pitches + YAW_ORDERS * yawed) * block


@compiled
def resistance_at(table: Samples, e: float, pitch: float, yaw: float, phase: float, out: Samples) -> int:
    """Fill the symmetric 8x8 of a place, viscosity 1, in the robot's axes without roll; how the table's range was left.

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
