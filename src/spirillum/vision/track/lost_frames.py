"""Frames that were lost while the time stamps stay even, from the steps of tail, body and place.

A simple recording script states even times, or a constant rate, whatever the camera delivered. Where k frames are
lost, all of the motion goes on by 1 + k steps on one frame. In steady motion each step gives its own estimate of k:
sum of squares over the three series, each step modulo the period of its angle, weighted by the scatter of its steps.

A frame that is repeated is a step of no motion between usual ones. Either the recorder stored a picture twice, and what
follows comes a frame too late; or the video was converted from a lower frame rate, and its times are right. Both look
alike, so that times are kept, and their uncertainty holds both.

Where every other frame is lost or repeated, there is no usual step. But in steady motion all steps are then multiples
of one step, and two or more multiples are frequent, which neither a steady nor a stuttering motor makes.
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from spirillum.arrays import Samples
from spirillum.robust import mad_scale, running_median, stretches_of
from spirillum.vision.flag import Flag
from spirillum.vision.track.constants import LOST_FRAMES, MULTIPLES
from spirillum.vision.track.steadiness import PictureSteps


class FrameSeries(NamedTuple):
    """One series of a video, as it was read on each frame."""

    values: Samples  #: Position, m, or angle modulo `period`, rad, (n,); NaN where unreadable.
    period: float  #: Period of the angle, rad; infinite for a position.
    least: float  #: Least standard error of a step.


class Restored(NamedTuple):
    """Times with the lost frames put back."""

    time: Samples  #: Corrected time of each frame, s, (n,); the given times where nothing was corrected.
    relative_error: float  #: Relative standard uncertainty that doubtful steps leave in the length of the video.
    flags: tuple[Flag, ...]  #: What was corrected, or why nothing is given.


class _Jumps(NamedTuple):
    """Jumps of one series at each step, against the straight line through its neighbourhood."""

    jump: Samples  # median of frames after the step minus that of as many before, modulo the period, (m,); NaN: unknown
    usual: Samples  # usual step in the time of one frame, (m,)
    error: float  # robust standard error of a jump
    period: float


def restored_times(time: Samples, readings: tuple[FrameSeries, ...], picture: PictureSteps | None = None) -> Restored:
    """Find frames that are missing although the times go on evenly, and correct the times where that is clear.

    A loss counts where the jumps prefer it to none by `LOST_FRAMES.clear` in chi-square, and to any other number by
    `LOST_FRAMES.apart`. Jumps between neighbouring frames are taken first, then those between medians of more and
    more frames, which show smaller steps. All losses together have to be seen by each series that can see them.
    Otherwise nothing is given, as also if too many jumps are clear but not by whole frames, or if further losses of
    one frame could not be seen. Losses by which no series moves clearly stay unseen: slow robots, even rates.

    A jump counts only where the picture jumps too, and a repeated frame only where the picture rests: otherwise the
    outline has hopped, or was misread.

    Args:
        time: time of each frame as the video states it, s, (n,).
        readings: the series: tail, body and position.
        picture: evidence of the pictures about each step; None: none.
    """
    none = Restored(time, 0.0, ())
    if time.size <= LOST_FRAMES.fewest or np.any(np.diff(time) <= 0):
        return none
    frame = float(np.median(np.diff(time)))
    lost = np.zeros(time.size - 1, dtype=np.int64)
    odd = np.zeros(lost.shape, dtype=bool)
    for wide in LOST_FRAMES.windows:
        for _ in range(LOST_FRAMES.rounds):
            series = _all_jumps(_later(time, lost, frame), readings, frame, wide)
            more, odd = _losses(series, wide, picture) if series else (np.zeros_like(lost), odd)
            lost += more
            if not more.any():
                break
    found = _restored_times(time, readings, frame, lost, odd) if lost.any() else none
    uneven = any(flag.spoils for flag in found.flags)
    many = None if uneven else _in_multiples(found.time, readings, frame)
    if many is not None and max(many.lost, many.repeated) > MULTIPLES.largest_share * many.steps:
        return none._replace(flags=(_no_usual_step(many),))
    repeats = 0 if uneven else _repeated(found.time, readings, frame, picture)
    change = _change_of_motion(time, readings, unclear=bool(uneven or repeats))
    if change:
        return none._replace(flags=(change,)) if change.spoils else found._replace(flags=(*found.flags, change))
    if not repeats:
        return found
    doubt = LOST_FRAMES.repeats_error * repeats * frame / float(found.time[-1] - found.time[0])
    return Restored(found.time, found.relative_error + doubt, (*found.flags, _repeats(repeats, lost.size)))


def _in_multiples(time: Samples, readings: tuple[FrameSeries, ...], frame: float) -> Multiples | None:
    """Of the first series whose steps are multiples of one; None where those of a clear series are alike."""
    if any(all_alike(time, reading.values, reading.period, frame) for reading in readings):
        return None
    found = (multiples_of(time, reading.values, reading.period, frame) for reading in readings)
    return next((one for one in found if one is not None), None)


def _restored_times(
    time: Samples, readings: tuple[FrameSeries, ...], frame: float, lost: np.ndarray, odd: np.ndarray
) -> Restored:
    """Times with the losses that were found put back, or why nothing is given."""
    after = _all_jumps(_later(time, lost, frame), readings, frame, LOST_FRAMES.windows[-1])
    many = np.count_nonzero(lost) > LOST_FRAMES.largest_share * lost.size
    stray = int(np.sum(odd & ~(lost > 0)))
    if (
        many
        or _power(after) < LOST_FRAMES.power
        or stray > max(2.0, LOST_FRAMES.odd_share * lost.sum())
        or not all(_agrees(one, lost) for one in after)
    ):
        single = int(lost.sum()) + stray == 1  # it changes no rate by more than its share of the video
        flag = Flag.named("one-uneven-step" if single else "uneven-steps", count=int(np.count_nonzero(lost)) + stray)
        return Restored(time, 0.0 if flag.spoils else frame / float(time[-1] - time[0]), (flag,))
    corrected = _later(time, lost, frame)
    # A loss that one series alone shows counts half.
    alone = sum(_sees(one, lost) for one in after) < 2
    doubt = (LOST_FRAMES.half * float(np.sqrt(np.sum(lost**2))) if alone else 0.0) + stray
    length = float(corrected[-1] - corrected[0])
    return Restored(corrected, doubt * frame / length, (_corrected(lost, doubtful=doubt > 0),))


def _repeated(time: Samples, readings: tuple[FrameSeries, ...], frame: float, picture: PictureSteps | None) -> int:
    """Number of frames that show no motion between frames that do."""
    # Those that make up for a loss are none: the next step is twice as large. Nor is a robot that stands for a while.
    series = _all_jumps(time, readings, frame, 1)
    if _power(series) < LOST_FRAMES.repeats_power:
        return 0
    misfit = np.asarray(sum(_misfit(one, np.arange(-1, LOST_FRAMES.most + 1)) for one in series))
    fit = misfit < LOST_FRAMES.fits * len(series)
    still = fit[:, 0] & (misfit[:, 1:].min(axis=1) - misfit[:, 0] > LOST_FRAMES.repeats)
    still = still if picture is None else still & picture.rests
    twice = fit[:, 2] & (misfit[:, 1] - misfit[:, 2] > LOST_FRAMES.apart)
    stands = np.convolve(still, np.ones(2 * LOST_FRAMES.stands + 1), "same") > LOST_FRAMES.stands
    return int(np.sum(still & ~stands & ~np.append(twice[1:], False)))


def _power(series: list[_Jumps]) -> float:
    """Chi-square by which the loss of one frame fits better than none; 0 without any series."""
    return sum(float(np.nanmedian(one.usual) / one.error) ** 2 for one in series)


def _change_of_motion(time: Samples, readings: tuple[FrameSeries, ...], *, unclear: bool) -> Flag | None:
    """Flag a video in which nothing moves for a while, or everything reverses; nothing is given if it is `unclear`."""
    # The tail, which comes first, has to show it: compression holds a body that hardly moves where it is for a while.
    few = LOST_FRAMES.standing // 3
    means: list[Samples] = []
    for number, reading in enumerate(readings):
        known = np.flatnonzero(np.isfinite(reading.values))
        if known.size > 2 * LOST_FRAMES.standing:
            off = _wrapped(np.diff(reading.values[known]), reading.period) / np.diff(known)
            every = np.interp(np.arange(time.size), known[1:], off)
            mean = sliding_window_view(every, few).mean(axis=1)
            usual = float(np.quantile(np.abs(mean), 0.9))
            error = max(float(mad_scale(np.diff(off))), reading.least)  # a codec copies pictures without any
            if usual > LOST_FRAMES.told * error / few:  # errors of steps cancel in a row
                moving = mean[np.abs(mean) > LOST_FRAMES.still * usual]
                means.append(mean / usual * np.sign(moving[0]))
        if number == 0 and not means:
            return None
    if len(means) < 2:
        return None
    over = sliding_window_view(np.array(means), LOST_FRAMES.standing - few + 1, axis=1)
    rests = stretches_of(np.abs(over).max(axis=(0, 2)) < LOST_FRAMES.still)
    if rests:
        longest = max(rests, key=len)
        first, last = float(time[longest[0]]), float(time[longest[-1] + LOST_FRAMES.standing - 1])
        parts = [] if first <= time[1] else [f"--end {first:.2f}s"]
        parts += [] if last >= time[-1] - (time[1] - time[0]) else [f"--start {last:.2f}s"]
        name = "stands-and-uneven" if unclear else "stands-for-a-while"
        return Flag.named(name, first=first, last=last, parts=" or ".join(parts))
    back = np.flatnonzero(over.max(axis=(0, 2)) < -LOST_FRAMES.still)
    name = "reverses-and-uneven" if unclear else "reverses"
    return Flag.named(name, moment=time[back[0]]) if back.size else None


def _later(time: Samples, lost: np.ndarray, frame: float) -> Samples:
    """Times with lost frames put back, s, (n,)."""
    return time + frame * np.concatenate([[0.0], np.cumsum(lost)])


def _losses(series: list[_Jumps], wide: int, picture: PictureSteps | None) -> tuple[np.ndarray, np.ndarray]:
    """Frames lost at each step, (m,), and a mask of jumps that stand out without being whole frames, (m,)."""
    counts = np.arange(LOST_FRAMES.most + 1)
    misfit = np.asarray(sum(_misfit(one, counts) for one in series))
    rows = np.arange(len(misfit))
    best = np.argmin(misfit, axis=1)
    gain = misfit[:, 0] - misfit[rows, best]
    others = misfit.copy()
    others[rows, best] = np.inf
    second = others.min(axis=1) - misfit[rows, best]
    stands_out = gain > LOST_FRAMES.clear
    if picture is not None:
        stands_out &= np.convolve(picture.jumps, np.ones(2 * wide - 1), "same") > 0.0
    clear = stands_out & (second > LOST_FRAMES.apart) & (misfit[rows, best] < LOST_FRAMES.fits * len(series))
    lost, odd = np.zeros(best.shape, dtype=np.int64), stands_out & ~clear
    for place in np.argsort(-gain):  # a jump shows at all steps within the window: the clearest is taken
        near = slice(max(0, place - wide), place + wide + 1)
        if clear[place] and not lost[near].any():
            lost[place] = best[place]
            odd[near] = False
    return lost, odd


def _all_jumps(time: Samples, readings: tuple[FrameSeries, ...], frame: float, wide: int) -> list[_Jumps]:
    """Jumps of the series that move enough to show lost frames, by medians of `wide` frames."""
    found = (_jumps(time, reading, frame, wide) for reading in readings)
    return [one for one in found if one is not None]


def _jumps(time: Samples, reading: FrameSeries, frame: float, wide: int) -> _Jumps | None:
    known = np.flatnonzero(np.isfinite(reading.values))
    if known.size <= LOST_FRAMES.fewest:
        return None
    spans, steps = np.diff(time[known]), np.diff(reading.values[known])
    rate = float(np.median(near_their_mean(steps, reading.period) / spans))
    excess = _wrapped(steps - rate * spans, reading.period)
    level = np.full(time.size, np.nan)
    level[known] = np.concatenate([[0.0], np.cumsum(excess)])
    far = LOST_FRAMES.spike * max(float(mad_scale(excess)), reading.least)
    values = level[known]
    level[known[np.abs(values - running_median(values, 5)) > far]] = np.nan  # misread frames; a lasting jump stays
    rest = np.where(
        np.abs(excess) > LOST_FRAMES.beyond / LOST_FRAMES.spike * far, 0.0, excess
    )  # jumps are no part of the slope
    drift = _local_slope(time[known], np.concatenate([[0.0], np.cumsum(rest)]))
    padded = np.pad(level, wide, constant_values=np.nan)
    windows = sliding_window_view(padded, wide)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # windows without any reading
        medians = np.nanmedian(windows, axis=1)
        away = np.nanmedian(
            sliding_window_view(np.pad(np.where(np.isfinite(level), time, np.nan), wide, constant_values=np.nan), wide),
            axis=1,
        )
    before, after = slice(1, time.size), slice(1 + wide, time.size + wide)
    slope = np.interp(0.5 * (time[1:] + time[:-1]), time[known], drift)
    jump = _wrapped(medians[after] - medians[before] - slope * (away[after] - away[before]), reading.period)
    good = np.isfinite(jump)
    if good.sum() < LOST_FRAMES.fewest:
        return None
    error = max(float(mad_scale(jump[good])), reading.least / np.sqrt(wide))
    usual = (rate + slope) * frame
    return _Jumps(jump, usual, error, reading.period) if np.median(np.abs(usual)) > 0.1 * error else None


def _local_slope(time: Samples, values: Samples) -> Samples:
    """Slope about each frame, from medians at both ends of a neighbourhood of `LOST_FRAMES.around` frames, (n,)."""
    wide = min(LOST_FRAMES.around, time.size - 1) // 4
    ends = sliding_window_view(values, wide)
    medians, times = np.median(ends, axis=1), sliding_window_view(time, wide).mean(axis=1)
    last = medians.size - 1
    place = np.arange(time.size) - wide // 2
    low, high = np.clip(place - 2 * wide, 0, last), np.clip(place + 2 * wide, 0, last)
    return np.asarray((medians[high] - medians[low]) / (times[high] - times[low]))


def _misfit(steps: _Jumps, counts: np.ndarray) -> Samples:
    """Chi-square of each number of lost frames at each step, (m, counts); 0 where the series has no information."""
    off = _wrapped(steps.jump[:, None] - counts[None, :] * steps.usual[:, None], steps.period)
    return np.nan_to_num((off / steps.error) ** 2, nan=0.0)


def _sees(steps: _Jumps, lost: np.ndarray) -> bool:
    """Whether the series can distinguish the losses from none, taken together."""
    at = (lost > 0) & np.isfinite(steps.jump)
    return bool(np.sqrt(np.sum((lost[at] * steps.usual[at]) ** 2)) > LOST_FRAMES.told * steps.error)


def _agrees(steps: _Jumps, lost: np.ndarray) -> bool:
    """Whether the series has the losses' size; a series that cannot see them agrees."""
    # What jumps are left with the corrected times is regressed on the losses: 0 within four standard errors, or within
    # `LOST_FRAMES.agrees`.
    if not _sees(steps, lost):
        return True
    at = (lost > 0) & np.isfinite(steps.jump)
    wanted = lost[at] * steps.usual[at]
    square = float(np.sum(wanted**2))
    left = abs(float(np.sum(wanted * steps.jump[at]))) / square
    return bool(left < max(4.0 * steps.error / np.sqrt(square), LOST_FRAMES.agrees))


