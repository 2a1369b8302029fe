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

__all__ = ["film_of", "observe", "packed", "rates", "thinnest_film"]

# Columns of the arrays, by name on both sides: integers of the module are constants in compiled code.

# The state.
POSITION, ATTITUDE = 0, 3  # of the origin in the lab, m; unit quaternion (w, x, y, z), body axes to lab
PHASE, ROLL = 7, 8  # tail angle phi against the body; integral of Omega_x, rad
CURRENT = 9  # I in the motor's own sense, A
ELECTRICAL, RESISTIVE, CONVERSION, CHARGE = 10, 11, 12, 13  # integrals of powers, J, and of the battery's current, A s
DRIVEN, FRICTION, DISSIPATED = 14, 15, 16  # work of the drive's torque on both links, and where it goes, J
STATES = 17

# What is observed: the seven rates first.
VELOCITY, ROTATION, JOINT = 0, 3, 6  # U, m/s; Omega_b, rad/s, body axes; omega_m, rad/s
DRIVE_TORQUE, FILM = 7, 8  # N m; thinnest film, m
FRICTION_POWER, DISSIPATED_POWER, DRIVE_POWER = 9, 10, 11  # W; the last of field and drive
PRESSED = 12  # energy of pressed roughness, J
OBSERVED = 13

# The drive.
KIND, FIXED, DUTY = 0, 1, 2  # one of the kinds below; whether the joint is fixed; duty of the remote
GIVEN = 3  # prescribed torque, N m, or rate, rad/s
MOMENT, FIELD, FIELD_RATE = 3, 6, 7  # magnetic moment (3), A m^2; field, T; its rotation rate, rad/s
POLARITY, TORQUE_CONSTANT, BACK_EMF, INDUCTANCE = 8, 9, 10, 11  # sign; K_m, N m/A; K_b, V s/rad; L, H
CONSTANT, DECAY, DECAY_RATE, GROWTH, GROWTH_RATE, SLOPE = 12, 13, 14, 15, 16, 17  # of R(I), Table II
VOLTAGE, INTERNAL_RESISTANCE = 18, 19  # of the battery, V and ohm
DRIVE = 20
MOTOR, TORQUE, RATE, MAGNETIC = 0.0, 1.0, 2.0, 3.0  # kinds

# The wall.
RADIUS, ROUGHNESS, STIFFEST, LOAD = 0, 1, 2, 3  # m; m; largest resistance of a film, N s/m; pressing force, N
WALL = 4

# A ring that may near the wall.
RING_X, RING_RADIUS, RING_REACH = 0, 1, 2  # on the axis, m; a, m; half-length b along the axis, m
FILM_RESISTANCE, FILM_POWER, FILM_REACH = 3, 4, 5  # c, N s/m; p; H, m
RING = 6

# Weight: submerged weight of body and rotor, N, and first moments of the rest, N m, at phase 0.
WEIGHT_BODY, WEIGHT_ROTOR, MOMENT_BODY, MOMENT_ROTOR = 0, 1, 2, 5
WEIGHT = 8

# The work space, and what `packed` puts behind it.
_OUT, _ROTATION, _WORK = 139, 152, 161
_DRAG = _WORK
_FRICTION = _DRAG + 49
_WEIGHT = _FRICTION + 49
_WALL = _WEIGHT + WEIGHT
_DRIVE = _WALL + WALL
_RINGS = _DRIVE + DRIVE


def packed(drag: Samples, friction: Samples, weight: Samples, wall: Samples, spots: Samples, drive: Samples) -> Samples:
    """One array for `rates`, which takes longer to read eight of them than to work with them.

    Args:
        drag: A(0), 7x7, SI.
        friction: friction of joint and wall, 7x7, between Omega_x and omega_m only (`paper`: not symmetric).
        weight: submerged weight of body and rotor, and its first moments, (8,).
        wall: the wall, (4,); an infinite radius means none.
        spots: rings that may near the wall, (n, 6). A film of thickness h resists with c ((H/h)^p - 1).
        drive: drive and motor, (20,).
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
    w, i, j, k = y[ATTITUDE], y[ATTITUDE + 1], y[ATTITUDE + 2], y[ATTITUDE + 3]
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
    rotor, body = weight[MOMENT_ROTOR:WEIGHT], weight[MOMENT_BODY:MOMENT_ROTOR]
    rotor_x = rotor[0]
    rotor_y, rotor_z = cos * rotor[1] - sin * rotor[2], sin * rotor[1] + cos * rotor[2]
    x, y, z = body[0] + rotor_x, body[1] + rotor_y, body[2] + rotor_z
    total = weight[WEIGHT_BODY] + weight[WEIGHT_ROTOR]
    force[0], force[1], force[2] = total * down_x, total * down_y, total * down_z
    force[3] = y * down_z - z * down_y
    force[4] = z * down_x - x * down_z
    force[5] = x * down_y - y * down_x
    force[6] = rotor_y * down_z - rotor_z * down_y


@compiled
def _field(time: float, rotation: Samples, drive: Samples, force: Samples) -> None:
    """Add the torque m x B of a field B that turns about the lab's +x, up at time 0; m is fixed in the body."""
    angle = drive[FIELD_RATE] * time
    along, up = -drive[FIELD] * math.sin(angle), drive[FIELD] * math.cos(angle)
    b_x = rotation[1, 0] * along + rotation[2, 0] * up
    b_y = rotation[1, 1] * along + rotation[2, 1] * up
    b_z = rotation[1, 2] * along + rotation[2, 2] * up
    m_x, m_y, m_z = drive[MOMENT], drive[MOMENT + 1], drive[MOMENT + 2]
    force[3] += m_y * b_z - m_z * b_y
    force[4] += m_z * b_x - m_x * b_z
    force[5] += m_x * b_y - m_y * b_x


