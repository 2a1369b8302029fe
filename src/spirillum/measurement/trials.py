"""From the track of one video to its speed, its rates and its wobble, each with a 95 % interval."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from spirillum.answer import quantity
from spirillum.arrays import Samples
from spirillum.measurement.flags import BY_HAND, SEEN, SYNTHETIC, flags_of
from spirillum.measurement.outliers import outlying_frames
from spirillum.measurement.rates import Cycle, Rate, mean_of, rate_of
from spirillum.robot.robot import Robot
from spirillum.vision.flag import Flag
from spirillum.vision.setup import stripes_of
from spirillum.vision.track.colours import pattern_period
from spirillum.vision.track.track import Track

__all__ = [
    "LEVEL",
    "MEASURED",
    "RATE_NAMES",
    "WOBBLES",
    "Measured",
    "Trial",
    "trial_of",
]

LEVEL = 0.95
"""Level of all intervals."""
RATE_NAMES = (*SEEN, "motor_rotation_rate")
"""What is measured by a slope."""
WOBBLES = (
    "lateral_wobble_at_tail_rate",
    "lateral_wobble_at_body_rate",
    "heading_wobble_at_tail_rate",
    "heading_wobble_at_body_rate",
)
"""Amplitudes of the motion across, and of the heading, that come back with tail or body."""
MEASURED = (*RATE_NAMES, "lateral_position", "heading", *WOBBLES)
"""All that a trial measures, and a summary over trials."""
_NORMAL = 1.959964
_PIXEL_ERROR = 0.03
"""Least usual size of errors of the position that come back with an angle or with each pixel, pixels."""
_HELD = 0.12
"""Standard error of a lateral amplitude, relative: edges of the glass that stand still beside the body hold it back.

On rendered films from the side, with the body within some pixels of the tube's edge, 12 to 20 % were missing."""
_STRIPE_ERROR = math.radians(0.2)
"""Usual size of errors of the body's angle that come back with every stripe, rad."""
_PHASE_ERROR = math.radians(1.0)
"""Usual size of errors of the tail's phase that come back once or twice a turn, rad."""
_SLOW_PIXELS = 0.01
"""Error of the position from end to end that slow changes of light and perspective may leave, pixels."""
_SLOW_BARE = 0.1
"""Slow error of the place of a body without stripes, pixels: its nose alone places it; to 0.12 on rendered films."""
_SLOW_ANGLE = math.radians(0.1)
"""Slow error of an angle, rad; at least the standard error of a frame, which glare makes slow."""
_PLACE = 0.15
"""Standard error of a place itself, which does not matter to a speed, pixels: of outline, light and lens."""
_HEADING = math.radians(0.2)
"""Systematic error of the heading, rad, of a body that is `_LONG` pixels long."""
_LONG = 100.0
_FEW_TURNS = 2.0
_DEGREE = 5
_FEWEST = 12
_UNSTEADY = 0.5
"""rad, root mean square."""
_TOO_FEW = "it was read on too few frames"


@dataclass(frozen=True)
class Measured:
    """A number with its 95 % interval, SI; NaN where it was not measured.

    The reason says why there is no number, or no interval.
    """

    value: float
    low: float
    high: float
    unit: str
    reason: str = ""

    def to_dict(self, **more: Any) -> dict[str, Any]:
        """As JSON: with its interval; null where it was not measured, or without an interval, and then a reason."""
        if not math.isfinite(self.value):
            return quantity(None, self.unit, reason=self.reason or "it was not seen", **more)
        if not math.isfinite(self.low):
            return quantity(self.value, self.unit, reason=self.reason, **more)
        interval = {"low": self.low, "high": self.high, "kind": "interval", "level": LEVEL}
        return quantity(self.value, self.unit, **interval, **more)

    @classmethod
    def missing(cls, unit: str, reason: str) -> Measured:
        """What was not measured."""
        return cls(math.nan, math.nan, math.nan, unit, reason)


