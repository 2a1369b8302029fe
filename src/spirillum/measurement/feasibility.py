"""Feasibility of an experiment: whether a camera resolves the expected rates, and the expected uncertainty."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spirillum.answer_entries import answer_of
from spirillum.display import DisplayMixin
from spirillum.envelope import quantity
from spirillum.errors import InputError, check_range
from spirillum.measurement.setup_template import depth_shares, spacing_at_axis
from spirillum.measurement.statistics import NORMAL
from spirillum.notes import Note
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, Hz, parse_option
from spirillum.vision.camera.camera import opened, scale_of
from spirillum.vision.setup import Setup, load_setup, stripes_of
from spirillum.vision.track.colours import pattern_period
from spirillum.vision.track.constants import UNWRAPPING
from spirillum.vision.video.frames import Video

_FRAMES_PER_SECOND = 30.0
_WIDTH = 640
_DURATION, _LONGEST = 20.0, 86400.0
_POSITION_ERROR = 0.05  # standard error of the position on a frame, pixels
_EDGE_ERROR = 0.25  # standard error of a stripe's edge on a frame, pixels along the circumference
_WAVE_ERROR = 0.1  # standard error of the wire's lateral position on a frame, pixels
_STRIPE_ERROR = math.radians(0.2)  # expected amplitude of errors that repeat with every stripe, rad
_CORRELATION = 4.0  # correlation time of errors of position and wire, frames
_EDGE_CORRELATION = 20.0  # correlation time of errors of the stripes' edges, frames
_FEWEST = 4  # fewest frames that give a rate
_FOREVER = 1e9  # represents the infinite time in view of a robot at rest, s
_SMALLEST = {"wire": 1.0, "stripe": 3.0, "spacing": 4.0, "amplitude": 2.0}
"""Sizes at which the tracker passes its tests with a margin, pixels."""
_NEEDED = {"robot": 20.0, "spacing": 3.0}  # sizes below which ruler or robot are not detected, pixels
_BASIS = (
    f"errors of a frame: {_POSITION_ERROR:g} pixels of position, {_EDGE_ERROR:g} pixels of a stripe's edge, "
    f"{_WAVE_ERROR:g} pixels of the wire across; {_CORRELATION:g} neighbouring frames err alike, "
    f"{_EDGE_CORRELATION:g} of the stripes. Orders of magnitude of clean synthetic films, not of your camera"
)


@dataclass(frozen=True)
class Check:
    """A condition of feasibility."""

    name: str
    value: float
    limit: float
    unit: str
    passed: bool
    decides: bool  #: Whether its failure makes the experiment infeasible; otherwise it is a warning.
    sentence: str


@dataclass(frozen=True, repr=False)
class Feasibility(DisplayMixin):
    """The feasibility of an experiment."""

    robot: Robot
    setup: str
    expected: Mapping[str, tuple[float, str]]  #: Expected values, SI, and their sources.
    checks: tuple[Check, ...]
    intervals: Mapping[str, tuple[float, float]]
    """Expected half width of the 95 % interval of one trial, absolute and relative.

    Empty where the scale is unknown, robot or ruler are too small to be detected, or the robot exceeds the view.
    """
    measured: float  #: Time for which the whole robot is in view, s.
    shares: Mapping[str, float]  #: Relative standard uncertainty of lengths by source.
    warnings: tuple[Note, ...]

    @property
    def feasible(self) -> bool:
        """Whether all decisive checks pass."""
        return all(check.passed for check in self.checks if check.decides)

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        units = {"forward_velocity": "m/s", "duration": "s", "frames_per_second": "1/s", "length_per_pixel": "m"}
        expected = {
            name: quantity(value, units.get(name, "rad/s"), source=source)
            for name, (value, source) in self.expected.items()
        }
        intervals = {
            name: {"half_width": quantity(reach, units.get(name, "rad/s")), "share": share}
            for name, (reach, share) in self.intervals.items()
        }
        total = math.sqrt(sum(share**2 for share in self.shares.values()))
        return answer_of(self, expected=expected, intervals=intervals, total=total, basis=_BASIS)


def feasibility(
    setup: str | Path,
    *,
    tail_rate: str | float | None = None,
    body_rate: str | float | None = None,
    speed: str | float | None = None,
    duration: str | float | None = None,
    frames_per_second: float | None = None,
    view_width: str | float | None = None,
    picture_width: int | None = None,
    video: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> Feasibility:
    """Whether a camera resolves the expected motion of a robot, and with what uncertainty.

    Args:
        setup: the setup file.
        tail_rate: expected rate of the tail, with its unit or a float in rad/s; None: predicted by the model of
            `predict`, where it answers at once.
        body_rate: expected rate of the body, with its unit or a float in rad/s; None: predicted.
        speed: expected forward velocity, with its unit or a float in m/s; None: predicted.
        duration: length of a trial, with its unit or a float in s; None: the video's, or 20 s.
        frames_per_second: frames a second; None: the setup's, the video's, or 30.
        view_width: width of the view at the robot's axis, with its unit or a float in m; None: from the setup's scale.
        picture_width: width of the picture, pixels; None: the video's, or 640.
        video: a video or folder of images from whose ruler the scale is fitted, in place of `view_width`.
        overrides: dotted fields of the robot, as for `spirillum.load`.

    Raises:
        InputError: if a field is wrong, or the robot's motion cannot be predicted and is not given.
    """
    for name, value in (("view-width", view_width), ("width", picture_width)):
        if video is not None and value is not None:
            raise InputError(f"{name} = {value} with the video {video}, which shows its own; allowed: one of the two")
    chosen, robot = load_setup(setup, overrides)
    expected, caution = _expected(robot, tail_rate, body_rate, speed)
    film = None if video is None else opened(video, chosen)
    rate, source_of_rate = _first(
        (frames_per_second, "given"),
        (chosen.camera.frames_per_second, "setup"),
        (None if film is None else film.rate, "video"),
        (_FRAMES_PER_SECOND, "assumed"),
    )
    check_range("fps", rate, 0.01, 1e5)
    span, source_of_span = _first(
        (None if duration is None else parse_option("duration", duration, KINDS["time"]), "given"),
        (None if film is None else film.duration, "video"),
        (_DURATION, "assumed"),
    )
    if not 0.0 < span <= _LONGEST:
        raise InputError(f"duration = {span:g} s; allowed: more than 0 s, at most {_LONGEST:g} s (a day)")
    width = _WIDTH if picture_width is None else picture_width
    check_range("width", width, 32, 100_000, " pixels")
    pixel, source, width = _pixel(chosen, Path(setup).parent, view_width, width, film)
    expected |= {"duration": (span, source_of_span), "frames_per_second": (rate, source_of_rate)}
    expected |= {"length_per_pixel": (pixel, source)} if math.isfinite(pixel) else {}
    stripes = stripes_of(chosen, robot)
    shares = depth_shares(chosen)
    sizes = _pixels(chosen, robot, pixel, len(stripes))
    found = all(check.passed for check in sizes if check.decides)
    checks = [*_rates(expected, rate, stripes), *sizes]
    measured = span
    if math.isfinite(pixel):
        view = _view(expected, robot, pixel * width, span, rate)
        checks.append(view)
        measured = min(span, view.value)
    seen = found and math.isfinite(pixel) and measured * rate >= _FEWEST
    intervals = _intervals(expected, robot, pixel, len(stripes), shares, rate, measured) if seen else {}
    warnings = (*_warnings(checks, expected, pixel, shares), *caution)
    return Feasibility(robot, str(setup), expected, tuple(checks), intervals, measured, shares, warnings)


def _first(*values: tuple[float | None, str]) -> tuple[float, str]:
    """Return the first value that there is, with its source."""
    return next((value, source) for value, source in values if value is not None)


def _warnings(
    checks: Sequence[Check], expected: Mapping[str, tuple[float, str]], pixel: float, shares: Mapping[str, float]
) -> list[Note]:
    warnings = [Note("cannot-resolve", check.sentence, (check.name,)) for check in checks if not check.passed]
    if not math.isfinite(pixel):
        words = "the size of a pixel is unknown: sizes in the picture and intervals are not given; state --view-width"
        warnings.append(Note("pixel-size-unknown", words, ("markers.length_per_pixel",)))
    if expected["forward_velocity"][0] < 0:
        words = "the robot swims backwards at this sign of the tail rate; forward is positive for a right-handed tail"
        warnings.append(Note("swims-backwards", words, ("tail_rotation_rate", "tail.handedness")))
    if not shares:
        words = "the setup states no uncertainty of heights: 10 mm of depth can be 7 % of a length; state it"
        warnings.append(Note("setup-incomplete", words))
    return warnings


def _expected(
    robot: Robot, tail_rate: str | float | None, body_rate: str | float | None, speed: str | float | None
) -> tuple[dict[str, tuple[float, str]], tuple[Note, ...]]:
    """Expected motion by name, each value with its source, and what to be careful about in a prediction."""
    given: dict[str, float | None] = {
        "forward_velocity": None if speed is None else parse_option("expect-speed", speed, KINDS["velocity"]),
        "body_rotation_rate": None if body_rate is None else parse_option("expect-body-rate", body_rate, KINDS["rate"]),
        "tail_rotation_rate": None if tail_rate is None else parse_option("expect-tail-rate", tail_rate, KINDS["rate"]),
    }
    found = {name: (value, "given") for name, value in given.items() if value is not None}
    if len(found) == len(given):
        return {name: found[name] for name in given}, ()
    from spirillum.robot.limits import reynolds_limits, reynolds_warnings
    from spirillum.swimming.prediction import predict_steady
    from spirillum.swimming.preparation import AUTO, choose_model

    try:
        choice = choose_model(AUTO, robot)
        answer = predict_steady(robot, model=choice.model, tail_rate=given["tail_rotation_rate"], band=False)
    except InputError as error:
        raise InputError(f"the robot's motion cannot be predicted ({error}); allowed: --expect-... for all") from error
    held = ", held at its place" if answer.model.placed else ""
    for name in given:
        found.setdefault(name, (float(getattr(answer, name)), f"predicted by {choice.model}{held}"))
    motion = answer.swimming
    inertia = reynolds_warnings(reynolds_limits(answer.batch, motion.reynolds_number, motion.tail_reynolds_number))
    return {name: found[name] for name in given}, tuple(inertia.values())


def _pixel(
    setup: Setup, folder: Path, view_width: str | float | None, width: int, video: Video | None
) -> tuple[float, str, int]:
    """Length per pixel at the height of the axis, m, its source, and the picture's width, pixels."""
    if view_width is not None:
        return parse_option("view-width", view_width, KINDS["length"]) / width, "view width", width
    if video is not None:
        found, _ = scale_of(video, setup, folder=folder)
        return found.scale.length_per_pixel, "ruler in the video", video.size[0]
    if setup.markers.length_per_pixel is not None:
        return setup.markers.length_per_pixel, "setup", width
    return math.nan, "", width


