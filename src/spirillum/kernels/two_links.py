"""Two rigid links in a viscous fluid, weight and a wall: the rates of a robot's state, compiled.

Unknowns are the seven rates (U, Omega_b, omega_m) in body axes about the origin. Forces balance without inertia:

    [A(phi) + friction + sum_c k_c j_c j_c'] (U, Omega_b, omega_m) = weight + field + tau d

with A(phi) the resistance of both links, constant in the tail's frame and turned with it; k_c the resistance of the
thin film at a point c of the surface against the speed j_c' V with which it nears the wall; and the drive's torque tau
along d: the joint, or the robot's axis where the joint is fixed.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

__all__ = [
    "ATTITUDE",
    "CHARGE",
    "CONVERSION",
    "CURRENT",
    "DISSIPATED",
    "DRIVEN",
    "ELECTRICAL",
    "FRICTION",
    "JOINT",
    "MAGNETIC",
    "MOTOR",
    "OBSERVED",
    "PHASE",
    "POSITION",
    "RATE",
    "RESISTIVE",
    "ROLL",
    "STATES",
    "TORQUE",
    "film_of",
    "observe",
    "packed",
    "rates",
    "thinnest_film",
]

# Places in the state.
POSITION, ATTITUDE = 0, 3  # of the origin in the lab, m; unit quaternion (w, x, y, z), body axes to lab
PHASE, ROLL = 7, 8  # tail angle phi against the body; integral of Omega_x, rad
CURRENT = 9  # I in the motor's own sense, A
ELECTRICAL, RESISTIVE, CONVERSION, CHARGE = 10, 11, 12, 13  # integrals of powers, J, and of the battery's current, A s
DRIVEN, FRICTION, DISSIPATED = 14, 15, 16  # work of the drive's torque on both links, and where it goes, J
STATES = 17

JOINT = 6  # the joint's place among the rates
OBSERVED = 13
"""Columns: seven rates, torque of the drive, thinnest film, powers of friction, fluid and drive, energy of pressed
roughness."""
_WORK = 161

# Kinds of drive, drive[0].
MOTOR, TORQUE, RATE, MAGNETIC = 0.0, 1.0, 2.0, 3.0


def packed(drag: Samples, friction: Samples, weight: Samples, wall: Samples, spots: Samples, drive: Samples) -> Samples:
    """One array for `rates`, which takes longer to read eight of them than to work with them.

    Args:
        drag: A(0), 7x7, SI.
        friction: friction of joint and wall, 7x7, between Omega_x and omega_m only (`paper`: not symmetric).
        weight: submerged weight of body and rotor, N, and its first moments, N m (8).
        wall: radius of the channel (infinite: none), roughness, m; largest resistance of a film, N s/m; load, N.
        spots: rings that may near the wall (n, 6): x, a, b, coefficient c, power p, reach H. A film of thickness h
            resists with c ((H/h)^p - 1).
        drive: kind, fixed joint, duty, then: torque or rate; or moment (3), field, its rate; motor from place 8 on:
            polarity, K_m, K_b, L, R(I) (6), voltage, internal resistance.
    """
    parts = (np.zeros(_WORK), drag, friction, weight, wall, drive, spots)
    return np.concatenate([np.ravel(part) for part in parts])


@compiled
def _turned(drag: Samples, phase: float, out: Samples) -> None:
    """A(phi) = Q A(0) Q' with Q the rotation by phi about x of velocities and of rotations."""
    cos, sin = math.cos(phase), math.sin(phase)
    for i in range(7):
        for j in range(7):
            out[i, j] = drag[i, j]
    for first in (1, 4):
        for i in range(7):
            a, b = out[i, first], out[i, first + 1]
            out[i, first], out[i, first + 1] = cos * a - sin * b, sin * a + cos * b
    for first in (1, 4):
        for j in range(7):
            a, b = out[first, j], out[first + 1, j]
            out[first, j], out[first + 1, j] = cos * a - sin * b, sin * a + cos * b


