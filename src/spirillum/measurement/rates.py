"""The rate of a noisy series over true times, with an interval that allows for autocorrelated errors.

A straight line is fitted by generalised least squares. The noise model has three parts: white noise; an
Ornstein-Uhlenbeck process (a first-order autoregression in discrete time) of unknown variance share and correlation
time; and periodic errors of an angle, such as the error of reading a stripe that passes under a highlight. Share and
correlation time are marginalised on a grid, each node weighted by its restricted likelihood (Harville 1974), so that a
short series with a long correlation time gets a wide interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.measurement.outliers import outlying_frames
from spirillum.measurement.statistics import student_t, student_t_quantile

_MOST_BLOCKS = 100
"""Most blocks into which frames are averaged: a slope is a low-frequency quantity; the cost is cubic in blocks."""
_SHARES = (0.03, 0.1, 0.25, 0.5, 0.75, 0.9, 0.97, 0.995)  # variance shares of the correlated part on the grid
_TIMES = 8  # correlation times on the grid
_SIZES = (0.25, 1.0)  # variances of periodic errors on the grid, over the expected ones; weighted by likelihood
_FEWEST_BLOCKS = 24  # fewest blocks from which a change of the rate is detected
_WHITE = 3.0  # prior odds of white noise against all correlated noises
_FEWEST = 8  # fewest frames from which autocorrelation is estimated; errors of fewer frames are taken as independent
_UNSTEADY_P = 1e-3  # p-value of a curvature below which a rate is taken to change, two-sided
_LARGEST_RATIO = 1e6
"""Largest variance of a periodic error over that of the noise; larger ones only add rounding errors."""
_UNSTEADY_SHARE = 0.1  # relative change of a rate below which it counts as steady
_END_TO_END = np.array([0.0, 1.0, 0.0, 1.0])
"""The mean rate (p(1) - p(-1))/2 of a series of Legendre polynomials, to which those of odd degree contribute."""
_ENDS = 5  # readings averaged at each end of a series
_OF_STATED = 0.5
"""Least standard deviation, over the stated standard error of a frame, by six of which an outlier is off: frames that
happen to lie on a line make no strays of others that are off by their own error."""
_ROUNDING = 1e-12  # relative range of a series below which its variation is rounding error: it counts as steady


@dataclass(frozen=True)
class PeriodicError:
    """A systematic error that repeats with every turn of an angle."""

    angle: Samples = field(repr=False)
    """The angle on every frame, rad, (n,); the error has the period 2 pi in it; NaN where unknown."""
    amplitude: float  #: Expected amplitude, in the unit of the series; a larger one seen in the series is added.


@dataclass(frozen=True)
class Rate:
    """The mean rate of a series, in its unit per second."""

    value: float  #: Mean rate; NaN with fewer than two frames.
    low: float  #: Lower end of the confidence interval; NaN with two frames.
    high: float  #: Upper end of the confidence interval.
    frames: int  #: Frames that were used.
    outliers: int  #: Outliers, which were left out.
    steady: bool  #: Whether no significant change of the rate was detected.
    correlation_time: float  #: Most likely correlation time of the errors, s; 0 for white noise.
    residual: Samples = field(repr=False, default_factory=lambda: np.zeros(0))
    """Residuals of the fit, (n,); NaN where not measured or an outlier."""
    thirds: tuple[float, ...] = ()
    """Mean rate over each third of the time, NaN where nothing was measured; empty where the rate is steady."""

    @property
    def measured(self) -> bool:
        """Whether there is a value."""
        return bool(np.isfinite(self.value))

    def less(self, other: Rate) -> Rate:
        """The rate of the difference of two series over the same times, both steady."""
        # Errors of the two are independent but for what their residuals show: where one runs ahead while the other lags
        # behind, the interval is wider.
        left = self.residual - other.residual if self.measured and other.measured else np.zeros(0)
        both = np.isfinite(left)
        if (count := int(both.sum())) < 2:
            return replace(_NOTHING, frames=count)
        own, theirs = self.residual[both], other.residual[both]
        opposite = -float(own @ theirs) / max(float(np.sqrt((own @ own) * (theirs @ theirs))), 1e-300)

        def reach(one: float, another: float) -> float:
            return float(np.sqrt(one**2 + another**2 + 2.0 * max(opposite, 0.0) * one * another))

        value, outliers = self.value - other.value, max(self.outliers, other.outliers)
        low = value - reach(self.value - self.low, other.high - other.value)
        high = value + reach(self.high - self.value, other.value - other.low)
        time = max(self.correlation_time, other.correlation_time)
        return Rate(value, low, high, count, outliers, steady=True, correlation_time=time, residual=left)


_NOTHING = Rate(np.nan, np.nan, np.nan, 0, 0, steady=True, correlation_time=0.0)
"""The rate of a series of fewer than two frames."""


def rate_of(
    time: Samples,
    values: Samples,
    error: Samples | None = None,
    periodic: Sequence[PeriodicError] = (),
    level: float = 0.95,
    *,
    read: np.ndarray | None = None,
    unsteady: bool = False,
) -> Rate:
    """Mean rate of a series and its confidence interval.

    Args:
        time: times, s, (n,), increasing; gaps are allowed.
        values: the series, unwrapped where it is an angle, (n,); NaN where it was not measured.
        error: standard error of each frame, (n,); a frame is an outlier only beyond three of its own. Else only their
            ratios are used.
        periodic: periodic errors.
        level: confidence level.
        read: mask of the frames read by hand, (n,). They are outliers only beyond six of their own standard errors,
            which also enter the interval of a few readings that lie on a line by chance.
        unsteady: whether the rate is known to change.

    Returns:
        The slope; where the rate changes, the mean rate from end to end.
    """
    known = np.isfinite(values) & np.isfinite(time)
    own = None if error is None else np.where(False if read is None else read, 1.0, _OF_STATED) * error
    outlier = outlying_frames(time, values, own, straight=not unsteady)
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
        return Rate(*found, count, int(outlier.sum()), steady=True, correlation_time=0.0, residual=residual)
    angles = [(np.where(np.isfinite(c.angle), c.angle, 0.0)[used], c.amplitude) for c in periodic]
    blocks = _Blocks.of(s, y, weights, angles)
    straight, parabola, cubic = _fitted(blocks, (2, 3, 4))
    changes = unsteady or _rate_changes(blocks, (parabola, cubic))
    if changes and not unsteady and outlier.any():  # what lies far from a line may belong to a curve
        return rate_of(time, values, error, periodic, level, read=read, unsteady=True)
    fitted = cubic if changes else straight
    value, low, high = fitted.interval(_END_TO_END, level)
    left = np.asarray(y - np.polynomial.legendre.legval(s, fitted.mean))
    residual = _residual(values, used, left - left.mean())  # errors that wander leave the line's height open
    if changes:  # lack of fit of a cubic at a start or a stop, whose frames may have been taken for outliers
        off = abs(_from_end_to_end((time[known] - middle) / half, values[known]) - value)
        low, high = value - float(np.hypot(value - low, off)), value + float(np.hypot(high - value, off))
    return Rate(
        value / half,
        low / half,
        high / half,
        count,
        int(outlier.sum()),
        not changes,
        fitted.correlation_time * half,
        residual,
        _in_thirds(t, y) if changes else (),
    )


def mean_of(time: Samples, values: Samples) -> tuple[float, float, float]:
    """Mean of a series and its 95 % interval, with the noise model of `rate_of` without periodic errors."""
    used = np.isfinite(values) & np.isfinite(time) & ~outlying_frames(time, values)
    if used.sum() < _FEWEST or np.ptp(time[used]) <= 0:
        return float(values[used].mean()) if used.any() else np.nan, np.nan, np.nan
    t = time[used]
    s = (t - 0.5 * (t[0] + t[-1])) / (0.5 * (t[-1] - t[0]))
    [line] = _fitted(_Blocks.of(s, values[used], np.ones(t.size), []), (2,))
    return line.interval(np.array([1.0, 0.0]), 0.95)


def _residual(values: Samples, used: np.ndarray, inside: Samples) -> Samples:
    residual = np.full(values.shape, np.nan)
    residual[used] = inside
    return residual


def _weights(error: Samples | None, used: np.ndarray) -> Samples:
    """Inverse variances of the frames; standard errors are clipped to a factor of three about their median."""
    if error is None:
        return np.ones(int(used.sum()))
    here = np.where(np.isfinite(error) & (error > 0), error, np.nan)[used]
    usual = np.nanmedian(here) if np.isfinite(here).any() else 1.0
    ratio = np.where(np.isfinite(here), here / usual, 3.0)
    return np.asarray(1.0 / np.clip(ratio, 1.0 / 3.0, 3.0) ** 2)


def _in_thirds(time: Samples, values: Samples) -> tuple[float, ...]:
    """Mean slope over each third of the time, from its first few readings to its last few; NaN where there are few."""
    third = np.minimum((3.0 * (time - time[0]) / (time[-1] - time[0])).astype(int), 2)
    parts = [(time[third == k], values[third == k]) for k in range(3)]
    return tuple(_from_end_to_end(*part) if part[0].size > _ENDS else np.nan for part in parts)


def _from_end_to_end(s: Samples, y: Samples) -> float:
    """Slope from the median of the first few readings to that of the last few."""
    ends = slice(None, _ENDS), slice(-_ENDS, None)
    first, last = (np.array([np.median(s[end]), np.median(y[end])]) for end in ends)
    return float((last[1] - first[1]) / (last[0] - first[0]))


def _few(s: Samples, y: Samples, weights: Samples, level: float, eye: Samples | None) -> tuple[float, float, float]:
    """Slope of a few readings with independent errors, with its confidence interval."""
    # Three readings may lie on a line by chance: known standard errors of the readings add one degree of freedom.
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
    """Block averages of a series, and the noise model's fixed parts."""

    s: Samples  # time, scaled to -1 to 1, (m,)
    y: Samples
    design: Samples  # legendre polynomials of degree 0 to 3, (m, 4)
    white: Samples  # variance of white noise in each block, 1 in the mean, (m,)
    returning: Samples  # covariance of the periodic errors in units of `variance`, (m, m)
    variance: float  # residual variance of a straight line with all periodic errors

    @classmethod
    def of(cls, s: Samples, y: Samples, weights: Samples, angles: list[tuple[Samples, float]]) -> _Blocks:
        """Average frames into blocks of about equal numbers of frames; no block spans a wide gap."""
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
    """Index of the block of each frame."""
    if s.size <= _MOST_BLOCKS:
        return np.arange(s.size)
    edges = np.floor(np.arange(s.size) * (_MOST_BLOCKS / s.size)).astype(np.int64)
    gap = np.concatenate([[False], np.diff(s) > 4.0 / _MOST_BLOCKS])
    return np.cumsum(np.concatenate([[0], np.diff(edges)]) + gap > 0) - int(gap[0])