def _rates(expected: Mapping[str, tuple[float, str]], rate: float, stripes: tuple[str, ...]) -> list[Check]:
    found = []
    tail, body = abs(expected["tail_rotation_rate"][0]), abs(expected["body_rotation_rate"][0])
    limits = [("tail-rate", "tail", tail, UNWRAPPING.largest_step * rate * Hz, "a helix looks the same after a turn")]
    if stripes:
        share = pattern_period(stripes) / Hz
        most, why = UNWRAPPING.largest_step * rate * share * Hz, f"the stripes repeat after {share:.3g} turns"
        limits.append(("body-rate", "body", body, most, why))
    else:
        sentence = "the robot has no stripes: the body's rotation cannot be seen"
        found.append(Check("body-rate", body, 0.0, "rad/s", passed=False, decides=True, sentence=sentence))
    for name, part, value, limit, why in limits:
        passed = value < limit
        verdict = "below" if passed else "not below"
        sentence = (
            f"the {part} turns {value / Hz:.4g} times a second, {verdict} the {limit / Hz:.4g} that {rate:g} frames a "
            f"second resolve ({why})"
        )
        found.append(Check(name, value, limit, "rad/s", passed, decides=True, sentence=sentence))
    return found


def _pixels(setup: Setup, robot: Robot, pixel: float, stripes: int) -> list[Check]:
    """Checks of sizes in the picture; decisive where robot or ruler are too small to be detected."""
    if not math.isfinite(pixel):
        return []
    tail = robot.tail
    sizes = {"wire": ("the wire", tail.wire_diameter), "amplitude": ("the helix's amplitude", tail.amplitude)}
    if stripes:
        sizes["stripe"] = ("a stripe that faces the camera", math.pi * robot.body.diameter / stripes)
    if setup.markers.spacing is not None:
        sizes["spacing"] = ("the ruler's spacing", spacing_at_axis(setup))
    long = (robot.body.length + robot.coupling.length + robot.tail.length) / pixel
    if long < (limit := _NEEDED["robot"]):
        sentence = f"the whole robot is {long:.3g} pixels long, fewer than the {limit:g} without which it is not found"
        return [Check("robot-pixels", long, limit, "1", passed=False, decides=True, sentence=sentence)]
    found = []
    for name, (words, length) in sizes.items():
        value = length / pixel
        decides = value < _NEEDED.get(name, 0.0)
        limit = _NEEDED[name] if decides else _SMALLEST[name]
        passed = value >= limit
        size = f"{value:.3g}"
        pixels = "pixel" if size == "1" else "pixels"
        sentence = f"{words} is {size} {pixels} wide, {'at least' if passed else 'fewer than'} {limit:g}"
        if decides:
            sentence += ": its lines cannot be told apart, and there is no scale"
        found.append(Check(f"{name}-pixels", value, limit, "1", passed, decides, sentence=sentence))
    return found


