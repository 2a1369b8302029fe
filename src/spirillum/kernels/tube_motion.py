"""The motion of two rigid links in a tube: film, walls, contact and dry friction, compiled.

Unknowns are the seven rates q = (U, Omega_b, omega_m) in body axes about the origin. Forces balance without inertia:

    (mu M + B) q + sum_c mu_c N_c J_c' J_c q/sqrt(q' J_c' J_c q + v_r^2) = weight + field + tau d + flow - N n

M, (7, 7), is the table's at the robot's place, with the mean flow of open ends eliminated; B friction in the joint; N_c
the load that asperities carry at contact c along n_c, J_c q its sliding velocity (2,), mu_c the coefficient of dry
friction, made smooth below the sliding speed v_r. See `contacts` and `dry_friction`.

The place: offset e of the origin from the tube's axis, azimuth A about +x from the lowest place, pitch p away from the
wall and yaw psi against the local axes (X along the tube, z_loc towards its axis, y_loc = z_loc x X), and the phase of
the tail in the roll-free axes F of the body.
"""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.contacts import (
    SITE,
    SITE_ROTOR,
    STATION,
    STATION_X,
    STATION_XI,
    STATION_Y,
    STATION_Z,
    WIRE,
    asperity_energy,
    asperity_load,
    contact_rows,
    crest,
    ring_gap,
    tail_reaches,
)
from spirillum.kernels.dry_friction import balanced, sliding_force
from spirillum.kernels.rigid_links import (
    CONTACT,
    DRIVE,
    DRIVE_TORQUE,
    DUTY,
    FILM,
    FIXED,
    FLOW,
    GIVEN,
    JOINT,
    KIND,
    MAGNETIC,
    OUTSIDE,
    PHASE,
    POSITION,
    PRESSED,
    RATE,
    ROTATION,
    SEEN,
    TAIL_GAP,
    WEIGHT,
    assembled,
    axes,
    derivative,
    drive_torque,
    field_torque,
    powers,
    turned,
    weight_loads,
)
from spirillum.kernels.tube_table import resistance_at

# What is observed, behind that of `rigid_links`; FILM is the smallest gap of the body.
CONTACT_FORCE, CONTACT_FRICTION = 13, 14  # normal and tangential, sums over contacts, N
CONTACT_POWER, FLOW_POWER = 15, 16  # lost to dry friction, and from the imposed flow, W
MEAN_FLOW = 17  # m/s; behind it TAIL_GAP, the smallest gap of the wire, m, where it is near the wall
OFFSET, AZIMUTH, WALL_PITCH, WALL_YAW, TURN = 19, 20, 21, 22, 23  # e, A, p, psi; roll of the body against F
BALANCE = 25  # what the solution leaves of the forces, 1; before it OUTSIDE, 0 inside the table, else the range left
OBSERVED = SEEN

# The tube.
RADIUS, ROUGHNESS, LOAD = 0, 1, 2  # R, m; s, m; load at half of it, N
COEFFICIENT, SLIDING = 3, 4  # mu_c; v_r, m/s
VISCOSITY, ENDS, LENGTH = 5, 6, 7  # Pa s; one of the kinds below; L_eff, m
SITES, STATIONS = 8, 9  # their numbers
TUBE = 10
CLOSED, OPEN, IMPOSED = 0.0, 1.0, 2.0  # kinds of ends

_MOST = 32  # contacts at once

# The work space, and what `packed` puts behind it.
_OUT, _ROTATION = 0, OBSERVED
_MATRIX = _ROTATION + 9
_TURNED = _MATRIX + 64
_FLUID = _TURNED + 64
_A = _FLUID + 49
_H = _A + 49
_FORCE = _H + 77 + 2 * _MOST
_FIELD = _FORCE + 7
_STREAM = _FIELD + 7
_Q = _STREAM + 7
_R = _Q + 7
_J = _R + 7
_NORMAL = _J + 7
_POINT = _NORMAL + 3
_LOADS = _POINT + 3
_ROWS = _LOADS + _MOST
_WORK = _ROWS + 14 * _MOST
_FRICTION = _WORK
_WEIGHT = _FRICTION + 49
_DRIVE = _WEIGHT + WEIGHT
_TUBE = _DRIVE + DRIVE
_WIRE = _TUBE + TUBE
_SITES = _WIRE + WIRE


