"""Where a robot touches the wall of its tube, and the load that asperities carry there, compiled.

Smooth surfaces in a viscous fluid never touch in finite time; asperities of height s do, and carry the load from then
on (J. R. Smart, D. T. Leighton, Phys. Fluids A 1:52, 1989; C. J. Cawthorn, N. J. Balmforth, J. Fluid Mech. 646:327,
2010). With h the gap of the mean surfaces and W a load of the order of the robot's weight,

    N(h) = W (s/h - 1)^2,   E(h) = W (s^2/h - h - 2 s log(s/h))   for h < s, zero beyond

which is W at h = s/2 and grows without bound as h -> 0, so that no finite load brings the mean surfaces together. Just
below s it grows as (s - h)^2, between a single elastic asperity (power 3/2) and many of evenly spread heights (5/2;
J. A. Greenwood, J. B. P. Williamson, Proc. R. Soc. A 295:300, 1966). The form is assumed; what follows from it depends
on s above all.

Sites on the solids are rings about the motor axis that carry a ball: hemisphere, edge, fillet and spheroid. The wire
touches where its distance from the tube's axis is a local maximum along it, ends included.
"""

from __future__ import annotations

import math

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.rigid_links import POSITION

# A site on body or coupling: ring of radius rho (semi-axis b along the motor axis) at x, with a ball of radius beta.
SITE_X, SITE_RING, SITE_HALF, SITE_BALL, SITE_ROTOR = 0, 1, 2, 3, 4  # m; last: 1 where it turns with the rotor
SITE = 5

# The wire: radius and amplitude, m; taper over length, 1/m (0: none); h k, rad/m; x of the root and axial length, m.
WIRE_RADIUS, AMPLITUDE, TAPER, HAND_K, ROOT, LENGTH = 0, 1, 2, 3, 4, 5
WIRE = 6

# A station along the wire: distance from the root, m, and its place at phase 0, m.
STATION_XI, STATION_X, STATION_Y, STATION_Z = 0, 1, 2, 3
STATION = 4

_THINNEST = 1e-3
"""Smallest gap over s at which the load is evaluated."""


@compiled
def asperity_load(gap: float, height: float, load: float) -> float:
    """N(h), N."""
    if gap >= height:
        return 0.0
    over = height / max(gap, _THINNEST * height) - 1.0
    return load * over * over


@compiled
def asperity_energy(gap: float, height: float, load: float) -> float:
    """E(h), J."""
    if gap >= height:
        return 0.0
    h = max(gap, _THINNEST * height)
    return load * (height * height / h - h - 2.0 * height * math.log(height / h))


@compiled
def ring_gap(
    y: Samples, rotation: Samples, radius: float, site: Samples, normal: Samples, point: Samples, j: Samples
) -> float:
    """Gap between the wall and one site, m.

    Across the tube the site reaches H(n) = c.n + S(n_1) + beta from the tube's axis along a unit vector n, with the
    ring's centre c, n_1 = n.e_1 and S^2 = rho^2 (1 - n_1^2) + b^2 n_1^2. The gap is R less the largest H, which
    Newton's method finds from n = c/|c|; its gradient is that at constant n.

    Args:
        y: the state.
        rotation: body axes to lab.
        radius: R of the tube.
        site: row of sites.
        normal: result, n in body axes (3,).
        point: result, the touching point from the origin in body axes, m (3,).
        j: result, (7,): the gap closes at j.q at the rates q.
    """
    x, ring, half, ball = site[SITE_X], site[SITE_RING], site[SITE_HALF], site[SITE_BALL]
    side, up = y[POSITION + 1] + rotation[1, 0] * x, y[POSITION + 2] + rotation[2, 0] * x
    flat = half**2 - ring**2
    angle = math.atan2(up, side) if math.hypot(side, up) > 1e-9 * radius else -0.5 * math.pi
    n_y, n_z, n_1, reach = 0.0, 0.0, 0.0, 0.0
    for _ in range(12):
        n_y, n_z = math.cos(angle), math.sin(angle)
        n_1, turned = n_y * rotation[1, 0] + n_z * rotation[2, 0], n_y * rotation[2, 0] - n_z * rotation[1, 0]
        reach = math.sqrt(max(ring**2 + flat * n_1 * n_1, 1e-36 * radius**2))
        slope = flat * n_1 * turned / reach
        first = n_y * up - n_z * side + slope
        second = -n_y * side - n_z * up + (flat * (turned * turned - n_1 * n_1) - slope * slope) / reach
        if second >= 0.0 or abs(first) < 1e-15 * radius:
            break
        angle -= min(max(first / second, -0.5), 0.5)
    for i in range(3):
        normal[i] = rotation[1, i] * n_y + rotation[2, i] * n_z
        j[i] = normal[i]
        point[i] = (ring * ring / reach + ball) * normal[i]
    arm = x + flat * n_1 / reach
    point[0] = arm + point[0]
    j[3] = j[6] = 0.0
    j[4], j[5] = -arm * normal[2], arm * normal[1]
    return float(radius - n_y * side - n_z * up - reach - ball)


