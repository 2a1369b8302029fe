"""Velocity, rotation rates and wobble of one track, each with a 95 % confidence interval."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from spirillum.answer_entries import content_of
from spirillum.arrays import Samples
from spirillum.envelope import quantity
from spirillum.measurement.flags import BY_HAND, IMPORTED, SEEN, SYNTHETIC, elongation_of, flags_of
from spirillum.measurement.outliers import outlying_frames, without_codec_lag
from spirillum.measurement.rates import PeriodicError, Rate, mean_of, rate_of
from spirillum.measurement.statistics import (
    AMPLITUDE_ERROR,
    DRIFT_ANGLE,
    DRIFT_BARE,
    DRIFT_PIXELS,
    HEADING_ERROR,
    LONG,
    NORMAL,
    PHASE_ERROR,
    PIXEL_ERROR,
    POSITION_ERROR,
    STRIPE_ERROR,
)
from spirillum.robot.robot import Robot
from spirillum.vision.flag import Flag
from spirillum.vision.setup import stripes_of
from spirillum.vision.track.colours import pattern_period
from spirillum.vision.track.track import Track

LEVEL = 0.95  #: Confidence level of all intervals.
RATE_NAMES = (*SEEN, "motor_rotation_rate")  #: Quantities that are slopes of a series.
WOBBLES = (
    "lateral_wobble_at_tail_rate",
    "lateral_wobble_at_body_rate",
    "heading_wobble_at_tail_rate",
    "heading_wobble_at_body_rate",
)
"""Amplitudes of lateral motion and heading at the rotation rates of tail and body."""
MEASURED = (*RATE_NAMES, "lateral_position", "heading", *WOBBLES)  #: All quantities of a trial and of a summary.
_FEW_TURNS = 2.0  # fewest turns over which a wobble is fitted
_DEGREE = 5  # degree of the polynomial that smooths an angle
_FEWEST = 12  # fewest frames for that polynomial
_UNSTEADY = 0.5  # largest root mean square residual of that polynomial, rad
_TENTHS = 10  # parts of a track whose mean residuals estimate slow errors
_TOO_FEW = "it was read on too few frames"


@dataclass(frozen=True)
class Measured:
    """A quantity with its 95 % interval, SI; NaN where it was not measured.

    The reason states why the value or the interval is missing.
    """

    value: float
    low: float
    high: float
    unit: str
    reason: str = ""

    def to_dict(self, **more: Any) -> dict[str, Any]:
        """As JSON: value and interval, or null and a reason."""
        if not math.isfinite(self.value):
            return quantity(None, self.unit, reason=self.reason or "it was not seen", **more)
        if not math.isfinite(self.low):
            return quantity(self.value, self.unit, reason=self.reason, **more)
        interval = {"low": self.low, "high": self.high, "kind": "interval", "level": LEVEL}
        return quantity(self.value, self.unit, **interval, **more)

    @classmethod
    def missing(cls, unit: str, reason: str) -> Measured:
        """A quantity that was not measured."""
        return cls(math.nan, math.nan, math.nan, unit, reason)


@dataclass(frozen=True)
class Trial:
    """The measurement of one video."""

    track: Track = field(repr=False)  #: Pose, body angle and tail phase on every frame.
    quantities: Mapping[str, Measured]  #: Measured quantities by the names of `MEASURED`.
    fits: Mapping[str, Rate] = field(repr=False)
    """Fitted lines by the names of `RATE_NAMES`, including those that a flag invalidates."""
    flags: tuple[Flag, ...]  #: Warnings about the trial.
    name: str = ""  #: Name of the trial and of its files.

    @property
    def synthetic(self) -> bool:
        """Whether the metadata of the video declare it synthetic."""
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
        time, position = self.track.time, self.track.position
        duration = float(np.ptp(time)) if time.size else 0.0
        return content_of(self, measured=int(np.isfinite(position[:, 0]).sum()), duration=duration)


def trial_of(track: Track, robot: Robot, name: str = "", read: np.ndarray | None = None) -> Trial:
    """Measure one track."""
    by_hand = any(flag.name == BY_HAND for flag in track.flags)
    if by_hand:
        read = np.ones(track.time.size, dtype=bool)
    fits = _fits(track, robot, read)
    elongation = elongation_of(track)
    flags = flags_of(fits, track, robot, elongation)
    velocity, *rates = RATE_NAMES
    quantities = {velocity: _velocity(fits[velocity], track, _drift(track, elongation.error()))}
    quantities |= {
        name: _with_errors(
            fits[name],
            "rad/s",
            *_drifts(track, name),
            0.0 if by_hand else _drift(track, _wander(fits[name])),
            _timing(fits[name], track),
        )
        for name in rates
    }
    pixel = track.scale.length_per_pixel if math.isfinite(track.scale.length_per_pixel) else 0.0
    quantities["lateral_position"] = _mean(track, track.position[:, 1], "m", POSITION_ERROR * pixel)
    quantities["heading"] = _mean(track, track.heading, "rad", HEADING_ERROR * LONG * pixel / robot.body.length)
    quantities |= _wobbles(track, robot)
    if not by_hand:
        quantities = {name: _with_interval(item) for name, item in quantities.items()}
    return Trial(track, _spoiled(quantities, flags), fits, flags, name)


def _with_interval(item: Measured) -> Measured:
    """A quantity without an interval, replaced by a missing one."""
    if math.isfinite(item.low) or not math.isfinite(item.value):
        return item
    return Measured.missing(item.unit, _TOO_FEW)


def _fits(track: Track, robot: Robot, read: np.ndarray | None) -> dict[str, Rate]:
    """Fitted lines, without the first frames of a compressed video that are ahead, unless the robot slows there."""
    shorter = track if read is not None else without_codec_lag(track)
    fits = _fits_of(shorter, robot, read)
    if shorter is track or all(rate.steady for rate in fits.values()):
        return fits
    return _fits_of(track, robot, read)


def _fits_of(track: Track, robot: Robot, read: np.ndarray | None) -> dict[str, Rate]:
    time, pixel = track.time, track.scale.length_per_pixel
    body, tail = _smooth(time, track.body_angle), _smooth(time, track.tail_phase)
    x = track.position[:, 0]
    stripes = stripes_of(track.setup, robot)
    around = max(len(stripes), 1)
    repeats = round(2 * np.pi / pattern_period(stripes)) if stripes else 1
    of_x = []
    if math.isfinite(pixel):  # manual readings in millimetres have no pixel grid
        angles = (_smooth(time, 2 * np.pi * x / pixel), tail, body, around * body)
        of_x = [
            PeriodicError(angle, _expected(track.position_error, PIXEL_ERROR * pixel))
            for angle in angles
            if _turns(angle)
        ]
    of_body = [
        PeriodicError(multiple * body, _expected(track.body_angle_error, STRIPE_ERROR))
        for multiple in sorted({1, repeats, 2 * repeats, 3 * repeats, around})
        if _turns(body)
    ]
    of_tail = [
        PeriodicError(multiple * tail, _expected(track.tail_phase_error, PHASE_ERROR))
        for multiple in (1, 2)
        if _turns(tail)
    ]
    of_both = (
        rate_of(time, track.body_angle, track.body_angle_error, of_body, read=read),
        rate_of(time, track.tail_phase, track.tail_phase_error, of_tail, read=read),
    )
    return {
        "forward_velocity": rate_of(time, x, track.position_error, of_x, read=read),
        "body_rotation_rate": of_both[0],
        "tail_rotation_rate": of_both[1],
        "motor_rotation_rate": _motor_rate(track, *of_both, [*of_body, *of_tail], read),
    }


def _motor_rate(track: Track, body: Rate, tail: Rate, periodic: list[PeriodicError], read: np.ndarray | None) -> Rate:
    """Tail less body rate; where one of them changes, the mean over the frames on which both angles were read."""
    if body.steady and tail.steady:
        return tail.less(body)
    difference = track.tail_phase - track.body_angle
    for rate in (body, tail):  # outliers of one angle are left out of their difference
        if rate.residual.size == track.time.size:
            difference = np.where(np.isfinite(rate.residual), difference, np.nan)
    error = np.hypot(track.tail_phase_error, track.body_angle_error)
    return rate_of(track.time, difference, error, periodic, read=read, unsteady=True)


def _smooth(time: Samples, angle: Samples) -> Samples:
    """A smoothed angle: a regressor with its own noise would explain that noise."""
    # A polynomial of low degree; where its residual is large, the angle itself, linearly interpolated over gaps.
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


def _expected(error: Samples, least: float) -> float:
    """Expected amplitude of a periodic error: the median standard error of the frames, at least `least`."""
    known = error[np.isfinite(error)]
    return max(float(np.median(known)), least) if known.size else least


def _turns(angle: Samples) -> bool:
    return angle.size > 0 and float(np.ptp(angle)) > 0


def _with_errors(rate: Rate, unit: str, *errors: float) -> Measured:
    """A rate whose interval includes further standard errors, added in quadrature."""
    if not rate.measured:
        return Measured.missing(unit, _TOO_FEW if rate.frames else "it was not read on any frame")
    if not math.isfinite(rate.low):
        return Measured(rate.value, math.nan, math.nan, unit, "two readings leave no errors to tell it from")
    reach = NORMAL * math.hypot(*errors)
    low = rate.value - math.hypot(rate.value - rate.low, reach)
    return Measured(rate.value, low, rate.value + math.hypot(rate.high - rate.value, reach), unit)


def _drift(track: Track, error: float) -> float:
    """Standard error of a rate by an error that drifts over the length of the track."""
    return error / float(np.ptp(track.time)) if track.time.size > 1 else 0.0


def _timing(rate: Rate, track: Track) -> float:
    """Standard error of a rate by the uncertain length of the video in time."""
    return track.time_uncertainty * abs(rate.value) if math.isfinite(rate.value) else 0.0


def _drifts(track: Track, name: str) -> list[float]:
    """Standard errors of a rotation rate by drifts of its angles, rad/s."""
    errors = {"body_rotation_rate": (track.body_angle_error,), "tail_rotation_rate": (track.tail_phase_error,)}
    both = (track.body_angle_error, track.tail_phase_error)
    read = any(flag.name == BY_HAND for flag in track.flags)  # errors of manual readings are independent
    drifts = [DRIFT_ANGLE if read else _expected(error, DRIFT_ANGLE) for error in errors.get(name, both)]
    if name != "tail_rotation_rate":
        drifts.append(track.body_angle_drift)
    if name != "body_rotation_rate":
        drifts.append(track.tail_phase_drift)
    return [_drift(track, drift) for drift in drifts]


def _velocity(rate: Rate, track: Track, tilt: float) -> Measured:
    """The forward velocity; its interval includes the uncertainty of scale and time, and that by a tilt, m/s."""
    pixel = track.scale.length_per_pixel if math.isfinite(track.scale.length_per_pixel) else 0.0
    scale = track.scale.relative_uncertainty * abs(rate.value)
    bare = any(flag.name in ("no-stripes", "stripes-do-not-fit") for flag in track.flags)  # no edges at the seal
    least = (DRIFT_BARE if bare else DRIFT_PIXELS) * pixel
    read = any(flag.name in (BY_HAND, IMPORTED) for flag in track.flags)
    drift = _drift(track, least if read else max(least, _wander(rate)))
    cues = _drift(track, track.cue_drift)
    return _with_errors(rate, "m/s", drift, scale, tilt, track.drift, cues, _timing(rate, track))


def _wander(rate: Rate) -> float:
    """Scatter of the mean residuals of tenths of the track: pictures of a compressed video lag behind, and catch up."""
    known = rate.residual[np.isfinite(rate.residual)]
    if known.size < _TENTHS:
        return 0.0
    return float(np.std([part.mean() for part in np.array_split(known, _TENTHS)]))


def _mean(track: Track, values: Samples, unit: str, systematic: float) -> Measured:
    """A mean, whose interval includes a systematic standard error."""
    value, low, high = mean_of(track.time, values)
    if not math.isfinite(value):
        return Measured.missing(unit, "it was not seen")
    if not math.isfinite(low):
        return Measured(value, low, high, unit, "few readings do not tell how their errors hang together")
    shared = track.scale.relative_uncertainty * abs(value) if unit == "m" else 0.0
    reach = NORMAL * math.hypot(shared, systematic)
    return Measured(value, value - math.hypot(value - low, reach), value + math.hypot(high - value, reach), unit)


def _wobbles(track: Track, robot: Robot) -> dict[str, Measured]:
    """Amplitudes by least squares in the measured angle of tail or body, which an unsteady rate does not smear."""
    found = {}
    pixel = track.scale.length_per_pixel if math.isfinite(track.scale.length_per_pixel) else 0.0
    half = 0.5 * robot.body.length
    for part, angle in (("tail", track.tail_phase), ("body", track.body_angle)):
        size, error = _amplitude(track.time, track.position[:, 1], angle)
        turned, turned_error = _amplitude(track.time, track.heading, angle)
        added = math.hypot(PIXEL_ERROR * pixel, AMPLITUDE_ERROR * size if math.isfinite(size) else 0.0)
        # Lines of a grid under glass hold the pose, and less so the seal.
        held = _amplitude(track.time, track.sideways, angle) if np.isfinite(track.sideways).any() else (0.0, 0.0)
        found[f"lateral_wobble_at_{part}_rate"] = _wobble(size, math.hypot(error, added, *held), "m", part)
        found[f"heading_wobble_at_{part}_rate"] = _wobble(turned, math.hypot(turned_error, added / half), "rad", part)
    return {name: found[name] for name in WOBBLES}


def _wobble(size: float, error: float, unit: str, part: str) -> Measured:
    """An amplitude with its 95 % interval."""
    if not math.isfinite(size) or not math.isfinite(error):
        return Measured.missing(unit, f"the {part} was not seen to turn {_FEW_TURNS:g} times")
    return Measured(size, max(size - NORMAL * error, 0.0), size + NORMAL * error, unit)


def _amplitude(time: Samples, values: Samples, angle: Samples) -> tuple[float, float]:
    """Amplitude of a series' first harmonic in an angle, and its standard error; NaN below `_FEW_TURNS` turns."""
    known = np.isfinite(values) & np.isfinite(angle)
    if known.sum() < 12 or np.ptp(angle[known]) < 2 * np.pi * _FEW_TURNS:
        return math.nan, math.nan
    s = (time[known] - time[known].mean()) / np.ptp(time[known])
    design = np.stack([np.ones_like(s), s, s**2, np.cos(angle[known]), np.sin(angle[known])], axis=1)
    beta = np.linalg.lstsq(design, values[known], rcond=None)[0]
    residual = values[known] - design @ beta
    lag_one = residual[1:] @ residual[:-1] / max(residual @ residual, 1e-300)
    autocorrelation = float(np.clip(lag_one, 0.0, 0.99))
    effective = max(known.sum() * (1 - autocorrelation) / (1 + autocorrelation) - 5, 1.0)
    return float(np.hypot(beta[3], beta[4])), math.sqrt(2.0 * float(residual.var()) / effective)


def _spoiled(quantities: Mapping[str, Measured], flags: tuple[Flag, ...]) -> dict[str, Measured]:
    """The quantities without those that a flag invalidates, directly or by derivation; the first flag is the reason."""
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
            names |= set(MEASURED)  # no rate is valid, so that nothing else is either
        for name in (names & set(found)) - spoiled:
            found[name] = Measured.missing(found[name].unit, flag.sentence)
        spoiled |= names
    return found
