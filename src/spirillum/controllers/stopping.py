"""Go to a place and stop, with a remote that knows on and off.

With the place x that the follower expects where a command will act, the goal g, the way d = 1 or -1 of the robot, the
tolerance e and the hysteresis h = e/10:

    on   while  d x < d g - b          (once off: - b - h),   b = e/2.

The robot cannot turn back: beyond g + e all is lost, short of it nothing is. So it aims short by b, and has room on
both sides for a pulse of flow. A relay with hysteresis holds a system of the first order within h and what it moves
between two decisions (Tsypkin 1984).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spirillum.controllers.follower import Follower
from spirillum.controllers.lab import Lab
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller, News

__all__ = ["KnowingStop", "StopAt", "Timed"]

_SHORT = 0.5
"""b over the tolerance."""
_HYSTERESIS = 0.1
"""h over the tolerance."""


class StopAt(Controller):
    """From camera alone."""

    def __init__(self, lab: Lab, speed: float, duty: float, goal: float, tolerance: float) -> None:
        """Begin.

        Args:
            lab: sensors and remote.
            speed: predicted while the drive is on, m/s, with its sign.
            duty: of the drive while it is on.
            goal: where to stop, m.
            tolerance: how far beside it is good, m.
        """
        self._follower = Follower(lab, speed / duty)
        self._delay, self._duty, self._way = lab.remote.delay, duty, float(np.sign(speed))
        self._aim, self._back = goal - self._way * _SHORT * tolerance, _HYSTERESIS * tolerance
        self._on = True
        self._estimate = {"estimated_position": 0.0, "estimated_speed": speed, "estimated_drift": 0.0}

    def decide(self, news: News) -> float:
        """On while the aim is ahead of where the robot will be when the command acts."""
        for sight in news.sights:
            self._follower.see(sight)
        mean, _spread = self._follower.ahead(news.time + self._delay)
        left = self._way * (self._aim - mean[0])
        self._on = left > (0.0 if self._on else self._back)
        duty = self._duty if self._on else 0.0
        now, around = self._follower.ahead(news.time)
        self._estimate = {
            "estimated_position": float(now[0]),
            "estimated_position_error": float(np.sqrt(around[0, 0])),
            "estimated_speed": float(now[1] * self._duty),
            "estimated_drift": float(now[2]),
        }
        self._follower.send(news.time, duty)
        return duty

    def estimate(self) -> Mapping[str, float]:
        """Place, its standard deviation, speed while on, and drift."""
        return self._estimate


class Timed(Controller):
    """Open loop: on for a time that was computed beforehand; 0: does nothing."""

    blind = True

    def __init__(self, lab: Lab, on: float, duty: float) -> None:
        """Begin.

        Args:
            lab: sensors and remote.
            on: for how long the drive has to be on, s.
            duty: of the drive while it is on.
        """
        self._off_at, self._duty = on - 0.5 * lab.remote.period, duty

    def decide(self, news: News) -> float:
        """On for its time: the command that ends it is the one nearest to it."""
        return self._duty if news.time < self._off_at else 0.0


class KnowingStop(Controller):
    """Knows place, speed and all flow to come, without error: what no controller can beat by much.

    It stops as far before the goal as a coming pulse will carry it on at most, and swims on when the pulse is over.
    """

    blind = True
    knowing = True

    def __init__(self, lab: Lab, duty: float, goal: float, way: float, flow: FlowPulse | None, carried: float) -> None:
        """Begin.

        Args:
            lab: its remote.
            duty: of the drive while it is on.
            goal: where to stop, m.
            way: 1 or -1, along which the robot swims.
            flow: the pulse of flow.
            carried: way of the robot over the way of the mean flow.
        """
        self._delay, self._duty, self._goal, self._way = lab.remote.delay, duty, goal, way
        self._flow, self._carried = flow, carried

    def decide(self, news: News) -> float:
        """On while the goal is ahead of where the flow will have carried the robot."""
        assert news.truth is not None  # noqa: S101 - it knows
        acts = news.time + self._delay
        place = float(news.truth.pose.position[0]) + self._delay * news.truth.values["forward_velocity"]
        if self._flow is not None:
            place += self._carried * self._way * max(0.0, self._way * self._flow.passed_after(acts))
        return self._duty if self._way * (self._goal - place) > 0.0 else 0.0