@dataclass(frozen=True)
class Trial:
    """One video, measured."""

    track: Track = field(repr=False)
    """What was seen on every frame."""
    quantities: Mapping[str, Measured]
    """By the names of `MEASURED`."""
    fits: Mapping[str, Rate] = field(repr=False)
    """The fitted lines by the names of `RATE_NAMES`, also of those that a flag spoils."""
    flags: tuple[Flag, ...]
    """What to know about it."""
    name: str = ""
    """Its name among the trials: that of its files."""

    @property
    def synthetic(self) -> bool:
        """Whether the video says of itself that it is synthetic."""
        return any(flag.name == SYNTHETIC for flag in self.flags)

    @property
    def video(self) -> str:
        """Name of the video."""
        return self.track.video

    def flagged(self, flag: Flag) -> Trial:
        """A copy with one more flag."""
        return replace(self, flags=(*self.flags, flag))

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        scale = self.track.scale
        return {
            "video": self.video,
            "frames": int(self.track.time.size),
            "frames_measured": int(np.isfinite(self.track.position[:, 0]).sum()),
            "duration": quantity(float(np.ptp(self.track.time)) if self.track.time.size else 0.0, "s"),
            **{name: item.to_dict() for name, item in self.quantities.items()},
            "scale": {
                "length_per_pixel": quantity(scale.length_per_pixel, "m"),
                "relative_uncertainty": scale.relative_uncertainty,
                "sources": dict(scale.sources),
                "markers": scale.markers,
                "apparent_body_size": scale.apparent_size if math.isfinite(scale.apparent_size) else None,
            },
            "flags": [{"name": f.name, "sentence": f.sentence, "spoils": list(f.spoils)} for f in self.flags],
        }


def trial_of(track: Track, robot: Robot, name: str = "", read: np.ndarray | None = None) -> Trial:
    """Measure one track.

    Args:
        track: what was seen on every frame.
        robot: the robot, for its stripes.
        name: name of the trial.
        read: frames that were corrected by hand, truth values, (n,); all are where the track was read by hand alone.
    """
    by_hand = any(flag.name == BY_HAND for flag in track.flags)
    if by_hand:
        read = np.ones(track.time.size, dtype=bool)
    fits = _fits(track, robot, read)
    flags = flags_of(fits, track, robot)
    velocity, *rates = RATE_NAMES
    quantities = {velocity: _velocity(fits[velocity], track)}
    quantities |= {name: _widened(fits[name], "rad/s", *_slow_angles(track, name)) for name in rates}
    pixel = track.scale.length_per_pixel if math.isfinite(track.scale.length_per_pixel) else 0.0
    quantities["lateral_position"] = _mean(track, track.position[:, 1], "m", _PLACE * pixel)
    quantities["heading"] = _mean(track, track.heading, "rad", _HEADING * _LONG * pixel / robot.body.length)
    quantities |= _wobbles(track, robot)
    if not by_hand:
        quantities = {name: _with_interval(item) for name, item in quantities.items()}
    return Trial(track, _spoiled(quantities, flags), fits, flags, name)


def _with_interval(item: Measured) -> Measured:
    """No number of a camera stands without an interval; two readings by hand may."""
    if math.isfinite(item.low) or not math.isfinite(item.value):
        return item
    return Measured.missing(item.unit, _TOO_FEW)


