"""A single painted line on a bare seal: its colour, and that of the seal, from what moves.

On most frames of a turn the line faces away, and a highlight of the lamp looks like one that stands still. What stays
at an angle is the seal under the lamp; the line is what differs from it there for a while.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples, Whole
from spirillum.robust import mad_scale
from spirillum.vision.track.colours import runs_of
from spirillum.vision.track.constants import SINGLE_LINE


class SeenLine(NamedTuple):
    """What a seal and the line on it look like."""

    palette: Samples
    """Colour of each class, (2, 3)."""
    sheen: Samples
    """What the lamp adds at each angle, (n, 3)."""


def is_single(stripes: Sequence[str]) -> bool:
    """Whether stripes are a line of one colour on a seal of another, which fills the view while the line is away."""
    widest = max(runs_of(stripes), default=0) / max(len(stripes), 1)
    return len(set(stripes)) == 2 and 2.0 * np.pi * widest > SINGLE_LINE.bare


def seen_line(profiles: Samples, facing: np.ndarray, order: Whole) -> SeenLine | None:
    """Colours of seal and line, and what the lamp adds, to begin with; None where no line is seen to move.

    Args:
        profiles: colours along the angle about the axis, for some frames, (f, n, 3); NaN where nothing is seen.
        facing: mask of the samples that face the camera, (f, n).
        order: class of each stripe, (s,).
    """
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
