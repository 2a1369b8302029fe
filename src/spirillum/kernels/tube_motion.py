"""A robot in its tube with contact and dry friction, packed for csrc/tube_motion.c."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import SEEN_SIZE

RANGE_LEFT = "the range of the robot's table"
"""Prefix of the event of a robot that tilts farther than its table is followed."""


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
    """One array for csrc/stiff_steps.c; it begins with what is observed, and serves one caller at a time.

    Args:
        friction: friction of joint and wall, 7x7, between Omega_x and omega_m only (`paper`: not symmetric).
        weight: submerged weight of body and rotor, and its first moments, `Weight`, (8,).
        drive: drive and motor, `Drive`, (48,).
        tube: `Tube`, (9,) up to the numbers of sites and stations.
        wire: the wire, `Wire`, (6,).
        sites: sites of body and coupling, `Site`, (n, 5).
        stations: stations along the wires, `Station`, (m, 8).
        flow: imposed mean flow: times, s, and velocities, m/s, (k, 2); straight between them, constant beyond.
    """
    numbers = np.array([len(sites), len(stations)], dtype=float)
    parts = (np.zeros(SEEN_SIZE), friction, weight, drive, tube, numbers, wire, sites, stations, flow)
    return np.concatenate([np.ravel(part) for part in parts])
