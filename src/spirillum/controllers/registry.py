"""Tasks by their names.

The task `stop-at`: go to a place and stop there.
Go to a place and stop, with a remote that knows on and off.
With the place x that the follower expects where a command will act, the goal g, the way d = 1 or -1 of the robot, the
tolerance e and the hysteresis h = e/10:

    on   while  d x < d g - b          (once off: - b - h),   b = e/2.

The robot cannot turn back: beyond g + e all is lost, short of it nothing is. So it aims short by b, and has room on
both sides for a pulse of flow. A relay with hysteresis holds a system of the first order within h and what it moves
between two decisions (Tsypkin 1984).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import BeforeValidator

from spirillum.arrays import Samples
from spirillum.controllers.course_tasks import HoldSpeedTask, RideOutTask, SaveBatteryTask
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun, run_loop
from spirillum.controllers.position_filter import PositionFilter
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller, Message
from spirillum.controllers.steering import MOST_TILT, Law, Replay, Steer, Steering, pushed_for
from spirillum.controllers.task import FEEDBACK, Brief, Task, carried_by_flow
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.dynamics.start import reach_of
from spirillum.dynamics.turning_field import Field
from spirillum.errors import InputError, did_you_mean
from spirillum.robot.arguments import one_of
from spirillum.robot.fields import Length, Rate, SignedLength
from spirillum.units import show

_SHORT = 0.5
"""b over the tolerance."""
_HYSTERESIS = 0.1
"""h over the tolerance."""


class StopController(Controller):
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
        self._follower = PositionFilter(lab, speed / duty)
        self._delay, self._duty, self._way = lab.remote.delay, duty, float(np.sign(speed))
        self._aim, self._back = goal - self._way * _SHORT * tolerance, _HYSTERESIS * tolerance
        self._on = True
        self._estimate = {"estimated_position": 0.0, "estimated_speed": speed, "estimated_drift": 0.0}

    def decide(self, news: Message) -> float:
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

    def decide(self, news: Message) -> float:
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

    def decide(self, news: Message) -> float:
        """On while the goal is ahead of where the flow will have carried the robot."""
        assert news.truth is not None  # noqa: S101 - it knows
        acts = news.time + self._delay
        place = float(news.truth.pose.position[0]) + self._delay * news.truth.values["forward_velocity"]
        if self._flow is not None:
            place += self._carried * self._way * max(0.0, self._way * self._flow.passed_after(acts))
        return self._duty if self._way * (self._goal - place) > 0.0 else 0.0


_STEP = 0.2
"""Step in which the open loop's time is looked for, s."""
_PATIENCE = 10.0
"""The robot as its file says has so many times the time at its steady speed to arrive."""
_SPARE, _SETTLING = 2.5, 5.0
"""A run lasts so many times as long as the robot of the file needs, and s."""


class StopAtTask(Task):
    """Go to a place and stop, with a remote that knows on and off."""

    kind: ClassVar[str] = "stop-at"
    error_name: ClassVar[str] = "distance from the goal at the end"
    error_unit: ClassVar[str] = "m"

    at: SignedLength | None = None
    """x of the body's mid-length at which to stop; it starts at 0. It has to be given."""
    tolerance: Length = 1e-3
    """How far beside it is good."""

    @property
    def goal(self) -> float:
        """`at`, m."""
        if self.at is None:
            raise InputError("task.at is missing; allowed: the place at which to stop, such as 80 mm")
        return self.at

    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> Brief:
        """Check that the place is ahead and in the tube, and time the way there."""
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
            return KnowingStop(brief.lab, brief.duty, self.goal, brief.way, flow, brief.carried)
        return Timed(brief.lab, brief.schedule[0] if name == "open-loop" else 0.0, brief.duty)

    def _error(self, run: LoopRun, brief: Brief) -> float:  # noqa: ARG002 - one interface for all tasks
        return float(run.moments[-1].pose.position[0]) - self.goal

    def _is_good(self, error: float) -> bool:
        return abs(error) <= self.tolerance

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:  # noqa: ARG002 - one interface for all tasks
        """The place, throughout."""
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
        """When the robot as its file says arrives with its drive on and without a pulse, s."""
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


_DURATION = 60.0
"""Of a run, s."""
_SHARE = 0.9
"""Largest rate of the field over the step-out rate."""
_SETTLED = 2
"""Turns of the field before orbit and gain are looked for."""


@dataclass(frozen=True)
class SteeringBrief(Brief):
    """What is known of a magnetic robot beforehand."""

    steering: Steering
    tilts: tuple[tuple[float, complex], ...]
    """Of the open loop: times, s, and tilts, rad."""


