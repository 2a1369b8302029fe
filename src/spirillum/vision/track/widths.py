"""Uneven stripes: where the edges between them lie, learnt from the video.

On each frame the edges in view are located one by one against an even pattern. An edge d off its place shows d on every
frame, less what the frame's own angle is off; the angles of all frames and the places of all edges follow by linear
least squares. A whole turn is exact whatever the widths are.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, sqrt
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import stripe_edges
from spirillum.robust import mad_scale
from spirillum.vision.flag import Flag


@dataclass(frozen=True)
class WidthConstants:
    """Uneven stripes."""

    reach: float = radians(14.0)  #: Largest shift of an edge that is tried, rad: a third of a stripe of eight.
    step: float = radians(0.5)  #: Steps between the shifts that are tried, rad.
    steepest: float = radians(52.0)  #: Largest angle from the direction to the camera at which an edge is located, rad.
    around: float = 0.42  #: Half width over that of a stripe of the surroundings through which an edge is located.
    contrast: float = 40.0  #: Least difference of the colours on either side, of 255.
    fewest: int = 8  #: Fewest samples along the angle.
    frames: int = 20  #: Fewest frames with two edges in view.
    rounds: int = 4  #: Rounds in which stray edges are left out.
    stray: float = 4.0  #: Residual over the usual one from which on an edge of a frame is left out.
    seen: int = 10  #: Fewest frames of an edge.
    linked: int = 4  #: Fewest frames with two edges together that determine their distance.
    uneven: float = radians(2.0)
    """Range of the edges' shifts from which on the stripes are uneven, rad; see `docs/measuring-reference.md`."""
    clear: float = 10.0
    """Least range over the scatter of an edge on a frame: colours of compressed pictures are blurred, not all alike.

    On six degraded videos even stripes reached 7.5, on two others stripes uneven by a fifth 17 and 43."""
    left: float = 0.05  #: Share of that range that is left as an error of each angle. Assumed.
    widest: float = 0.24
    """Largest difference of a stripe's width from an even one, over that: by hand they differ by up to a fifth."""
    painted: float = 0.2 / sqrt(3.0)
    """Standard deviation of the widths of stripes by hand, over an even one: evenly spread up to a fifth."""
    other_size: float = 0.015  #: Standard deviation of all widths by wrong scale, diameter and heights. Assumed.
    size: float = 0.005
    """Standard uncertainty of what wrong sizes and heights add to widths learnt from a part of a turn. Assumed."""
    printed: float = 0.01  #: Standard deviation of widths by noise, lens and printing, over an even one. Assumed.
    together: float = 2.5
    """Mean difference of the widths that are known over its standard deviation from which on it is not of paint."""


WIDTHS = WidthConstants()
_TRIED = np.arange(-WIDTHS.reach, WIDTHS.reach + 0.5 * WIDTHS.step, WIDTHS.step)  # tried shifts of an edge, rad


class Evened(NamedTuple):
    """Angles of a body without what its stripes' widths do to them."""

    angle: Samples  #: Continuous, rad, (n,).
    error: Samples  #: Standard error on each frame, rad, (n,).
    flags: tuple[Flag, ...]
    drift: float = 0.0  #: Standard uncertainty of the angle from end to end, where less than a turn was seen, rad.


def edge_shifts(
    levels: Samples, angles: Samples, blur: Samples, shade: Samples, colours: Samples, angle: float
) -> Samples:
    """Angles by which the edges in view lie beyond their even places, rad, (stripes,); NaN of others."""
    found = np.empty(len(colours))
    limits = WIDTHS.step, WIDTHS.steepest, WIDTHS.around, WIDTHS.contrast, WIDTHS.fewest
    stripe_edges(levels, angles, blur, shade, colours, angle, _TRIED, *limits, np.empty(_TRIED.size), found)
    return found


def evened(angle: Samples, read: Samples, error: Samples, edges: Samples, period: float) -> Evened:
    """Angles corrected by the learnt widths; as they are where stripes are about even, or too little was seen."""
    untouched, count = Evened(angle, error, ()), edges.shape[1]
    known = np.isfinite(angle) & (np.isfinite(edges).sum(axis=1) >= 2)
    if known.sum() < WIDTHS.frames:
        return untouched
    repeat = round(count * period / (2.0 * np.pi))
    turned = np.round((angle - read) / period)[known].astype(int)
    which = (np.arange(count)[None, :] - repeat * turned[:, None]) % count
    shifts = np.full((int(known.sum()), count), np.nan)
    np.put_along_axis(shifts, which, edges[known], axis=1)
    places, scatter = _places(shifts)
    seen = np.isfinite(places)
    off = float(np.ptp(places[seen])) if seen.any() else 0.0
    if off < max(WIDTHS.uneven, WIDTHS.clear * scatter):
        return untouched
    if (wide := _not_of_paint(places)) is not None:
        return Evened(angle, error, (wide,))
    turned = float(np.ptp(angle[known]))
    if (size := _another_size(places)) is not None:
        share, flag = size
        return Evened(angle, error, (flag,), 0.5 * abs(share) * turned)
    weight = (np.isfinite(shifts) & seen).astype(float)
    total = np.maximum(weight.sum(axis=1), 1e-9)
    own = np.sum(weight * np.nan_to_num(shifts - places), axis=1) / total
    better, surer = np.full(angle.shape, np.nan), error.copy()
    better[known] = np.where(weight.sum(axis=1) > 0, angle[known] + own, np.nan)
    surer[known] = np.hypot(error[known], WIDTHS.left * off)
    even = 2.0 * np.pi / count
    flag = Flag.named("uneven-stripes", even=np.degrees(even), off=np.degrees(off))
    return Evened(better, surer, (flag,), 0.0 if seen.all() else WIDTHS.size * turned)


