"""Controllers of a magnetic robot: the axis of its field is tilted so that the robot comes to the tube's axis.

With the place across the tube zeta = y + i z, and the tilt of the field's axis theta = yaw + i pitch, a confined robot
moves by

    d zeta/dt = m zeta + g theta,   m = lambda + i Omega,

linear for small tilts: Omega is the rate at which it is carried around the axis (the orbit of a pusher), lambda the
orbit's growth, |g| its speed for each radian of tilt, arg g how far the orbit turns a push. Both laws need the place
alone, not the attitude, which a camera sees badly:

    `position`   theta = -(1/T + lambda)/g zeta,     T = 5 s    (feedback of the place: Caldag and Yesilyurt 2020)
    `aim`        theta = -zeta/L                                (line of sight: Mohammadi and Spong 2021, no integral)

held within |theta| <= 3 degrees. The first takes m and g of the robot of the file, the second knows nothing of the
orbit. The place is filtered by the same equation (an observer), and moved on to where a command will act.

The field turns at the rate that is asked for. Where the body is seen to turn more slowly than 0.9 of it, the robot has
stepped out, and the field slows down to 0.8 of its rate.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from spirillum.controllers.lab import Lab
from spirillum.controllers.signals import Command, Controller, Detection, Message
from spirillum.dynamics.turning_field import Field

Law = Literal["position", "aim"]

_CLOSED = 5.0
"""T, s."""
_AHEAD = 2.0
"""L over the body's length."""
MOST_TILT = np.radians(3.0)
"""Largest tilt, rad."""
_OBSERVED_OVER = 0.7
"""Time constant of the observer, s."""
_TURNS_OVER = 2.0
"""Time over which the body's turning is compared with the field's, s."""
_SLIPS, _SLOWER = 0.9, 0.8


def pushed_for(orbit: complex, time: float) -> complex:
    """Time for which a constant push counts on an orbit: the integral of exp(m s) over a time, s.

    Args:
        orbit: m, 1/s.
        time: s.
    """
    return time if abs(orbit * time) < 1e-6 else complex((np.exp(orbit * time) - 1.0) / orbit)


@dataclass(frozen=True)
class Steering:
    """What is known of a robot beforehand; SI."""

    orbit: complex
    """m, 1/s."""
    gain: complex
    """g, m/s."""
    rate: float
    """Of the field, rad/s, with its sign."""
    length: float
    """Of the body, m."""

    def moved(self, place: complex, tilt: complex, dt: float) -> complex:
        """Place after a time, m."""
        return complex(np.exp(self.orbit * dt) * place + pushed_for(self.orbit, dt) * self.gain * tilt)

    def tilt(self, law: Law, place: complex) -> complex:
        """The tilt that a law asks for at a place, rad."""
        per_place = (1.0 / _CLOSED + self.orbit.real) / self.gain if law == "position" else 1.0 / (_AHEAD * self.length)
        asked = -per_place * place
        return complex(asked * min(1.0, MOST_TILT / max(abs(asked), 1e-12)))


class Steer(Controller):
    """Feedback of the place across the tube."""

    def __init__(self, lab: Lab, known: Steering, law: Law, *, knowing: bool = False) -> None:
        """Begin."""
        self.knowing = self.blind = knowing
        self._known, self._law, self._delay = known, law, lab.remote.delay
        self._rate = known.rate
        self._place: complex | None = None
        self._seen_at = 0.0
        self._sent: deque[tuple[float, complex]] = deque([(0.0, 0j)])
        self._turns: deque[tuple[float, float]] = deque()
        self._tilt = 0j

    def decide(self, news: Message) -> Command:
        """The tilt of the law where the command will act."""
        if news.truth is not None:
            place = complex(*news.truth.pose.position[1:])
            self._see(Detection(news.time, 0.0, 0.0, news.truth.values["body_angle"], 0.0, place.real, place.imag))
            self._place = place
        for sight in news.sights:
            self._see(sight)
        if self._place is None:
            return Command(1.0, _field(self._rate, 0j))
        acts = news.time + self._delay
        self._tilt = self._known.tilt(self._law, self._moved(acts))
        self._sent.append((acts, self._tilt))
        return Command(1.0, _field(self._rate, self._tilt))

    def estimate(self) -> Mapping[str, float]:
        """Place across the tube, tilt and rate of the field."""
        place = complex(np.nan, np.nan) if self._place is None else self._place
        return {
            "estimated_side": place.real,
            "estimated_height": place.imag,
            "field_yaw": self._tilt.real,
            "field_pitch": self._tilt.imag,
            "field_rate": self._rate,
        }

    def _see(self, sight: Detection) -> None:
        """Take a sight into the observer, and watch whether the robot follows the field."""
        seen = complex(sight.side, sight.height)
        if self._place is None:
            self._place, self._seen_at = seen, sight.time
        moved = self._moved(sight.time)
        share = 1.0 - np.exp(-(sight.time - self._seen_at) / _OBSERVED_OVER)
        self._place, self._seen_at = moved + share * (seen - moved), sight.time
        while len(self._sent) > 1 and self._sent[1][0] <= sight.time:
            self._sent.popleft()
        self._turns.append((sight.time, sight.body_angle))
        if sight.time - self._turns[0][0] < _TURNS_OVER:
            return
        (start, first), (end, last) = self._turns.popleft(), self._turns[-1]
        if abs(last - first) < _SLIPS * abs(self._rate) * (end - start):
            self._rate *= _SLOWER
            self._turns.clear()

    def _moved(self, time: float) -> complex:
        """Place at a time, with the tilts that have been sent, m."""
        place, now = self._place or 0j, self._seen_at
        for (_, tilt), (end, _) in zip(self._sent, [*list(self._sent)[1:], (time, 0j)], strict=True):
            until = min(end, time)
            if until > now:
                place, now = self._known.moved(place, tilt, until - now), until
        return place


class Replay(Controller):
    """Open loop: tilts that were computed beforehand; without any, the field turns about the tube's axis."""

    blind = True

    def __init__(self, rate: float, tilts: Sequence[tuple[float, complex]] = ()) -> None:
        """Begin.

        Args:
            rate: of the field, rad/s.
            tilts: times, s, from which on a tilt is sent, and the tilts, rad.
        """
        self._rate, self._tilts = rate, tilts

    def decide(self, news: Message) -> Command:
        """The last tilt that was due."""
        tilt = next((tilt for start, tilt in reversed(self._tilts) if start <= news.time), 0j)
        return Command(1.0, _field(self._rate, tilt))


def _field(rate: float, tilt: complex) -> Field:
    return Field.model_construct(rotation_rate=rate, yaw=tilt.real, pitch=tilt.imag, strength=None)
