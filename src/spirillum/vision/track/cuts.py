"""Detection of videos whose time stamps or pictures contradict the motion.

Where a part of the video is missing but time stamps continue evenly, position, body and tail jump on the same frame.
Where time stamps jump but nothing is missing, the motion continues as if no time had passed. Where strong compression
repeats the edges of the body, or something that stands still is taken for them, its tail turns and the robot stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from spirillum.arrays import Samples
from spirillum.robust import least_squares_line, mad_scale
from spirillum.vision.flag import Flag
from spirillum.vision.track.constants import STANDING
from spirillum.vision.track.steadiness import PictureSteps
from spirillum.vision.track.track import RobotMotion


@dataclass(frozen=True)
class CutConstants:
    """Videos whose times do not fit what they show."""

    window: int = 8  #: Frames before and after a moment through which straight lines are fitted.
    clear: float = 8.0  #: Jump over the standard deviation of the other jumps.
    place: float = 1.0  #: Least jump of the place, pixels.
    angle: float = 0.12  #: Least jump of an angle, rad.
    persists: float = 0.5  #: Share of a jump below which a series goes on after it as before.
    gap: float = 3.0  #: Time between two frames over the usual one from which on it is a gap, and no line goes across.
    long_window: int = 30  #: Readings before and after a gap whose fitted lines show whether time has passed.
    clock_place: float = 0.3  #: Distance of these lines below which they meet, pixels.
    clock_angle: float = 0.05  #: Distance of these lines below which they meet, rad.
    clock_errors: float = 5.0  #: Distance over its standard error below which they meet: errors are not independent.
    unseen: int = 20  #: Frames without the robot over which lines go on: it may be lost where it jumps.
    advance: float = 0.5  #: Least advance of a robot that turns, pixels.
    tail_turns: float = 1.0  #: Turns of the tail in which it has to advance by that.
    body_turns: float = 0.25  #: Turns of the body in which it has to.
    misread: float = 0.5  #: Jump of the tail's phase, rad, from which on its turns may be miscounted.


CUTS = CutConstants()


def cuts_in(motion: RobotMotion, length_per_pixel: float, picture: PictureSteps | None = None) -> tuple[Flag, ...]:
    """Flag a frame on which two of position, body and tail jump together, which viscous fluid does not allow."""
    # Where the picture goes on evenly there, the outline has hopped, and the angles that are read by it: see `hops_in`.
    jumps = [jump for jump in _jumps(motion, length_per_pixel) if jump is not None]
    usual = _usual(motion.time)
    for one, other in pairwise(sorted(jumps)):
        if other.moment - one.moment < CUTS.gap * usual and _in_the_picture(one, motion.time, picture):
            return (Flag.named("video-is-cut", moment=one.moment),)
    return ()


class Hops(NamedTuple):
    """Jumps of what was read on pictures that go on evenly."""

    distance: float  #: Standard error of the displacement from end to end, m.
    angle: float  #: Standard error of the body's angle from end to end, rad.
    phase: float  #: Standard error of the tail's phase from end to end, rad.
    flags: tuple[Flag, ...]


def hops_in(motion: RobotMotion, length_per_pixel: float, picture: PictureSteps | None) -> Hops:
    """Find jumps of the place or the angles on which the picture does not jump: another edge was followed since."""
    # Of a video that is cut nothing is given, and nothing is looked for in it.
    if picture is None or cuts_in(motion, length_per_pixel, picture):
        return Hops(0.0, 0.0, 0.0, ())
    hops = [
        None
        if jump is None or _in_the_picture(jump, motion.time, picture) or _returns(jump, motion.time, one)
        else jump
        for jump, one in zip(_jumps(motion, length_per_pixel), motion[1:], strict=True)
    ]
    first = min((hop for hop in hops if hop is not None), default=None)
    if first is None:
        return Hops(0.0, 0.0, 0.0, ())
    names = [name for name, hop in zip(("place", "body angle", "tail phase"), hops, strict=True) if hop is not None]
    what = f"{', '.join(names[:-1])} and {names[-1]} jump" if names[1:] else f"{names[0]} jumps"
    frame = int(np.searchsorted(motion.time, first.moment))
    miscounted = (tail := hops[2]) is not None and abs(tail.size) > CUTS.misread
    name = "outline-hops-and-tail" if miscounted else "outline-hops"
    flag = Flag.named(name, frame, what=what, moment=first.moment)
    place, body, phase = (abs(hop.size) if hop else 0.0 for hop in hops)
    return Hops(place, body, phase, (flag,))


class Clock(NamedTuple):
    """Evidence of the motion about the largest gap between the times of the frames."""

    relative_error: float  #: Relative standard uncertainty that it leaves in the length of the video.
    flags: tuple[Flag, ...]


def clock_of(motion: RobotMotion, length_per_pixel: float, period: float, stated: Samples | None = None) -> Clock:
    """Compare the motion before and after the largest gap between times: has time passed, or did the clock jump?"""
    # Straight lines through the readings on both sides are extrapolated to its middle, by the times as they are and as
    # if no time had passed. Where all series meet by the second and not by the first, the clock has jumped. Where they
    # meet by both, as of a slow robot, the uncertainty holds both.
    time, x, body_angle, tail_phase = motion
    none = Clock(0.0, ())
    if time.size < 2:
        return none
    steps = np.diff(time if stated is None else stated)
    usual, gap = float(np.median(steps)), int(np.argmax(steps))
    if not steps[gap] > CUTS.gap * usual:
        return none
    closed = np.where(np.arange(time.size) > gap, time - (steps[gap] - usual), time)
    series = (
        (x, CUTS.clock_place * length_per_pixel, math.inf),
        (body_angle, CUTS.clock_angle, period),
        (tail_phase, CUTS.clock_angle, 2.0 * math.pi),
    )
    passed, jumped = ([_mismatch(t, values, gap, *rest) for values, *rest in series] for t in (time, closed))
    if max(jumped) > 1.0:
        return none
    start, span = float(time[gap]), float(steps[gap])
    if math.hypot(*passed) > 1.0:
        return Clock(0.0, (Flag.named("times-do-not-fit", span=span, start=start),))
    flag = Flag.named("clock-in-doubt", span=span, start=start, stop=start + span)
    return Clock(0.5 * (span - usual) / float(closed[-1] - closed[0]), (flag,))


def one_picture(motion: RobotMotion) -> tuple[Flag, ...]:
    """Flag frames that are the same to the last digit: a camera that is stuck, or copies of one picture."""
    _, *series = motion
    seen = [values[np.isfinite(values)] for values in series]
    frames = seen[0].size
    if frames < CUTS.long_window or any(values.size and np.ptp(values) > 0.0 for values in seen):
        return ()
    return (Flag.named("one-picture", frames=frames),)


def standstill_flag(motion: RobotMotion, length_per_pixel: float) -> tuple[Flag, ...]:
    """Flag a robot that turns, but does not advance by half a pixel."""
    # A video codec repeats parts of a picture that have changed by less than its quantisation, so that strong
    # compression leaves out slow motion; a cable or a reflection that stands still may be taken for an edge of the
    # body.
    time, x, body_angle, tail_phase = motion
    known = np.isfinite(x)
    turns, turned = (_turned(angle) for angle in (tail_phase, body_angle))
    if known.sum() < CUTS.long_window or max(turns / CUTS.tail_turns, turned / CUTS.body_turns) < 1.0:
        return ()
    line = least_squares_line(time[known], x[known])
    if abs(line.slope) * float(np.ptp(time[known])) > CUTS.advance * length_per_pixel:
        return ()
    part = f"its tail turns {turns:.1f} times" if turns >= CUTS.tail_turns else "it turns"
    return (Flag.named("does-not-advance", part=part, least=CUTS.advance),)


def _turned(angle: Samples) -> float:
    """Turns from least to largest angle; 0 where unknown."""
    known = angle[np.isfinite(angle)]
    return float(np.ptp(known)) / (2.0 * math.pi) if known.size else 0.0


def _mismatch(time: Samples, values: Samples, gap: int, least: float, period: float) -> float:
    """Mismatch, modulo `period`, of the lines fitted on both sides of the gap after frame `gap`, in its middle."""
    # It is in units of what rates that are not quite steady explain (`least`, more where the lines go on for longer
    # than they were fitted), or of what the scatter of the readings does; 0 where too few are known.
    middle, far, variance, reached = 0.5 * (time[gap] + time[gap + 1]), 0.0, 0.0, []
    for part in (slice(None, gap + 1), slice(gap + 1, None)):
        known = np.flatnonzero(np.isfinite(values[part]))
        known = known[-CUTS.long_window :] if part.start is None else known[: CUTS.long_window]
        if known.size < CUTS.window:
            return 0.0
        t, v = time[part][known], values[part][known]
        line = least_squares_line(t, v)
        reached.append(float(line.at(middle)))
        away = middle - line.time
        far += 0.5 * (away / (0.5 * float(np.ptp(t)))) ** 2
        scatter = float(mad_scale(v - line.at(t)))
        variance += scatter**2 * (1.0 / known.size + away**2 / float(np.sum((t - line.time) ** 2)))
    unit = max(least * max(1.0, math.sqrt(far)), CUTS.clock_errors * math.sqrt(variance))
    return abs(math.remainder(reached[1] - reached[0], period)) / unit


class _Jump(NamedTuple):
    """The largest jump of a series."""

    moment: float  # time, s
    size: float  # of the series


def _jumps(motion: RobotMotion, length_per_pixel: float) -> list[_Jump | None]:
    """The largest significant jumps of place, body and tail; None where there is none."""
    time, x, body_angle, tail_phase = motion
    if time.size < 2:
        return [None, None, None]
    usual = _usual(time)
    angles = (_jump(time, angle, CUTS.angle, usual) for angle in (body_angle, tail_phase))
    return [_jump(time, x, CUTS.place * length_per_pixel, usual), *angles]


def _usual(time: Samples) -> float:
    """Usual time between two frames, s."""
    return float(np.median(np.diff(time))) if time.size > 1 else 0.0


def _in_the_picture(jump: _Jump, time: Samples, picture: PictureSteps | None) -> bool:
    """Whether the picture jumps at a jump of a series, or within a step of it; it does where that is unknown."""
    if picture is None:
        return True
    return picture.jump_near(int(np.searchsorted(time, jump.moment)) - 1)


def _jump(time: Samples, values: Samples, least: float, usual: float) -> _Jump | None:
    """The largest significant jump of a series; None if there is none."""
    known = np.isfinite(values)
    t, v = time[known], values[known]
    if t.size < 4 * CUTS.window:
        return None
    windows_t, windows_v = sliding_window_view(t, CUTS.window), sliding_window_view(v, CUTS.window)
    middle_t, middle_v = windows_t.mean(axis=1), windows_v.mean(axis=1)
    spans = windows_t - middle_t[:, None]
    squares = np.sum(spans**2, axis=1)
    slopes = np.sum(spans * windows_v, axis=1) / squares
    splits = 0.5 * (t[CUTS.window : -CUTS.window] + t[CUTS.window - 1 : -CUTS.window - 1])
    before, after = slice(None, splits.size), slice(CUTS.window, CUTS.window + splits.size)
    far = [splits - middle_t[part] for part in (before, after)]
    reached = [middle_v[part] + slopes[part] * away for part, away in zip((before, after), far, strict=True)]
    # In units of the standard error of the mismatch of lines that end half a frame before and after the split.
    unsure = sum(1.0 / CUTS.window + away**2 / squares[part] for part, away in zip((before, after), far, strict=True))
    steps = (reached[1] - reached[0]) / np.sqrt(unsure / np.min(unsure))
    longest = sliding_window_view(np.diff(t), 2 * CUTS.window - 1).max(axis=1)[: splits.size]
    steps = np.where(_even(time, t, usual) & (longest < CUTS.unseen * usual), steps, 0.0)
    if not steps.any():
        return None
    spread = float(mad_scale(steps[steps != 0.0]))
    largest = int(np.argmax(np.abs(steps)))
    if not abs(steps[largest]) > max(least, CUTS.clear * spread):
        return None
    return _Jump(float(splits[largest]), float(reached[1][largest] - reached[0][largest]))


def _returns(jump: _Jump, time: Samples, values: Samples) -> bool:
    """Whether a series goes on after a jump as before: only frames beside it were misread, such as under a highlight.

    By a line with a step through what lies farther away than the lines that show the jump.
    """
    known = np.flatnonzero(np.isfinite(values))
    split = int(np.searchsorted(time[known], jump.moment))
    far = np.concatenate([known[: max(0, split - CUTS.window)], known[split + CUTS.window :]])
    after = time[far] > jump.moment
    if min(np.count_nonzero(after), np.count_nonzero(~after)) < CUTS.window:
        return False
    design = np.column_stack([np.ones(far.size), time[far], after])
    return bool(abs(np.linalg.lstsq(design, values[far], rcond=None)[0][2]) < CUTS.persists * abs(jump.size))


def _even(time: Samples, t: Samples, usual: float) -> np.ndarray:
    """Mask of the splits of the known frames `t` without a gap in all frames' times, (len(t) - 2 CUTS.window,)."""
    gaps = np.concatenate([[0], np.cumsum(np.diff(time) > CUTS.gap * usual)])
    place = np.searchsorted(time, t)
    return np.asarray(gaps[place[2 * CUTS.window - 1 : -1]] == gaps[place[: -2 * CUTS.window]])


def no_motion_flag(motion: RobotMotion, length_per_pixel: float) -> tuple[Flag, ...]:
    """Flag a robot that neither advances nor turns, whose stripes or tail were read."""
    time, x, body_angle, tail_phase = motion
    limits = [(x, STANDING.moved * length_per_pixel), *((angle, STANDING.turned) for angle in (body_angle, tail_phase))]
    read = [(values[known], limit) for values, limit in limits if (known := np.isfinite(values)).any()]
    if len(read) < 2 or not np.isfinite(x).any():
        return ()
    for values, limit in read:  # from the first to the last fifth
        few = max(1, len(values) // 5)
        if abs(np.median(values[-few:]) - np.median(values[:few])) > limit:
            return ()
    turned = np.degrees(STANDING.turned)
    return (Flag.named("robot-stands-still", span=np.ptp(time), moved=STANDING.moved, turned=turned),)