def packed(
    friction: Samples,
    weight: Samples,
    drive: Samples,
    tube: Samples,
    wire: Samples,
    sites: Samples,
    stations: Samples,
    flow: Samples,
) -> Samples:
    """One array for `rates`.

    Args:
        friction: friction of joint and wall, 7x7, between Omega_x and omega_m only (`paper`: not symmetric).
        weight: submerged weight of body and rotor, and its first moments, (8,).
        drive: drive and motor, (23,).
        tube: the tube, (8,) up to the numbers of sites and stations.
        wire: the wire, see `contacts`, (6,).
        sites: sites of body and coupling, see `contacts`, (n, 5).
        stations: stations along the wire, see `contacts`, (m, 4).
        flow: imposed mean flow: times, s, and velocities, m/s, (k, 2); straight between them, constant beyond.
    """
    numbers = np.array([len(sites), len(stations)], dtype=float)
    parts = (np.zeros(_WORK), friction, weight, drive, tube, numbers, wire, sites, stations, flow)
    return np.concatenate([np.ravel(part) for part in parts])


@compiled
def _placed(y: Samples, rotation: Samples, radius: float, out: Samples) -> None:
    """Offset, azimuth, pitch, yaw and roll of the body against F; on the axis the azimuth is 0."""
    side, up = y[POSITION + 1], y[POSITION + 2]
    e = math.hypot(side, up)
    z_y, z_z = 0.0, 1.0
    if e > 1e-9 * radius:
        z_y, z_z = -side / e, -up / e
    y_y, y_z = z_z, -z_y  # y_loc = z_loc x X
    d_y, d_z = rotation[1, 0], rotation[2, 0]
    pitch = math.asin(min(max(d_y * z_y + d_z * z_z, -1.0), 1.0))
    yaw = math.atan2(d_y * y_y + d_z * y_z, rotation[0, 0])
    # y' of F is across the axis and along the plane of X and y_loc; z' = d x y'.
    sin, cos = math.sin(yaw), math.cos(yaw)
    f_x, f_y, f_z = -sin, cos * y_y, cos * y_z
    along = rotation[0, 1] * f_x + rotation[1, 1] * f_y + rotation[2, 1] * f_z
    across = rotation[0, 2] * f_x + rotation[1, 2] * f_y + rotation[2, 2] * f_z  # e_3.y' = -e_2.z'
    out[OFFSET], out[AZIMUTH], out[WALL_PITCH], out[WALL_YAW] = e, math.atan2(-z_y, z_z), pitch, yaw
    out[TURN] = math.atan2(-across, along)


@compiled
def _mean_flow(time: float, flow: Samples) -> float:
    """Imposed mean velocity, m/s."""
    last = flow.shape[0] - 1
    if time >= flow[last, 0]:
        return float(flow[last, 1])
    if time <= flow[0, 0]:
        return float(flow[0, 1])
    before, after = 0, last
    while after - before > 1:
        middle = (before + after) // 2
        before, after = (middle, after) if flow[middle, 0] < time else (before, middle)
    share = (time - flow[before, 0]) / (flow[after, 0] - flow[before, 0])
    return float(flow[before, 1] + share * (flow[after, 1] - flow[before, 1]))


@compiled
def _fluid(
    time: float, phase: float, table: Samples, tube: Samples, flow: Samples, out: Samples, work: Samples
) -> float:
    """The fluid's matrix (7, 7) and the force of an imposed flow (7,), in body axes; what open ends add per q.

    Returns:
        The weight of M[:7, 7].q in the mean flow of open ends; else 0, and the mean flow is in `out`.
    """
    m, m_b = work[_MATRIX:_TURNED].reshape(8, 8), work[_TURNED:_FLUID].reshape(8, 8)
    fluid, stream = work[_FLUID:_A].reshape(7, 7), work[_STREAM:_Q]
    roll, mu = out[TURN], tube[VISCOSITY]
    out[OUTSIDE] = resistance_at(table, out[OFFSET], out[WALL_PITCH], out[WALL_YAW], roll + phase, m)
    turned(m, -roll, m_b)
    opened = 1.0 / (8.0 * math.pi * tube[LENGTH] + m_b[7, 7]) if tube[ENDS] == OPEN else 0.0
    out[MEAN_FLOW] = _mean_flow(time, flow) if tube[ENDS] == IMPOSED else 0.0
    for i in range(7):
        stream[i] = mu * m_b[i, 7] * out[MEAN_FLOW]
        for j in range(7):
            fluid[i, j] = mu * (m_b[i, j] - opened * m_b[i, 7] * m_b[j, 7])
    return opened


