"""The task `stop-at`: go to a position and stop there, with a remote that is on or off.

With the place x that the follower expects where a command will act, the goal g, the way d = 1 or -1 of the robot, the
tolerance e and the hysteresis h = e/10:

    on   while  d x < d g - b          (once off: - b - h),   b = e/2.

The robot cannot turn back: beyond g + e all is lost, short of it nothing is. So it aims short by b, and has room on
both sides for a pulse of flow. A relay with hysteresis holds a system of the first order within h and what it moves
between two decisions (Tsypkin 1984).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.estimators import PositionController
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun
from spirillum.controllers.sensors import Controller, FlowPulse, Message
from spirillum.controllers.task import FEEDBACK, Brief, Task, carried_by_flow
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.dynamics.release import reach_of
from spirillum.errors import InputError
from spirillum.progress import Progress
from spirillum.robot.fields import Length, SignedLength
from spirillum.units import show

_SHORT = 0.5  # b over the tolerance
_HYSTERESIS = 0.1  # h over the tolerance


class StopController(PositionController):
    """From camera alone."""

    def __init__(self, lab: Lab, speed: float, duty: float, goal: float, tolerance: float) -> None:
        super().__init__(lab, speed, duty)
        self._aim, self._back = goal - self._way * _SHORT * tolerance, _HYSTERESIS * tolerance
        self._on = True

    def decide(self, news: Message) -> float:
        """On while the aim is ahead of where the robot will be when the command acts."""
        left = self._way * (self._aim - self._follow(news)[0])
        self._on = left > (0.0 if self._on else self._back)
        return self._sent(news, self._duty if self._on else 0.0)


class Timed(Controller):
    """Open loop: on for a time that was computed beforehand; 0: does nothing."""

    blind = True

    def __init__(self, lab: Lab, on: float, duty: float) -> None:
        self._off_at, self._duty = on - 0.5 * lab.remote.period, duty

    def decide(self, news: Message) -> float:
        """On for its time: the command that ends it is the one nearest to it."""
        return self._duty if news.time < self._off_at else 0.0


class KnowingStop(Controller):
    """Knows position, speed and all flow to come, without error: a bound for any controller.

    It stops as far before the goal as a coming pulse will carry it on at most, and swims on when the pulse is over.
    """

    blind = True
    knowing = True

    def __init__(self, lab: Lab, duty: float, goal: float, way: float, flow: FlowPulse | None, carried: float) -> None:
        self._delay, self._duty, self._goal, self._way = lab.remote.delay, duty, goal, way
        self._flow, self._carried = flow, carried

    def decide(self, news: Message) -> float:
        """On while the goal is ahead of where the flow will have carried the robot."""
        assert news.truth is not None  # noqa: S101 - it knows
        acts = news.time + self._delay
        place = float(news.truth.pose.position[0]) + self._delay * news.truth.values["forward_velocity"]
        if self._flow is not None:
            place += self._carried * self._way * max(0.0, self._way * self._flow.passed_after(acts))
        return self._duty if self._way * (self._goal - place) > 0.0 else 0.0


_STEP = 0.2  # step in which the open loop's time is looked for, s
_PATIENCE = 10.0  # multiple of the time that the robot of the file needs at steady speed, within which it has to arrive
_SPARE, _SETTLING = 2.5, 5.0  # A run lasts so many times as long as the robot of the file needs, and s


class StopAtTask(Task):
    """Go to a position and stop, with a remote that is on or off."""

    kind: ClassVar[str] = "stop-at"
    error_name: ClassVar[str] = "distance from the goal at the end"
    error_unit: ClassVar[str] = "m"

    at: SignedLength | None = None  #: x of the body's mid-length at which to stop; it starts at 0. It has to be given.
    tolerance: Length = 1e-3  #: How far beside it is good.

    @property
    def goal(self) -> float:
        """`at`, m."""
        if self.at is None:
            raise InputError("task.at is missing; allowed: the position at which to stop, such as 80 mm")
        return self.at

    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> Brief:
        """Check that the goal is ahead and in the tube, and time the path to it."""
        speed = float(plant.steady.forward_velocity)
        self._check_place(plant, speed)
        needed = self._time_to_goal(plant, speed, progress)
        duty = plant.state.command
        return Brief(
            lab=lab,
            duration=_SPARE * needed + _SETTLING if self.duration is None else self.duration,
            speed=speed,
            duty=duty,
            schedule=(needed, duty),
            carried=carried_by_flow(plant, lab.pulse.velocity, lab.pulse.duration),
        )

    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:
        """A new controller; doing nothing leaves the drive off."""
        if name == FEEDBACK:
            return StopController(brief.lab, brief.speed, brief.duty, self.goal, self.tolerance)
        if name == "knowing":
            return KnowingStop(brief.lab, brief.duty, self.goal, brief.direction, flow, brief.carried)
        return Timed(brief.lab, brief.schedule[0] if name == "open-loop" else 0.0, brief.duty)

    def _error(self, run: LoopRun, brief: Brief) -> float:  # noqa: ARG002 - one interface for all tasks
        return float(run.moments[-1].pose.position[0]) - self.goal

    def _is_good(self, error: float) -> bool:
        return abs(error) <= self.tolerance

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:  # noqa: ARG002 - one interface for all tasks
        """The position, throughout."""
        return np.full_like(time, self.goal), self.tolerance

    def _check_place(self, plant: Plant, speed: float) -> None:
        way = float(np.sign(speed))
        start = float(plant.observe().pose.position[0])
        if way == 0.0 or not np.isfinite(speed):
            raise InputError(f"{plant.robot.name} does not swim by model '{plant.model}'; allowed: a robot that does")
        reach = reach_of(plant.robot)
        last = reach.middle + (reach.channel - reach.nose if way > 0.0 else -reach.channel - reach.tip)
        if not way * start < way * self.goal < way * last:
            low, high = sorted((start, last))
            beyond = way * self.goal >= way * last
            why = "where the end of the channel stops the robot" if beyond else "for the robot cannot swim backwards"
            raise InputError(
                f"task.at = {show(self.goal, 'mm')}; allowed: between {show(low, 'mm')} and {show(high, 'mm')}, {why}"
            )
        if self.tolerance >= abs(self.goal - start):
            raise InputError(
                f"task.tolerance = {show(self.tolerance, 'mm')}; allowed: less than the "
                f"{show(abs(self.goal - start), 'mm')} to the goal"
            )

    def _time_to_goal(self, plant: Plant, speed: float, progress: Progress | None) -> float:
        """Arrival time of the robot of the file with its drive on and without a pulse, s."""
        way, other = float(np.sign(speed)), plant.copy()
        most = _PATIENCE * self.goal / speed + 10.0
        place = before = 0.0
        while way * place < way * self.goal:
            before = place
            moment = uninterrupted(other.step(_STEP, remote=True))
            place = float(moment.pose.position[0])
            if progress is not None and moment.time > _STEP:
                progress("way of the robot as its file says", int(100 * max(0.0, min(place / self.goal, 1.0))), 100)
            if moment.ended or moment.time > most:
                raise InputError(
                    f"task.at = {show(self.goal, 'mm')} is not reached: {moment.ended or 'too slow'} at "
                    f"{show(place, 'mm')} after {moment.time:.4g} s; allowed: a nearer place, or another robot"
                )
        return float(other.state.time - _STEP * (place - self.goal) / (place - before))
