"""The rate of a noisy series over true times, with an interval that allows for autocorrelated errors.

A straight line is fitted by generalised least squares. Its errors are three: white noise of each frame; a part with a
memory (Ornstein and Uhlenbeck's, in discrete time an autoregression of first order) of unknown share and unknown time;
and errors that come back with an angle, such as those of reading a stripe that moves under the glare. Share and time
are not estimated and then believed: the interval is averaged over all of them, each weighted by its restricted
likelihood (Harville 1974), so that a short stretch with a long memory gives a wide interval.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.measurement.outliers import outlying_frames
from spirillum.measurement.statistics import student_t, student_t_quantile

__all__ = ["Cycle", "Rate", "mean_of", "rate_of"]

_MOST_BLOCKS = 100
"""Frames are averaged to so many blocks: the slope lives in the slow part, and the work grows with the third power."""
_SHARES = (0.03, 0.1, 0.25, 0.5, 0.75, 0.9, 0.97, 0.995)
_MEMORIES = 8
_SIZES = (0.25, 1.0)
"""Variances of errors that come back with an angle, over what is usual: the series says which of them is likely."""
_WHITE = 3.0
"""Odds, before anything is seen, of errors without a memory against all others."""
_FEWEST = 8
"""With fewer frames nothing can be said about memory: their errors are taken as independent."""
_UNSTEADY_P = 1e-5
_LARGEST_RATIO = 1e6
"""Variance of what returns over that of noise: beyond it nothing changes but rounding."""
_UNSTEADY_SHARE = 0.1
_ENDS = 5
"""Readings of which an end consists."""
_ROUNDING = 1e-12
"""Range of a series over its values that is rounding: what rests is steady."""


@dataclass(frozen=True)
class Cycle:
    """An error that comes back with an angle."""

    angle: Samples = field(repr=False)
    """The angle on every frame, rad, (n,): the error is the same one turn of it later; NaN where unknown."""
    amplitude: float
    """How large such errors usually are, in the unit of the series; what the series shows beyond it counts too."""


@dataclass(frozen=True)
class Rate:
    """The mean rate of a series over a stretch, in the unit of the series per second."""

    value: float
    """Mean rate; NaN where it cannot be told."""
    low: float
    """Lower end of the 95 % interval; NaN where there are too few frames for one."""
    high: float
    """Upper end."""
    frames: int
    """Frames that were used."""
    outliers: int
    """Frames that were left out because they lie far from their neighbours."""
    steady: bool
    """Whether the rate is the same all along, as far as can be seen."""
    memory: float
    """Correlation time of the errors, s: the likeliest one; 0 for white noise."""
    residual: Samples = field(repr=False, default_factory=lambda: np.zeros(0))
    """The series less the fitted line, (n,); NaN where it was not measured or left out."""

    @property
    def measured(self) -> bool:
        """Whether there is a value."""
        return bool(np.isfinite(self.value))


_NOTHING = Rate(np.nan, np.nan, np.nan, 0, 0, steady=True, memory=0.0)
"""A rate of a series without two frames."""


def rate_of(
    time: Samples,
    values: Samples,
    error: Samples | None = None,
    cycles: Sequence[Cycle] = (),
    level: float = 0.95,
    *,
    read: np.ndarray | None = None,
    bent: bool = False,
) -> Rate:
    """Mean rate of a series and its interval.

    Args:
        time: true times, s, (n,), increasing; gaps are welcome.
        values: the series, unwrapped where it is an angle, (n,); NaN where it was not measured.
        error: standard error of each frame, (n,); only their ratios are used.
        cycles: errors that come back with an angle.
        level: confidence level.
        read: frames that were read by hand, truth values, (n,): they are left out only beyond six of their own errors,
            which also widen the interval of a few readings that agree by chance.
        bent: whether it is known that the rate changes.

    Returns:
        The slope; where the rate is seen to change, the mean from end to end.
    """
    known = np.isfinite(values) & np.isfinite(time)
    outlier = outlying_frames(time, values, None if read is None or error is None else np.where(read, error, np.nan))
    used = known & ~outlier
    count = int(used.sum())
    if count < 2 or np.ptp(time[used]) <= 0:
        return replace(_NOTHING, frames=count)
    weights = _weights(error, used)
    t, y = time[used], values[used]
    middle, half = 0.5 * float(t[0] + t[-1]), 0.5 * float(t[-1] - t[0])
    s = (t - middle) / half
    if count < _FEWEST:
        by_eye = error is not None and read is not None and read[used].all() and np.isfinite(error[used]).all()
        eye = error[used] if error is not None and by_eye else None
        value, low, high = _few(s, y, weights, level, eye)
        found = (value / half, low / half, high / half)
        line = np.polynomial.polynomial.polyfit(s, y, 1)
        residual = _residual(values, used, y - line[0] - line[1] * s)
        return Rate(*found, count, int(outlier.sum()), steady=True, memory=0.0, residual=residual)
    angles = [(np.where(np.isfinite(c.angle), c.angle, 0.0)[used], c.amplitude) for c in cycles]
    blocks = _Blocks.of(s, y, weights, angles)
    bend = bent or _bend(blocks)
    columns = 4 if bend else 2
    # From end to end, (p(1) - p(-1))/2: Legendre polynomials of odd degree count.
    fitted = _averaged(blocks, columns, level, np.array([0.0, 1.0, 0.0, 1.0])[:columns])
    line = np.polynomial.legendre.legval(s, fitted.line)
    residual = _residual(values, used, y - line)
    low, high = fitted.low, fitted.high
    if bend:  # what a cubic misses of a start or a stop
        off = abs(_from_end_to_end(s, y) - fitted.value)
        low, high = fitted.value - np.hypot(fitted.value - low, off), fitted.value + np.hypot(high - fitted.value, off)
    return Rate(
        fitted.value / half,
        float(low) / half,
        float(high) / half,
        count,
        int(outlier.sum()),
        not bend,
        fitted.memory * half,
        residual,
    )


def mean_of(time: Samples, values: Samples, level: float = 0.95) -> tuple[float, float, float]:
    """Mean of a series over a stretch, with its interval; the same errors as for a rate.

    Args:
        time: true times, s, (n,).
        values: the series, (n,); NaN where it was not measured.
        level: confidence level.
    """
    used = np.isfinite(values) & np.isfinite(time) & ~outlying_frames(time, values)
    if used.sum() < _FEWEST or np.ptp(time[used]) <= 0:
        return float(values[used].mean()) if used.any() else np.nan, np.nan, np.nan
    t = time[used]
    s = (t - 0.5 * (t[0] + t[-1])) / (0.5 * (t[-1] - t[0]))
    fitted = _averaged(_Blocks.of(s, values[used], np.ones(t.size), []), 2, level, np.array([1.0, 0.0]))
    return fitted.value, fitted.low, fitted.high


def _residual(values: Samples, used: np.ndarray, inside: Samples) -> Samples:
    residual = np.full(values.shape, np.nan)
    residual[used] = inside
    return residual


def _weights(error: Samples | None, used: np.ndarray) -> Samples:
    """Weights of the frames: an error that is claimed to be tiny or huge is not believed beyond a factor of three."""
    if error is None:
        return np.ones(int(used.sum()))
    here = np.where(np.isfinite(error) & (error > 0), error, np.nan)[used]
    usual = np.nanmedian(here) if np.isfinite(here).any() else 1.0
    ratio = np.where(np.isfinite(here), here / usual, 3.0)
    return np.asarray(1.0 / np.clip(ratio, 1.0 / 3.0, 3.0) ** 2)


def _from_end_to_end(s: Samples, y: Samples) -> float:
    """Slope from the first few readings to the last few."""
    ends = slice(None, _ENDS), slice(-_ENDS, None)
    first, last = (np.array([s[end].mean(), y[end].mean()]) for end in ends)
    return float((last[1] - first[1]) / (last[0] - first[0]))


def _few(s: Samples, y: Samples, weights: Samples, level: float, eye: Samples | None) -> tuple[float, float, float]:
    """Slope of a handful of readings with independent errors.

    Three readings may lie on a line by chance: where an eye's errors are known, they count as one more residual.
    """
    design = np.stack([np.ones_like(s), s], axis=1) * np.sqrt(weights)[:, None]
    inverse = np.linalg.inv(design.T @ design)
    beta = inverse @ design.T @ (y * np.sqrt(weights))
    free = s.size - 2
    if free == 0:
        return float(beta[1]), np.nan, np.nan
    squares = float(np.sum((y * np.sqrt(weights) - design @ beta) ** 2))
    if eye is not None:
        squares, free = squares + float(np.mean(weights * eye**2)), free + 1
    reach = float(student_t_quantile(0.5 + 0.5 * level, free) * np.sqrt(squares / free * inverse[1, 1]))
    return float(beta[1]), float(beta[1] - reach), float(beta[1] + reach)


@dataclass(frozen=True)
class _Blocks:
    """Averages over neighbouring frames."""

    s: Samples
    """Time from -1 to 1."""
    y: Samples
    design: Samples
    """Legendre polynomials of degree 0 to 3, (m, 4)."""
    white: Samples
    """Variance of white noise, 1 in the mean."""
    returning: Samples
    """Covariance of errors that come back with an angle, in units of `variance`, (m, m)."""
    variance: float
    """Variance of what is left of a line and all that returns."""

    @classmethod
    def of(cls, s: Samples, y: Samples, weights: Samples, angles: list[tuple[Samples, float]]) -> _Blocks:
        """Average frames to blocks of about the same number of frames, none across a wide gap."""
        label = _labels(s)
        count = int(label[-1]) + 1
        total: Samples = np.bincount(label, weights, count).astype(np.float64)

        def mean(values: Samples) -> Samples:
            return np.asarray(np.bincount(label, weights * values, count) / total)

        place = mean(s)
        height = mean(y)
        design = np.stack([mean(column) for column in np.polynomial.legendre.legvander(s, 3).T], axis=1)
        waves = [np.stack([mean(np.cos(angle)), mean(np.sin(angle))], axis=1) for angle, _ in angles]
        coefficients, left = _first_fit(design[:, :2], waves, total, height)
        variance = max(left, 1e-18 * float(np.mean(height**2)), 1e-300)
        largest = 2.0 * float(np.std(height - design[:, :2] @ np.linalg.lstsq(design[:, :2], height, rcond=None)[0]))
        returning = np.zeros((count, count))
        for wave, (angle, usual), pair in zip(waves, angles, coefficients, strict=True):
            seen = min(float(np.hypot(*pair)), largest) if np.ptp(angle) > 3.0 * np.pi else 0.0
            returning += min((usual**2 + seen**2) / variance, _LARGEST_RATIO) * wave @ wave.T
        return cls(place, height, design, np.mean(total) / total, returning, variance)


def _labels(s: Samples) -> np.ndarray:
    """Number of the block of each frame."""
    if s.size <= _MOST_BLOCKS:
        return np.arange(s.size)
    edges = np.floor(np.arange(s.size) * (_MOST_BLOCKS / s.size)).astype(np.int64)
    gap = np.concatenate([[False], np.diff(s) > 4.0 / _MOST_BLOCKS])
    return np.cumsum(np.concatenate([[0], np.diff(edges)]) + gap > 0) - int(gap[0])


def _first_fit(line: Samples, waves: list[Samples], total: Samples, height: Samples) -> tuple[list[Samples], float]:
    """Ordinary least squares with everything: amplitudes of what returns, and the variance of what is left."""
    root = np.sqrt(total / total.mean())
    design = np.concatenate([line, *waves], axis=1) * root[:, None]
    beta = np.linalg.lstsq(design, height * root, rcond=1e-8)[0]
    free = max(height.size - design.shape[1], 1)
    left = float(np.sum((height * root - design @ beta) ** 2)) / free
    return [beta[2 + 2 * i : 4 + 2 * i] for i in range(len(waves))], left


@dataclass(frozen=True)
class _Fit:
    value: float
    low: float
    high: float
    line: Samples
    memory: float


class _Noise(NamedTuple):
    """A noise to be tried."""

    share: float
    """Share of the part with a memory."""
    memory: float
    """Its time, in half stretches."""
    alike: Samples
    """Correlation of that part, (m, m)."""
    size: float
    """Variance of what comes back with an angle over what is usual."""


def _noises(
    blocks: _Blocks, shares: Sequence[float], memories: Samples, sizes: Sequence[float] = (1.0,)
) -> list[_Noise]:
    """All shares and memories, and white noise, for all sizes of what comes back; one if nothing does."""
    apart = np.abs(blocks.s[:, None] - blocks.s[None, :])
    alike = [np.exp(-apart / memory) for memory in memories]
    parts = [(share, float(m), a) for share in shares for m, a in zip(memories, alike, strict=True)]
    parts.append((0.0, 0.0, np.zeros_like(apart)))
    return [_Noise(*part, size) for size in (sizes if blocks.returning.any() else (1.0,)) for part in parts]


class _Solved(NamedTuple):
    """Generalised least squares with one noise."""

    likelihood: float
    """Restricted log likelihood."""
    fit: float
    """Log likelihood, by which different columns may be compared."""
    beta: Samples
    """Coefficients."""
    covariance: Samples
    """Their covariance."""


def _solved(blocks: _Blocks, columns: int, noise: _Noise) -> _Solved:
    """Generalised least squares with one noise."""
    from scipy.linalg.lapack import dpotrf, dpotrs

    covariance = noise.share * noise.alike + noise.size * blocks.returning
    covariance.flat[:: blocks.s.size + 1] += (1.0 - noise.share) * blocks.white + 1e-7
    factor, failed = dpotrf(covariance, lower=1, overwrite_a=1)
    if failed:  # by rounding, where the series has next to no noise
        return _Solved(-np.inf, -np.inf, np.zeros(columns), np.eye(columns))
    design = blocks.design[:, :columns]
    both, _ = dpotrs(factor, np.concatenate([design, blocks.y[:, None]], axis=1), lower=1)
    normal = design.T @ both[:, :columns]
    inverse = np.linalg.inv(normal)
    beta = inverse @ (design.T @ both[:, columns])
    free = blocks.s.size - columns
    misfit = float((blocks.y - design @ beta) @ (both[:, columns] - both[:, :columns] @ beta))
    misfit = max(misfit, 1e-300)
    half_log = float(np.sum(np.log(np.diag(factor))))
    likelihood = -half_log + 0.5 * float(np.linalg.slogdet(inverse)[1]) - 0.5 * free * np.log(misfit)
    fit = -half_log - 0.5 * blocks.s.size * np.log(misfit)
    return _Solved(likelihood, fit, beta, inverse * (misfit / free))


def _averaged(blocks: _Blocks, columns: int, level: float, along: Samples) -> _Fit:
    """A combination of the coefficients, averaged over all noises."""
    from scipy.optimize import brentq

    noises = _noises(blocks, _SHARES, np.geomspace(2.0 / blocks.s.size, 2.0, _MEMORIES), _SIZES)
    solved = [_solved(blocks, columns, noise) for noise in noises]
    likelihoods = np.array([item.likelihood for item in solved])
    likelihoods[[noise.share == 0.0 for noise in noises]] += np.log(_WHITE * len(_SHARES) * _MEMORIES)
    weights = np.exp(likelihoods - likelihoods.max())
    weights /= weights.sum()
    centres = np.array([along @ item.beta for item in solved])
    widths = np.sqrt(np.array([along @ item.covariance @ along for item in solved]))
    free = blocks.s.size - columns
    value = float(weights @ centres)
    reach = float(np.max(np.abs(centres - value) + 60.0 * widths)) or 1e-300

    def quantile(share: float) -> float:
        def excess(at: float) -> float:
            return float(weights @ student_t((at - centres) / np.maximum(widths, 1e-300), free)) - share

        return float(brentq(excess, value - reach, value + reach, xtol=1e-6 * reach))

    line = np.sum(weights[:, None] * np.array([item.beta for item in solved]), axis=0)
    best = noises[int(np.argmax(weights))]
    tail = 0.5 * (1.0 - level)
    return _Fit(value, quantile(tail), quantile(1.0 - tail), line, best.memory)


def _bend(blocks: _Blocks) -> bool:
    """Whether the rate changes along the stretch, beyond doubt and by more than a tenth.

    A bent line has to explain the series far better than a straight one with errors of whatever memory (likelihood
    ratio of both at their best noise).
    """
    count = blocks.s.size
    if count < 24 or np.ptp(blocks.y) <= _ROUNDING * np.abs(blocks.y).max():
        return False
    noises = _noises(blocks, _SHARES[1::2], np.geomspace(2.0 / count, 2.0, 5))
    straight, bent = ([_solved(blocks, columns, noise) for noise in noises] for columns in (2, 4))
    gain = 2.0 * (max(item.fit for item in bent) - max(item.fit for item in straight))
    if gain < -2.0 * math.log(_UNSTEADY_P):  # chi-squared with two degrees of freedom: exp(-gain/2)
        return False
    beta = max(bent, key=lambda item: item.fit).beta
    slope = np.polynomial.legendre.legval(np.linspace(-1, 1, 41), np.polynomial.legendre.legder(beta))
    return bool(np.ptp(slope) > _UNSTEADY_SHARE * abs(beta[1] + beta[3]))
