"""The closed loop: plant, camera, meter, remote and controller on one clock, every event at its own time.

Frames, readings, decisions, arrivals of commands and edges of the flow are events in one queue. Between two of them the
plant takes one step, so that delays are exact and no period has to fit another. The drive is off until the first
command arrives, when the camera has been silent for too long, and when the loop ends, for whatever reason.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import count, pairwise
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab
from spirillum.controllers.sensors import Command, Controller, Detection, FlowPulse, Message, MeterReading, Senses
from spirillum.dynamics.integration import INTERRUPTED
from spirillum.dynamics.plant import Plant, Snapshot
from spirillum.errors import InputError
from spirillum.progress import Progress

SILENCE = 1.0  #: The drive is off so long after the last frame has arrived, s.
_LEAST_PATIENCE = 0.5 * SILENCE
"""A remote that needs more than the rest of `SILENCE` switches the drive off later, by what it needs more, s."""
_LONGEST_WAIT = 12.0  # so long the robot swims on without being seen while it is learnt how it looks, s
_AT_ONCE = 1e-9
_LEAST_OFF = 0.05  # least time that a run continues after the last command, s
_REPORTS = 200  # how often a run reports its progress


class _Kind(IntEnum):
    """Events; of those at one time the first here comes first."""

    FLOW = 0
    ARRIVAL = 1
    FRAME = 2
    READING = 3
    DELIVERY = 4
    DECISION = 5
    END = 6


@dataclass(frozen=True)
class Decision:
    """What a controller decided."""

    time: float  #: s.
    duty: float  #: Duty that was sent.
    estimate: dict[str, float]  #: Its estimate of the robot.


@dataclass
class LoopRun:
    """A controlled run; SI."""

    moments: list[Snapshot] = field(default_factory=list)  #: The robot after each event that moved it, in order of time
    flows: list[float] = field(default_factory=list)  #: Flow that is imposed up to each of them, m/s; 0: none.
    frames: list[tuple[float, Detection | None]] = field(default_factory=list)  #: Frames, s, and detections
    readings: list[MeterReading] = field(default_factory=list)  #: Readings of the meter.
    decisions: list[Decision] = field(default_factory=list)  #: Decisions of the controller.
    lost: int = 0  #: Commands that did not arrive.
    silent: float | None = None  #: When the drive was first switched off because the camera was silent, s.
    ended: str = ""  #: Why the run ended before its time; empty if it did not.

    @property
    def interrupted(self) -> bool:
        """Whether it was interrupted."""
        return self.ended == INTERRUPTED

    @property
    def time(self) -> Samples:
        """When each of `moments` is, s."""
        return np.array([moment.time for moment in self.moments])

    @property
    def position(self) -> Samples:
        """Positions of the body then, m, (n, 3)."""
        return np.array([moment.pose.position for moment in self.moments])

    @property
    def time_on(self) -> float:
        """Time in which the drive was on, s."""
        return sum(after.time - before.time for before, after in pairwise(self.moments) if after.values["duty"] > 0.0)

    @property
    def energy(self) -> float:
        """From the battery's terminals (without a motor: of the drive), J."""
        values = self.moments[-1].values
        return float(values.get("electrical_energy", values["drive_energy"]))


