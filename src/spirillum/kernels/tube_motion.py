"""A robot in its tube with contact and dry friction: columns of its arrays; the equations stand in csrc/tube_motion.c.

The place: offset e of the origin from the tube's axis, azimuth A about +x from the lowest place, pitch p away from the
wall and yaw psi against the local axes (X along the tube, z_loc towards its axis, y_loc = z_loc x X), and the phase of
the tail in the roll-free axes F of the body.
"""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.rigid_links import SEEN

# What is observed, behind that of `rigid_links`; FILM is the smallest gap of the body.
CONTACT_FORCE, CONTACT_FRICTION = 13, 14  # normal and tangential, sums over contacts, N
CONTACT_POWER, FLOW_POWER = 15, 16  # lost to dry friction, and from the imposed flow, W
MEAN_FLOW = 17  # m/s; behind it TAIL_GAP, the smallest gap of the wire, m, where it is near the wall
OFFSET, AZIMUTH, WALL_PITCH, WALL_YAW, TURN = 19, 20, 21, 22, 23  # e, A, p, psi; roll of the body against F
BALANCE = 25  # what the solution leaves of the forces, 1; before it OUTSIDE, 0 inside the table, else the range left
# Forces towards the wall at the body's mid-length, N, which sum to zero; what the bound of the film's pressure lifts.
WEIGHT_LOAD, FILM_LOAD, OUTER_LOAD, CONTACT_LOAD, LIFT = 26, 27, 28, 29, 30

# The tube.
RADIUS, ROUGHNESS, LOAD = 0, 1, 2  # R, m; s, m; load at half of it, N
COEFFICIENT, SLIDING = 3, 4  # mu_c; v_r, m/s
VISCOSITY, ENDS, LENGTH = 5, 6, 7  # Pa s; one of the kinds below; L_eff, m
CAVITATION = 8  # the film's pressure is not below -p_c, Pa; infinite: without a bound
SITES, STATIONS = 9, 10  # their numbers
TUBE = 11
RANGE_LEFT = "the range of the robot's table"
"""Prefix of the event of a robot that tilts farther than its table is followed."""
CLOSED, OPEN, IMPOSED = 0.0, 1.0, 2.0  # kinds of ends


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
    """One array for `stiff_steps`; it begins with what is observed, and serves one caller at a time.

    Args:
        friction: friction of joint and wall, 7x7, between Omega_x and omega_m only (`paper`: not symmetric).
        weight: submerged weight of body and rotor, and its first moments, (8,).
        drive: drive and motor, (48,).
        tube: the tube, (9,) up to the numbers of sites and stations.
        wire: the wire, see `contacts`, (6,).
        sites: sites of body and coupling, see `contacts`, (n, 5).
        stations: stations along the wires, see `contacts`, (m, 8).
        flow: imposed mean flow: times, s, and velocities, m/s, (k, 2); straight between them, constant beyond.
    """
    numbers = np.array([len(sites), len(stations)], dtype=float)
    parts = (np.zeros(SEEN), friction, weight, drive, tube, numbers, wire, sites, stations, flow)
    return np.concatenate([np.ravel(part) for part in parts])