@compiled
def tail_reaches(y: Samples, rotation: Samples, radius: float, wire: Samples, height: float) -> bool:
    """Whether the cylinder in which the tail turns comes within a height of the wall."""
    farthest = 0.0
    for x in (wire[ROOT], wire[ROOT] - wire[LENGTH]):
        side = y[POSITION + 1] + rotation[1, 0] * x
        up = y[POSITION + 2] + rotation[2, 0] * x
        farthest = max(farthest, math.hypot(side, up))
    return bool(radius - farthest - wire[AMPLITUDE] - wire[WIRE_RADIUS] < height)


@compiled
def _wire_point(
    y: Samples, rotation: Samples, wire: Samples, phase: float, xi: float, point: Samples
) -> tuple[float, float, float, float, float]:
    """Centreline at xi into `point`, in body axes; its place across the tube, d^2, and d(d^2/2)/dxi once and twice."""
    shrink = math.exp(-wire[TAPER] * xi) if wire[TAPER] > 0 else 0.0
    r, r_1 = wire[AMPLITUDE] * (1.0 - shrink), wire[AMPLITUDE] * wire[TAPER] * shrink
    r_2 = -wire[TAPER] * r_1
    x, k = wire[ROOT] - xi, wire[HAND_K]
    angle = k * x + phase
    cos, sin = math.cos(angle), math.sin(angle)
    point[0], point[1], point[2] = x, r * cos, r * sin
    y_1, z_1 = r_1 * cos + k * r * sin, r_1 * sin - k * r * cos
    y_2, z_2 = (r_2 - k * k * r) * cos + 2.0 * k * r_1 * sin, (r_2 - k * k * r) * sin - 2.0 * k * r_1 * cos
    value, first, second = 0.0, 0.0, 0.0
    side = y[POSITION + 1] + rotation[1, 0] * x + rotation[1, 1] * point[1] + rotation[1, 2] * point[2]
    up = y[POSITION + 2] + rotation[2, 0] * x + rotation[2, 1] * point[1] + rotation[2, 2] * point[2]
    across = (side, up)
    for row in (1, 2):
        c = across[row - 1]
        c_1 = -rotation[row, 0] + rotation[row, 1] * y_1 + rotation[row, 2] * z_1
        c_2 = rotation[row, 1] * y_2 + rotation[row, 2] * z_2
        value += c * c
        first += c * c_1
        second += c_1 * c_1 + c * c_2
    return side, up, value, first, second


@compiled
def crest(
    y: Samples,
    rotation: Samples,
    radius: float,
    wire: Samples,
    phase: float,
    bracket: tuple[float, float, float],
    normal: Samples,
    point: Samples,
    j: Samples,
) -> float:
    """Gap between the wall and the wire where the wire is farthest from the tube's axis, m.

    Args:
        y: the state.
        rotation: body axes to lab.
        radius: R of the tube.
        wire: the wire, (6,).
        phase: of the tail against the body, rad.
        bracket: where along the wire to look: from, first guess, to; m from the root.
        normal: result, as in `ring_gap`; so are `point` and `j`.
        point: see there.
        j: see there.
    """
    low, xi, high = bracket
    side, up, value, first, second = _wire_point(y, rotation, wire, phase, xi, point)
    for _ in range(50):
        if first > 0:
            low = xi
        else:
            high = xi
        if (xi == bracket[0] and first <= 0) or (xi == bracket[2] and first >= 0):
            break  # at an end of the wire
        new = xi - first / second if second < 0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        moved = abs(new - xi)
        xi = new
        side, up, value, first, second = _wire_point(y, rotation, wire, phase, xi, point)
        if moved < 1e-13 * wire[LENGTH]:
            break
    distance = max(math.sqrt(value), 1e-9 * radius)
    side, up = side / distance, up / distance
    for i in range(3):
        normal[i] = rotation[1, i] * side + rotation[2, i] * up
        j[i] = normal[i]
    j[3] = point[1] * normal[2] - point[2] * normal[1]
    j[4] = point[2] * normal[0] - point[0] * normal[2]
    j[5] = point[0] * normal[1] - point[1] * normal[0]
    j[6] = j[3]
    for i in range(3):
        point[i] += wire[WIRE_RADIUS] * normal[i]
    return float(radius - distance - wire[WIRE_RADIUS])


@compiled
def contact_rows(rotation: Samples, normal: Samples, point: Samples, turning: float, rows: Samples) -> None:
    """Sliding velocities at a contact as rows against the seven rates: along the tube, and around it.

    Args:
        rotation: body axes to lab.
        normal: n in body axes, towards the wall.
        point: the touching point from the origin in body axes, m.
        turning: 1 where it turns with the rotor, else 0.
        rows: result, (2, 7).
    """
    for row in range(2):
        a, b, c = rotation[0, 0], rotation[0, 1], rotation[0, 2]
        if row == 1:
            a, b, c = b * normal[2] - c * normal[1], c * normal[0] - a * normal[2], a * normal[1] - b * normal[0]
        rows[row, 0], rows[row, 1], rows[row, 2] = a, b, c
        rows[row, 3] = point[1] * c - point[2] * b
        rows[row, 4] = point[2] * a - point[0] * c
        rows[row, 5] = point[0] * b - point[1] * a
        rows[row, 6] = turning * rows[row, 3]