def _view(expected: Mapping[str, tuple[float, str]], robot: Robot, view: float, span: float, rate: float) -> Check:
    """Check of the time in view; decisive where it is too short for any rate."""
    length = robot.body.length + robot.coupling.length + robot.tail.length
    whole = f"the whole robot ({1e3 * length:.4g} mm)"
    if view <= length:
        sentence = f"{whole} never fits into a view of {1e3 * view:.4g} mm: no rate and no interval can be expected"
        return Check("time-in-view", 0.0, span, "s", passed=False, decides=True, sentence=sentence)
    speed = abs(expected["forward_velocity"][0])
    time = min((view - length) / speed, _FOREVER) if speed > 0 else _FOREVER
    stays, few = time >= span, min(time, span) * rate < _FEWEST
    long = "ever" if time >= _FOREVER else f"{time:.4g} s"
    sentence = (
        f"{whole} stays in a view of {1e3 * view:.4g} mm for {long}, "
        f"{'at least as long as' if stays else 'shorter than'} a trial of {span:g} s"
    )
    if few:
        sentence += f": fewer than the {_FEWEST} frames that a rate needs"
    elif not stays:
        sentence += ": intervals are those of the time in view"
    return Check("time-in-view", time, span, "s", stays and not few, decides=few, sentence=sentence)