def _wrapped(values: Samples, period: float) -> Samples:
    """Values modulo the period, nearest to 0."""
    return values if not np.isfinite(period) else values - period * np.round(values / period)


def _corrected(lost: np.ndarray, *, doubtful: bool) -> Flag:
    count, places = int(lost.sum()), int(np.count_nonzero(lost))
    frames = "1 frame is" if count == 1 else f"{count} frames are"
    where = "at 1 place" if places == 1 else f"at {places} places"
    doubt = "; not all of the series show it, so that all intervals are wider" if doubtful else ""
    return Flag.named("lost-frames", frames=frames, where=where, doubt=doubt)


def _repeats(count: int, steps: int) -> Flag:
    frames = "1 frame repeats" if count == 1 else f"{count} frames repeat"
    return Flag.named("repeated-frames", frames=frames, low=100.0 * count / (steps - count))


def _no_usual_step(many: Multiples) -> Flag:
    """Nothing is given where most steps are of several frames or of none."""
    if many.lost > many.repeated:
        what, wrong = f"some {many.lost} frames were lost between {many.steps} steps", "high"
    else:
        what, wrong = f"{many.repeated} of {many.steps} frames repeat the one before", "low"
    return Flag.named("no-usual-step", what=what, wrong=wrong)


class Multiples(NamedTuple):
    """Count the steps by their multiple of the smallest one."""

    repeated: int  #: Frames that repeat the one before, and are not made up for by the next step.
    lost: int  #: Frames that were lost, but for those before which one was repeated.
    steps: int  #: Steps in all.


