"""The learner beside a controller: it tells from the meter when the drive is on, lets its bank follow, and learns.

The current follows a switching within milliseconds, so that a reading tells whether a command has arrived; without a
meter the commands are believed as they were sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from spirillum.controllers.bank import Bank
from spirillum.controllers.lab import Lab
from spirillum.controllers.learning import BLOCK, SETTLING, Learnt, Stretch, learnt
from spirillum.controllers.signals import Controller, News, Reading, Sight

__all__ = ["Learner", "Learning"]

_NAMES = ("friction", "gap")


class Learner:
    """What has been seen of a run, and what it tells."""

    def __init__(self, lab: Lab, bank: Bank) -> None:
        """Begin.

        Args:
            lab: sensors, remote, and what is unknown.
            bank: where the run begins; it is moved.
        """
        self._lab, self._bank = lab, bank
        self._sights: list[Sight] = []
        self._readings: list[Reading] = []
        self._duties: list[tuple[float, float]] = [(0.0, 0.0)]
        """From when on the drive has which duty, s."""
        self._sent: list[tuple[float, float]] = [(0.0, 0.0)]
        self._next = SETTLING + 2.0 * BLOCK
        self.found: Learnt | None = None

    def take(self, news: News, duty: float) -> None:
        """Take in what a controller was told, and what it sent."""
        self._sights += news.sights
        acts = news.time + self._lab.remote.delay
        if duty != self._sent[-1][1]:
            self._sent.append((acts, duty))
        if self._lab.meter.rate:
            for reading in news.readings:
                self._hear(reading)
            until = self._readings[-1].time if self._readings else 0.0
        else:
            self._duties, until = list(self._sent), news.time
        if until >= self._next:
            self._learn(until)

    def _hear(self, reading: Reading) -> None:
        """Note a reading, and a switching that it shows: halfway to the reading before."""
        on = reading.current > 0.5 * self._bank.current * min(self._last_sent(reading.time), 1.0)
        duty = self._last_sent(reading.time) if on else 0.0
        before = self._readings[-1].time if self._readings else 0.0
        if duty != self._duties[-1][1]:
            self._duties.append((0.5 * (before + reading.time), duty))
        self._readings.append(reading)

    def _last_sent(self, time: float) -> float:
        """Duty that was last asked for while it was not 0; the robot's own if none was."""
        sent = [duty for start, duty in self._sent if start <= time and duty > 0.0]
        return sent[-1] if sent else self._bank.duty

    def _learn(self, until: float) -> None:
        for (start, duty), (end, _) in zip(self._duties, [*self._duties[1:], (until, 0.0)], strict=True):
            if end > self._bank.time:
                self._bank.follow(min(end, until), duty if start <= until else 0.0)
        self._next = until + BLOCK
        self.found = learnt(self._bank.paths(), self._lab, self._on(until), self._sights, self._readings)

    def _on(self, until: float) -> list[Stretch]:
        found: list[Stretch] = []
        for (start, duty), (end, _) in zip(self._duties, [*self._duties[1:], (until, 0.0)], strict=True):
            if duty > 0.0 and found and found[-1].end == start:
                found[-1] = Stretch(found[-1].start, end)
            elif duty > 0.0:
                found.append(Stretch(start, end))
        return found


class Learning:
    """A controller with a learner beside it, which changes nothing of what it does."""

    def __init__(self, controller: Controller, learner: Learner) -> None:
        self._controller, self.learner = controller, learner
        self.blind, self.knowing = controller.blind, controller.knowing

    def decide(self, news: News) -> float:
        """As the controller."""
        duty = self._controller.decide(news)
        self.learner.take(news, duty)
        return duty

    def estimate(self) -> Mapping[str, float]:
        """As the controller, and median and 95 % interval of the factors of friction and gap; NaN before."""
        found: dict[str, Any] = dict(self._controller.estimate())
        for name in _NAMES:
            factor = None if self.learner.found is None else getattr(self.learner.found, name)
            for end, part in (("", "value"), ("_low", "low"), ("_high", "high")):
                found[f"estimated_{name}_factor{end}"] = np.nan if factor is None else float(getattr(factor, part))
        return found