@compiled
def _solved(a: Samples, b: Samples) -> None:
    """Solve a x = b (7x7, two right-hand sides) in place by elimination.

    No pivots: the symmetric part of `a` is positive definite.
    """
    for k in range(7):
        a[k, k] = 1.0 / a[k, k]
        for i in range(k + 1, 7):
            factor = a[i, k] * a[k, k]
            for j in range(k + 1, 7):
                a[i, j] -= factor * a[k, j]
            b[i, 0] -= factor * b[k, 0]
            b[i, 1] -= factor * b[k, 1]
    for i in range(6, -1, -1):
        first, second = b[i, 0], b[i, 1]
        for j in range(i + 1, 7):
            first -= a[i, j] * b[j, 0]
            second -= a[i, j] * b[j, 1]
        b[i, 0], b[i, 1] = first * a[i, i], second * a[i, i]


@compiled
def _axes(y: Samples, rotation: Samples) -> None:
    """Rotation matrix, body axes to lab, of the state's quaternion made a unit one."""
    w, i, j, k = y[3], y[4], y[5], y[6]
    s = 2.0 / (w * w + i * i + j * j + k * k)
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = 1 - s * (j * j + k * k), s * (i * j - k * w), s * (i * k + j * w)
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = s * (i * j + k * w), 1 - s * (i * i + k * k), s * (j * k - i * w)
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = s * (i * k - j * w), s * (j * k + i * w), 1 - s * (i * i + j * j)


@compiled
def _loads(phase: float, rotation: Samples, weight: Samples, force: Samples) -> None:
    """Generalised force of weight and buoyancy on both links.

    `weight` is submerged weight of body and rotor, N, and its first moments about the origin at phase 0, N m.
    """
    down_x, down_y, down_z = -rotation[2, 0], -rotation[2, 1], -rotation[2, 2]
    cos, sin = math.cos(phase), math.sin(phase)
    rotor_x = weight[5]
    rotor_y, rotor_z = cos * weight[6] - sin * weight[7], sin * weight[6] + cos * weight[7]
    x, y, z = weight[2] + rotor_x, weight[3] + rotor_y, weight[4] + rotor_z
    total = weight[0] + weight[1]
    force[0], force[1], force[2] = total * down_x, total * down_y, total * down_z
    force[3] = y * down_z - z * down_y
    force[4] = z * down_x - x * down_z
    force[5] = x * down_y - y * down_x
    force[6] = rotor_y * down_z - rotor_z * down_y


@compiled
def _field(time: float, rotation: Samples, drive: Samples, force: Samples) -> None:
    """Add the torque m x B of a field B that turns about the lab's +x, up at time 0; m is fixed in the body."""
    angle = drive[7] * time
    along, up = -drive[6] * math.sin(angle), drive[6] * math.cos(angle)
    b_x = rotation[1, 0] * along + rotation[2, 0] * up
    b_y = rotation[1, 1] * along + rotation[2, 1] * up
    b_z = rotation[1, 2] * along + rotation[2, 2] * up
    m_x, m_y, m_z = drive[3], drive[4], drive[5]
    force[3] += m_y * b_z - m_z * b_y
    force[4] += m_z * b_x - m_x * b_z
    force[5] += m_x * b_y - m_y * b_x


@compiled
def film_of(y: Samples, rotation: Samples, wall: Samples, spot: Samples, j: Samples) -> float:
    """Film between the wall and the surface about one ring of the robot, m; its loss per rate goes into `j`.

    `wall` begins with radius R and roughness, `spot` with the ring's place x, its radius a, and its half-length b along
    the axis (0 for an edge). With the ring's middle c off the channel's axis, n = c/|c| across it and n_1 = n.e_1, the
    film is R - |c| - s less the roughness, where s^2 = b^2 n_1^2 + a^2 (1 - n_1^2) is how far a spheroid with semi-axes
    b, a reaches along n. `j` is its gradient: with t across n in the channel's section and s' = ds/dn_1,

        j_U = n + s' (t.e_1)/|c| t,   j_Omega = s' e_1 x n + x e_1 x j_U
    """
    side = y[1] + rotation[1, 0] * spot[0]
    height = y[2] + rotation[2, 0] * spot[0]
    distance = math.hypot(side, height)
    near = distance < 1e-12 * wall[0]
    if near:
        side, height = 0.0, -1.0
    else:
        side, height = side / distance, height / distance
    n_1 = rotation[1, 0] * side + rotation[2, 0] * height
    reach = max(math.sqrt((spot[2] * n_1) ** 2 + spot[1] ** 2 * max(1.0 - n_1 * n_1, 0.0)), 1e-12 * spot[1])
    slope = (spot[2] ** 2 - spot[1] ** 2) * n_1 / reach
    turning = 0.0 if near else slope * (-rotation[1, 0] * height + rotation[2, 0] * side) / distance
    for i in range(3):
        normal = rotation[1, i] * side + rotation[2, i] * height
        across = -rotation[1, i] * height + rotation[2, i] * side
        j[i] = normal + turning * across
        j[3 + i] = normal
    n_y, n_z = j[4], j[5]
    j[3] = 0.0
    j[4] = -slope * n_z - spot[0] * j[2]
    j[5] = slope * n_y + spot[0] * j[1]
    return float(wall[0] - (0.0 if near else distance) - reach - wall[1])