def multiples_of(time: Samples, values: Samples, period: float, frame: float) -> Multiples | None:
    """Repeated and lost frames of a series whose steps are multiples of one; None where they are equal, or differ."""
    each = _steps(time, values, period, frame)
    if each.size <= MULTIPLES.fewest:
        return None
    unit = _unit(each)
    if unit is None:
        return None
    counts = np.round(each / unit).astype(np.int64)
    frequent = [count for count in np.unique(counts) if np.mean(counts == count) > MULTIPLES.share]
    if len(frequent) < 2 or frequent[0] < 0 or np.mean(np.diff(counts) != 0) < MULTIPLES.changing:
        return None
    still, far = counts == 0, counts > 1
    made_up = still & np.append(far[1:], False)  # a picture that came late: its time is wrong, and the next one's right
    far &= ~np.concatenate([[False], made_up[:-1]])
    repeated = still & ~made_up
    for rest in stretches_of(still):
        if len(rest) > MULTIPLES.rest:
            repeated[rest] = False
    return Multiples(int(repeated.sum()), int(np.sum(counts[far] - 1)), int(counts.size))


def all_alike(time: Samples, values: Samples, period: float, frame: float) -> bool:
    """Whether nearly all steps of a series are about as large as their median: it is clear, and has no multiples."""
    each = _steps(time, values, period, frame)
    if each.size <= MULTIPLES.fewest:
        return False
    middle = float(np.median(each))
    return bool(np.mean(np.abs(each - middle) < MULTIPLES.alike * middle) > 1.0 - MULTIPLES.share)