def _first_fit(line: Samples, waves: list[Samples], total: Samples, height: Samples) -> tuple[list[Samples], float]:
    """Ordinary least squares of a line and all periodic errors: their amplitudes and the residual variance."""
    root = np.sqrt(total / total.mean())
    design = np.concatenate([line, *waves], axis=1) * root[:, None]
    beta = np.linalg.lstsq(design, height * root, rcond=1e-8)[0]
    free = max(height.size - design.shape[1], 1)
    left = float(np.sum((height * root - design @ beta) ** 2)) / free
    return [beta[2 + 2 * i : 4 + 2 * i] for i in range(len(waves))], left


@dataclass(frozen=True)
class _Fit:
    """Coefficients of a polynomial, averaged over all noise models: a mixture of Student's t distributions."""

    weights: Samples  # probability of each noise model, (k,)
    betas: Samples  # coefficients for each noise model, (k, c)
    covariances: Samples  # their covariances, (k, c, c)
    free: int  # degrees of freedom
    correlation_time: float  # that of the most likely noise model, in half lengths of the series

    @property
    def mean(self) -> Samples:
        """Mean coefficients, (c,)."""
        return np.asarray(self.weights @ self.betas)

    def below(self, at: float, centres: Samples, widths: Samples) -> float:
        """Probability that a linear combination with these centres and widths is below a value."""
        return float(self.weights @ student_t((at - centres) / np.maximum(widths, 1e-300), self.free))

    def along(self, direction: Samples) -> tuple[Samples, Samples]:
        """Centres and standard errors of a linear combination of the coefficients for each noise model, (k,) each."""
        direction = direction[: self.betas.shape[1]]
        return self.betas @ direction, np.sqrt(np.einsum("i,kij,j->k", direction, self.covariances, direction))

    def interval(self, direction: Samples, level: float) -> tuple[float, float, float]:
        """Mean of a linear combination, and the ends of its confidence interval."""
        from scipy.optimize import brentq

        centres, widths = self.along(direction)
        value, tail = float(self.weights @ centres), 0.5 * (1.0 - level)
        reach = float(np.max(np.abs(centres - value) + 60.0 * widths)) or 1e-300
        low, high = (
            float(
                brentq(
                    lambda at, share=share: self.below(at, centres, widths) - share,
                    value - reach,
                    value + reach,
                    xtol=1e-6 * reach,
                )
            )
            for share in (tail, 1.0 - tail)
        )
        return value, low, high

    def p_value(self, coefficient: int) -> float:
        """Two-sided p-value of a coefficient against 0."""
        below = self.below(0.0, *self.along(np.eye(self.betas.shape[1])[coefficient]))
        return 2.0 * min(below, 1.0 - below)