@compiled
def _films(
    y: Samples, rotation: Samples, wall: Samples, spots: Samples, a: Samples, force: Samples, work: Samples
) -> tuple[float, float]:
    """Add the films' resistance to `a` and the roughness's pressure to `force`; thinnest film, m, and its energy, J.

    Films are counted from the tips of the roughness s. Thinner than s, these are pressed together, with the force
    N (s/h - 1) and the energy N (s log(s/h) - s + h) for a load N of the robot's order.
    """
    thinnest, energy = math.inf, 0.0
    rough, load = wall[1], wall[3]
    j = work[0:6]
    for c in range(spots.shape[0]):
        spot = spots[c]
        film = film_of(y, rotation, wall, spot, j)
        thinnest = min(thinnest, film)
        if film >= spot[5]:
            continue
        film = max(film, 1e-9 * rough)
        share = film / spot[5]
        thinner = 1.0 / (share * math.sqrt(share)) if spot[4] == 1.5 else 1.0 / share
        k = min(spot[3] * (thinner - 1.0), wall[2])
        pressed = 0.0
        if film < rough:
            pressed = load * (rough / film - 1.0)
            energy += load * (rough * math.log(rough / film) - rough + film)
        for i in range(6):  # a ring about the motor axis is pushed without a torque about it
            force[i] -= pressed * j[i]
            pushed = k * j[i]
            for m in range(6):
                a[i, m] += pushed * j[m]
    return thinnest, energy


@compiled
def _assembled(fluid: Samples, friction: Samples, fixed: bool, a: Samples) -> None:  # noqa: FBT001 - compiled
    """The matrix of the balance; friction is between Omega_x and omega_m only."""
    for i in range(7):
        for j in range(7):
            a[i, j] = fluid[i, j]
    for i in range(3, 7, 3):
        a[i, 3] += friction[i, 3]
        a[i, 6] += friction[i, 6]
    if fixed:
        for i in range(7):
            a[6, i] = a[i, 6] = 0.0
        a[6, 6] = 1.0


@compiled
def _torque(y: Samples, drive: Samples, spin: float, spin_per_torque: float) -> float:
    """Torque of the drive along its direction.

    `spin` is the tail's rate about the motor axis without that torque, and what the torque adds to it.
    """
    kind, on = drive[0], drive[2]
    if kind == MOTOR:
        return float(drive[8] * drive[9] * y[9])
    if kind == TORQUE:
        return float(on * drive[3])
    if kind == RATE and on > 0.0:
        return float((drive[3] - spin) / spin_per_torque)
    return 0.0


@compiled
def _powers(fluid: Samples, friction: Samples, field: Samples, driven: float, out: Samples) -> None:
    """Powers of friction, of the fluid, and of field and drive, from the rates in `out`."""
    dissipated, worked = 0.0, driven
    for i in range(7):
        worked += field[i] * out[i]
        against = 0.0
        for m in range(7):
            against += fluid[i, m] * out[m]
        dissipated += out[i] * against
    out[9] = out[3] * (friction[3, 3] * out[3] + friction[3, 6] * out[6])
    out[9] += out[6] * (friction[6, 3] * out[3] + friction[6, 6] * out[6])
    out[10], out[11] = dissipated, worked


