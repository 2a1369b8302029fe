"""A robot in unbounded fluid with films at a channel's wall: columns of its arrays; the equations: csrc/two_links.c."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.rigid_links import SEEN

# The wall.
RADIUS, ROUGHNESS, STIFFEST, LOAD = 0, 1, 2, 3  # m; m; largest resistance of a film, N s/m; pressing force, N
WALL = 4

# A ring that may near the wall.
RING_X, RING_RADIUS, RING_REACH = 0, 1, 2  # on the axis, m; a, m; half-length b along the axis, m
FILM_RESISTANCE, FILM_POWER, FILM_REACH = 3, 4, 5  # c, N s/m; p; H, m
RING = 6


def packed(drag: Samples, friction: Samples, weight: Samples, wall: Samples, spots: Samples, drive: Samples) -> Samples:
    """One array for `stiff_steps`; it begins with what is observed, and serves one caller at a time.

    Args:
        drag: A(0), 7x7, SI.
        friction: friction of joint and wall, 7x7, between Omega_x and omega_m only (`paper`: not symmetric).
        weight: submerged weight of body and rotor, and its first moments, (8,).
        wall: the wall, (4,); an infinite radius means none.
        spots: rings that may near the wall, (n, 6). A film of thickness h resists with c ((H/h)^p - 1).
        drive: drive and motor, (48,).
    """
    return np.concatenate([np.ravel(part) for part in (np.zeros(SEEN), friction, weight, drive, drag, wall, spots)])
