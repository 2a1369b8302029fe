"""Apparent elongation of the body: nose and rear seen to drift apart tell a tilt out of the plane of the picture.

From above, a nose that rises by an angle moves what is seen of the body's upper side back by the body's radius times
that angle, and a round nose not at all. The place that is fitted to all edges lies in between, so that a tilt that
changes on the way is taken for a part of the speed. Other causes are edges that glare or compression shift.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spirillum.measurement.rates import rate_of
from spirillum.measurement.statistics import NORMAL
from spirillum.vision.flag import Flag
from spirillum.vision.track.track import Track

_CLEAR = 0.2
"""Change beyond the ends of its interval from which on it is flagged, pixels. On clean films of bodies that do not tilt
it is below 0.1."""


class Elongation(NamedTuple):
    """Change of the distance between nose and rear from the first frame to the last."""

    change: float
    """Positive where they drift apart, m; 0 where it is not known."""
    half_width: float
    """Of its 95 % interval, m."""
    pixel: float
    """Length per pixel, m; NaN without a scale, and so without a known change."""

    def error(self) -> float:
        """Standard error of the robot's way by it, m.

        Half of the change, so that a 95 % interval holds what the nose alone says, and what the rear alone says. The
        variance of the change itself is taken off: what is noise widens nothing. All of a clear change: a body that
        goes around the tube while it tilts hides up to a half of it, and the place that is fitted follows the rear.
        """
        share = 1.0 if self.clear else 0.5
        return share * math.sqrt(max(self.change**2 - (self.half_width / NORMAL) ** 2, 0.0))

    @property
    def clear(self) -> bool:
        """Whether the change is more than noise and what clean films of bodies show that do not tilt."""
        return abs(self.change) - self.half_width > _CLEAR * self.pixel

    def flags(self) -> tuple[Flag, ...]:
        """A flag where the change is clear."""
        if not self.clear:
            return ()
        how = "drift apart" if self.change > 0.0 else "draw together"
        size = f"{1e3 * abs(self.change):.2g} mm ({abs(self.change) / self.pixel:.2g} pixels)"
        sentence = (
            f"nose and rear of the body {how} by {size} during the video, as where the nose rises or sinks: the speed "
            "of the body's middle may be off by up to twice that over the video, and its interval is as wide; film a "
            "robot that has settled, or one that swims further"
        )
        return (Flag("ends-drift-apart", sentence),)


def elongation_of(track: Track) -> Elongation:
    """The change of a track; none where its edges were not fitted on enough frames, or there is no scale."""
    pixel = track.scale.length_per_pixel
    if track.elongation.size != track.time.size or not math.isfinite(pixel):
        return Elongation(0.0, 0.0, pixel)
    rate, length = rate_of(track.time, track.elongation), float(np.ptp(track.time))
    if not math.isfinite(rate.low):
        return Elongation(0.0, 0.0, pixel)
    return Elongation(rate.value * length, 0.5 * (rate.high - rate.low) * length, pixel)
