"""Phase unwrapping: from angles modulo a period to continuous angles, with detection of aliasing.

At a constant frame rate, rates that differ by whole periods per frame are aliases; the smallest one is taken. Aliasing
is detected by steps near half a period, steps without order, uneven frame times that another alias fits better, and a
body that turns in the sense of its tail.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.robot import Robot
from spirillum.robust import least_squares_line, running_median
from spirillum.units import show
from spirillum.vision.flag import Flag
from spirillum.vision.track.constants import UNWRAPPING
from spirillum.vision.track.track import RobotMotion

_Part = Literal["body", "tail"]


def unwrapped(
    time: Samples, angle: Samples, error: Samples, period: float, part: _Part = "body", *, readable: float = 1.0
) -> tuple[Samples, tuple[Flag, ...]]:
    """Continuous angles, NaN where unknown or outliers, and flags."""
    # Each angle gets the whole periods that bring it nearest to its prediction by an alpha-beta filter, also after
    # gaps.
    out = np.full(angle.shape, np.nan)
    known = np.flatnonzero(np.isfinite(angle) & np.isfinite(time))
    if known.size < 4:
        return out, (_unread(part, known.size, angle.size),)
    t, a = time[known], angle[known] % period
    dt = float(np.median(np.diff(t)))
    rate, order = _rate(t, a, period, dt)
    flags: list[Flag] = []
    if known.size < 0.5 * readable * angle.size:
        flags.append(_unread(part, known.size, angle.size))
    least = UNWRAPPING.least_order
    if abs(rate) * dt > UNWRAPPING.largest_step * period:
        step = abs(rate) * dt / period
        flags.append(Flag.named("turns-too-fast", part=part, step=step, largest=UNWRAPPING.largest_step))
    elif (other := _better_alias(t, a, period, dt, rate)) is not None:
        flags.append(Flag.named("another-rate", part=part, rate=rate / (2 * np.pi), other=other / (2 * np.pi)))
    elif order < least and _local_order(t, a, period, dt) < least:  # at a start or stop, steps agree locally
        flags.append(Flag.named("angle-jumps", part=part))
    values, doubtful = _followed(t, a, error[known], period, dt)
    if doubtful:
        flags.append(Flag.named("turns-lost", part=part, start=doubtful[0], stop=doubtful[1]))
    if part == "body":
        values = _without_strays(t, values, dt)
        if (count := _leaps(t, values, dt)) >= UNWRAPPING.leaps:
            flags.append(Flag.named("stripes-leap", count=count, angle=np.degrees(UNWRAPPING.leap)))
    out[known] = values
    return out, tuple(flags)


def _resultant(t: Samples, a: Samples, period: float, dt: float, rates: Samples) -> Samples:
    """Mean cosine of the residual phases of the steps at each trial rate, 1 at best."""
    steps, spans = np.diff(a), np.diff(t)
    near = (spans > 0) & (spans < 3.5 * dt)
    turns = (steps[near] - rates[:, None] * spans[near]) / period
    return np.asarray(np.mean(np.cos(2 * np.pi * turns), axis=1) if near.any() else np.zeros(rates.size))


def likeliest_rate(time: Samples, angle: Samples, period: float, usual: float) -> float:
    """The rate below half a period a frame that fits the steps of some readings best, rad/s."""
    return _rate(time, angle, period, usual)[0]


def _rate(t: Samples, a: Samples, period: float, dt: float) -> tuple[float, float]:
    """The rate below half a period per frame with the largest mean cosine, and that cosine."""
    rates = np.linspace(-0.5, 0.5, 241) * period / dt
    length = _resultant(t, a, period, dt, rates)
    best = rates[int(np.argmax(length))]
    rates = best + np.linspace(-1.0, 1.0, 21) / 240 * period / dt
    fine = _resultant(t, a, period, dt, rates)
    return float(rates[int(np.argmax(fine))]), float(fine.max())


def _local_order(t: Samples, a: Samples, period: float, dt: float) -> float:
    """Median over short windows of the largest mean cosine."""
    starts = range(0, max(1, t.size - 10), 20)
    return float(np.median([_rate(t[k : k + 20], a[k : k + 20], period, dt)[1] for k in starts]))


def _better_alias(t: Samples, a: Samples, period: float, dt: float, rate: float) -> float | None:
    """An alias of the rate that uneven frame times fit significantly better; None if there is none."""
    others = rate + np.array([-3, -2, -1, 1, 2, 3]) * period / dt
    length = np.array(
        [_resultant(t, a, period, dt, other + np.linspace(-0.02, 0.02, 41) * period / dt).max() for other in others]
    )
    own = _resultant(t, a, period, dt, rate + np.linspace(-0.02, 0.02, 41) * period / dt).max()
    best = int(np.argmax(length))
    count = max(4, t.size - 1)
    return float(others[best]) if length[best] > own + 3.0 / np.sqrt(count) * (1.0 - own) + 1e-3 else None


def _followed(
    t: Samples, a: Samples, error: Samples, period: float, dt: float
) -> tuple[Samples, tuple[float, float] | None]:
    """Unwrapped angles by an alpha-beta filter, NaN for outliers; the first gap over which periods may be lost."""
    values = np.full(a.size, np.nan)
    outliers = 0
    lost = None
    rate = _rate(t[: UNWRAPPING.start + 1], a[: UNWRAPPING.start + 1], period, dt)[0]
    begin = _first_good(t, a, period, rate)
    state, at = float(a[begin]), float(t[begin])
    for k in range(begin, a.size):
        span = float(t[k]) - at
        expected = state + rate * span
        value = float(a[k] + period * np.round((expected - a[k]) / period))
        if span > 10.0 * dt and abs(rate) * span * UNWRAPPING.drift > 0.5 * period and lost is None:
            lost = (at, float(t[k]))
        if abs(value - expected) > UNWRAPPING.outlier * period and k > begin:
            outliers += 1
            if outliers >= UNWRAPPING.lost:
                near = slice(max(0, k - UNWRAPPING.lost + 1), min(a.size, k + UNWRAPPING.start))
                rate = _rate(t[near], a[near], period, dt)[0]
                state, at, outliers = value, float(t[k]), 0
                values[k] = value
            continue
        outliers = 0
        values[k] = value
        gain = UNWRAPPING.gain if np.isfinite(error[k]) and error[k] < 0.1 * period else 0.2
        if span > 0:
            rate += UNWRAPPING.rate_gain * gain / UNWRAPPING.gain * (value - expected) / max(span, dt)
        state, at = expected + gain * (value - expected), float(t[k])
    return values, lost


def _first_good(t: Samples, a: Samples, period: float, rate: float) -> int:
    """Index of the first angle that is consistent with the next ones."""
    for k in range(min(20, a.size - 3)):
        ahead = a[k] + rate * (t[k + 1 : k + 6] - t[k])
        miss = (a[k + 1 : k + 6] - ahead) / period
        if np.median(np.abs(miss - np.round(miss))) < 0.2:
            return k
    return 0


def _without_strays(t: Samples, values: Samples, dt: float) -> Samples:
    """Angles without single readings far off the line between their neighbours, which go on as if it were not there."""
    known = np.flatnonzero(np.isfinite(values))
    a, at = values[known], t[known]
    if a.size < UNWRAPPING.leap_window:
        return values
    before, here, after = a[:-2], a[1:-1], a[2:]
    span = at[2:] - at[:-2]
    between = before + (after - before) * (at[1:-1] - at[:-2]) / span
    usual = running_median(np.diff(a) / np.diff(at), UNWRAPPING.leap_window)
    on = np.abs(after - before - 0.5 * (usual[:-1] + usual[1:]) * span) < UNWRAPPING.stray_rest
    stray = on & (np.abs(here - between) > UNWRAPPING.leap) & (span < 10.0 * dt)
    kept = values.copy()
    kept[known[1:-1][stray]] = np.nan
    return kept


def _leaps(t: Samples, values: Samples, dt: float) -> int:
    """Number of outliers among the steps between neighbouring angles, against their running median."""
    known = np.isfinite(values)
    steps, spans = np.diff(values[known]), np.diff(t[known])
    if steps.size < UNWRAPPING.leap_window:
        return 0
    off = np.abs(steps - running_median(steps / spans, UNWRAPPING.leap_window) * spans)
    return int(np.sum((off > UNWRAPPING.leap) & (spans < 10.0 * dt)))


def _unread(part: _Part, seen: int, total: int) -> Flag:
    name = "unreadable" if seen < max(4, UNWRAPPING.least_share * total) else "partly-unreadable"
    return Flag.named(name, part=part, what="stripes" if part == "body" else "tail", seen=seen, total=total)


def _slope(time: Samples, value: Samples) -> tuple[float, float]:
    """Rate of a series by least squares, and its total change; 0 where unknown."""
    known = np.isfinite(value)
    if known.sum() < 4:
        return 0.0, 0.0
    t, v = time[known], value[known]
    rate = float(least_squares_line(t, v).slope)
    return rate, rate * float(t[-1] - t[0])


def static_object_flag(motion: RobotMotion, robot: Robot) -> tuple[Flag, ...]:
    """Flag an object that neither moves nor turns and has no tail: it may belong to the background."""
    time, x, body_angle, tail_phase = motion
    if time.size < UNWRAPPING.fewest_frames:
        return ()
    moved, turned = (abs(_slope(time, values)[1]) for values in (x, body_angle))
    if np.isfinite(tail_phase).any() or moved > UNWRAPPING.rest * robot.body.length or turned > UNWRAPPING.rest_angle:
        return ()
    return (Flag.named("static-object"),)


def no_stripe_passes(motion: RobotMotion, robot: Robot, *, readable: float = 1.0) -> tuple[Flag, ...]:
    """Flag a body that stays where it is while its tail turns: shades of the lamp may have been taken for stripes."""
    known = motion.body_angle[np.isfinite(motion.body_angle)]
    turns = abs(_slope(motion.time, motion.tail_phase)[1]) / (2.0 * np.pi)
    fixed = robot.drive is not None and robot.drive.joint == "fixed"
    least_turns = 0.0 if 0.0 < readable < 1.0 else UNWRAPPING.tail_turns
    if fixed or known.size < UNWRAPPING.fewest_frames or turns < least_turns:
        return ()
    low, high = np.quantile(known, [0.02, 0.98])
    if high - low > UNWRAPPING.seen_to_pass:
        return ()
    return (Flag.named("stripes-do-not-pass", least=np.degrees(UNWRAPPING.seen_to_pass), turns=turns),)


def contradictions(motion: RobotMotion, robot: Robot, hand_seen: int = 0) -> tuple[Flag, ...]:
    """Flag rates that no torque-free swimmer has: signs of aliasing, or of a wrong robot file."""
    # Without an external torque the body counter-rotates. The tail propels in the sense of its rotation and handedness,
    # and its advance per turn does not exceed that of a tail without body.
    time, x, body_angle, tail_phase = motion
    if robot.drive is not None and robot.drive.joint == "fixed":
        return ()  # body and tail are one rigid body
    body, body_turned = _slope(time, body_angle)
    tail, tail_turned = _slope(time, tail_phase)
    _, moved = _slope(time, x)
    turns = abs(tail_turned) > UNWRAPPING.turning
    if turns and abs(body_turned) > UNWRAPPING.turning and body * tail > 0:
        return (Flag.named("turns-with-body" if hand_seen > 0 else "handedness"),)
    far = abs(moved) > 0.05 * robot.body.length
    if far and np.isfinite(tail_phase).any() and (flags := _not_driven(moved, tail_turned, robot)):
        return flags
    if turns and abs(body) > 1.5 * abs(tail):
        return (Flag.named("body-outruns-tail", tail=abs(tail) / (2 * np.pi)),)
    return ()


def _not_driven(moved: float, tail_turned: float, robot: Robot) -> tuple[Flag, ...]:
    """Flag a displacement that the measured rotation of the tail cannot produce."""
    turns, what = abs(tail_turned) / (2 * np.pi), "the tail is too fast for this frame rate"
    if abs(tail_turned) > UNWRAPPING.turning and moved * tail_turned * robot.hand < 0:
        why, what = "moves against the sense in which its tail seems to turn", f"{what}, tail.handedness is wrong"
    elif abs(moved) <= turns * UNWRAPPING.wall_factor * _largest_advance(robot):
        return ()
    elif abs(tail_turned) > UNWRAPPING.turning:
        why = (
            f"advances {show(abs(moved) / turns, 'mm')} a turn of its tail, more than such a wire can in viscous fluid"
        )
    else:
        why = "moves while its tail seems to rest"
    return (Flag.named("not-driven", why=why, what=what),)


def _largest_advance(robot: Robot) -> float:
    """Advance of a tail without body per turn, m, by resistive force theory (Gray and Hancock 1955): an upper bound."""
    # A force-free helix of angle b, tan b = k B_o, advances (1 - g) sin^2 b / (g cos^2 b + sin^2 b) of its wavelength,
    # with g = c_t/c_n no less than 1/2.
    tail = robot.tail
    steepness = (2 * np.pi * tail.amplitude / tail.wavelength) ** 2
    return float(tail.wavelength * 0.5 * steepness / (0.5 + steepness))
