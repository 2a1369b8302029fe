"""A robot in unbounded fluid with films at a channel's wall, packed for csrc/two_links.c."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import SEEN_SIZE


def packed(drag: Samples, friction: Samples, weight: Samples, wall: Samples, spots: Samples, drive: Samples) -> Samples:
    """One array for csrc/stiff_steps.c; it begins with what is observed, and serves one caller at a time.

    Args:
        drag: A(0), 7x7, SI.
        friction: friction of joint and wall, 7x7, between Omega_x and omega_m only (`paper`: not symmetric).
        weight: submerged weight of body and rotor, and its first moments, `Weight`, (8,).
        wall: the wall, `Wall`, (4,); an infinite radius means none.
        spots: rings that may near the wall, `Ring`, (n, 6). A film of thickness h resists with c ((H/h)^p - 1).
        drive: drive and motor, `Drive`, (48,).
    """
    parts = (np.zeros(SEEN_SIZE), friction, weight, drive, drag, wall, spots)
    return np.concatenate([np.ravel(part) for part in parts])
