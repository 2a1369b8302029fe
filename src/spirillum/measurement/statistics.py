"""Statistics of repeated trials: means, confidence intervals, systematic errors; digits that an interval deserves.

The functions of `scipy.special` are the ones behind `scipy.stats`, without the time that takes to import. Errors of a
track that no repetition shows, by the pixel, the stripes, the lamp, each state what they were seen on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.units import for_people, shown_in

NORMAL = 1.959964  #: Half width of a 95 % interval over its standard deviation, of a normal distribution.


class Mean(NamedTuple):
    """Mean of a few trials with its confidence interval."""

    value: float  #: Arithmetic mean; NaN without trials.
    half_width: float  #: Half width of the interval; NaN with fewer than two trials and no error of their own.
    trials: int  #: Number of trials.


def student_t_quantile(share: float, free: float) -> float:
    """What Student's t with `free` degrees of freedom is below with a probability of `share`."""
    from scipy.special import stdtrit

    return float(stdtrit(free, share))


def student_t(at: Samples, free: float) -> Samples:
    """Probability that Student's t with `free` degrees of freedom is below some values."""
    from scipy.special import stdtr

    return np.asarray(stdtr(free, at))


def mean_with_interval(values: Sequence[float], level: float = 0.95, within: Sequence[float] = ()) -> Mean:
    """Mean of independent trials and its interval: Student's t of their scatter, at least what their own errors leave.

    Two trials often agree by chance, which makes none of them more accurate: as with Birge's ratio (Phys. Rev. 40, 207,
    1932), scatter widens the interval that the trials' own errors give, and never narrows it.

    Args:
        values: a value of each trial, (n,); NaN where it was not measured.
        level: confidence level.
        within: half width of each trial's own interval at that level, (n,), by errors that are independent between
            trials; NaN where unknown: it then is the root mean square of the others', for all were measured alike, and
            a trial without an error would narrow the mean.
    """
    measured = np.asarray(values, dtype=float)
    known = ~np.isnan(measured)
    own = np.asarray(within, dtype=float)[known] if len(within) else np.empty(0)
    own = own[~np.isnan(own)]
    error = float(np.sqrt(np.mean(own**2))) if own.size else math.nan
    measured = measured[known]
    count = measured.size
    if count == 0:
        return Mean(float("nan"), float("nan"), 0)
    if count == 1:
        return Mean(float(measured[0]), error, 1)
    spread = float(measured.std(ddof=1)) / np.sqrt(count)
    reach = student_t_quantile(0.5 + 0.5 * level, count - 1) * spread
    return Mean(float(measured.mean()), float(np.fmax(reach, error / np.sqrt(count))), count)


PIXEL_ERROR = 0.03  #: Least expected amplitude of periodic errors of the position, by angles or the pixel grid, pixels.
AMPLITUDE_ERROR = 0.12
"""Relative standard error of a lateral amplitude: static edges of the glass beside the body bias it towards zero.

On rendered videos from the side, with the body within a few pixels of the tube's edge, the bias was 12 to 20 %."""
STRIPE_ERROR = math.radians(0.2)  #: Least expected amplitude of the body's angle errors that repeat with stripes, rad.
PHASE_ERROR = math.radians(1.0)  #: Least expected amplitude of the phase's errors that repeat once or twice a turn, rad
DRIFT_PIXELS = 0.01  #: Drift of the position error from end to end, by light and perspective, pixels.
DRIFT_BARE = 0.1  #: Drift of the position error of a body without stripes, pixels; up to 0.12 on rendered videos.
DRIFT_ANGLE = math.radians(0.1)
"""Least drift of the error of an angle, rad; the standard error of a frame if larger, as highlights move slowly."""
POSITION_ERROR = 0.25
"""Systematic standard error of an absolute position, pixels: of outline, light and lens; it cancels in a velocity."""
HEADING_ERROR = math.radians(0.2)  #: Systematic standard error of the heading of a body that is `LONG` pixels long, rad
LONG = 100.0  #: Length of a body whose heading has that error, pixels.


_MOST_DIGITS = 7  # digits of a value at most, however narrow its interval is
_MOST_DECIMALS = 9


class ShownNumber(NamedTuple):
    """A number with its interval as texts; ``-`` for what is not there."""

    value: str  #: The value.
    low: str  #: Lower end of its interval.
    high: str  #: Upper end.
    unit: str  #: Unit of all three; empty where there is no value.


def rounded_with_ends(value: float | None, low: float | None, high: float | None, unit: str) -> ShownNumber:
    """A number, SI, down to the second digit of its interval's half width, or in four digits, and the ends likewise."""
    if value is None or not math.isfinite(value):
        return ShownNumber("-", "-", "-", "")
    read = for_people(unit)
    number = shown_in(value, read)
    if low is None or high is None or not math.isfinite(low):
        return ShownNumber(f"{number:.4g}", "-", "-", read)
    ends = [shown_in(low, read), shown_in(high, read)]
    decimals = _decimals(number, 0.5 * (ends[1] - ends[0]))
    texts = [f"{round(item, decimals) + 0.0:.{decimals}f}" for item in (number, *ends)]  # + 0.0: no minus zero
    return ShownNumber(texts[0], texts[1], texts[2], read)


def measured_rows(answer: Mapping[str, Any], names: Iterable[str]) -> list[dict[str, str]]:
    """Rows of an answer's measured quantities for people: name, value, low, high, unit, trials, reason."""
    return [
        {
            "name": name.replace("_", " "),
            **rounded_with_ends(item["value"], item.get("low"), item.get("high"), item["unit"])._asdict(),
            "trials": str(item.get("n", "")),
            "reason": item.get("reason", ""),
        }
        for name, item in ((name, answer[name]) for name in names)
    ]


def _decimals(value: float, half_width: float) -> int:
    """Decimals down to the second digit of a half width."""
    wanted = 1 - math.floor(math.log10(half_width)) if half_width > 0 else _MOST_DECIMALS
    most = _MOST_DIGITS - 1 - math.floor(math.log10(abs(value))) if value else _MOST_DECIMALS
    return max(min(wanted, most, _MOST_DECIMALS), 0)