@compiled
def film_of(y: Samples, rotation: Samples, wall: Samples, spot: Samples, j: Samples) -> float:
    """Film between the wall and the surface about one ring of the robot, m; its loss per rate goes into `j`.

    The ring of radius a is at x on the axis and has a half-length b along it (0 for an edge). With the ring's middle c
    off the channel's axis, n = c/|c| across it and n_1 = n.e_1, the film is R - |c| - s less the roughness, where
    s^2 = b^2 n_1^2 + a^2 (1 - n_1^2) is how far a spheroid with semi-axes b, a reaches along n. `j` is its gradient:
    with t across n in the channel's section and s' = ds/dn_1,

        j_U = n + s' (t.e_1)/|c| t,   j_Omega = s' e_1 x n + x e_1 x j_U
    """
    x, radius, half = spot[RING_X], spot[RING_RADIUS], spot[RING_REACH]
    side = y[POSITION + 1] + rotation[1, 0] * x
    height = y[POSITION + 2] + rotation[2, 0] * x
    distance = math.hypot(side, height)
    near = distance < 1e-12 * wall[RADIUS]
    if near:
        side, height = 0.0, -1.0
    else:
        side, height = side / distance, height / distance
    n_1 = rotation[1, 0] * side + rotation[2, 0] * height
    reach = max(math.sqrt((half * n_1) ** 2 + radius**2 * max(1.0 - n_1 * n_1, 0.0)), 1e-12 * radius)
    slope = (half**2 - radius**2) * n_1 / reach
    turning = 0.0 if near else slope * (-rotation[1, 0] * height + rotation[2, 0] * side) / distance
    for i in range(3):
        normal = rotation[1, i] * side + rotation[2, i] * height
        across = -rotation[1, i] * height + rotation[2, i] * side
        j[i] = normal + turning * across
        j[3 + i] = normal
    n_y, n_z = j[4], j[5]
    j[3] = 0.0
    j[4] = -slope * n_z - x * j[2]
    j[5] = slope * n_y + x * j[1]
    return float(wall[RADIUS] - (0.0 if near else distance) - reach - wall[ROUGHNESS])