class _Noise(NamedTuple):
    """A noise model on the grid."""

    share: float  # share of the correlated part in the variance
    time: float  # its correlation time, in half lengths of the series
    correlation: Samples  # its correlation matrix, (m, m)
    size: float  # variance of the periodic errors over the expected one


def _noises(blocks: _Blocks, shares: Sequence[float], times: Samples, sizes: Sequence[float] = (1.0,)) -> list[_Noise]:
    """The grid of noise models: shares by correlation times, and white noise; each with all `sizes`."""
    lag = np.abs(blocks.s[:, None] - blocks.s[None, :])
    correlations = [np.exp(-lag / time) for time in times]
    parts = [(share, float(m), a) for share in shares for m, a in zip(times, correlations, strict=True)]
    parts.append((0.0, 0.0, np.zeros_like(lag)))
    return [_Noise(*part, size) for size in (sizes if blocks.returning.any() else (1.0,)) for part in parts]


class _Solved(NamedTuple):
    """The generalised least squares estimates for all noise models."""

    likelihood: Samples  # restricted log likelihoods, (k,)
    beta: Samples  # coefficients, (k, c)
    covariance: Samples  # covariances of the coefficients, (k, c, c)


def _whitened(blocks: _Blocks, noise: _Noise, most: int) -> tuple[Samples, float] | None:
    """Design matrix and values divided by the covariance of a noise model, and half the logarithm of its determinant.

    None where it is singular by rounding, as the series is almost free of noise.
    """
    from scipy.linalg.lapack import dpotrf, dpotrs

    covariance = noise.share * noise.correlation + noise.size * blocks.returning
    covariance.flat[:: blocks.s.size + 1] += (1.0 - noise.share) * blocks.white + 1e-7
    factor, failed = dpotrf(covariance, lower=1, overwrite_a=1)
    if failed:
        return None
    both, _ = dpotrs(factor, np.concatenate([blocks.design[:, :most], blocks.y[:, None]], axis=1), lower=1)
    return both, float(np.sum(np.log(np.diag(factor))))