def _steps(time: Samples, values: Samples, period: float, frame: float) -> Samples:
    """Steps between neighbouring frames in the time of one, mostly positive, (m,)."""
    known = np.flatnonzero(np.isfinite(values))
    if known.size < 2:
        return np.zeros(0)
    steps, spans = np.diff(values[known]), np.diff(time[known])
    each: Samples = (near_their_mean(steps, period) * frame / spans)[np.diff(known) == 1]
    return each * np.sign(np.mean(each)) if each.size else each


def near_their_mean(steps: Samples, period: float) -> Samples:
    """Steps of an angle, each the whole periods nearer to their circular mean; those of a position as they are."""
    if not np.isfinite(period):
        return steps
    middle = float(np.angle(np.mean(np.exp(2j * np.pi * steps / period)))) * period / (2.0 * np.pi)
    found: Samples = steps - period * np.round((steps - middle) / period)
    return found


def _unit(steps: Samples) -> float | None:
    """The largest step of which all are multiples; None where there is none."""
    top = float(np.quantile(steps, 1.0 - MULTIPLES.share))  # beyond it may lie misread frames
    if top <= 0.0:
        return None
    sizes = top * np.geomspace(1.0 / MULTIPLES.most, 1.05, 400)
    score = np.cos(2.0 * np.pi * steps[:, None] / sizes).mean(axis=0)
    good = np.flatnonzero(score > MULTIPLES.coherent)
    if not good.size:
        return None
    first = int(good[-1])
    while first - 1 in good:
        first -= 1
    around = slice(first, int(good[-1]) + 1)
    return float(sizes[around][np.argmax(score[around])])