class KeepAxisTask(Task):
    """Swim along the tube's axis, steered by the axis of the field."""

    kind: ClassVar[str] = "keep-axis"
    error_name: ClassVar[str] = "mean distance from the axis over the second half"
    error_unit: ClassVar[str] = "m"
    across: ClassVar[bool] = True

    law: Annotated[Law, BeforeValidator(one_of("position", "aim"))] = "position"
    """`position`: feedback of the place, with the orbit as predicted; `aim`: at a point of the axis ahead."""
    rate: Rate | None = None
    """Of the field, at most 0.9 of the step-out rate; None: the robot's own."""
    tolerance: Length = 5e-4
    """How far from the axis is good."""

    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> SteeringBrief:
        """Check the rate of the field, find orbit and gain, and the tilts for the robot as its file says."""
        field, step_out = plant.state.field, float(plant.steady.step_out_rate)
        if field is None:
            raise InputError(f"task 'keep-axis' with {plant.robot.name}; allowed: a robot with drive.kind 'magnetic'")
        rate = field.rotation_rate if self.rate is None else self.rate
        if not 0.0 < abs(rate) <= _SHARE * step_out:
            raise InputError(
                f"task.rate = {show(rate, 'Hz')}; allowed: up to {show(_SHARE * step_out, 'Hz')}, {_SHARE:g} of its "
                "step-out rate"
            )
        steering = _identified(plant, rate)
        duration = _DURATION if self.duration is None else self.duration
        exact = Lab.exact()
        ahead = run_loop(plant.copy(), Steer(exact, steering, self.law), exact, duration, progress=progress)
        if ahead.interrupted:
            raise KeyboardInterrupt
        return SteeringBrief(
            lab=lab,
            duration=duration,
            speed=float(plant.steady.forward_velocity),
            duty=1.0,
            schedule=(duration, 1.0),
            carried=0.0,
            steering=steering,
            tilts=tuple(
                (one.time, complex(one.estimate["field_yaw"], one.estimate["field_pitch"])) for one in ahead.decisions
            ),
        )

    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:  # noqa: ARG002 - one interface
        """A new controller; doing nothing leaves the field's axis along the tube."""
        assert isinstance(brief, SteeringBrief)  # noqa: S101 - this task's own
        if name in (FEEDBACK, "knowing"):
            return Steer(brief.lab, brief.steering, self.law, knowing=name == "knowing")
        return Replay(brief.steering.rate, brief.tilts if name == "open-loop" else ())

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:  # noqa: ARG002 - one interface
        """The axis, throughout."""
        return np.zeros_like(time), self.tolerance

    def _error(self, run: LoopRun, brief: Brief) -> float:
        time = np.array([moment.time for moment in run.moments])
        distance = np.array([np.hypot(*moment.pose.position[1:]) for moment in run.moments])
        even = np.linspace(0.5 * brief.duration, brief.duration, 400)
        return float(np.mean(np.interp(even, time, distance)))

    def _is_good(self, error: float) -> bool:
        return error <= self.tolerance


def _identified(plant: Plant, rate: float) -> Steering:
    """Orbit and gain of a robot where it starts, from a look ahead with a tilt and without one."""
    turn = 2.0 * np.pi / abs(rate)

    def place(of: Plant, tilt: float, time: float) -> complex:
        field = Field.of({"rotation_rate": rate, "yaw": tilt})
        moment = uninterrupted(of.step(time, field=field, duty=1.0))
        if moment.ended:
            why = f"{moment.ended} after {moment.time:.4g} s"
            raise InputError(f"{of.robot.name} cannot be steered there: {why}; allowed: another place or rate")
        return complex(*moment.pose.position[1:])

    ahead = plant.copy()
    before = place(ahead, 0.0, _SETTLED * turn)
    straight, aside = place(ahead.copy(), 0.0, turn), place(ahead.copy(), MOST_TILT, turn)
    orbit = complex(np.log(straight / before)) / turn if abs(before) > 0.0 and abs(straight) > 0.0 else 0j
    gain = (aside - straight) / (MOST_TILT * pushed_for(orbit, turn))
    return Steering(orbit, complex(gain), rate, plant.robot.body.length)


_TASKS: tuple[type[Task], ...] = (StopAtTask, HoldSpeedTask, RideOutTask, SaveBatteryTask, KeepAxisTask)
TASKS = {task.kind: task for task in _TASKS}
"""Tasks by their kinds."""


def task_of(value: Task | Mapping[str, Any]) -> Task:
    """A task from what a caller may give."""
    if isinstance(value, Task):
        return value
    if "kind" not in value:
        raise InputError(
            f"task = {str(value)[:60]!r}; allowed: kind ({', '.join(TASKS)}) and the task's fields, by name"
        )
    kind = str(value["kind"])
    if kind not in TASKS:
        raise InputError(f"task = {kind[:60]!r}{did_you_mean(kind, TASKS)}; allowed: {', '.join(TASKS)}")
    return TASKS[kind].of({name: item for name, item in value.items() if name != "kind"})
