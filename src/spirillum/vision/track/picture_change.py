"""Change of the whole picture from frame to frame: a cue on lost frames and cuts that needs no pose.

Where frames are missing, the picture changes by more than one step of the motion does. Where the outline hops from one
edge of the body to another, its place jumps, and the angles that are read there with it, but the picture goes on
evenly. How much two steps at once change the picture tells what one lost frame would.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.optional_dependencies import import_optional
from spirillum.robust import mad_scale, running_median


@dataclass(frozen=True)
class PictureChangeConstants:
    """Change of the picture from frame to frame."""

    width: float = 320.0
    """Longer side to which the pictures are reduced, pixels."""
    blur: float = 1.0
    """Standard deviation of the blur that takes noise away, pixels of the reduced picture."""
    fewest: int = 20
    """Fewest frames that tell the usual change."""
    around: int = 15
    """Steps of the running median."""
    least: float = 1.1
    """Least change by two steps over that by one; with less, noise hides the motion."""
    scatter: float = 0.4
    """Largest scatter of the change over the rise by two steps."""
    share: float = 0.5
    """Share of the rise by two steps from which on a frame is missing."""
    rest: float = 0.6
    """Change over the usual one below which a frame repeats the one before."""


PICTURE_CHANGE = PictureChangeConstants()


class PictureChange:
    """Compares each picture with the last two."""

    def __init__(self, bounds: tuple[int, int, int, int]) -> None:
        """Begin."""
        self.bounds = bounds
        self._last: list[np.ndarray] = []

    def of(self, image: np.ndarray) -> tuple[float, float]:
        """Root mean square change of brightness from the last picture and the one before, of 255; NaN without one."""
        cv2 = import_optional("cv2", "measuring a video", "video")
        left, top, right, bottom = self.bounds
        part = cv2.cvtColor(image[top:bottom, left:right], cv2.COLOR_RGB2GRAY)
        share = min(1.0, PICTURE_CHANGE.width / max(part.shape))
        size = max(1, round(share * part.shape[1])), max(1, round(share * part.shape[0]))
        grey = cv2.resize(part, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        grey = cv2.GaussianBlur(grey, (0, 0), PICTURE_CHANGE.blur)
        found = [cv2.norm(grey, other) / math.sqrt(grey.size) for other in self._last]
        self._last = [grey, *self._last[:1]]
        one, two = [*found, np.nan, np.nan][:2]
        return one, two


class PictureSteps(NamedTuple):
    """What the pictures say of each step from a frame to the next."""

    jumps: np.ndarray
    """Mask of the steps on which the picture changes as if a frame or more were missing, (n - 1,)."""
    rests: np.ndarray
    """Mask of the steps on which it hardly changes, as on a frame that repeats the one before, (n - 1,)."""

    def jump_near(self, step: int) -> bool:
        """Whether the picture jumps at a step or beside it."""
        return bool(self.jumps[max(0, step - 1) : step + 2].any())


def picture_steps(change: Samples) -> PictureSteps | None:
    """What the changes of the picture say of missing and repeated frames.

    Args:
        change: of each picture against the last one and the one before, (n, 2).

    Returns:
        None where the motion changes the picture too little, or too unevenly, to tell.
    """
    if len(change) < PICTURE_CHANGE.fewest:
        return None
    one, two = change[1:, 0], change[1:, 1]
    usual = running_median(one, PICTURE_CHANGE.around)
    if not np.all(usual > 0.0):
        return None
    lost = float(np.median(two[1:] / usual[1:]))  # of the usual change, if one frame was missing
    scatter = float(mad_scale(one / usual - 1.0))
    if lost < PICTURE_CHANGE.least or scatter > PICTURE_CHANGE.scatter * (lost - 1.0):
        return None
    missing = (1.0 + PICTURE_CHANGE.share * (lost - 1.0)) * usual
    return PictureSteps(np.asarray(one > missing), np.asarray(one < PICTURE_CHANGE.rest * usual))
