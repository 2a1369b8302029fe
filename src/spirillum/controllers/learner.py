"""The learner beside a controller: it infers from the meter when the drive is on, simulates its bank, and estimates.

The current follows a switching within milliseconds, so that a reading tells whether a command has arrived; without a
meter the commands are believed as they were sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from spirillum.controllers.bank import Bank
from spirillum.controllers.lab import Lab
from spirillum.controllers.learning import BLOCK, SETTLING, DriveInterval, RobotEstimate, learnt
from spirillum.controllers.signals import Command, Controller, Detection, Message, MeterReading

_NAMES = ("friction", "gap")


class Learner:
    """What has been seen of a run, and the factors estimated from it."""

    def __init__(self, lab: Lab, bank: Bank) -> None:
        """Begin."""
        self._lab, self._bank = lab, bank
        self._sights: list[Detection] = []
        self._readings: list[MeterReading] = []
        self._duties: list[tuple[float, float]] = [(0.0, 0.0)]
        """From when on the drive has which duty, s."""
        self._sent: list[tuple[float, float]] = [(0.0, 0.0)]
        self._next = SETTLING + 2.0 * BLOCK
        self.learnt: RobotEstimate | None = None

    def take(self, news: Message, duty: float) -> None:
        """Take in what reached a controller, and the duty that it sent."""
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

    def _hear(self, reading: MeterReading) -> None:
        """Note a reading, and a switching that it shows: halfway to the reading before."""
        on = reading.current > 0.5 * self._bank.current * min(self._last_sent(reading.time), 1.0)
        duty = self._last_sent(reading.time) if on else 0.0
        before = self._readings[-1].time if self._readings else 0.0
        if duty != self._duties[-1][1]:
            self._duties.append((0.5 * (before + reading.time), duty))
        self._readings.append(reading)

    def _last_sent(self, time: float) -> float:
        """Last duty that was sent and not 0; the robot's own if there is none."""
        sent = [duty for start, duty in self._sent if start <= time and duty > 0.0]
        return sent[-1] if sent else self._bank.duty

    def _learn(self, until: float) -> None:
        for (start, duty), (end, _) in zip(self._duties, [*self._duties[1:], (until, 0.0)], strict=True):
            if end > self._bank.time:
                self._bank.follow(min(end, until), duty if start <= until else 0.0)
        self._next = until + BLOCK
        self.learnt = learnt(self._bank.paths(), self._lab, self._on(until), self._sights, self._readings)

    def _on(self, until: float) -> list[DriveInterval]:
        """Stretches of time in which the drive was on."""
        stretches: list[DriveInterval] = []
        for (start, duty), (end, _) in zip(self._duties, [*self._duties[1:], (until, 0.0)], strict=True):
            if duty > 0.0 and stretches and stretches[-1].end == start:
                stretches[-1] = DriveInterval(stretches[-1].start, end)
            elif duty > 0.0:
                stretches.append(DriveInterval(start, end))
        return stretches


class Learning(Controller):
    """A controller with a learner beside it, which leaves its decisions alone."""

    def __init__(self, controller: Controller, learner: Learner) -> None:
        self._controller, self.learner = controller, learner
        self.blind, self.knowing = controller.blind, controller.knowing

    def decide(self, news: Message) -> float | Command:
        """The controller's duty, which the learner takes note of."""
        asked = self._controller.decide(news)
        self.learner.take(news, asked.duty if isinstance(asked, Command) else asked)
        return asked

    def estimate(self) -> Mapping[str, float]:
        """The controller's, and median and 95 % interval of the factors of friction and gap; NaN before."""
        estimate: dict[str, Any] = dict(self._controller.estimate())
        for name in _NAMES:
            factor = None if self.learner.learnt is None else getattr(self.learner.learnt, name)
            for end, part in (("", "value"), ("_low", "low"), ("_high", "high")):
                estimate[f"estimated_{name}_factor{end}"] = np.nan if factor is None else float(getattr(factor, part))
        return estimate
