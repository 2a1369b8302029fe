"""The tasks of speed: `hold-speed`, `ride-out` and `save-battery`."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator

from spirillum.arrays import Samples
from spirillum.controllers.course import HoldSpeed, KeepCourse, SaveBattery, Steady
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller
from spirillum.controllers.task import FEEDBACK, Brief, Score, Task, carried_by_flow, energy, positive
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.errors import InputError
from spirillum.robot.fields import LengthOrZero, Velocity
from spirillum.units import show

__all__ = ["HoldSpeedTask", "RideOutTask", "SaveBatteryTask"]

_DURATION = 40.0
"""Of a run, s."""
_STEP = 0.5
"""Step of the runs by which the open loop is found, s."""
_SPEED_OVER = 2.0
"""Time over which a speed is taken, s."""
_WITHIN = 0.05
"""Relative error of a speed that is good."""


class _CourseTask(Task):
    """What the tasks of speed share."""

    speed: Annotated[
        Velocity | None, AfterValidator(lambda value: value if value is None else positive(value, "m/s"))
    ] = None
    """Speed along the robot's way. It has to be given."""

    @property
    def asked(self) -> float:
        """`speed`, m/s.

        Raises:
            InputError: if it is not given.
        """
        if self.speed is None:
            raise InputError("task.speed is missing; allowed: a speed, such as 0.1 mm/s")
        return self.speed

    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> Brief:
        """Check that the robot of the file swims so fast, and find the duty at which it does."""
        duration = _DURATION if self.duration is None else self.duration
        speed, own = float(plant.steady.forward_velocity), plant.state.command
        way = float(np.sign(speed))
        asked = self.asked
        fastest = way * _mean_speed(plant, own, duration, progress)
        if not asked < fastest:
            raise InputError(
                f"task.speed = {show(asked, 'mm/s')}; allowed: below {show(fastest, 'mm/s')}, the mean of "
                f"{duration:g} s at the robot's own duty"
            )
        first = own * asked / fastest
        found = way * _mean_speed(plant, first, duration, progress)
        power = np.log(fastest / found) / np.log(own / first) if 0.0 < found < fastest else 1.0
        duty = float(min(own * (asked / fastest) ** (1.0 / power), 1.0))
        return Brief(
            lab=lab,
            duration=duration,
            speed=speed,
            duty=own,
            schedule=(asked / fastest, duty),
            carried=carried_by_flow(plant, lab.pulse.velocity, lab.pulse.duration),
        )

    def _way_missed(self, run: LoopRun, brief: Brief) -> float:
        """Way of the run less that of the course, m."""
        time, place = _path(run)
        gone = float(np.interp(brief.duration, time, place) - place[0])
        return brief.way * gone - self.asked * brief.duration

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:
        """The course."""
        return way * self.asked * time, 5e-4


class HoldSpeedTask(_CourseTask):
    """Hold a speed by PWM."""

    kind: ClassVar[str] = "hold-speed"
    error_name: ClassVar[str] = "median speed of the second half less that asked for"
    error_unit: ClassVar[str] = "m/s"

    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:
        """A new controller; doing nothing leaves the drive on."""
        if name == FEEDBACK:
            return HoldSpeed(brief.lab, brief.speed, brief.duty, self.asked)
        return _reference(name, brief, self.asked, flow)

    def score(self, run: LoopRun, brief: Brief) -> Score:
        """Good within 5 % of the speed; speeds are over 2 s, so that turns of the tail and a pulse do not count."""
        time, place = _path(run)
        starts = np.arange(0.5 * brief.duration, brief.duration - _SPEED_OVER, 0.25)
        ways = np.interp(starts + _SPEED_OVER, time, place) - np.interp(starts, time, place)
        error = float(np.median(brief.way * ways / _SPEED_OVER)) - self.asked
        return Score(error, abs(error) <= _WITHIN * self.asked and not run.ended, energy(run))


class RideOutTask(_CourseTask):
    """Keep a course at a speed through a pulse of flow, by PWM."""

    kind: ClassVar[str] = "ride-out"
    error_name: ClassVar[str] = "distance from the course at the end"
    error_unit: ClassVar[str] = "m"

    tolerance: Annotated[LengthOrZero, AfterValidator(lambda value: positive(value, "m"))] = 5e-4
    """How far from the course is good."""

    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:
        """A new controller; doing nothing leaves the drive on."""
        if name == FEEDBACK:
            return KeepCourse(brief.lab, brief.speed, brief.duty, self.asked)
        return _reference(name, brief, self.asked, flow)

    def score(self, run: LoopRun, brief: Brief) -> Score:
        """Good within the tolerance."""
        error = self._way_missed(run, brief)
        return Score(error, abs(error) <= self.tolerance and not run.ended, energy(run))

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:
        """The course."""
        return way * self.asked * time, self.tolerance


class SaveBatteryTask(RideOutTask):
    """Go a way in a time with as little from the battery as a remote that knows on and off allows."""

    kind: ClassVar[str] = "save-battery"
    error_name: ClassVar[str] = "distance from the course at the end"

    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:
        """A new controller; doing nothing leaves the drive on."""
        if name in (FEEDBACK, "knowing"):
            band = 0.4 * self.tolerance
            return SaveBattery(brief.lab, brief.speed, brief.duty, self.asked, band, knowing=name == "knowing")
        if name == "open-loop":
            return Steady(brief.duty, share=brief.schedule[0])
        return _reference(name, brief, self.asked, flow)

    def score(self, run: LoopRun, brief: Brief) -> Score:
        """Good if it has come as far as asked, within the tolerance; energy is what it is about."""
        error = self._way_missed(run, brief)
        return Score(error, error >= -self.tolerance and not run.ended, energy(run))


def _reference(name: str, brief: Brief, asked: float, flow: FlowPulse | None) -> Controller:
    """What a controller of speed is judged against."""
    if name == "knowing":
        return KeepCourse(brief.lab, brief.speed, brief.duty, asked, knowing=True, flow=flow, carried=brief.carried)
    return Steady(brief.schedule[1] if name == "open-loop" else brief.duty)


def _path(run: LoopRun) -> tuple[Samples, Samples]:
    """Times, s, and places along the tube, m."""
    return (
        np.array([moment.time for moment in run.moments]),
        np.array([moment.pose.position[0] for moment in run.moments]),
    )


def _mean_speed(plant: Plant, duty: float, duration: float, progress: Progress | None) -> float:
    """Mean speed of a robot from rest at a duty, m/s.

    Raises:
        InputError: if it does not last so long.
    """
    other, count = plant.copy(), int(np.ceil(duration / _STEP))
    moment = other.observe()
    start = float(moment.pose.position[0])
    for number in range(count):
        moment = uninterrupted(other.step(duration / count, duty=duty))
        if progress is not None:
            progress("robot as its file says", number + 1, count)
        if moment.ended:
            raise InputError(
                f"task.duration = {duration:g} s: {moment.ended} after {moment.time:.4g} s; allowed: a shorter time"
            )
    return (float(moment.pose.position[0]) - start) / duration
