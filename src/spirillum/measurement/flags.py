"""Flags of a trial: warnings with a machine-readable name and a sentence; apparent elongation of the body.

From above, a nose that rises by an angle moves what is seen of the body's upper side back by the body's radius times
that angle, and a round nose not at all. The position that is fitted to all edges lies in between, so that a tilt that
changes on the way is taken for a part of the speed. Other causes are edges that glare or compression shift.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.data_tables import rows_of
from spirillum.measurement.rates import Rate, rate_of
from spirillum.measurement.statistics import NORMAL
from spirillum.robot.robot import Robot
from spirillum.units import Hz
from spirillum.vision.flag import Flag
from spirillum.vision.setup import stripes_of
from spirillum.vision.track.track import Track

_CLEAR = 0.2
"""Change beyond the ends of its interval from which on it is flagged, pixels. On clean videos of bodies that do not
tilt it is below 0.1."""


class Elongation(NamedTuple):
    """Change of the distance between nose and rear from the first frame to the last."""

    change: float  #: Positive where they drift apart, m; 0 where it is not known.
    half_width: float  #: Of its 95 % interval, m.
    pixel: float  #: Length per pixel, m; NaN without a scale, and so without a known change.

    def error(self) -> float:
        """Standard error of the robot's displacement by it, m."""
        # Half of the change, so that a 95 % interval holds what the nose alone says, and what the rear alone says. The
        # variance of the change itself is taken off: what is noise widens nothing. All of a clear change: a body that
        # goes around the tube while it tilts hides up to a half of it, and the place that is fitted follows the rear.
        share = 1.0 if self.clear else 0.5
        return share * math.sqrt(max(self.change**2 - (self.half_width / NORMAL) ** 2, 0.0))

    @property
    def clear(self) -> bool:
        """Whether the change is more than noise and what clean videos of bodies show that do not tilt."""
        return abs(self.change) - self.half_width > _CLEAR * self.pixel

    def flags(self) -> tuple[Flag, ...]:
        """A flag where the change is clear."""
        if not self.clear:
            return ()
        how = "drift apart" if self.change > 0.0 else "draw together"
        far = abs(self.change)
        return (Flag.named("ends-drift-apart", how=how, length=1e3 * far, pixels=far / self.pixel),)


def elongation_of(track: Track) -> Elongation:
    """The change of a track; none where its edges were not fitted on enough frames, or there is no scale."""
    pixel = track.scale.length_per_pixel
    if track.elongation.size != track.time.size or not math.isfinite(pixel):
        return Elongation(0.0, 0.0, pixel)
    rate, length = rate_of(track.time, track.elongation), float(np.ptp(track.time))
    if not math.isfinite(rate.low):
        return Elongation(0.0, 0.0, pixel)
    return Elongation(rate.value * length, 0.5 * (rate.high - rate.low) * length, pixel)


SEEN = ("forward_velocity", "body_rotation_rate", "tail_rotation_rate")
"""Rates measured directly; that of the motor follows from them."""
BY_HAND = "by-hand"  #: Name of the flag of a track of manual readings alone.
IMPORTED = "imported"  #: Name of the flag of a track from another program.
SYNTHETIC = "synthetic"  #: Word in the metadata of computed videos, and name of the flag.
_MANY_OUTLIERS, _FEW_OUTLIERS = 0.02, 2
"""Share and number of outliers above which a flag is raised: a good video may show one or two."""
_FEWEST_FRAMES = 4  # fewest measured frames of a video that give a rate
_FOLLOWING = {"stripes-unreadable", "tail-unreadable", "short-turn"}
"""Flags that follow from too few frames, or from another object than the robot."""
_IMPLIED = {row["flag"]: {*row["implied"].split()} for row in rows_of("measurement/implied_flags.csv")}
"""Flags that are redundant beside another one that withholds a number, by its name; it withholds what they do."""
_CHANGES = {"stands-for-a-while", "reverses"}
_OF_CHANGES = {"video-is-cut", "does-not-advance"}
"""Flags that are redundant where the robot does not move in one direction throughout."""
_ONCE = {"stripes-unreadable", "tail-unreadable"}  # flags of which only the first is kept


def flags_of(fits: Mapping[str, Rate], track: Track, robot: Robot, elongation: Elongation) -> tuple[Flag, ...]:
    """All flags of a trial, without duplicates and without those that another flag implies."""
    both = (*track.flags, *elongation.flags(), *_own_flags(fits, track, robot))
    flags: list[Flag] = []
    for flag in both:
        same = [other for other in flags if other.name == flag.name]
        if not same or (flag.name not in _ONCE and all(other.sentence != flag.sentence for other in same)):
            flags.append(flag)
    flags += _mirrored(flags)
    names = {flag.name for flag in flags}
    implied = set[str]().union(*(_IMPLIED.get(flag.name, ()) for flag in flags if flag.spoils))
    for name in SEEN:  # what is not given has no mean, and no frames left out of it
        if any(name in flag.spoils for flag in flags):
            implied |= {f"{kind}-{name.replace('_', '-')}" for kind in ("not-steady", "stray-frames")}
    if "robot-stands-still" in names:
        implied.add("short-turn")
    if _CHANGES & names:
        implied |= _OF_CHANGES
    count = track.time.size
    if count < _FEWEST_FRAMES and not {BY_HAND, IMPORTED} & names:
        frames = "1 frame was" if count == 1 else f"{count} frames were"
        flags.insert(0, Flag.named("too-few-frames", frames=frames, least=_FEWEST_FRAMES))
        implied |= _FOLLOWING
    return tuple(flag for flag in flags if flag.name not in implied)


def _mirrored(flags: list[Flag]) -> list[Flag]:
    """A flag where stripes and tail both turn in the opposite sense."""
    reversed_order = any(flag.name == "stripe-order" and "reversed" in flag.sentence for flag in flags)
    if not reversed_order or all(flag.name != "handedness" for flag in flags):
        return []
    return [Flag.named("mirrored")]


def _own_flags(fits: Mapping[str, Rate], track: Track, robot: Robot) -> list[Flag]:
    flags = []
    if says_synthetic(track.words):
        flags.append(Flag.named(SYNTHETIC))
    for name in SEEN:
        rate = fits[name]
        both: dict[str, Any] = {"rate": name.replace("_", "-"), "words": name.replace("_", " ")}
        if not rate.measured:
            continue
        if not rate.steady:
            flags.append(Flag.named("not-steady", how=_how(rate, name), **both))
        if rate.outliers > max(_FEW_OUTLIERS, _MANY_OUTLIERS * (rate.frames + rate.outliers)):
            flags.append(Flag.named("stray-frames", count=rate.outliers, **both))
    stripes = stripes_of(track.setup, robot)
    turned = _range(track.body_angle)
    if stripes and fits["body_rotation_rate"].measured and turned < 2 * np.pi / len(stripes):
        flags.append(Flag.named("short-turn", turned=math.degrees(turned)))
    return flags


def _how(rate: Rate, name: str) -> str:
    """How a rate changes, a clause; third by third of the time, as far as it was measured."""
    unit, size = ("mm/s", 1e3) if name == "forward_velocity" else ("Hz", 1.0 / Hz)
    places = ("first", "second", "last")
    known = [(place, third) for place, third in zip(places, rate.thirds, strict=False) if np.isfinite(third)]
    told = [f"{size * third:.3g} {unit} in its {place} third" for place, third in known]
    return f": {', '.join(told)}" if told else ""


def says_synthetic(words: str) -> bool:
    """Whether the metadata of a file declare it synthetic."""
    return SYNTHETIC in words.lower()


def _range(values: Samples) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0