def _off_even(places: Samples) -> Samples:
    """Differences of the widths that are known from even ones, over these, from the shift of each edge, rad."""
    off: Samples = np.diff(np.append(places, places[0])) * places.size / (2.0 * np.pi)
    return off[np.isfinite(off)]


def _not_of_paint(places: Samples) -> Flag | None:
    """A flag if widths differ as no painter's do: by too much, or, of those that are known, all to the same side."""
    # All widths add up to a whole turn. Of n that are drawn by chance and scaled so, the mean of k has the standard
    # deviation s sqrt((n - k)/(k (n - 1))).
    count, off = places.size, _off_even(places)
    if not off.size:
        return None
    scatter = WIDTHS.painted * np.sqrt(max(count - off.size, 0) / (off.size * (count - 1)))
    to_one_side = off.size < count and abs(off.mean()) > WIDTHS.together * scatter
    if np.abs(off).max() <= WIDTHS.widest and not to_one_side:
        return None
    most = off[np.argmax(np.abs(off))]
    side = "wider" if most > 0 else "narrower"
    return Flag.named("stripes-not-of-paint", far=100.0 * abs(most), side=side)


def _another_size(places: Samples) -> tuple[float, Flag] | None:
    """The relative difference of the widths that are known from even ones, and a flag, if they differ all alike."""
    # A body that looks smaller than it should brings all edges in view nearer to each other by the same share; in less
    # than a turn that looks like stripes that are narrower than those out of view. Widths by hand differ among each
    # other, too. By Bayes' rule, with equal prior odds: widths by hand against even ones, both with an error of the
    # size.
    count, off = places.size, _off_even(places)
    if not 1 < off.size < count:
        return None
    whole = np.eye(off.size)

    def misfit(width: float) -> float:
        """Minus twice the logarithm of the likelihood of widths with a standard deviation; all add up to a turn."""
        among = (count * whole - 1.0) / (count - 1.0)
        covariance = width**2 * among + WIDTHS.other_size**2 + WIDTHS.printed**2 * whole
        return float(off @ np.linalg.solve(covariance, off) + np.linalg.slogdet(covariance)[1])

    if misfit(WIDTHS.painted) < misfit(0.0):
        return None
    side = "wider" if off.mean() > 0 else "narrower"
    return float(off.mean()), Flag.named("stripes-of-another-size", far=100.0 * abs(off.mean()), side=side)


def _places(shifts: Samples) -> tuple[Samples, float]:
    """Shift of each edge, rad, (stripes,), and the scatter of an edge on a frame, rad."""
    # The mean is 0 over each group of edges that frames link. The shift is NaN for edges that were seen too rarely.
    from scipy.sparse.csgraph import connected_components

    weight = np.isfinite(shifts).astype(float)
    value = np.nan_to_num(shifts)
    places, scale = np.zeros(shifts.shape[1]), 0.0
    for _ in range(WIDTHS.rounds):
        total = np.maximum(weight.sum(axis=1), 1e-9)
        normal = np.diag(weight.sum(axis=0)) - (weight / total[:, None]).T @ weight
        right = (weight * value).sum(axis=0) - (weight / total[:, None]).T @ (weight * value).sum(axis=1)
        places = np.linalg.lstsq(normal, right, rcond=1e-6)[0]
        own = (weight * (value - places)).sum(axis=1) / total
        residual = value - places - own[:, None]
        scale = float(mad_scale(residual[weight > 0])) + 1e-4
        weight = (np.isfinite(shifts) & (np.abs(residual) < WIDTHS.stray * scale)).astype(float)
    often = weight.sum(axis=0) >= WIDTHS.seen
    group = connected_components(weight.T @ weight >= WIDTHS.linked, directed=False)[1]
    for one in np.unique(group[often]):  # how groups lie to each other hangs on few frames, if on any
        places[group == one] -= places[often & (group == one)].mean()
    return np.where(often, places, np.nan), scale