@compiled
def _films(
    y: Samples, rotation: Samples, wall: Samples, spots: Samples, a: Samples, force: Samples, work: Samples
) -> tuple[float, float]:
    """Add the films' resistance to `a` and the roughness's pressure to `force`; thinnest film, m, and its energy, J.

    Films are counted from the tips of the roughness s. Thinner than s, these are pressed together, with the force
    N (s/h - 1) and the energy N (s log(s/h) - s + h) for a load N of the robot's order.
    """
    thinnest, energy = math.inf, 0.0
    rough, load = wall[ROUGHNESS], wall[LOAD]
    j = work[0:6]
    for c in range(spots.shape[0]):
        spot = spots[c]
        film = film_of(y, rotation, wall, spot, j)
        thinnest = min(thinnest, film)
        if film >= spot[FILM_REACH]:
            continue
        film = max(film, 1e-9 * rough)
        share = film / spot[FILM_REACH]
        thinner = 1.0 / (share * math.sqrt(share)) if spot[FILM_POWER] == 1.5 else 1.0 / share
        k = min(spot[FILM_RESISTANCE] * (thinner - 1.0), wall[STIFFEST])
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
    kind, on = drive[KIND], drive[DUTY]
    if kind == MOTOR:
        return float(drive[POLARITY] * drive[TORQUE_CONSTANT] * y[CURRENT])
    if kind == TORQUE:
        return float(on * drive[GIVEN])
    if kind == RATE and on > 0.0:
        return float((drive[GIVEN] - spin) / spin_per_torque)
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
    out[FRICTION_POWER] = out[3] * (friction[3, 3] * out[3] + friction[3, 6] * out[6])
    out[FRICTION_POWER] += out[6] * (friction[6, 3] * out[3] + friction[6, 6] * out[6])
    out[DISSIPATED_POWER], out[DRIVE_POWER] = dissipated, worked


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
    fixed = drive[FIXED] != 0.0
    along = ROTATION if fixed else JOINT
    _axes(y, rotation)
    _turned(drag, y[PHASE], fluid)
    _loads(y[PHASE], rotation, weight, force)
    out[FILM], out[PRESSED] = _films(y, rotation, wall, spots, fluid, force, work[126:132])
    _assembled(fluid, friction, fixed, a)
    field[:] = 0.0
    if drive[KIND] == MAGNETIC and drive[DUTY] > 0.0:
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
    out[DRIVE_TORQUE] = torque
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
    drag, friction = data[_DRAG:_FRICTION].reshape(7, 7), data[_FRICTION:_WEIGHT].reshape(7, 7)
    weight, wall = data[_WEIGHT:_WALL], data[_WALL:_DRIVE]
    drive, spots = data[_DRIVE:_RINGS], data[_RINGS:].reshape(-1, RING)
    out, rotation = work[_OUT:_ROTATION], work[_ROTATION:_WORK].reshape(3, 3)
    _motion(time, y, drag, friction, weight, wall, spots, drive, rotation, out, work)
    for i in range(3):
        dy[i] = rotation[i, 0] * out[0] + rotation[i, 1] * out[1] + rotation[i, 2] * out[2]
    w, i, j, k = y[ATTITUDE], y[ATTITUDE + 1], y[ATTITUDE + 2], y[ATTITUDE + 3]
    turn_x, turn_y, turn_z = out[ROTATION], out[ROTATION + 1], out[ROTATION + 2]
    dy[ATTITUDE] = 0.5 * (-i * turn_x - j * turn_y - k * turn_z)
    dy[ATTITUDE + 1] = 0.5 * (w * turn_x + j * turn_z - k * turn_y)
    dy[ATTITUDE + 2] = 0.5 * (w * turn_y + k * turn_x - i * turn_z)
    dy[ATTITUDE + 3] = 0.5 * (w * turn_z + i * turn_y - j * turn_x)
    dy[PHASE], dy[ROLL] = out[JOINT], turn_x
    dy[DRIVEN], dy[FRICTION], dy[DISSIPATED] = out[DRIVE_POWER], out[FRICTION_POWER], out[DISSIPATED_POWER]
    if drive[KIND] != MOTOR:
        dy[CURRENT:DRIVEN] = 0.0
        return
    current, slip = y[CURRENT], drive[POLARITY] * out[JOINT]
    size = abs(current)
    resistance = (
        drive[CONSTANT]
        + drive[DECAY] * math.exp(-drive[DECAY_RATE] * size)
        + drive[GROWTH] * math.exp(drive[GROWTH_RATE] * size)
        + drive[SLOPE] * size
    )
    supply = drive[DUTY] * (drive[VOLTAGE] - drive[INTERNAL_RESISTANCE] * size)
    dy[CURRENT] = (supply - resistance * current - drive[BACK_EMF] * slip) / drive[INDUCTANCE]
    dy[ELECTRICAL] = supply * current
    dy[RESISTIVE] = resistance * current * current
    dy[CONVERSION] = (drive[BACK_EMF] - drive[TORQUE_CONSTANT]) * slip * current
    dy[CHARGE] = drive[DUTY] * current


@compiled
def observe(time: Samples, states: Samples, data: Samples, out: Samples) -> None:
    """Write what is in `OBSERVED` for samples of one stretch between switchings into the rows of `out`."""
    work, dy = data[:_WORK], np.empty(STATES)
    for row in range(time.size):
        rates(dy, time[row], states[row], data)
        out[row] = work[_OUT:_ROTATION]


@compiled
def thinnest_film(y: Samples, wall: Samples, spots: Samples) -> float:
    """Thinnest film between the wall and the robot in a state, m; infinite without a wall."""
    rotation, j = np.empty((3, 3)), np.empty(6)
    _axes(y, rotation)
    thinnest = math.inf
    for c in range(spots.shape[0]):
        thinnest = min(thinnest, film_of(y, rotation, wall, spots[c], j))
    return thinnest
