"""Resistance of the film between a body of revolution and a tube's wall, interpolated and compiled.

The film is a spline (cubic, tensor product) of coordinates in which thin films are straight lines: logarithms of the
clearances v under both ends of the straight side (under the middle, and the pitch, for a spheroid), and the yaw against
the yaw at which the side leaves the wall's curvature. What is interpolated are the logarithms of D and the entries of
the unit triangular M of R = M D M', R in an order of motions in which M stays finite. It is positive definite anywhere.

A clearance v is the depth by which an end may sink before it touches, at the place across where it is. It is smooth
through the tube's axis, and its zeros are contacts.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

# Columns of the head of a packed table.
TUBE, BODY, HALF = 0, 1, 2  # R, a and a spheroid's half-length (0: a straight side), m
REAR, REAR_ROUND, FRONT, FRONT_ROUND = 3, 4, 5, 6  # ends of the straight side, x, and the radii of the ends, m
FIRST, LAST, INTERVALS = 7, 8, 9  # of the first coordinate's knots
SECOND_FIRST, SECOND_LAST, SECOND_INTERVALS = 10, 11, 12  # of the second's
YAW, YAWS = 13, 14  # largest yaw, rad; polynomials in yaw
HEAD = 15

ORDER = (2, 4, 0, 1, 5, 3)
"""Order of the motions (U, Omega) in the factors: those that the film resists most come first, even ones before odd."""
ENTRIES = 21
_MANY = 99  # intervals of a coordinate, and polynomials
_ODD = 3
"""Motions of the order from here on change their sign with the mirror."""


def has_head(table: Samples, size: int, radius: float) -> bool:
    """Whether an array begins with that many finite numbers, the first of them the radius of a tube, m."""
    return table.size >= size and bool(np.isfinite(table[:size]).all()) and math.isclose(table[0], radius)


def shape_of(film: Samples) -> tuple[int, int, int, int]:
    """Shape of the coefficients of a film from its head, or from all of it: both coordinates, yaws, entries."""
    return int(film[INTERVALS]) + 3, int(film[SECOND_INTERVALS]) + 3, int(film[YAWS]), ENTRIES


def film_is_whole(film: Samples, radius: float) -> bool:
    """Whether an array is a packed film in a tube of this radius: the loops below check no index.

    Args:
        film: of any numbers.
        radius: R of the tube, m.
    """
    if not has_head(film, HEAD, radius):
        return False
    counts = film[[INTERVALS, SECOND_INTERVALS, YAWS]]
    if np.any(counts % 1.0) or counts.min() < 1 or counts.max() > _MANY or not 0.0 < film[BODY] < radius:
        return False
    values = film[HEAD:].view(np.float32)  # one more where their number is odd
    return values.size - math.prod(shape_of(film)) in (0, 1) and bool(np.isfinite(values).all())


@compiled
def clearance(
    head: Samples, x: float, half: float, ring: float, rounded: float, e: float, lift: float, side: float
) -> float:
    """Depth by which a ring, or a spheroid, may sink until it touches the wall, m.

    Args:
        head: head of a packed table.
        x: place on the body's axis.
        half: half-length of the spheroid, 0 for a ring.
        ring: radius of the ring or spheroid.
        rounded: radius of the ball that runs around on the ring.
        e: offset of the body's middle.
        lift: component of the body's axis towards the tube's axis.
        side: component of the body's axis to the side.
    """
    room = head[TUBE] - rounded
    across, depth = x * side, e - x * lift
    limit = 0.99
    n_y = min(max(across / (room - ring), -limit), limit)
    q_y, q_z = across, depth
    for _ in range(4 if half > 0.0 else 2):
        n_z = math.sqrt(1.0 - n_y * n_y)
        along = n_y * side - n_z * lift  # n.d; the depth counts downwards
        reach = math.sqrt(ring * ring + (half * half - ring * ring) * along * along)
        bend = (half * half - ring * ring) * along
        if reach > 0.0:
            q_y = across + (ring * ring * n_y + bend * side) / reach
            q_z = depth + (ring * ring * n_z - bend * lift) / reach
        n_y = min(max(n_y + (q_y - room * n_y) / (room - ring), -limit), limit)
    return float(math.sqrt(max(room * room - q_y * q_y, 0.0)) - q_z)


@compiled
def _gap(
    head: Samples, x: float, half: float, ring: float, rounded: float, e: float, lift: float, side: float
) -> float:
    """Distance between the wall and a ring with a ball on it, or a spheroid, m."""
    c_y, c_z = x * side, e - x * lift
    size = math.hypot(c_y, c_z)
    n_y, n_z = 0.0, 1.0
    if size > 1e-9 * head[TUBE]:
        n_y, n_z = c_y / size, c_z / size
    stretch = half * half - ring * ring
    q_y, q_z = c_y, c_z
    for k in range(4):
        along, across = n_y * side - n_z * lift, -n_y * lift - n_z * side
        reach = math.sqrt(max(ring * ring + stretch * along * along, 0.0))
        if reach > 0.0:
            q_y = c_y + (ring * ring * n_y + stretch * along * side) / reach
            q_z = c_z + (ring * ring * n_z - stretch * along * lift) / reach
        if k == 3 or reach == 0.0:
            break
        # turn the normal until it points at the nearest point
        error = n_y * c_z - n_z * c_y + stretch * along * across / reach
        slope = -(n_y * c_y + n_z * c_z) + stretch * (across * across - along * along) / reach
        if slope > -1e-6 * head[TUBE]:
            break
        turn = min(max(-error / slope, -0.3), 0.3)
        n_y, n_z = n_y - turn * n_z, n_z + turn * n_y
        length = math.hypot(n_y, n_z)
        n_y, n_z = n_y / length, n_z / length
    return float(head[TUBE] - rounded - math.hypot(q_y, q_z))


@compiled
def smallest_gap(head: Samples, e: float, p: float, psi: float) -> float:
    """Smallest distance between a body and the wall, m; `head` may be a packed table."""
    lift, side = math.sin(p), math.cos(p) * math.sin(psi)
    if head[HALF] > 0.0:
        return _gap(head, 0.0, head[HALF], head[BODY], 0.0, e, lift, side)
    rear = _gap(head, head[REAR], 0.0, head[BODY] - head[REAR_ROUND], head[REAR_ROUND], e, lift, side)
    front = _gap(head, head[FRONT], 0.0, head[BODY] - head[FRONT_ROUND], head[FRONT_ROUND], e, lift, side)
    return min(rear, front)


@compiled
def stretched(v: float, radius: float) -> float:
    """Coordinate of a clearance: its logarithm where it is small against the radius, and finer about the radius."""
    wide = 1.0 + v / radius
    return math.log(v * wide * wide)


@compiled
def yaw_scale(head: Samples, rear: float, front: float) -> float:
    """Sine of the yaw at which the wall's curvature under the straight side counts, from the clearances of its ends.

    With h = rear, front at the ends and the curvature's term C s (L - s), C = sin^2 psi/(2 (R - a)), in between,

        int h^-1.5 ds = 2 L/(sqrt(rear front) (sqrt rear + sqrt front) (1 + (sin psi/scale)^2)).
    """
    if head[HALF] > 0.0:
        return 1.0
    sum_of_roots = math.sqrt(rear) + math.sqrt(front)
    return float(math.sqrt(2.0 * (head[TUBE] - head[BODY])) * sum_of_roots / (head[FRONT] - head[REAR]))


@compiled
def film_coordinates(head: Samples, e: float, p: float, psi: float, out: Samples) -> None:
    """Write what the interpolation of a film goes by at a place; `head` may be a packed table.

    Three coordinates; the part of log D of the first motion that is known in closed form; and the angle from z' to
    the normal of the wall, where a rounded end is nearest.
    """
    lift, side, turn = math.sin(p), math.cos(p) * math.sin(psi), math.sin(psi)
    a = head[BODY]
    least = 1e-12 * a
    largest = math.sin(head[YAW])
    if head[HALF] > 0.0:
        out[0] = stretched(max(clearance(head, 0.0, head[HALF], a, 0.0, e, lift, side), least), a)
        out[1], out[2], out[3], out[4] = p, math.asinh(turn) / math.asinh(largest), 0.0, p
    else:
        rear = clearance(head, head[REAR], 0.0, a - head[REAR_ROUND], head[REAR_ROUND], e, lift, side)
        front = clearance(head, head[FRONT], 0.0, a - head[FRONT_ROUND], head[FRONT_ROUND], e, lift, side)
        rear, front = max(rear, least), max(front, least)
        out[0], out[1] = stretched(rear, a), stretched(front, a)
        scale = yaw_scale(head, rear, front)
        turn /= scale
        out[2] = math.asinh(turn) / math.asinh(largest / scale)
        product = rear * front / a**3
        out[3] = -math.log(math.sqrt(product) * (math.sqrt(rear) + math.sqrt(front)) * (1.0 + turn * turn))
        out[4] = 0.0
        if head[REAR_ROUND] > 0.0:
            out[4] += p * (front / (rear + front)) ** 2
        if head[FRONT_ROUND] > 0.0:
            out[4] += p * (rear / (rear + front)) ** 2
    out[2] = min(max(out[2], -1.0), 1.0)


@compiled
def spline_weights(at: float, first: float, last: float, intervals: int, out: Samples) -> int:
    """Weights of the four cubic B-splines at a place, and the number of their first; a straight line outside."""
    step = (last - first) / intervals
    place = (at - first) / step
    inside = min(max(place, 0.0), float(intervals))
    cell = min(int(inside), intervals - 1)
    u = inside - cell
    v = 1.0 - u
    out[0] = v * v * v / 6.0
    out[1] = (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0
    out[2] = (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0
    out[3] = u * u * u / 6.0
    beyond = place - inside
    if beyond != 0.0:
        out[0] -= 0.5 * v * v * beyond
        out[1] += (1.5 * u * u - 2.0 * u) * beyond
        out[2] += (2.0 * v - 1.5 * v * v) * beyond
        out[3] += 0.5 * u * u * beyond
    return cell


@compiled
def _interpolated(packed: Samples, coordinates: Samples, weights: Samples, sums: Samples) -> None:
    """Write log D and M at three coordinates, in the order of the triangle, to the first entries of `sums`."""
    rows, columns, yaws = int(packed[INTERVALS]), int(packed[SECOND_INTERVALS]), int(packed[YAWS])
    along, across = weights[0:4], weights[4:8]
    row = spline_weights(coordinates[0], packed[FIRST], packed[LAST], rows, along)
    column = spline_weights(coordinates[1], packed[SECOND_FIRST], packed[SECOND_LAST], columns, across)
    coefficients = packed[HEAD:].view(np.float32)
    count = ENTRIES * yaws
    for k in range(count):
        sums[k] = 0.0
    for i in range(4):
        for j in range(4):
            weight = along[i] * across[j]
            start = ((row + i) * (columns + 3) + column + j) * count
            for k in range(count):
                sums[k] += weight * coefficients[start + k]
    # even polynomials in yaw, times the yaw for entries that change their sign with the mirror
    eta = coordinates[2]
    square = eta * eta
    for n in range(yaws - 2, -1, -1):
        for k in range(ENTRIES):
            sums[n * ENTRIES + k] += square * sums[(n + 1) * ENTRIES + k]
    for i in range(_ODD, 6):
        for j in range(_ODD):
            sums[6 + i * (i - 1) // 2 + j] *= eta


@compiled
def _multiplied(sums: Samples, a: float, angle: float, out: Samples) -> None:
    """Write M D M' in the order of the motions, times powers of a, and turn it by an angle from the normal to z'."""
    for i in range(6):
        sums[i] = math.exp(sums[i])
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for n in range(j + 1):
                left = 1.0 if n == i else sums[6 + i * (i - 1) // 2 + n]
                right = 1.0 if n == j else sums[6 + j * (j - 1) // 2 + n]
                total += left * right * sums[n]
            m, n = ORDER[i], ORDER[j]
            total *= a if m < 3 else a * a
            total *= 1.0 if n < 3 else a
            out[m, n] = total
            out[n, m] = total
    cos, sin = math.cos(angle), math.sin(angle)
    for i in range(6):
        x, z = out[i, 0], out[i, 2]
        out[i, 0], out[i, 2] = cos * x + sin * z, cos * z - sin * x
    for i in range(6):
        x, z = out[0, i], out[2, i]
        out[0, i], out[2, i] = cos * x + sin * z, cos * z - sin * x


@compiled
def film_at(packed: Samples, e: float, p: float, psi: float, out: Samples) -> float:
    """Write the film's resistance (6x6, per viscosity, in F about the body's middle); the body's smallest gap, m.

    Outside of the table the film goes on: as power laws below its thinnest clearances, unchanged beyond its largest
    yaw. Where the body touches the wall, the clearances are 1e-12 of its radius, and the gap is negative.

    Args:
        packed: a film's table, packed.
        e: offset of the body's middle from the tube's axis, m, at least 0.
        p: pitch, rad, positive where the nose points away from the wall.
        psi: yaw, rad.
        out: (6, 6), the result.
    """
    work = np.empty(13 + ENTRIES * int(packed[YAWS]))
    film_coordinates(packed, e, p, psi, work)
    sums = work[13:]
    _interpolated(packed, work, work[5:13], sums)
    sums[0] += work[3]
    _multiplied(sums, packed[BODY], work[4], out)
    return smallest_gap(packed, e, p, psi)
