"""Steps that are whole multiples of one another: so many frames lost or repeated that there is no usual step.

Lost frames and repeated ones are found against the usual step (`lost_frames`). Where every other frame is one, there is
none: the median step is that of no frame. But in steady motion all steps are then multiples of one step, and two or
more multiples are frequent, which neither a steady nor a stuttering motor makes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robust import stretches_of
from spirillum.vision.track.constants import MULTIPLES


class Multiples(NamedTuple):
    """How often which multiple of the smallest step is taken."""

    repeated: int  #: Frames that repeat the one before, and are not made up for by the next step.
    lost: int  #: Frames that were lost, but for those before which one was repeated.
    steps: int  #: Steps in all.


def multiples_of(time: Samples, values: Samples, period: float, frame: float) -> Multiples | None:
    """Repeated and lost frames of a series whose steps are multiples of one; None where they are equal, or differ."""
    each = _steps(time, values, period, frame)
    if each.size <= MULTIPLES.fewest:
        return None
    unit = _unit(each)
    if unit is None:
        return None
    counts = np.round(each / unit).astype(np.int64)
    frequent = [count for count in np.unique(counts) if np.mean(counts == count) > MULTIPLES.share]
    if len(frequent) < 2 or frequent[0] < 0 or np.mean(np.diff(counts) != 0) < MULTIPLES.changing:
        return None
    still, far = counts == 0, counts > 1
    made_up = still & np.append(far[1:], False)  # a picture that came late: its time is wrong, and the next one's right
    far &= ~np.concatenate([[False], made_up[:-1]])
    repeated = still & ~made_up
    for rest in stretches_of(still):
        if len(rest) > MULTIPLES.rest:
            repeated[rest] = False
    return Multiples(int(repeated.sum()), int(np.sum(counts[far] - 1)), int(counts.size))


def all_alike(time: Samples, values: Samples, period: float, frame: float) -> bool:
    """Whether nearly all steps of a series are about as large as their median: it is clear, and has no multiples."""
    each = _steps(time, values, period, frame)
    if each.size <= MULTIPLES.fewest:
        return False
    middle = float(np.median(each))
    return bool(np.mean(np.abs(each - middle) < MULTIPLES.alike * middle) > 1.0 - MULTIPLES.share)


def _steps(time: Samples, values: Samples, period: float, frame: float) -> Samples:
    """Steps between neighbouring frames in the time of one, mostly positive, (m,)."""
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2:
        return np.zeros(0)
    steps, spans = np.diff(values[known]), np.diff(time[known])
    each: Samples = (near_their_mean(steps, period) * frame / spans)[np.diff(known) == 1]
    return each * np.sign(np.mean(each)) if each.size else each


def near_their_mean(steps: Samples, period: float) -> Samples:
    """Steps of an angle, each the whole periods nearer to their circular mean; those of a position as they are."""
    if not np.isfinite(period):
        return steps
    middle = float(np.angle(np.mean(np.exp(2j * np.pi * steps / period)))) * period / (2.0 * np.pi)
    found: Samples = steps - period * np.round((steps - middle) / period)
    return found


def _unit(steps: Samples) -> float | None:
    """The largest step of which all are multiples; None where there is none."""
    top = float(np.quantile(steps, 1.0 - MULTIPLES.share))  # beyond it may lie misread frames
    if top <= 0.0:
        return None
    sizes = top * np.geomspace(1.0 / MULTIPLES.most, 1.05, 400)
    score = np.cos(2.0 * np.pi * steps[:, None] / sizes).mean(axis=0)
    good = np.flatnonzero(score > MULTIPLES.coherent)
    if not good.size:
        return None
    first = int(good[-1])
    while first - 1 in good:
        first -= 1
    around = slice(first, int(good[-1]) + 1)
    return float(sizes[around][np.argmax(score[around])])