@compiled
def _motion(
    time: float,
    y: Samples,
    drag: Samples,
    friction: Samples,
    weight: Samples,
    wall: Samples,
    spots: Samples,
    drive: Samples,
    rotation: Samples,
    out: Samples,
    work: Samples,
) -> None:
    """Write what is in `OBSERVED` for a state."""
    a, fluid = work[0:49].reshape(7, 7), work[49:98].reshape(7, 7)
    b, force, field = work[98:112].reshape(7, 2), work[112:119], work[119:126]
    fixed = drive[1] != 0.0
    along = 3 if fixed else JOINT
    _axes(y, rotation)
    _turned(drag, y[7], fluid)
    _loads(y[7], rotation, weight, force)
    out[8], out[12] = _films(y, rotation, wall, spots, fluid, force, work[126:132])
    _assembled(fluid, friction, fixed, a)
    field[:] = 0.0
    if drive[0] == MAGNETIC and drive[2] > 0.0:
        _field(time, rotation, drive, field)
    if fixed:
        force[JOINT] = 0.0
    for i in range(7):
        b[i, 0], b[i, 1] = force[i] + field[i], 0.0
    b[along, 1] = 1.0
    _solved(a, b)
    torque = _torque(y, drive, b[3, 0] + b[6, 0], b[3, 1] + b[6, 1])  # the joint's rate is 0 where it is fixed
    for i in range(7):
        out[i] = b[i, 0] + torque * b[i, 1]
    out[7] = torque
    _powers(fluid, friction, field, torque * out[along], out)


@compiled
def rates(dy: Samples, time: float, y: Samples, data: Samples) -> None:
    """Write the time derivative of the state into `dy`.

    Args:
        dy: derivative of the state, the result.
        time: s.
        y: the state, see the constants of this module.
        data: from `packed`; it holds the work space too, and serves one caller at a time.
    """
    work = data[:_WORK]
    drag, friction = data[_WORK : _WORK + 49].reshape(7, 7), data[_WORK + 49 : _WORK + 98].reshape(7, 7)
    weight, wall = data[_WORK + 98 : _WORK + 106], data[_WORK + 106 : _WORK + 110]
    drive, spots = data[_WORK + 110 : _WORK + 130], data[_WORK + 130 :].reshape(-1, 6)
    out, rotation = work[139:152], work[152:161].reshape(3, 3)
    _motion(time, y, drag, friction, weight, wall, spots, drive, rotation, out, work)
    for i in range(3):
        dy[i] = rotation[i, 0] * out[0] + rotation[i, 1] * out[1] + rotation[i, 2] * out[2]
    w, i, j, k = y[3], y[4], y[5], y[6]
    dy[3] = 0.5 * (-i * out[3] - j * out[4] - k * out[5])
    dy[4] = 0.5 * (w * out[3] + j * out[5] - k * out[4])
    dy[5] = 0.5 * (w * out[4] + k * out[3] - i * out[5])
    dy[6] = 0.5 * (w * out[5] + i * out[4] - j * out[3])
    dy[7], dy[8] = out[6], out[3]
    dy[14], dy[15], dy[16] = out[11], out[9], out[10]
    if drive[0] != MOTOR:
        dy[9] = dy[10] = dy[11] = dy[12] = dy[13] = 0.0
        return
    current, slip = y[9], drive[8] * out[6]
    size = abs(current)
    resistance = (
        drive[12] + drive[13] * math.exp(-drive[14] * size) + drive[15] * math.exp(drive[16] * size) + drive[17] * size
    )
    supply = drive[2] * (drive[18] - drive[19] * size)
    dy[9] = (supply - resistance * current - drive[10] * slip) / drive[11]
    dy[10] = supply * current
    dy[11] = resistance * current * current
    dy[12] = (drive[10] - drive[9]) * slip * current
    dy[13] = drive[2] * current


@compiled
def observe(time: Samples, states: Samples, data: Samples, out: Samples) -> None:
    """Write what is in `OBSERVED` for samples of one stretch between switchings into the rows of `out`."""
    work, dy = data[:_WORK], np.empty(STATES)
    for row in range(time.size):
        rates(dy, time[row], states[row], data)
        out[row] = work[139:152]


@compiled
def thinnest_film(y: Samples, wall: Samples, spots: Samples) -> float:
    """Thinnest film between the wall and the robot in a state, m; infinite without a wall."""
    rotation, j = np.empty((3, 3)), np.empty(6)
    _axes(y, rotation)
    thinnest = math.inf
    for c in range(spots.shape[0]):
        thinnest = min(thinnest, film_of(y, rotation, wall, spots[c], j))
    return thinnest
