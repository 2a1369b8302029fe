"""Rates over the last seconds: a straight line by least squares, with an interval that autocorrelated errors widen."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from spirillum.arrays import Samples
from spirillum.measurement.statistics import student_t_quantile

_FEWEST = 8
"""Fewest readings of a rate."""
_LEAST_SPAN = 0.5
"""Least share of the window that readings have to span."""
_LARGEST = 0.95
"""Largest autocorrelation from frame to frame that a window can tell."""


class Window:
    """The readings of one series in the last seconds."""

    def __init__(self, length: float) -> None:
        """Begin empty.

        Args:
            length: of the window, s.
        """
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
    """Slope of a least-squares line, and the half width of its interval.

    The errors are taken as a first-order autoregression: with the residuals' correlation r from frame to frame, which
    is first freed of its bias (1 + 3 r)/n, n readings tell as much as n (1 - r)/(1 + r) independent ones (Bartlett
    1946); Student's t has that many less two degrees of freedom.

    Args:
        time: of the readings, s, (n,), four or more, rising.
        values: (n,).
        level: confidence level.
    """
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
    """Standard error of a slope by errors that come back with angles, their phases unknown.

    A line through A sin(w t + p) over a time T has a slope of up to 6 A/T |j1(w T/2)|, with the spherical Bessel
    function j1(u) = sin(u)/u^2 - cos(u)/u; over all phases, 1/sqrt 2 of it in the root mean square.

    Args:
        amplitude: A.
        rates: w of each angle, rad/s.
        span: T, s.
    """
    total = 0.0
    for rate in rates:
        u = abs(0.5 * rate * span)
        if u > 1e-6:
            total += (6.0 * amplitude / span * (math.sin(u) / u**2 - math.cos(u) / u)) ** 2
    return math.sqrt(0.5 * total)
