"""Controllers of speed: by PWM at a set speed, along a course through pulses of flow, and with the remote alone.

The follower (`spirillum.controllers.follower`) gives place x, speed s at full duty and drift w of the fluid; v is the
set speed, t the time, d = 1 or -1 the robot's way.

`HoldSpeed`, proportional and integral with back-calculation against windup (Astrom and Hagglund 2006):

    e = d v - y,   u = sat(d v / s + K e + I),   dI/dt = K_i e + (sat(u) - u) / T_t,

with the followed way y over the last W = 2 s, per time. A robot without inertia answers at once, after a dead time:
K_i = 1 / (s (T_c + theta)) is Skogestad's (2003) for such a process, K = 0.2 / s, and the dead time theta counts half
of W. The speed s that is followed takes the robot's slow changes away from the integral.

`KeepCourse`, place by a cascade whose inner loop inverts the robot as it is estimated, drift included:

    u = sat((d v + (d v t - x) / T - w) / s),   T = 3 s.

`SaveBattery`, a relay around the course, for a remote that knows on and off: on below d v t - h, off above d v t + h.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.follower import Follower
from spirillum.controllers.lab import Lab
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller, News, Sight

__all__ = ["HoldSpeed", "KeepCourse", "SaveBattery", "Steady"]

_CLOSED = 1.5
"""T_c, s."""
_PROPORTIONAL = 0.2
"""K s."""
_WINDOW = 2.0
"""W, s."""
_BACK = 3.0
"""T_t, s."""
_CATCH_UP = 3.0
"""T, s."""
_SLOWEST = 0.05
"""The estimated speed at full duty counts as at least this share of the predicted one."""
_EXACT = {"camera": {"position_noise": 1e-6, "position_wander": 0.0}}


class _Watching(Controller):
    """A controller that follows the robot; one that knows is told place and coming flow."""

    def __init__(self, lab: Lab, speed: float, duty: float, *, knowing: bool = False) -> None:
        """Begin.

        Args:
            lab: sensors and remote.
            speed: predicted while the drive is on, m/s, with its sign.
            duty: of the drive while it is on.
            knowing: whether it is told the truth.
        """
        self.knowing = self.blind = knowing
        seen = lab if not knowing else Lab.of(_EXACT).model_copy(update={"remote": lab.remote})
        self._follower = Follower(seen, speed / duty)
        self._full, self._delay = speed / duty, lab.remote.delay
        self._way = float(np.sign(speed))
        self._duty = duty
        self._now: Samples = np.array([0.0, self._full, 0.0, 0.0])
        self._error = 0.0

    def _follow(self, news: News) -> Samples:
        """Place, speed at full duty, drift and the camera's error where a command that is decided now will act."""
        for sight in news.sights if news.truth is None else ():
            self._follower.see(sight)
        if news.truth is not None:
            self._follower.see(Sight(news.time, float(news.truth.pose.position[0]), 0.0, 0.0, 0.0))
        self._now, spread = self._follower.ahead(news.time)
        self._error = float(np.sqrt(spread[0, 0]))
        ahead, _ = self._follower.ahead(news.time + self._delay)
        least = _SLOWEST * abs(self._full)
        ahead[1] = self._way * max(self._way * ahead[1], least)
        return ahead

    def _sent(self, news: News, duty: float) -> float:
        self._follower.send(news.time, duty)
        return duty

    def estimate(self) -> Mapping[str, float]:
        """Place, its standard deviation, speed at the robot's own duty, and drift."""
        return {
            "estimated_position": float(self._now[0]),
            "estimated_position_error": self._error,
            "estimated_speed": float(self._now[1] * self._duty),
            "estimated_drift": float(self._now[2]),
        }


