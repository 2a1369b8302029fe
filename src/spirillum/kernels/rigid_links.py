"""Two rigid links that move together: what acts on them beside the fluid, compiled.

State, weight and buoyancy, the field on a magnetic moment, the drive's torque, the motor's current and the powers are
the same wherever the robot swims; `two_links` and `tube_motion` differ in the fluid, the wall and their solution.
"""

from __future__ import annotations

import math

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled

# Columns of the arrays, by name on both sides: integers of the module are constants in compiled code.

# The state.
POSITION, ATTITUDE = 0, 3  # of the origin in the lab, m; unit quaternion (w, x, y, z), body axes to lab
PHASE, ROLL = 7, 8  # tail angle phi against the body; integral of Omega_x, rad
CURRENT = 9  # I in the motor's own sense, A
ELECTRICAL, RESISTIVE, CONVERSION, CHARGE = 10, 11, 12, 13  # integrals of powers, J, and of the battery's current, A s
DRIVEN, FRICTION, DISSIPATED = 14, 15, 16  # work of the drive's torque on both links, and where it goes, J
CONTACT, FLOW = 17, 18  # work of dry friction, and of an imposed flow, J; zero outside a tube
STATES = 19

# What is observed: the seven rates first.
VELOCITY, ROTATION, JOINT = 0, 3, 6  # U, m/s; Omega_b, rad/s, body axes; omega_m, rad/s
DRIVE_TORQUE, FILM = 7, 8  # N m; thinnest film, m
FRICTION_POWER, DISSIPATED_POWER, DRIVE_POWER = 9, 10, 11  # W; the last of field and drive
PRESSED = 12  # energy of pressed roughness, J
OBSERVED = 13
TAIL_GAP, OUTSIDE = 18, 24  # what the integrator reads besides, see `tube_motion`
SEEN = 26  # places of all that is observed, wherever the robot swims

# The drive.
KIND, FIXED, DUTY = 0, 1, 2  # one of the kinds below; whether the joint is fixed; duty of the remote
GIVEN = 3  # prescribed torque, N m, or rate, rad/s
MOMENT, FIELD, FIELD_RATE = 3, 6, 7  # magnetic moment (3), A m^2; field, T; its rotation rate, rad/s
POLARITY, TORQUE_CONSTANT, BACK_EMF, INDUCTANCE = 8, 9, 10, 11  # sign; K_m, N m/A; K_b, V s/rad; L, H
CONSTANT, DECAY, DECAY_RATE, GROWTH, GROWTH_RATE, SLOPE = 12, 13, 14, 15, 16, 17  # of R(I), Table II
VOLTAGE, INTERNAL_RESISTANCE = 18, 19  # of the battery, V and ohm
AXIS_Y, AXIS_Z, FIELD_PHASE = 20, 21, 22  # of the field's axis, a unit vector, across the lab's x; at time 0, rad
DRIVE = 23
MOTOR, TORQUE, RATE, MAGNETIC = 0.0, 1.0, 2.0, 3.0  # kinds


# Weight: submerged weight of body and rotor, N, and first moments of the rest, N m, at phase 0.
WEIGHT_BODY, WEIGHT_ROTOR, MOMENT_BODY, MOMENT_ROTOR = 0, 1, 2, 5
WEIGHT = 8


@compiled
def axes(y: Samples, rotation: Samples) -> None:
    """Rotation matrix, body axes to lab, of the state's quaternion made a unit one."""
    w, i, j, k = y[ATTITUDE], y[ATTITUDE + 1], y[ATTITUDE + 2], y[ATTITUDE + 3]
    s = 2.0 / (w * w + i * i + j * j + k * k)
    rotation[0, 0], rotation[0, 1], rotation[0, 2] = 1 - s * (j * j + k * k), s * (i * j - k * w), s * (i * k + j * w)
    rotation[1, 0], rotation[1, 1], rotation[1, 2] = s * (i * j + k * w), 1 - s * (i * i + k * k), s * (j * k - i * w)
    rotation[2, 0], rotation[2, 1], rotation[2, 2] = s * (i * k - j * w), s * (j * k + i * w), 1 - s * (i * i + j * j)


@compiled
def weight_loads(phase: float, rotation: Samples, weight: Samples, force: Samples) -> None:
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
def field_at(time: float, drive: Samples) -> tuple[float, float, float]:
    """The field in the lab at a time, T: it turns about its axis n, at right angles to it.

    About x it is b = B (0, -sin a, cos a), a = rate t + phase, up at a = 0. The least rotation that takes x to n takes
    it to b - n.b (x + n)/(1 + n_x).
    """
    angle = drive[FIELD_RATE] * time + drive[FIELD_PHASE]
    along, up = -drive[FIELD] * math.sin(angle), drive[FIELD] * math.cos(angle)
    n_y, n_z = drive[AXIS_Y], drive[AXIS_Z]
    n_x = math.sqrt(1.0 - n_y * n_y - n_z * n_z)
    share = (n_y * along + n_z * up) / (1.0 + n_x)
    return -share * (1.0 + n_x), along - share * n_y, up - share * n_z


@compiled
def field_torque(time: float, rotation: Samples, drive: Samples, force: Samples) -> None:
    """Add the torque m x B of a field B that turns about its axis; m is fixed in the body."""
    ahead, along, up = field_at(time, drive)
    b_x = rotation[0, 0] * ahead + rotation[1, 0] * along + rotation[2, 0] * up
    b_y = rotation[0, 1] * ahead + rotation[1, 1] * along + rotation[2, 1] * up
    b_z = rotation[0, 2] * ahead + rotation[1, 2] * along + rotation[2, 2] * up
    m_x, m_y, m_z = drive[MOMENT], drive[MOMENT + 1], drive[MOMENT + 2]
    force[3] += m_y * b_z - m_z * b_y
    force[4] += m_z * b_x - m_x * b_z
    force[5] += m_x * b_y - m_y * b_x


@compiled
def assembled(fluid: Samples, friction: Samples, fixed: bool, a: Samples) -> None:  # noqa: FBT001 - compiled
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
def drive_torque(y: Samples, drive: Samples, spin: float, spin_per_torque: float) -> float:
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
def powers(fluid: Samples, friction: Samples, field: Samples, driven: float, out: Samples) -> None:
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
def turned(drag: Samples, phase: float, out: Samples) -> None:
    """A(phi) = Q A(0) Q' with Q the rotation by phi about x of velocities and of rotations, 7x7 or larger."""
    cos, sin = math.cos(phase), math.sin(phase)
    size = drag.shape[0]
    for i in range(size):
        for j in range(size):
            out[i, j] = drag[i, j]
    for first in (1, 4):
        for i in range(size):
            a, b = out[i, first], out[i, first + 1]
            out[i, first], out[i, first + 1] = cos * a - sin * b, sin * a + cos * b
    for first in (1, 4):
        for j in range(size):
            a, b = out[first, j], out[first + 1, j]
            out[first, j], out[first + 1, j] = cos * a - sin * b, sin * a + cos * b


@compiled
def solved(a: Samples, b: Samples) -> None:
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
def derivative(dy: Samples, y: Samples, drive: Samples, rotation: Samples, out: Samples) -> None:
    """Write the time derivative of the state into `dy`, from the rates and powers in `out`; axes in `rotation`.

    The works of a tube, behind the others, are left alone.
    """
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