@compiled
def _touching(
    y: Samples, rotation: Samples, tube: Samples, wire: Samples, sites: Samples, stations: Samples, work: Samples
) -> int:
    """Contacts: their loads and sliding rows into `work`, their push into the force; how many there are."""
    out = work[_OUT:_ROTATION]
    j, normal, point = work[_J:_NORMAL], work[_NORMAL:_POINT], work[_POINT:_LOADS]
    height, radius = tube[ROUGHNESS], tube[RADIUS]
    count = 0
    out[FILM], out[TAIL_GAP], out[PRESSED], out[CONTACT_FORCE] = math.inf, math.inf, 0.0, 0.0
    for c in range(sites.shape[0]):
        gap = ring_gap(y, rotation, radius, sites[c], normal, point, j)
        if sites[c, SITE_ROTOR] == 0.0:
            out[FILM] = min(out[FILM], gap)
        if gap < height and count < _MOST:
            count = _touched(gap, tube, rotation, sites[c, SITE_ROTOR], count, work)
    if stations.shape[0] == 0 or not tail_reaches(y, rotation, radius, wire, height):
        return count
    phase, last = y[PHASE], stations.shape[0] - 1
    before, here = 0.0, _station(y, rotation, stations[0], phase)
    for k in range(last + 1):
        after = _station(y, rotation, stations[k + 1], phase) if k < last else 0.0
        if here >= before and here > after and count < _MOST:
            low, high = stations[max(k - 1, 0), STATION_XI], stations[min(k + 1, last), STATION_XI]
            bracket = (low, stations[k, STATION_XI], high)
            gap = crest(y, rotation, radius, wire, phase, bracket, normal, point, j)
            out[TAIL_GAP] = min(out[TAIL_GAP], gap)
            if gap < height:
                count = _touched(gap, tube, rotation, 1.0, count, work)
        before, here = here, after
    return count


@compiled
def _station(y: Samples, rotation: Samples, station: Samples, phase: float) -> float:
    """Squared distance of a station of the wire from the tube's axis, m^2."""
    cos, sin = math.cos(phase), math.sin(phase)
    a, b = cos * station[STATION_Y] - sin * station[STATION_Z], sin * station[STATION_Y] + cos * station[STATION_Z]
    side = y[POSITION + 1] + rotation[1, 0] * station[STATION_X] + rotation[1, 1] * a + rotation[1, 2] * b
    up = y[POSITION + 2] + rotation[2, 0] * station[STATION_X] + rotation[2, 1] * a + rotation[2, 2] * b
    return float(side * side + up * up)


@compiled
def _touched(gap: float, tube: Samples, rotation: Samples, turning: float, count: int, work: Samples) -> int:
    """Add one contact to the lists and its push to the force; how many there are."""
    out, force, j = work[_OUT:_ROTATION], work[_FORCE:_FIELD], work[_J:_NORMAL]
    load = asperity_load(gap, tube[ROUGHNESS], tube[LOAD])
    out[PRESSED] += asperity_energy(gap, tube[ROUGHNESS], tube[LOAD])
    out[CONTACT_FORCE] += load
    for i in range(7):
        force[i] -= load * j[i]
    work[_LOADS + count] = load
    rows = work[_ROWS:_WORK].reshape(_MOST, 2, 7)[count]
    contact_rows(rotation, work[_NORMAL:_POINT], work[_POINT:_LOADS], turning, rows)
    return count + 1


@compiled
def _moved(time: float, y: Samples, data: Samples, table: Samples) -> None:
    """Write what is in `OBSERVED` for a state into the work space."""
    work = data[:_WORK]
    friction, weight = data[_FRICTION:_WEIGHT].reshape(7, 7), data[_WEIGHT:_DRIVE]
    drive, tube, wire = data[_DRIVE:_TUBE], data[_TUBE:_WIRE], data[_WIRE:_SITES]
    first = _SITES + SITE * int(tube[SITES])
    second = first + STATION * int(tube[STATIONS])
    sites, stations = data[_SITES:first].reshape(-1, SITE), data[first:second].reshape(-1, STATION)
    flow = data[second:].reshape(-1, 2)
    out, rotation = work[_OUT:_ROTATION], work[_ROTATION:_MATRIX].reshape(3, 3)
    fluid, a = work[_FLUID:_A].reshape(7, 7), work[_A:_H].reshape(7, 7)
    force, field, stream, q = work[_FORCE:_FIELD], work[_FIELD:_STREAM], work[_STREAM:_Q], work[_Q:_R]
    axes(y, rotation)
    _placed(y, rotation, tube[RADIUS], out)
    opened = _fluid(time, y[PHASE], table, tube, flow, out, work)
    weight_loads(y[PHASE], rotation, weight, force)
    count = _touching(y, rotation, tube, wire, sites, stations, work)
    for i in range(7):
        field[i] = 0.0
    if drive[KIND] == MAGNETIC and drive[DUTY] > 0.0:
        field_torque(time, rotation, drive, field)
    assembled(fluid, friction, drive[FIXED] != 0.0, a)
    for i in range(7):
        force[i] += field[i] + stream[i]
    loads = work[_LOADS : _LOADS + count]
    for c in range(count):
        loads[c] *= tube[COEFFICIENT]
    torque = _driven(y, drive, tube[SLIDING], loads, work)
    for i in range(7):
        out[i] = q[i]
    out[DRIVE_TORQUE] = torque
    powers(fluid, friction, field, torque * out[ROTATION if drive[FIXED] != 0.0 else JOINT], out)
    out[FLOW_POWER] = 0.0
    for i in range(7):
        out[MEAN_FLOW] += opened * work[_TURNED + 8 * i + 7] * q[i]
        out[FLOW_POWER] += stream[i] * q[i]
    _slid(loads, work[_ROWS:_WORK].reshape(_MOST, 2, 7), tube[SLIDING], q, out)


