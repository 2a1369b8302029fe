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
from spirillum.kernels.rigid_links import (
    CONTACT,
    DRIVE,
    DRIVE_TORQUE,
    DUTY,
    FILM,
    FIXED,
    FLOW,
    JOINT,
    KIND,
    MAGNETIC,
    OBSERVED,
    OUTSIDE,
    PHASE,
    POSITION,
    PRESSED,
    ROTATION,
    SEEN,
    STATES,
    TAIL_GAP,
    WEIGHT,
    assembled,
    axes,
    derivative,
    drive_torque,
    field_torque,
    powers,
    solved,
    turned,
    weight_loads,
)

# Columns of the arrays, by name on both sides; those of the links are in `rigid_links`.

# The wall.
RADIUS, ROUGHNESS, STIFFEST, LOAD = 0, 1, 2, 3  # m; m; largest resistance of a film, N s/m; pressing force, N
WALL = 4

# A ring that may near the wall.
RING_X, RING_RADIUS, RING_REACH = 0, 1, 2  # on the axis, m; a, m; half-length b along the axis, m
FILM_RESISTANCE, FILM_POWER, FILM_REACH = 3, 4, 5  # c, N s/m; p; H, m
RING = 6

# The work space, and what `packed` puts behind it.
_OUT, _ROTATION = 0, SEEN
_BALANCE = _ROTATION + 9
_WORK = _BALANCE + 132
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
        drive: drive and motor, (23,).
    """
    parts = (np.zeros(_WORK), drag, friction, weight, wall, drive, spots)
    return np.concatenate([np.ravel(part) for part in parts])


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
    """Write what is observed in a state."""
    a, fluid = work[0:49].reshape(7, 7), work[49:98].reshape(7, 7)
    b, force, field = work[98:112].reshape(7, 2), work[112:119], work[119:126]
    fixed = drive[FIXED] != 0.0
    along = ROTATION if fixed else JOINT
    axes(y, rotation)
    turned(drag, y[PHASE], fluid)
    weight_loads(y[PHASE], rotation, weight, force)
    out[FILM], out[PRESSED] = _films(y, rotation, wall, spots, fluid, force, work[126:132])
    assembled(fluid, friction, fixed, a)
    field[:] = 0.0
    if drive[KIND] == MAGNETIC and drive[DUTY] > 0.0:
        field_torque(time, rotation, drive, field)
    if fixed:
        force[JOINT] = 0.0
    for i in range(7):
        b[i, 0], b[i, 1] = force[i] + field[i], 0.0
    b[along, 1] = 1.0
    solved(a, b)
    torque = drive_torque(y, drive, b[3, 0] + b[6, 0], b[3, 1] + b[6, 1])  # the joint's rate is 0 where it is fixed
    for i in range(7):
        out[i] = b[i, 0] + torque * b[i, 1]
    out[DRIVE_TORQUE], out[TAIL_GAP], out[OUTSIDE] = torque, math.inf, 0.0
    powers(fluid, friction, field, torque * out[along], out)


@compiled
def rates(dy: Samples, time: float, y: Samples, data: Samples) -> None:
    """Write the time derivative of the state into `dy`.

    Args:
        dy: derivative of the state, the result.
        time: s.
        y: the state, see the constants of this module.
        data: from `packed`; it holds the work space too, and serves one caller at a time.
    """
    out, rotation, work = data[_OUT:_ROTATION], data[_ROTATION:_BALANCE].reshape(3, 3), data[_BALANCE:_WORK]
    drag, friction = data[_DRAG:_FRICTION].reshape(7, 7), data[_FRICTION:_WEIGHT].reshape(7, 7)
    weight, wall = data[_WEIGHT:_WALL], data[_WALL:_DRIVE]
    drive, spots = data[_DRIVE:_RINGS], data[_RINGS:].reshape(-1, RING)
    _motion(time, y, drag, friction, weight, wall, spots, drive, rotation, out, work)
    derivative(dy, y, drive, rotation, out)
    dy[CONTACT] = dy[FLOW] = 0.0


@compiled
def observe(time: Samples, states: Samples, data: Samples, out: Samples) -> None:
    """Write what is in `OBSERVED` for samples of one stretch between switchings into the rows of `out`."""
    dy = np.empty(STATES)
    for row in range(time.size):
        rates(dy, time[row], states[row], data)
        for column in range(OBSERVED):
            out[row, column] = data[_OUT + column]


@compiled
def thinnest_film(y: Samples, wall: Samples, spots: Samples) -> float:
    """Thinnest film between the wall and the robot in a state, m; infinite without a wall."""
    rotation, j = np.empty((3, 3)), np.empty(6)
    axes(y, rotation)
    thinnest = math.inf
    for c in range(spots.shape[0]):
        thinnest = min(thinnest, film_of(y, rotation, wall, spots[c], j))
    return thinnest


@compiled
def gaps_of(y: Samples, data: Samples, gaps: Samples) -> None:
    """Thinnest film between the wall and the robot, from the tips of the roughness, m; infinite without a wall."""
    gaps[0] = thinnest_film(y, data[_WALL:_DRIVE], data[_RINGS:].reshape(-1, RING))
