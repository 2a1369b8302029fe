"""Colour classes: how the named colours of the stripes appear under the lamp and in the camera.

Of a single line on a bare seal: on most frames of a turn it faces away, and a highlight of the lamp looks like one that
stands still. What stays at an angle is the seal under the lamp; the line is what differs from it there for a while.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples, Whole
from spirillum.robot.mesh import STRIPE_COLOURS
from spirillum.robust import mad_scale
from spirillum.vision.track.constants import SINGLE_LINE


@dataclass(frozen=True)
class ColourConstants:
    """Classes of colour of the stripes."""

    pairs: int = 3  #: Kinds of neighbouring stripes that have to be seen before their order is judged.
    whole_samples: int = 4  #: Fewest angles of a stripe, and of those beside it, when its width is taken.
    blurred_width: float = 0.3  #: Width over a stripe's below which a colour between two others is their blurred edge.
    glare: float = 240.0  #: Brightness of glare to begin with, of 255.
    paint: float = 0.4
    """Darkest channel of painted stripes over their mean brightness; 0.35 and 0.42 on path-traced videos."""
    veil: float = 0.25  #: Light that is added to all stripes, over their mean brightness, from which on it is a veil.
    pale: float = 0.7  #: Ratio of the weakest to the strongest channel from which on a bright colour is glare.
    seen: float = 0.03  #: Share of the samples from which on a class is seen.
    contrast: float = 0.25  #: Least difference of two learnt colours over that of their names.
    fits: float = 0.7  #: Share of neighbouring stripes that have to stand in a given order.


COLOURS = ColourConstants()


_MANY = 6  # most classes for which all assignments of names are tried; more are assigned by the least total distance


def named_colours(names: Sequence[str]) -> Samples:
    """RGB of colours by name, 0 to 255, (n, 3)."""
    return 255.0 * np.array([STRIPE_COLOURS[name] for name in names])  # type: ignore[index]


def colours_named(samples: Samples, names: Sequence[str]) -> list[str]:
    """Nearest of some named colours to each sample, under the lamp that suits all of them best."""
    named, lamp = named_colours(names), np.ones(3)
    for _ in range(6):
        nearest = _nearest(samples, named * lamp)
        brightness = samples.sum() / named[nearest].sum()
        lamp = np.clip(np.full(3, brightness), 0.2, 5.0)
    return [names[k] for k in nearest]


def pattern_period(stripes: Sequence[str]) -> float:
    """Period of the stripes: the smallest rotation that maps the pattern to itself, rad."""
    count = len(stripes)
    for step in range(1, count + 1):
        if count % step == 0 and all(stripes[k] == stripes[(k + step) % count] for k in range(count)):
            return 2.0 * np.pi * step / count
    return 2.0 * np.pi


def runs_of(stripes: Sequence[str]) -> list[int]:
    """How many stripes of one colour lie side by side, run by run around the body."""
    starts = [k for k in range(len(stripes)) if stripes[k] != stripes[k - 1]]
    return [(after - start - 1) % len(stripes) + 1 for start, after in pairwise([*starts, *starts[:1]])]


def _opponent(colours: Samples) -> Samples:
    """Opponent colours: brightness, with a small weight as it depends on the lamp, and two differences."""
    red, green, blue = colours[..., 0], colours[..., 1], colours[..., 2]
    return np.stack([0.35 * (red + green + blue) / 3.0, red - green, 0.5 * (red + green) - blue], axis=-1)


def colour_classes(samples: Samples, names: Sequence[str]) -> tuple[Samples, Samples, Samples]:
    """Colours of the named classes in a picture, by k-means with a prior.

    The initial colours are the named ones under a lamp that reproduces the samples' mean; they are the prior of classes
    with few samples. Glare is white and has a class of its own, so that it does not shift the colour of a stripe.

    Returns:
        The classes' colours in the picture, (classes, 3), the named colours under the same lamp, and the colour of
        glare, (1, 3), or (0, 3) where a stripe is white itself.
    """
    veil = 0.0 if "white" in names else _veil(samples, names)
    samples = samples - veil
    named = named_colours(names)
    glary = np.zeros(len(samples), dtype=bool) if "white" in names else _glary(samples)
    lamp = np.clip(samples[~glary].mean(axis=0) / named.mean(axis=0), 0.2, 5.0)
    lamp = np.mean(lamp) * (lamp / np.mean(lamp)) ** 0.5  # not all stripes are in view: half of the tint is taken
    start = named * lamp
    palette = start.copy()
    glare = np.full((0 if "white" in names else 1, 3), COLOURS.glare)
    prior_weight = 0.02 * len(samples) / len(names)
    for _ in range(12):
        nearest = _nearest(samples, np.concatenate([palette, glare]))
        for index in range(len(names)):
            mine = samples[nearest == index]
            total = mine.sum(axis=0) if len(mine) else np.zeros(3)
            palette[index] = (total + prior_weight * start[index]) / (len(mine) + prior_weight)
        shining = samples[nearest == len(names)]
        if len(glare) and len(shining):
            glare[0] = (shining.sum(axis=0) + prior_weight * COLOURS.glare) / (len(shining) + prior_weight)
    return palette + veil, start + veil, glare + veil


def _veil(samples: Samples, names: Sequence[str]) -> float:
    """White light that a lamp mirrored in the surface adds to all stripes alike; 0 where none of them is so pale."""
    darkest, mean = float(np.quantile(samples.min(axis=1), 0.05)), float(samples.mean())
    veil = (darkest - COLOURS.paint * mean) / (1.0 - COLOURS.paint)
    if veil < COLOURS.veil * mean:
        return 0.0
    named = named_colours(names)
    painted = _opponent(named * (mean - veil) / named.mean())[:, 1:].std()
    return veil if _opponent(samples)[:, 1:].std() > COLOURS.contrast * painted else 0.0  # else the seal is bare


def without_glare(profiles: Samples, palettes: tuple[Samples, Samples, Samples]) -> Samples:
    """Colours with NaN where they are nearer to glare than to any stripe."""
    palette, _, glare = palettes
    nearest = _nearest(np.nan_to_num(profiles), np.concatenate([palette, glare]))
    return np.asarray(np.where((nearest < len(palette))[..., None], profiles, np.nan))


def _glary(samples: Samples) -> np.ndarray:
    """Mask of bright samples without colour; empty if all samples are so."""
    brightest, least = samples.max(axis=1), samples.min(axis=1)
    found = (least > COLOURS.pale * brightest) & (brightest > np.median(brightest))
    return np.asarray(found if not found.all() else np.zeros(len(samples), dtype=bool))


def _nearest(samples: Samples, palette: Samples) -> np.ndarray:
    """Class of each sample."""
    distance = np.sum((_opponent(samples)[..., None, :] - _opponent(palette)) ** 2, axis=-1)
    return np.asarray(np.argmin(distance, axis=-1))


def check_order(
    profiles: Samples,
    angles: Samples,
    palettes: tuple[Samples, Samples, Samples],
    stripes: Sequence[str],
    names: Sequence[str],
) -> tuple[Samples, str]:
    """Check the order of the stripes by the adjacent pairs of colours in view.

    Args:
        profiles: colours along the angle about the axis, from +z towards -y, for some frames, (f, n, 3).
        angles: these angles, rad, (n,).
        palettes: result of `colour_classes`.
        stripes: names in the stated order.
        names: distinct names, one per class.

    Returns:
        The classes' colours in the best-fitting order of names, and `given`, `reversed`, `other` or `unseen`.
    """
    palette, start, glare = palettes
    count = len(names)
    seen = _neighbours(profiles, angles, palette, glare, 2.0 * np.pi / len(stripes))
    if seen.sum() < 3 or np.count_nonzero(seen) < min(COLOURS.pairs, count):
        return palette, "unseen"
    order = [names.index(name) for name in stripes]
    forward = np.zeros((count, count), dtype=bool)
    for k, one in enumerate(order):
        forward[one, order[(k + 1) % len(order)]] = True
    cost = np.sqrt(np.sum((_opponent(palette)[:, None] - _opponent(start)) ** 2, axis=-1))  # cluster, name

    def share(assigned: np.ndarray, allowed: np.ndarray) -> float:
        """Share of the observed adjacent pairs that are allowed, with cluster i named assigned[i]."""
        return float(seen[allowed[np.ix_(assigned, assigned)]].sum() / seen.sum())

    if count <= _MANY:
        trials = [np.array(p) for p in permutations(range(count))]
    else:
        from scipy.optimize import linear_sum_assignment

        trials = [np.asarray(linear_sum_assignment(cost)[1])]
    costs = np.array([cost[np.arange(count), trial].sum() for trial in trials])
    shares = np.array([share(trial, forward) for trial in trials])
    best = int(np.argmin(costs))
    fitting = shares >= COLOURS.fits
    if fitting.any():
        chosen = int(np.argmin(np.where(fitting, costs, np.inf)))
        if costs[chosen] <= 1.5 * costs[best]:
            return _renamed(palette, trials[chosen]), "given"
    backward = share(trials[best], forward.T) >= COLOURS.fits
    return _renamed(palette, trials[best]), "reversed" if backward else "other"


def named_rightly(palette: Samples, start: Samples) -> bool:
    """Whether no other assignment of names to classes fits their colours clearly better."""
    from scipy.optimize import linear_sum_assignment

    cost = np.linalg.norm(_opponent(palette)[:, None] - _opponent(start), axis=-1)
    rows, columns = linear_sum_assignment(cost)
    return bool(np.trace(cost) <= 1.2 * cost[rows, columns].sum() + 1e-9)


def are_distinguishable(samples: Samples, palettes: tuple[Samples, Samples, Samples]) -> bool:
    """Whether the classes that are seen are two or more, and differ as their names do."""
    # Each pair has to differ by at least `COLOURS.contrast` of what their names differ by. Shades of a plain seal may
    # be learnt as colours: they differ by much less.
    palette, start, glare = palettes
    nearest = _nearest(samples, np.concatenate([palette, glare]))
    seen = [k for k in range(len(palette)) if np.mean(nearest == k) > COLOURS.seen]
    if len(seen) < 2:
        return False
    learnt, named = _opponent(np.array([samples[nearest == k].mean(axis=0) for k in seen])), _opponent(start[seen])
    one, other = np.triu_indices(len(seen), 1)
    apart = [np.linalg.norm(colours[one] - colours[other], axis=-1) for colours in (learnt, named)]
    return bool(np.all(apart[0] > COLOURS.contrast * apart[1]))


def _renamed(palette: Samples, assigned: np.ndarray) -> Samples:
    """Colours in the order of names, from colours in the order of clusters."""
    by_name = np.empty_like(palette)
    by_name[assigned] = palette
    return by_name


def observed_width(
    profiles: Samples, angles: Samples, palettes: tuple[Samples, Samples, Samples], stated: float
) -> float:
    """Median width of the stripes that are fully in view, rad; NaN for too few of them."""
    palette, _, glare = palettes
    step, widths = float(angles[1] - angles[0]), []
    least = max(COLOURS.whole_samples, COLOURS.blurred_width * stated / step)
    for profile in profiles:
        runs = _runs(profile, palette, glare)
        for before, run, after in zip(runs, runs[1:], runs[2:], strict=False):
            if (
                before[0] >= 0
                and run[0] >= 0
                and after[0] >= 0
                and min(len(before), len(after)) >= COLOURS.whole_samples
                and len(run) >= least
            ):
                widths.append(len(run) * step)
    return float(np.median(widths)) if len(widths) >= COLOURS.pairs else float("nan")


def _runs(profile: Samples, palette: Samples, glare: Samples) -> list[np.ndarray]:
    """Runs of one class along the angle; -1 for glare and missing samples."""
    good = np.isfinite(profile).all(axis=1)
    classes = np.where(good, _nearest(np.nan_to_num(profile), np.concatenate([palette, glare])), -1)
    classes = np.where(classes < len(palette), classes, -1)
    return np.split(classes, np.flatnonzero(np.diff(classes)) + 1)


def _neighbours(profiles: Samples, angles: Samples, palette: Samples, glare: Samples, width: float) -> Samples:
    """Counts of adjacent pairs of classes, towards larger angles, (classes, classes)."""
    seen = np.zeros((len(palette), len(palette)))
    step = float(angles[1] - angles[0])
    for profile in profiles:
        runs = _runs(profile, palette, glare)
        wide = [int(run[0]) for run in runs if len(run) * step > 0.35 * width]
        for one, two in pairwise(wide):
            if one != two and one >= 0 and two >= 0:
                seen[one, two] += 1.0
    return seen


class SeenLine(NamedTuple):
    """What a seal and the line on it look like."""

    palette: Samples  #: Colour of each class, (2, 3).
    sheen: Samples  #: What the lamp adds at each angle, (n, 3).


def is_single(stripes: Sequence[str]) -> bool:
    """Whether stripes are a line of one colour on a seal of another, which fills the view while the line is away."""
    widest = max(runs_of(stripes), default=0) / max(len(stripes), 1)
    return len(set(stripes)) == 2 and 2.0 * np.pi * widest > SINGLE_LINE.bare


def initial_line_colours(profiles: Samples, facing: np.ndarray, order: Whole) -> SeenLine | None:
    """Colours of seal and line, and what the lamp adds, to begin with; None where no line is seen to move."""
    seen = np.where(facing[..., None], profiles, np.nan)
    known = np.asarray(np.isfinite(seen).all(axis=2))
    often = known.sum(axis=0) >= SINGLE_LINE.frames
    if not often.any():
        return None
    seen = seen[known[:, often].sum(axis=1) > 0]
    still = np.full(seen.shape[1:], np.nan)
    still[often] = np.nanmedian(seen[:, often], axis=0)
    change = seen - still
    change -= np.nanmedian(change, axis=1, keepdims=True)  # of all angles alike, as the lamp drifts
    size = np.where(np.isfinite(change).all(axis=2), np.linalg.norm(change, axis=2) / np.sqrt(3.0), 0.0)
    noise = float(mad_scale(size[size > 0.0])) if (size > 0.0).any() else 0.0
    moved = size > max(SINGLE_LINE.contrast, SINGLE_LINE.clear * noise)
    if np.count_nonzero(moved.sum(axis=1) >= SINGLE_LINE.samples) < SINGLE_LINE.frames:
        return None
    line = np.median(change[moved], axis=0)
    ground = still[often][np.argmin(still[often].sum(axis=1))] if line.sum() > 0.0 else np.median(still[often], axis=0)
    palette = np.tile(ground, (2, 1))
    palette[int(np.argmin(np.bincount(order, minlength=2)))] = np.maximum(ground + line, 0.0)
    return SeenLine(palette, np.where(often[:, None], np.maximum(still - ground, 0.0), 0.0))