class HoldSpeed(_Watching):
    """A set speed by PWM."""

    def __init__(self, lab: Lab, speed: float, duty: float, set_speed: float) -> None:
        """Begin.

        Args:
            lab: sensors and remote.
            speed: predicted while the drive is on, m/s, with its sign.
            duty: of the drive while it is on.
            set_speed: speed that is to be held, m/s, without sign.
        """
        super().__init__(lab, speed, duty)
        self._set_speed = self._way * set_speed
        self._closed = _CLOSED + lab.camera.latency + lab.remote.delay + 0.5 * (lab.remote.period + _WINDOW)
        self._integral, self._decided_at = 0.0, 0.0
        self._places: deque[tuple[float, float]] = deque()

    def decide(self, news: News) -> float:
        """Proportional and integral, held within 0 and 1."""
        full = self._follow(news)[1]
        self._places.append((news.time, float(self._now[0])))
        while len(self._places) > 1 and self._places[1][0] <= news.time - _WINDOW:
            self._places.popleft()
        (start, first), (end, last) = self._places[0], self._places[-1]
        error = self._set_speed - (last - first) / (end - start) if end - start > 0.5 * _WINDOW else 0.0
        unlimited = (self._set_speed + _PROPORTIONAL * error) / full + self._integral
        duty = float(np.clip(unlimited, 0.0, 1.0))
        dt = news.time - self._decided_at
        self._integral += dt * (error / (full * self._closed) + (duty - unlimited) / _BACK)
        self._decided_at = news.time
        return self._sent(news, duty)


class KeepCourse(_Watching):
    """A course at a set speed, by PWM, through pulses of flow."""

    def __init__(
        self,
        lab: Lab,
        speed: float,
        duty: float,
        set_speed: float,
        *,
        knowing: bool = False,
        flow: FlowPulse | None = None,
        carried: float = 0.0,
    ) -> None:
        """Begin.

        Args:
            lab: sensors and remote.
            speed: predicted while the drive is on, m/s, with its sign.
            duty: of the drive while it is on.
            set_speed: speed of the course, m/s, without sign.
            knowing: whether it is told the truth.
            flow: for one that knows: the pulse.
            carried: way of the robot over the way of the mean flow.
        """
        super().__init__(lab, speed, duty, knowing=knowing)
        self._set_speed, self._flow, self._carried = self._way * set_speed, flow, carried

    def decide(self, news: News) -> float:
        """The duty that leads back to the course in T, by the robot as it is estimated."""
        ahead, acts = self._follow(news), news.time + self._delay
        drift = ahead[2]
        if self._flow is not None and self._flow.start <= acts <= self._flow.end:
            drift = self._carried * self._flow.velocity
        unlimited = (self._set_speed + (self._set_speed * acts - ahead[0]) / _CATCH_UP - drift) / ahead[1]
        return self._sent(news, float(np.clip(unlimited, 0.0, 1.0)))


class SaveBattery(_Watching):
    """A course at a set mean speed, with a remote that knows on and off."""

    def __init__(
        self, lab: Lab, speed: float, duty: float, set_speed: float, band: float, *, knowing: bool = False
    ) -> None:
        """Begin.

        Args:
            lab: sensors and remote.
            speed: predicted while the drive is on, m/s, with its sign.
            duty: of the drive while it is on.
            set_speed: mean speed of the course, m/s, without sign.
            band: half width of the relay, m.
            knowing: whether it is told the truth.
        """
        super().__init__(lab, speed, duty, knowing=knowing)
        self._set_speed, self._band = set_speed, band
        self._on = True

    def decide(self, news: News) -> float:
        """On where the robot has fallen behind, off where it is ahead."""
        ahead = self._follow(news)
        left = self._set_speed * (news.time + self._delay) - self._way * ahead[0]
        self._on = left > (-self._band if self._on else self._band)
        return self._sent(news, self._duty if self._on else 0.0)


class Steady(Controller):
    """Open loop: a duty throughout, or on for a share of each cycle."""

    blind = True

    def __init__(self, duty: float, *, share: float = 1.0, cycle: float = 5.0) -> None:
        """Begin.

        Args:
            duty: while it is on.
            share: of each cycle in which it is on.
            cycle: s.
        """
        self._duty, self._share, self._cycle = duty, share, cycle

    def decide(self, news: News) -> float:
        """The duty in the first part of each cycle, off in the rest."""
        return self._duty if (news.time / self._cycle) % 1.0 < self._share else 0.0
