"""Controllers of speed: by PWM at a set speed, along a course through pulses of flow, and with the remote alone.

The follower (`spirillum.controllers.follower`) gives place x, speed s at full duty and drift w of the fluid; v is the
set speed, t the time, d = 1 or -1 the robot's way.

`KeepCourse`, place by a cascade whose inner loop inverts the robot as it is estimated, drift included, for a course r:

    u = sat((d v + (r - x) / T - w) / s),   dr/dt = d v,   T = 3 s.

On a leash it holds the speed, not the course: r is held within l of x (conditional integration, Astrom and Hagglund
2006), so that a way that a pulse of flow took is not made up for beyond a share l / (T v) of the speed. The residual
r - x is the integral of the speed's error: a robot that slows down evenly is followed without one.

`SaveBattery`, a relay around the course, for a remote that knows on and off: on below d v t - h, off above d v t + h.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.follower import Follower
from spirillum.controllers.lab import Lab
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller, News, Sight

__all__ = ["LEASH", "KeepCourse", "SaveBattery", "Steady"]

_CATCH_UP = 3.0
"""T, s."""
LEASH = 0.3
"""l / (T v) of a controller that holds a speed."""
_WALK, _DRIFT = 0.05, 3e-5
"""Of the follower. Where the duty changes little, s and w show in the same way: a w that may be large would take what
belongs to s, and forget it."""
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
        self._follower = Follower(seen, speed / duty, walk=_WALK, drift=_DRIFT)
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


class KeepCourse(_Watching):
    """A course at a set speed, by PWM; on a leash it holds the speed and lets go of a way that a pulse of flow took."""

    def __init__(
        self,
        lab: Lab,
        speed: float,
        duty: float,
        set_speed: float,
        *,
        leash: float = np.inf,
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
            leash: l / (T v): so near to the robot the course is held; infinite: it is not.
            knowing: whether it is told the truth.
            flow: for one that knows: the pulse.
            carried: way of the robot over the way of the mean flow.
        """
        super().__init__(lab, speed, duty, knowing=knowing)
        self._set_speed, self._flow, self._carried = self._way * set_speed, flow, carried
        self._leash, self._course, self._until = leash * _CATCH_UP * set_speed, 0.0, 0.0

    def decide(self, news: News) -> float:
        """The duty that leads back to the course in T, by the robot as it is estimated."""
        ahead, acts = self._follow(news), news.time + self._delay
        self._course += self._set_speed * (acts - self._until)
        self._course, self._until = float(np.clip(self._course, ahead[0] - self._leash, ahead[0] + self._leash)), acts
        drift = ahead[2]
        if self._flow is not None and self._flow.start <= acts <= self._flow.end:
            drift = self._carried * self._flow.velocity
        unlimited = (self._set_speed + (self._course - ahead[0]) / _CATCH_UP - drift) / ahead[1]
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
