"""Where a robot is and how fast, from late and noisy sights: a Kalman filter with the commands that are under way.

The state is place x, speed s at full duty, drift w of the fluid, and the camera's slow error b with its memory T:

    dx/dt = u(t) s + w,   ds = sigma_s dB,   dw = -w/tau dt + sigma_w sqrt(2/tau) dB',
    db = -b/T dt + sigma_b sqrt(2/T) dB'',   y_k = x(t_k) + b(t_k) + noise,

with the duty u that acts at t, which was sent a delay before (Kalman 1960). Frames are used at the time of their
exposure; what has been sent since moves the state on to the time at which a command that is decided now will act: the
predictor of Smith (1957) for a dead time.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab
from spirillum.controllers.signals import Detection

_SPEED_WALK = 0.15
"""sigma_s over the predicted speed, 1/sqrt(s): the film under the robot thins within some ten seconds."""
_DRIFT = 3e-4
"""sigma_w, m/s: of the size of a pulse."""
_DRIFT_MEMORY = 2.0
"""tau, s."""
_STRAY = 6.0
"""Sights further away than so many standard deviations are left out..."""
_STRAYS = 5
"""...but not more than so many in a row."""


class PositionFilter:
    """The filter of one run."""

    def __init__(
        self, lab: Lab, speed: float, *, start: float = 0.0, walk: float = _SPEED_WALK, drift: float = _DRIFT
    ) -> None:
        """Begin.

        Args:
            lab: sensors and remote.
            speed: predicted at full duty, m/s; its own uncertainty is as large.
            start: place at time 0, m.
            walk: sigma_s over the predicted speed, 1/sqrt(s).
            drift: sigma_w, m/s.
        """
        self._noise = max(lab.camera.position_noise, 1e-6) ** 2
        self._wander, self._memory = lab.camera.position_wander, lab.camera.memory
        self._delay = lab.remote.delay
        self._walk = (walk * abs(speed)) ** 2
        self._sent: deque[tuple[float, float]] = deque([(0.0, 0.0)])
        self._time, self._strays, self._drift = 0.0, 0, drift
        self._mean: Samples = np.array([start, speed, 0.0, 0.0])
        self._spread: Samples = np.diag([1e-3, abs(speed), drift, self._wander]) ** 2

    def send(self, time: float, duty: float) -> None:
        """Note a command that is sent now."""
        if duty != self._sent[-1][1]:
            self._sent.append((time + self._delay, duty))

    def see(self, sight: Detection) -> None:
        """Take in a sight."""
        self._mean, self._spread = self._moved(sight.time)
        self._time = sight.time
        while len(self._sent) > 1 and self._sent[1][0] <= self._time:
            self._sent.popleft()
        along = self._spread[:, 0] + self._spread[:, 3]
        surprise, size = sight.position - self._mean[0] - self._mean[3], along[0] + along[3] + self._noise
        if surprise**2 > _STRAY**2 * size and self._strays < _STRAYS:
            self._strays += 1
            return
        self._strays = 0
        self._mean = self._mean + along * surprise / size
        self._spread = self._spread - np.outer(along, along) / size

    def ahead(self, time: float) -> tuple[Samples, Samples]:
        """Mean (x, s, w, b) and covariance at a time, with the commands that have been sent; SI."""
        return self._moved(time)

    def duty_at(self, time: float) -> float:
        """Duty that acts at a time if no command was lost."""
        return [duty for start, duty in self._sent if start <= time][-1]

    def _moved(self, time: float) -> tuple[Samples, Samples]:
        mean, spread, now = self._mean, self._spread, self._time
        edges = [start for start, _ in self._sent if now < start < time]
        for after in [*edges, time]:
            if after > now:
                mean, spread = self._stepped(mean, spread, after - now, self.duty_at(now))
                now = after
        return mean, spread

    def _stepped(self, mean: Samples, spread: Samples, dt: float, duty: float) -> tuple[Samples, Samples]:
        left, kept = np.exp(-dt / _DRIFT_MEMORY), np.exp(-dt / self._memory)
        moves = np.diag([1.0, 1.0, left, kept])
        moves[0, 1], moves[0, 2] = duty * dt, _DRIFT_MEMORY * (1.0 - left)
        spread = moves @ spread @ moves.T
        spread[1, 1] += self._walk * dt
        spread[2, 2] += self._drift**2 * (1.0 - left**2)
        spread[3, 3] += self._wander**2 * (1.0 - kept**2)
        return moves @ mean, spread
