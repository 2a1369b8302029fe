"""Continuous angles and rates of a live robot, reading by reading.

An angle gets its whole periods as `unwrapping` does for a whole video, without what comes later. Rates over the last
seconds are straight lines by least squares, with an interval that autocorrelated errors widen.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from spirillum.arrays import Samples
from spirillum.measurement.statistics import student_t_quantile
from spirillum.vision.track.constants import UNWRAPPING
from spirillum.vision.track.unwrapping import likeliest_rate

_FEWEST = 8  # fewest readings of a rate
_LEAST_SPAN = 0.5  # least share of the window that readings have to span
_LARGEST = 0.95  # largest autocorrelation from frame to frame that a window resolves


class Window:
    """The readings of one series in the last seconds."""

    def __init__(self, length: float) -> None:
        self.length = length
        self._readings: deque[tuple[float, float]] = deque()

    def add(self, time: float, value: float) -> None:
        """Take a reading, NaN where there is none; those older than the window leave it."""
        if math.isfinite(value):
            self._readings.append((time, value))
        while self._readings and self._readings[0][0] < time - self.length:
            self._readings.popleft()

    def clear(self) -> None:
        """Forget all readings."""
        self._readings.clear()

    def slope(self, level: float) -> tuple[float, float, float]:
        """Rate, half width of its interval, and time spanned; NaN where the readings are too few."""
        if len(self._readings) < _FEWEST:
            return math.nan, math.nan, 0.0
        time, values = np.array(self._readings).T
        span = float(time[-1] - time[0])
        if span < _LEAST_SPAN * self.length:
            return math.nan, math.nan, span
        return (*slope_of(time, values, level), span)


def slope_of(time: Samples, values: Samples, level: float = 0.95) -> tuple[float, float]:
    """Slope of a least-squares line, and the half width of its interval."""
    # The errors are taken as a first-order autoregression: with the residuals' correlation r from frame to frame, which
    # is first freed of its bias (1 + 3 r)/n, n readings tell as much as n (1 - r)/(1 + r) independent ones (Bartlett
    # 1946); Student's t has that many less two degrees of freedom.
    count = time.size
    spans = time - time.mean()
    squares = float(spans @ spans)
    slope = float(spans @ values) / squares
    residual = values - values.mean() - slope * spans
    total = float(residual @ residual)
    near = float(residual[1:] @ residual[:-1]) / total if total > 0.0 else 0.0
    near = min(max(near + (1.0 + 3.0 * near) / count, 0.0), _LARGEST)
    independent = max(count * (1.0 - near) / (1.0 + near), 3.0)
    free = independent - 2.0
    variance = total / count * independent / free  # of one reading
    error = math.sqrt(variance * (count / independent) / squares)
    return slope, float(student_t_quantile(0.5 + 0.5 * level, free)) * error


def periodic_error(amplitude: float, rates: Sequence[float], span: float) -> float:
    """Standard error of a slope by errors that come back with angles, their phases unknown."""
    # A line through A sin(w t + p) over a time T has a slope of up to 6 A/T |j1(w T/2)|, with the spherical Bessel
    # function j1(u) = sin(u)/u^2 - cos(u)/u; over all phases, 1/sqrt 2 of it in the root mean square.
    total = 0.0
    for rate in rates:
        u = abs(0.5 * rate * span)
        if u > 1e-6:
            total += (6.0 * amplitude / span * (math.sin(u) / u**2 - math.cos(u) / u)) ** 2
    return math.sqrt(0.5 * total)


_GAP = 10.0  # time between two readings over the usual one from which on whole periods may be missing


class CausalAngle:
    """Gives each angle the whole periods that bring it nearest to its prediction by an alpha-beta filter."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.restarts = 0  #: How often tracking restarted, so that angles before and after are not comparable.
        self._times: list[float] = []
        self._angles: list[float] = []
        self._value = self._at = math.nan
        self._rate = 0.0
        self._count = self._outliers = 0

    def update(self, time: float, angle: float, error: float) -> float:
        """The continuous angle of a frame, rad; NaN where it is unreadable or an outlier."""
        if not math.isfinite(angle):
            return math.nan
        self._times = [*self._times[-UNWRAPPING.start :], time]
        self._angles = [*self._angles[-UNWRAPPING.start :], angle % self.period]
        if self._count == 0:
            return self._begun(time, angle % self.period)
        usual = float(np.median(np.diff(self._times)))
        if self._count <= UNWRAPPING.start:
            self._rate = likeliest_rate(np.array(self._times), np.array(self._angles), self.period, usual)
        span = time - self._at
        if span > _GAP * usual and abs(self._rate) * span * UNWRAPPING.drift > 0.5 * self.period:
            self.restarts += 1
            return self._begun(time, angle % self.period)
        expected = self._value + self._rate * span
        value = angle + self.period * round((expected - angle) / self.period)
        if abs(value - expected) > UNWRAPPING.outlier * self.period and self._count > 1:
            return self._odd(time, value, usual)
        self._outliers = 0
        trusted = math.isfinite(error) and error < 0.1 * self.period
        gain = UNWRAPPING.gain if trusted else 0.4 * UNWRAPPING.gain
        self._rate += UNWRAPPING.rate_gain * gain / UNWRAPPING.gain * (value - expected) / max(span, usual)
        self._value, self._at = expected + gain * (value - expected), time
        self._count += 1
        return value

    def _begun(self, time: float, angle: float) -> float:
        """Begin at a reading; after a gap near the last angle, for the eye alone."""
        if math.isfinite(self._value):
            angle += self.period * round((self._value - angle) / self.period)
        self._times, self._angles = [time], [angle % self.period]
        self._value, self._at, self._count, self._outliers = angle, time, 1, 0
        return angle

    def _odd(self, time: float, value: float, usual: float) -> float:
        """An outlier; after several in a row the rate has changed."""
        self._outliers += 1
        if self._outliers < UNWRAPPING.lost:
            return math.nan
        few = slice(-UNWRAPPING.lost, None)
        self._rate = likeliest_rate(np.array(self._times[few]), np.array(self._angles[few]), self.period, usual)
        self.restarts += 1
        self._times, self._angles = self._times[few], self._angles[few]
        self._value, self._at, self._outliers = value, time, 0
        self._count = UNWRAPPING.lost
        return value