def _intervals(
    expected: Mapping[str, tuple[float, str]],
    robot: Robot,
    pixel: float,
    stripes: int,
    shares: Mapping[str, float],
    rate: float,
    span: float,
) -> dict[str, tuple[float, float]]:
    """Half widths of the 95 % intervals of one trial; the standard error of a slope is sigma sqrt(12/n)/T."""
    slope = math.sqrt(12.0 * _CORRELATION / (span * rate)) / span
    speed, body = expected["forward_velocity"][0], abs(expected["body_rotation_rate"][0])
    scale = math.sqrt(sum(share**2 for share in shares.values()))
    found = {"forward_velocity": math.hypot(_POSITION_ERROR * pixel * slope, scale * speed)}
    if stripes:
        edges = max(stripes / 3.0, 1.0)  # a third of the circumference is seen well
        error = _EDGE_ERROR * pixel / (0.5 * robot.body.diameter) / math.sqrt(edges)
        cycles = max(body * span * stripes / (2 * math.pi), 1.0)
        periodic = math.sqrt(2.0) * _STRIPE_ERROR / span / cycles
        longer = math.sqrt(_EDGE_CORRELATION / _CORRELATION)
        found["body_rotation_rate"] = math.hypot(error * slope * longer, periodic)
    waves = max(robot.tail.length / robot.tail.wavelength, 1.0)
    found["tail_rotation_rate"] = _WAVE_ERROR * pixel / robot.tail.amplitude / math.sqrt(waves) * slope
    return {
        name: (NORMAL * error, NORMAL * error / abs(expected[name][0]) if expected[name][0] else math.nan)
        for name, error in found.items()
    }