def _fits(track: Track, robot: Robot, read: np.ndarray | None) -> dict[str, Rate]:
    time, pixel = track.time, track.scale.length_per_pixel
    body, tail = _smooth(time, track.body_angle), _smooth(time, track.tail_phase)
    x = track.position[:, 0]
    stripes = stripes_of(track.setup, robot)
    around = max(len(stripes), 1)
    repeats = round(2 * np.pi / pattern_period(stripes)) if stripes else 1
    of_x = []
    if math.isfinite(pixel):  # readings in millimetres know of no pixels
        angles = (_smooth(time, 2 * np.pi * x / pixel), tail, body, around * body)
        of_x = [Cycle(angle, _usual(track.position_error, _PIXEL_ERROR * pixel)) for angle in angles if _turns(angle)]
    of_body = [
        Cycle(multiple * body, _usual(track.body_angle_error, _STRIPE_ERROR))
        for multiple in sorted({1, repeats, 2 * repeats, 3 * repeats, around})
        if _turns(body)
    ]
    of_tail = [
        Cycle(multiple * tail, _usual(track.tail_phase_error, _PHASE_ERROR)) for multiple in (1, 2) if _turns(tail)
    ]
    difference = track.tail_phase - track.body_angle
    error = np.hypot(track.tail_phase_error, track.body_angle_error)
    of_both = (
        rate_of(time, track.body_angle, track.body_angle_error, of_body, read=read),
        rate_of(time, track.tail_phase, track.tail_phase_error, of_tail, read=read),
    )
    bent = not all(rate.steady for rate in of_both)
    return {
        "forward_velocity": rate_of(time, x, track.position_error, of_x, read=read),
        "body_rotation_rate": of_both[0],
        "tail_rotation_rate": of_both[1],
        "motor_rotation_rate": rate_of(time, difference, error, [*of_body, *of_tail], read=read, bent=bent),
    }


def _smooth(time: Samples, angle: Samples) -> Samples:
    """An angle without its own noise, which would else explain itself; straight over what was not measured.

    A polynomial of low degree; where the angle is too unsteady for one, the angle as it was seen.
    """
    known = np.isfinite(angle) & ~outlying_frames(time, angle)
    if known.sum() < _FEWEST:
        return np.zeros(angle.shape)
    middle, half = 0.5 * (time[known][0] + time[known][-1]), 0.5 * float(np.ptp(time[known]))
    s = np.clip((time - middle) / half, -1.0, 1.0)
    coefficients = np.polynomial.legendre.legfit(s[known], angle[known], _DEGREE)
    smooth = np.polynomial.legendre.legval(s, coefficients)
    if float(np.std(angle[known] - smooth[known])) < _UNSTEADY:
        return np.asarray(smooth)
    return np.asarray(np.interp(time, time[known], angle[known]))


def _usual(error: Samples, least: float) -> float:
    """Usual size of errors that come back: a picture whose frames are worse to read is worse in this too."""
    known = error[np.isfinite(error)]
    return max(float(np.median(known)), least) if known.size else least


def _turns(angle: Samples) -> bool:
    return angle.size > 0 and float(np.ptp(angle)) > 0


def _widened(rate: Rate, unit: str, *errors: float) -> Measured:
    """A rate whose interval holds standard errors beside that of the fit."""
    if not rate.measured:
        return Measured.missing(unit, _TOO_FEW if rate.frames else "it was not read on any frame")
    if not math.isfinite(rate.low):
        return Measured(rate.value, math.nan, math.nan, unit, "two readings leave no errors to tell it from")
    reach = _NORMAL * math.hypot(*errors)
    low = rate.value - math.hypot(rate.value - rate.low, reach)
    return Measured(rate.value, low, rate.value + math.hypot(rate.high - rate.value, reach), unit)


def _slow(track: Track, error: float) -> float:
    """Standard error of a rate from an error that grows from one end to the other."""
    return error / float(np.ptp(track.time)) if track.time.size > 1 else 0.0


def _slow_angles(track: Track, name: str) -> list[float]:
    """Standard errors of a rotation rate from slow errors of the angles that it comes from, rad/s."""
    errors = {"body_rotation_rate": (track.body_angle_error,), "tail_rotation_rate": (track.tail_phase_error,)}
    both = (track.body_angle_error, track.tail_phase_error)
    read = any(flag.name == BY_HAND for flag in track.flags)  # errors of readings by eye are independent
    return [_slow(track, _SLOW_ANGLE if read else _usual(error, _SLOW_ANGLE)) for error in errors.get(name, both)]


def _velocity(rate: Rate, track: Track) -> Measured:
    """A velocity: the interval holds the scale's uncertainty too."""
    pixel = track.scale.length_per_pixel if math.isfinite(track.scale.length_per_pixel) else 0.0
    scale = track.scale.relative_uncertainty * abs(rate.value)
    bare = any(flag.name == "no-stripes" for flag in track.flags)
    return _widened(rate, "m/s", _slow(track, (_SLOW_BARE if bare else _SLOW_PIXELS) * pixel), scale)


