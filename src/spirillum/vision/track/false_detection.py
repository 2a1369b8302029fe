"""Frames on which something else than the robot was followed: its marks are not there, and its place does not fit.

Where a still picture hides a slow robot, or clutter looks like a body, the outline may lie beside the robot for a
while and then find it. Over a grid it stays behind where the robot is hidden or taken away. Neither stripes nor tail
can be read meanwhile, as they are looked for where they are not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.robust import mad_scale, repeated_median_line, stretches_of
from spirillum.vision.flag import Flag


@dataclass(frozen=True)
class FalseDetectionConstants:
    """Frames on which something else than the robot was followed."""

    fewest: int = 12  #: Fewest frames on which stripes or tail are read.
    shortest: int = 3  #: Fewest frames in a row without them.
    beside: int = 5  #: Frames to both sides of a jump whose medians are compared.
    jump: float = 0.15  #: Jump of the place over the body's length.
    leaves: float = 1.0
    """Distance from the path of the marked frames from which on the outline has left the robot, pixels."""
    scatters: float = 6.0
    """Distance from which on it has left the robot, over the scatter of the marked frames about their path."""


FALSE_DETECTION = FalseDetectionConstants()


def something_else(
    time: Samples, pose: Samples, marks: tuple[Samples, Samples], length: float, pixel: float
) -> np.ndarray:
    """Frames of stretches without marks that lie beside the path of those with marks, or jump to them, a mask, (n,).

    Args:
        time: of each frame, s, (n,).
        pose: of the body, whose first two columns are its place, m, (n, 3); NaN where unknown.
        marks: readings of stripes and tail, whose first column is NaN where they cannot be read, each (n, 2).
        length: of the body, m.
        pixel: length per pixel, m.
    """
    place, marked = pose[:, :2], np.isfinite(marks[0][:, 0]) | np.isfinite(marks[1][:, 0])
    found = np.zeros(time.size, dtype=bool)
    known = np.isfinite(place).all(axis=1)
    sure = np.flatnonzero(marked & known)
    if sure.size < FALSE_DETECTION.fewest:
        return found
    speed = np.array([repeated_median_line(time[sure], place[sure, axis]).slope for axis in (0, 1)])
    along = place - speed * (time - time[0])[:, None]  # what does not move as the robot does jumps, or leaves it
    path = np.median(along[sure], axis=0)
    scatter = float(np.hypot(*mad_scale(along[sure] - path, axis=0)))
    beside_path = max(FALSE_DETECTION.leaves * pixel, FALSE_DETECTION.scatters * scatter)
    for stretch in stretches_of(~marked & known):
        beside = sure[(sure > stretch[-1]) | (sure < stretch[0])]
        after, before = beside[beside > stretch[-1]], beside[beside < stretch[0]]
        few = FALSE_DETECTION.beside
        sides = [(stretch[-few:], after[:few]), (stretch[:few], before[-few:])]
        jumps = [np.median(along[own], axis=0) - np.median(along[other], axis=0) for own, other in sides if other.size]
        leaves = [np.hypot(*(np.median(along[own], axis=0) - path)) > beside_path for own, _ in sides]
        jumps_to_it = all(np.hypot(*jump) > FALSE_DETECTION.jump * length for jump in jumps)
        if stretch.size >= FALSE_DETECTION.shortest and (jumps_to_it or any(leaves)):
            found[stretch] = True
    return found


def something_else_flag(found: np.ndarray) -> tuple[Flag, ...]:
    """Note on such frames."""
    count = int(found.sum())
    if not count:
        return ()
    sentence = (
        f"on {count} frames ({100.0 * count / found.size:.3g} %) the outline shows no stripes and no tail, and lies "
        "beside the robot's path: they are left out; a [region] around the path avoids it"
    )
    return (Flag("something-else-followed", sentence),)