class _Loop:
    """A run in progress."""

    def __init__(self, plant: Plant, controller: Controller, lab: Lab, senses: Senses, flow: FlowPulse | None) -> None:
        self.plant, self.controller, self.lab, self.flow = plant, controller, lab, flow
        self.senses = senses
        self.own = Command(plant.state.command)
        self.run = LoopRun()
        self.command = Command(0.0)
        self.imposed = 0.0
        self.still = plant.state.flow
        self._queue: list[tuple[float, int, int, Any]] = []
        self._order = count()
        self._sights: list[Detection] = []
        self._readings: list[MeterReading] = []
        self._arrived = lab.camera.latency
        remote = lab.remote.period + lab.remote.delay  # what a decision may wait, and what its command takes
        self._patience = max(SILENCE - remote, _LEAST_PATIENCE)

    def push(self, time: float, kind: _Kind, content: Any = None) -> None:
        """Put an event into the queue."""
        heapq.heappush(self._queue, (time, int(kind), next(self._order), content))

    def pop(self) -> tuple[float, _Kind, Any]:
        """The next event."""
        time, kind, _order, content = heapq.heappop(self._queue)
        return time, _Kind(kind), content

    def advance(self, time: float) -> bool:
        """Move the robot up to a time; whether it got there."""
        dt = time - self.plant.state.time
        if dt > _AT_ONCE:
            self.run.moments.append(self.plant.step(dt, duty=self.command.duty, field=self.command.field))
            self.run.flows.append(self.imposed)
        self.run.ended = self.plant.state.ended
        return not self.run.ended

    def now(self) -> Snapshot:
        """The robot as it is."""
        return self.run.moments[-1]

    def decide(self, time: float) -> bool:
        """Let the controller decide and send its command; whether it gave a valid one."""
        waiting = "" if self.controller.blind else self.senses.not_ready(time)
        if waiting:
            self._arrived = max(self._arrived, self.senses.pictured + self.lab.camera.latency)
        silent = not self.controller.blind and time - self._arrived > self._patience
        if waiting and not silent:  # the robot swims at its own duty while its look is learnt, but not for ever
            if time > _LONGEST_WAIT:
                self.run.ended = f"nothing is seen after {time:.3g} s: {waiting}"
                return False
            return self.send(time, self.own, {})
        truth = self.now() if self.controller.knowing else None
        asked = self.controller.decide(Message(time, tuple(self._sights), tuple(self._readings), truth))
        command = asked if isinstance(asked, Command) else Command(float(asked))
        self._sights, self._readings = [], []
        if not 0.0 <= command.duty <= 1.0:
            self.run.ended = f"the controller requested a duty of {command.duty:g}; allowed: 0 to 1"
            return False
        if silent:
            command = Command(0.0)
            self.run.silent = time if self.run.silent is None else self.run.silent
        return self.send(time, command, dict(self.controller.estimate()))

    def send(self, time: float, command: Command, estimate: dict[str, float]) -> bool:
        """Note a decision and send it."""
        self.run.decisions.append(Decision(time, command.duty, estimate))
        if self.senses.command_arrives():
            self.push(time + self.lab.remote.delay, _Kind.ARRIVAL, command)
        else:
            self.run.lost += 1
        return True

    def handle(self, time: float, kind: _Kind, content: Any) -> bool:
        """Process one event; return whether the run continues."""
        if kind is _Kind.DELIVERY:
            if isinstance(content, Detection):
                self._sights.append(content)
                self._arrived = time
            else:
                self._readings.append(content)
            return True
        if kind is _Kind.ARRIVAL:
            return self.arrive(time, content)
        if (kind is not _Kind.DECISION or self.controller.knowing) and not self.advance(time):
            return False
        match kind:
            case _Kind.FLOW:
                self.imposed = content
                self.plant.impose_flow(content if content else self.still)
            case _Kind.FRAME:
                self._frame(time)
            case _Kind.READING:
                reading = self.senses.reading(self.now())
                self.run.readings.append(reading)
                self.push(time + self.lab.meter.latency, _Kind.DELIVERY, reading)
                self.push(time + 1.0 / self.lab.meter.rate, _Kind.READING)
            case _Kind.DECISION:
                self.push(time + self.lab.remote.period, _Kind.DECISION)
                return self.decide(time)
            case _:
                return False
        return True

    def arrive(self, time: float, sent: Command) -> bool:
        """Deliver a command to the robot; return whether the port is still there and the run continues."""
        try:
            command = self.senses.deliver(sent)
        except InputError as error:
            self.run.ended = str(error)
            return False
        if command != self.command:
            if not self.advance(time):
                return False
            self.command = command
        return True

    def _frame(self, time: float) -> None:
        sight = self.senses.sight(self.now())
        self.run.frames.append((time, sight))
        if sight is not None:
            self.push(time + self.lab.camera.latency, _Kind.DELIVERY, sight)
        self.push(len(self.run.frames) / self.lab.camera.fps, _Kind.FRAME)

    def switch_off(self) -> None:
        """Switch the drive off, whatever has happened, and follow the robot until it stands."""
        ended, self.command = self.run.ended, Command(0.0)
        if self.plant.state.ended == INTERRUPTED:
            self.plant.reset(replace(self.plant.state, ended=""))
        if not self.plant.state.ended:
            self.advance(self.plant.state.time + max(self.lab.remote.delay, _LEAST_OFF))
        self.run.ended = ended or self.run.ended


def run_loop(
    plant: Plant,
    controller: Controller,
    lab: Lab,
    duration: float,
    *,
    seed: int = 0,
    senses: Senses | None = None,
    flow: FlowPulse | None = None,
    pace: Callable[[float], None] | None = None,
    progress: Progress | None = None,
) -> LoopRun:
    """Let a controller drive a plant; an interrupt or a wrong command ends the run, and the drive is off at its end."""
    loop = _Loop(plant, controller, lab, senses or Senses(lab, seed), flow)
    loop.run.moments.append(plant.observe())
    loop.run.flows.append(0.0)
    loop.push(duration, _Kind.END)
    loop.push(0.0, _Kind.FRAME)
    loop.push(0.0, _Kind.DECISION)
    if lab.meter.rate:
        loop.push(0.0, _Kind.READING)
    if flow is not None and flow.start < duration:
        loop.push(flow.start, _Kind.FLOW, flow.velocity)
        loop.push(flow.end, _Kind.FLOW, 0.0)
    reported = 0
    try:
        going = True
        while going:
            time, kind, content = loop.pop()
            if kind is _Kind.DECISION and pace is not None:
                pace(time)
            going = loop.handle(time, kind, content)
            done = int(_REPORTS * min(time / duration, 1.0))
            if progress is not None and done > reported:
                reported = done
                progress("controlled run", done, _REPORTS)
    except KeyboardInterrupt:
        loop.run.ended = INTERRUPTED
    finally:
        loop.switch_off()
        loop.senses.close()
    return loop.run
