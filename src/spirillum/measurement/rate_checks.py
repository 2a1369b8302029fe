"""Plausibility of the rows of an observations file together: a single row is noisy, a convention is shared."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.notes import Note
from spirillum.robust import mad_scale
from spirillum.units import Hz

_TYPICAL = 0.03  # typical error of a motor's rate against tail less body rate where no row states one, relative
_ASSUMED_WIDTH, _STATED_WIDTH = 1.0, 0.5
"""Standard deviation of the logarithm of the true error over the typical one, and over the stated one."""
_GAIN = 0.01  # standard deviation of an error that all motor rates of a file share, as of two clocks, relative
_DECISIVE = 1e3  # likelihood ratio from which on the convention of a file is wrong
_DOUBTFUL = 10.0  # likelihood ratio from which on the convention is doubted
_BEYOND = 6.0  # standard errors beyond which a single value is not noise
_PRIOR_ERROR, _PRIOR_ROWS = 0.07, 4
"""Error that a row is taken to have before the scatter of the file is known, relative, and its weight in rows."""
_AGREE, _CONTRADICT = 0.2, 0.8
"""Relative differences of a motor's rate from tail less body rate that are always allowed, and never."""
_MOST_NAMED = 6


class RateTriples(NamedTuple):
    """Rows of a file that hold all three rates, rad/s, each (n,)."""

    rows: Sequence[int]  #: Line numbers.
    tail: Samples
    body: Samples
    motor: Samples
    error: Samples  #: Stated standard error of motor less tail plus body rate; NaN where none is stated.


def rows_in_words(rows: Iterable[int]) -> str:
    """Rows as a sentence names them, such as ``row 3`` or ``rows 2 to 9, 12``."""
    numbers = sorted(set(rows))
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    parts = [part for run in runs for part in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else map(str, run))]
    more = f" and {len(parts) - _MOST_NAMED} more" if len(parts) > _MOST_NAMED else ""
    return f"{'row' if len(numbers) == 1 else 'rows'} {', '.join(parts[:_MOST_NAMED])}{more}"


def check_motor_rates(path: str | Path, rates: RateTriples) -> None:
    """Refuse motor rates that are tail plus body rate throughout, or that contradict tail less body rate."""
    if not rates.rows:
        return
    if convention_evidence(rates) > math.log(_DECISIVE):
        difference = (rates.tail[0] - rates.body[0]) / Hz
        raise InputError(
            f"{path}, {rows_in_words(rates.rows)}, column motor_rate_Hz: {rates.motor[0] / Hz:.4g} is tail plus body "
            f"rate{first_of(rates.rows)}; allowed: tail less body rate, {difference:.4g}, for all rates are signed "
            "about the same axis"
        )
    _check_contradictions(path, rates)


def convention_doubt(rates: RateTriples) -> tuple[Note, ...]:
    """A note where motor rates fit tail plus body rate better than tail less body rate, but not decisively."""
    if not rates.rows or not math.log(_DOUBTFUL) < convention_evidence(rates) <= math.log(_DECISIVE):
        return ()
    words = (
        f"{rows_in_words(rates.rows)}: motor_rate_Hz is nearer to tail plus body rate than to tail less body rate; "
        "check the signs of all rates"
    )
    return (Note("units-doubtful", words, ("motor_rate_Hz", "body_rate_Hz")),)


def convention_evidence(rates: RateTriples) -> float:
    """Logarithm of the likelihood ratio of tail plus body rate to tail less body rate as the motor's."""
    # Errors are normal, relative to the motor's rate. Their standard deviation is the stated one, or `_TYPICAL`, times
    # a factor common to all rows, with a log-normal prior; a small error of gain is common to all rows, too.
    size = 0.5 * (np.abs(rates.motor) + np.abs(rates.tail))
    stated = rates.error / size
    known = np.isfinite(stated) & (stated > 0)
    spread = np.where(known, stated, _TYPICAL)
    width = _STATED_WIDTH if known.all() else _ASSUMED_WIDTH
    plus, less = ((rates.motor - rates.tail + sign * rates.body) / size for sign in (-1.0, 1.0))
    return _log_likelihood(plus, spread, width) - _log_likelihood(less, spread, width)


def _log_likelihood(residuals: Samples, spread: Samples, width: float) -> float:
    """Marginal log-likelihood of relative residuals, (n,), over the factor of their spread and the common gain."""
    exponents = width * np.linspace(-4.0, 4.0, 81)
    shrink = np.exp(-2.0 * exponents)
    weights = 1.0 / spread**2
    total, first, second = (float(weights @ residuals**power) for power in range(3))
    squares = shrink * second - np.square(_GAIN * shrink * first) / (1.0 + _GAIN**2 * shrink * total)
    determinants = 2.0 * residuals.size * exponents + np.log1p(_GAIN**2 * shrink * total)
    return float(np.logaddexp.reduce(-0.5 * (np.square(exponents / width) + squares + determinants)))


def _check_contradictions(path: str | Path, rates: RateTriples) -> None:
    difference = rates.tail - rates.body
    size = np.maximum(np.abs(rates.motor), np.abs(difference))
    off = (rates.motor - difference) / size
    scatter = float(mad_scale(off - np.median(off)))
    scatter = math.sqrt((_PRIOR_ROWS * _PRIOR_ERROR**2 + off.size * scatter**2) / (_PRIOR_ROWS + off.size))
    allowed = np.clip(_BEYOND * np.fmax(scatter, rates.error / size), _AGREE, _CONTRADICT)
    wrong = np.flatnonzero(np.abs(off) > allowed)
    if wrong.size:
        rows, first = [rates.rows[place] for place in wrong.tolist()], int(wrong[0])
        raise InputError(
            f"{path}, {rows_in_words(rows)}, column motor_rate_Hz: {rates.motor[first] / Hz:.4g}, but tail less body "
            f"rate is {difference[first] / Hz:.4g}{first_of(rows)}; allowed: equal within {100 * allowed[first]:.0f} %"
        )


def wrong_signs(values: Samples, expected: float, stated: Samples, groups: Sequence[Hashable]) -> np.ndarray:
    """Indices of values whose sign differs from the expected one by more than their error."""
    # The error is the stated one, or the scatter of magnitudes within groups; a value without either is exact.
    opposite = np.sign(values) * expected < 0
    error = np.where(np.isfinite(stated), stated, _scatter_of_magnitudes(values, groups))
    return np.flatnonzero(opposite & ~(np.abs(values) <= _BEYOND * error))


def _scatter_of_magnitudes(values: Samples, groups: Sequence[Hashable]) -> float:
    """Robust standard deviation about the group's median, pooled over groups of several; NaN without any."""
    members: dict[Hashable, list[float]] = {}
    for value, group in zip(np.abs(values).tolist(), groups, strict=True):
        if math.isfinite(value):
            members.setdefault(group, []).append(value)
    off = [np.array(own) - np.median(own) for own in members.values() if len(own) > 1]
    if not off:
        return math.nan
    count = sum(own.size for own in off)
    return float(mad_scale(np.concatenate(off))) * math.sqrt(count / (count - len(off)))


def first_of(rows: Sequence[int]) -> str:
    """Words on which of several rows a sentence gives the numbers of."""
    return f" in row {rows[0]}" if len(rows) > 1 else ""
