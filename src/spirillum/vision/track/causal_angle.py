"""A continuous angle, reading by reading: what `unwrapping` does for a whole film, without what comes later."""

from __future__ import annotations

import math

import numpy as np

from spirillum.vision.track.constants import UNWRAPPING
from spirillum.vision.track.unwrapping import likeliest_rate

_GAP = 10.0
"""Time between two readings over the usual one from which on whole periods may be missing."""


class CausalAngle:
    """Gives each angle the whole periods that bring it nearest to its prediction by an alpha-beta filter."""

    def __init__(self, period: float) -> None:
        """Begin."""
        self.period = period
        self.restarts = 0
        """How often it was begun anew, so that angles before and after do not hang together."""
        self._times: list[float] = []
        self._angles: list[float] = []
        self._value = self._at = math.nan
        self._rate = 0.0
        self._count = self._outliers = 0

    def update(self, time: float, angle: float, error: float) -> float:
        """The continuous angle of a frame, rad; NaN where it is unreadable or an outlier.

        Args:
            time: of the frame, s; later than before.
            angle: modulo the period, rad; NaN where it is unreadable.
            error: its standard error, rad.
        """
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
