"""Frames on which something else than the robot was followed: its marks are not there, and its place does not fit.

Where a still picture hides a slow robot, or clutter looks like a body, the outline may lie beside the robot for a
while and then find it. Over a grid it stays behind where the robot is hidden or taken away. Neither stripes nor tail
can be read meanwhile, as they are looked for where they are not. A robot that is at two places, too far apart for it to
have swum from one to the other, is found in a video of which a piece is missing, or is not the same robot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from spirillum.arrays import Samples
from spirillum.robust import mad_scale, repeated_median_line, stretches_of
from spirillum.units import show
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
    apart: float = 0.5
    """Lasting jump of the place over the body's length that no other edge of the same robot explains."""


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
    if not found.any():
        return ()
    return (Flag.named("something-else-followed", count=found.sum(), share=100.0 * found.mean()),)


def far_apart(time: Samples, x: Samples, length: float) -> tuple[Flag, ...]:
    """Flag a robot that is at two places, before and after a jump that is too long for another edge of its own.

    Where it comes back, what was followed in between is left out as stray frames.

    Args:
        time: of each frame, s, (n,).
        x: along the channel, m, (n,); NaN where unknown.
        length: of the body, m.
    """
    known, few, allowed = np.flatnonzero(np.isfinite(x)), FALSE_DETECTION.beside, FALSE_DETECTION.apart * length
    if known.size < 2 * few:
        return ()
    t, place = time[known], x[known]
    speed = float(np.median(np.diff(place) / np.diff(t)))
    beside = place - speed * t
    level = np.median(sliding_window_view(beside, few), axis=1)
    unseen = t[few : 1 - few] - t[few - 1 : -few]
    steps = np.abs(level[few:] - level[:-few]) - abs(speed) * unseen  # it may have stopped while it was not seen
    largest = int(np.argmax(steps))
    if steps[largest] <= allowed or abs(level[-1] - level[0]) <= allowed:
        return ()
    around = np.abs(np.diff(beside[largest : largest + 2 * few]))
    frame = int(known[largest + 1 + np.argmax(around)])
    return (Flag.named("two-places", frame, apart=show(float(steps[largest]), "mm"), time=time[frame]),)