@compiled
def _driven(y: Samples, drive: Samples, slow: float, loads: Samples, work: Samples) -> float:
    """Rates at which forces and drive are in balance, into the work space; the drive's torque, N m."""
    a, force, q, r = work[_A:_H].reshape(7, 7), work[_FORCE:_FIELD], work[_Q:_R], work[_R:_J]
    rows = work[_ROWS:_WORK].reshape(_MOST, 2, 7)
    fixed, prescribed = drive[FIXED] != 0.0, drive[KIND] == RATE and drive[DUTY] > 0.0
    along = ROTATION if fixed else JOINT
    begin = 1.0
    for i in range(7):
        if not math.isfinite(q[i]):
            begin = 0.0
    if begin == 0.0:  # a trial inside the wall has no rates; the next one must not begin with them
        for i in range(7):
            q[i] = 0.0
    torque = 0.0 if prescribed else drive_torque(y, drive, 0.0, 1.0)
    force[along] += torque
    if fixed:
        force[JOINT] = q[JOINT] = 0.0
        for c in range(loads.size):
            rows[c, 0, JOINT] = rows[c, 1, JOINT] = 0.0
    if prescribed:
        q[along] += drive[GIVEN] - q[3] - q[6]
    left = balanced(a, force, loads, rows, slow, along, prescribed, q, r, work[_H:_FORCE])
    work[_OUT + BALANCE] = left
    return float(r[along]) if prescribed else torque


@compiled
def _slid(loads: Samples, rows: Samples, slow: float, q: Samples, out: Samples) -> None:
    """Force and power of dry friction, summed over the contacts."""
    out[CONTACT_FRICTION] = out[CONTACT_POWER] = 0.0
    for c in range(loads.size):
        u, v, k = sliding_force(rows[c], q, loads[c], slow)
        out[CONTACT_FRICTION] += k * math.hypot(u, v)
        out[CONTACT_POWER] += k * (u * u + v * v)


@compiled
def rates(dy: Samples, time: float, y: Samples, data: Samples, table: Samples) -> None:
    """Write the time derivative of the state into `dy`.

    Args:
        dy: derivative of the state, the result, (19,).
        time: s.
        y: the state, see the constants of this module and of `rigid_links`.
        data: from `packed`; it holds the work space too, and serves one caller at a time.
        table: the robot's table.
    """
    _moved(time, y, data, table)
    out, rotation = data[_OUT:_ROTATION], data[_ROTATION:_MATRIX].reshape(3, 3)
    derivative(dy, y, data[_DRIVE:_TUBE], rotation, out)
    dy[CONTACT], dy[FLOW] = out[CONTACT_POWER], out[FLOW_POWER]


@compiled
def observe(time: Samples, states: Samples, data: Samples, table: Samples, out: Samples) -> None:
    """Write what is in `OBSERVED` for samples of one stretch between switchings into the rows of `out`."""
    for row in range(time.size):
        _moved(time[row], states[row], data, table)
        for column in range(_ROTATION - _OUT):
            out[row, column] = data[_OUT + column]


@compiled
def gaps_of(y: Samples, data: Samples, gaps: Samples) -> None:
    """Gap at every site, and last the smallest of the wire (infinite far from the wall), m."""
    work, tube, wire = data[:_WORK], data[_TUBE:_WIRE], data[_WIRE:_SITES]
    first = _SITES + SITE * int(tube[SITES])
    second = first + STATION * int(tube[STATIONS])
    sites, stations = data[_SITES:first].reshape(-1, SITE), data[first:second].reshape(-1, STATION)
    rotation = work[_ROTATION:_MATRIX].reshape(3, 3)
    axes(y, rotation)
    for c in range(sites.shape[0]):
        gaps[c] = ring_gap(
            y, rotation, tube[RADIUS], sites[c], work[_NORMAL:_POINT], work[_POINT:_LOADS], work[_J:_NORMAL]
        )
    _touching(y, rotation, tube, wire, sites, stations, work)
    gaps[sites.shape[0]] = work[_OUT + TAIL_GAP]