def _solved(blocks: _Blocks, numbers: Sequence[int], noises: Sequence[_Noise]) -> list[_Solved]:
    """Generalised least squares with all noise models, for several numbers of columns of the design matrix."""
    most = max(numbers)
    whitened = [_whitened(blocks, noise, most) for noise in noises]
    sound = np.array([one is not None for one in whitened])
    both = np.array([one[0] for one in whitened if one is not None]).reshape(-1, blocks.s.size, most + 1)
    half_log = np.array([one[1] for one in whitened if one is not None])
    found = []
    for columns in numbers:
        design, solved, values = blocks.design[:, :columns], both[:, :, :columns], both[:, :, most]
        inverse = np.linalg.inv(design.T @ solved)
        beta = np.einsum("kij,kj->ki", inverse, values @ design)
        free = blocks.s.size - columns
        left = values - np.einsum("kmc,kc->km", solved, beta)
        misfit = np.maximum(np.einsum("km,km->k", blocks.y - beta @ design.T, left), 1e-300)
        one = _Solved(
            np.full(sound.size, -np.inf), np.zeros((sound.size, columns)), np.tile(np.eye(columns), (sound.size, 1, 1))
        )
        one.likelihood[sound] = -half_log + 0.5 * np.linalg.slogdet(inverse)[1] - 0.5 * free * np.log(misfit)
        one.beta[sound], one.covariance[sound] = beta, inverse * (misfit / free)[:, None, None]
        found.append(one)
    return found


def _fitted(blocks: _Blocks, numbers: Sequence[int]) -> list[_Fit]:
    """Polynomials with several numbers of coefficients, averaged over the noise models by their likelihood."""
    noises = _noises(blocks, _SHARES, np.geomspace(2.0 / blocks.s.size, 2.0, _TIMES), _SIZES)
    white = np.log(_WHITE * len(_SHARES) * _TIMES) * np.array([noise.share == 0.0 for noise in noises])
    found = []
    for columns, solved in zip(numbers, _solved(blocks, numbers, noises), strict=True):
        likelihoods = solved.likelihood + white
        weights = np.exp(likelihoods - likelihoods.max())
        weights /= weights.sum()
        time = noises[int(np.argmax(weights))].time
        found.append(_Fit(weights, solved.beta, solved.covariance, blocks.s.size - columns, time))
    return found


def _rate_changes(blocks: _Blocks, curves: Sequence[_Fit]) -> bool:
    """Whether the rate changes significantly and by more than a tenth."""
    # The last coefficient of a parabola, which shows a steady change, or of a cubic is tested against 0. As its
    # standard error allows for autocorrelated noise of unknown correlation time, a series whose errors wander is no
    # change.
    if blocks.s.size < _FEWEST_BLOCKS or np.ptp(blocks.y) <= _ROUNDING * np.abs(blocks.y).max():
        return False
    return any(curve.p_value(-1) < _UNSTEADY_P and _bends(curve.mean) for curve in curves)


def _bends(beta: Samples) -> bool:
    """Whether the slope of a Legendre series changes by more than a tenth of its mean."""
    slope = np.polynomial.legendre.legval(np.linspace(-1, 1, 41), np.polynomial.legendre.legder(beta))
    return bool(np.ptp(slope) > _UNSTEADY_SHARE * abs(_END_TO_END[: beta.size] @ beta))