def _mean(track: Track, values: Samples, unit: str, lasting: float) -> Measured:
    """A mean, whose interval holds a standard error that lasts all along."""
    value, low, high = mean_of(track.time, values)
    if not math.isfinite(value):
        return Measured.missing(unit, "it was not seen")
    if not math.isfinite(low):
        return Measured(value, low, high, unit, "few readings do not tell how their errors hang together")
    shared = track.scale.relative_uncertainty * abs(value) if unit == "m" else 0.0
    reach = _NORMAL * math.hypot(shared, lasting)
    return Measured(value, value - math.hypot(value - low, reach), value + math.hypot(high - value, reach), unit)


def _wobbles(track: Track, robot: Robot) -> dict[str, Measured]:
    """Least squares at the angle of tail or body itself, so that an unsteady rate does not smear the amplitude."""
    found = {}
    pixel = track.scale.length_per_pixel if math.isfinite(track.scale.length_per_pixel) else 0.0
    half = 0.5 * robot.body.length
    for part, angle in (("tail", track.tail_phase), ("body", track.body_angle)):
        size, error = _amplitude(track.time, track.position[:, 1], angle)
        turned, turned_error = _amplitude(track.time, track.heading, angle)
        added = math.hypot(_PIXEL_ERROR * pixel, _HELD * size if math.isfinite(size) else 0.0)
        found[f"lateral_wobble_at_{part}_rate"] = _wobble(size, math.hypot(error, added), "m", part)
        found[f"heading_wobble_at_{part}_rate"] = _wobble(turned, math.hypot(turned_error, added / half), "rad", part)
    return {name: found[name] for name in WOBBLES}


def _wobble(size: float, error: float, unit: str, part: str) -> Measured:
    """An amplitude with its interval."""
    if not math.isfinite(size):
        return Measured.missing(unit, f"the {part} was not seen to turn {_FEW_TURNS:g} times")
    return Measured(size, max(size - _NORMAL * error, 0.0), size + _NORMAL * error, unit)


def _amplitude(time: Samples, values: Samples, angle: Samples) -> tuple[float, float]:
    """Amplitude of what comes back with an angle, and its standard error; NaN where it turned too little."""
    known = np.isfinite(values) & np.isfinite(angle)
    if known.sum() < 12 or np.ptp(angle[known]) < 2 * np.pi * _FEW_TURNS:
        return math.nan, math.nan
    s = (time[known] - time[known].mean()) / np.ptp(time[known])
    design = np.stack([np.ones_like(s), s, s**2, np.cos(angle[known]), np.sin(angle[known])], axis=1)
    beta = np.linalg.lstsq(design, values[known], rcond=None)[0]
    left = values[known] - design @ beta
    again = float(np.clip(left[1:] @ left[:-1] / max(left @ left, 1e-300), 0.0, 0.99))
    effective = max(known.sum() * (1 - again) / (1 + again) - 5, 1.0)
    return float(np.hypot(beta[3], beta[4])), math.sqrt(2.0 * float(left.var()) / effective)


def _spoiled(quantities: Mapping[str, Measured], flags: tuple[Flag, ...]) -> dict[str, Measured]:
    """Null what a flag spoils, and what follows from it; the first flag is the reason."""
    found, spoiled = dict(quantities), set[str]()
    for flag in flags:
        names = set(flag.spoils)
        if names & {"tail_rotation_rate", "body_rotation_rate"}:
            names.add("motor_rotation_rate")
        names |= {
            f"{kind}_wobble_at_{part}_rate"
            for part in ("tail", "body")
            for kind in ("lateral", "heading")
            if f"{part}_rotation_rate" in flag.spoils
        }
        if names >= {*RATE_NAMES}:
            names |= set(MEASURED)  # there is no confident number beside what cannot be believed at all
        for name in (names & set(found)) - spoiled:
            found[name] = Measured.missing(found[name].unit, flag.sentence)
        spoiled |= names
    return found
