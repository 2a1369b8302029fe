"""Frames on which something else than the robot was followed: its marks are not there, and its place jumps.

Where a still picture hides a slow robot, or clutter looks like a body, the outline may lie beside the robot for a
while and then find it. Neither stripes nor tail can be read meanwhile, as they are looked for where they are not.
"""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.robust import repeated_median_line, stretches_of
from spirillum.vision.flag import Flag
from spirillum.vision.track.constants import ELSEWHERE

__all__ = ["something_else", "something_else_flag"]


def something_else(time: Samples, place: Samples, marked: np.ndarray, length: float) -> np.ndarray:
    """Frames of stretches without marks from which the place jumps to frames with marks, a mask, (n,).

    Args:
        time: time of each frame, s, (n,).
        place: place of the body, m, (n, 2); NaN where it is unknown.
        marked: whether stripes or tail were read, (n,).
        length: of the body, m.
    """
    found = np.zeros(time.size, dtype=bool)
    known = np.isfinite(place).all(axis=1)
    sure = np.flatnonzero(marked & known)
    if sure.size < ELSEWHERE.fewest:
        return found
    speed = np.array([repeated_median_line(time[sure], place[sure, axis]).slope for axis in (0, 1)])
    along = place - speed * (time - time[0])[:, None]  # what does not move as the robot does jumps
    for stretch in stretches_of(~marked & known):
        beside = sure[(sure > stretch[-1]) | (sure < stretch[0])]
        after, before = beside[beside > stretch[-1]], beside[beside < stretch[0]]
        few = ELSEWHERE.beside
        sides = [(stretch[-few:], after[:few]), (stretch[:few], before[-few:])]
        jumps = [np.median(along[own], axis=0) - np.median(along[other], axis=0) for own, other in sides if other.size]
        if stretch.size >= ELSEWHERE.shortest and all(np.hypot(*jump) > ELSEWHERE.jump * length for jump in jumps):
            found[stretch] = True
    return found


def something_else_flag(found: np.ndarray) -> tuple[Flag, ...]:
    """What to say of such frames.

    Args:
        found: a mask of them, (n,).
    """
    count = int(found.sum())
    if not count:
        return ()
    sentence = (
        f"on {count} frames ({100.0 * count / found.size:.3g} %) something else than the robot was followed: neither "
        "stripes nor tail are there, and the place jumps to where they are; these frames are left out (a [region] of "
        "the setup around the robot's way leaves out what looks like it)"
    )
    return (Flag("something-else-followed", sentence),)
