"""The tasks of speed: `hold-speed`, `ride-out` and `save-battery`."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator

from spirillum.arrays import Samples
from spirillum.controllers.course import LEASH, KeepCourse, SaveBattery, Steady
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller
from spirillum.controllers.task import FEEDBACK, Brief, Task, carried_by_flow
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.errors import InputError
from spirillum.robot.arguments import refusal
from spirillum.robot.fields import Length, Velocity
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
_BAND = 5e-4
"""Half the width of the band around the course: what is good in `ride-out`, m."""
_RELAY = 0.4
"""Half the width of the relay's band over the tolerance."""


def _check_forward(speed: float) -> float:
    if not speed > 0.0:
        raise refusal(f"= {speed:g} m/s; allowed: above 0 m/s")
    return speed


class _CourseTask(Task):
    """What the tasks of speed share."""

    leash: ClassVar[float] = np.inf
    """See `KeepCourse`: whether the way that a pulse of flow took is made up for."""

    speed: Annotated[Velocity, AfterValidator(_check_forward)] | None = None
    """Speed along the robot's way. It has to be given."""

    @property
    def set_speed(self) -> float:
        """`speed`, m/s.

        Raises:
            InputError: if it is not given.
        """
        if self.speed is None:
            raise InputError("task.speed is missing; allowed: a speed, such as 0.1 mm/s")
        return self.speed

    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> Brief:
        """Check that the robot of the file swims so fast, and find the duty at which it does."""
        asked = self.set_speed  # before anything is run
        duration = _DURATION if self.duration is None else self.duration
        speed, full_duty = float(plant.steady.forward_velocity), plant.state.command
        way = float(np.sign(speed))
        fastest = way * _mean_speed(plant, full_duty, duration, progress)
        if not asked < fastest:
            raise InputError(
                f"task.speed = {show(asked, 'mm/s')}; allowed: below {show(fastest, 'mm/s')}, the mean of "
                f"{duration:g} s at the robot's own duty"
            )
        share = asked / fastest
        slower = way * _mean_speed(plant, share * full_duty, duration, progress)
        power = np.log(slower / fastest) / np.log(share) if 0.0 < slower < fastest else 1.0
        return Brief(
            lab=lab,
            duration=duration,
            speed=speed,
            duty=full_duty,
            schedule=(share, float(min(full_duty * share ** (1.0 / power), 1.0))),
            carried=carried_by_flow(plant, lab.pulse.velocity, lab.pulse.duration),
        )

    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:
        """A new controller; doing nothing leaves the drive on."""
        if name in (FEEDBACK, "knowing"):
            return self._closed(brief, flow, knowing=name == "knowing")
        return Steady(brief.schedule[1] if name == "open-loop" else brief.duty)

    def _closed(self, brief: Brief, flow: FlowPulse | None, *, knowing: bool) -> Controller:
        """The task's own controller, or the one that knows the robot and the flow."""
        return KeepCourse(
            brief.lab,
            brief.speed,
            brief.duty,
            self.set_speed,
            leash=self.leash,
            knowing=knowing,
            flow=flow if knowing else None,
            carried=brief.carried,
        )

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:
        """The course."""
        return way * self.set_speed * time, _BAND


class HoldSpeedTask(_CourseTask):
    """Hold a speed by PWM: good within 5 %. Speeds are over 2 s, so that turns of the tail and a pulse do not count."""

    kind: ClassVar[str] = "hold-speed"
    error_name: ClassVar[str] = "median speed of the second half less that asked for"
    error_unit: ClassVar[str] = "m/s"
    leash: ClassVar[float] = LEASH

    def _error(self, run: LoopRun, brief: Brief) -> float:
        time, place = _path(run)
        starts = np.arange(0.5 * brief.duration, brief.duration - _SPEED_OVER, 0.25)
        ways = np.interp(starts + _SPEED_OVER, time, place) - np.interp(starts, time, place)
        return float(np.median(brief.way * ways / _SPEED_OVER)) - self.set_speed

    def _is_good(self, error: float) -> bool:
        return abs(error) <= _WITHIN * self.set_speed


class RideOutTask(_CourseTask):
    """Keep a course at a speed through a pulse of flow, by PWM."""

    kind: ClassVar[str] = "ride-out"
    error_name: ClassVar[str] = "distance from the course at the end"
    error_unit: ClassVar[str] = "m"

    tolerance: Length = _BAND
    """How far from the course is good."""

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:
        """The course, and the tolerance around it."""
        return super().target(time, way)[0], self.tolerance

    def _error(self, run: LoopRun, brief: Brief) -> float:
        time, place = _path(run)
        travelled = float(np.interp(brief.duration, time, place) - place[0])
        return brief.way * travelled - self.set_speed * brief.duration

    def _is_good(self, error: float) -> bool:
        return abs(error) <= self.tolerance


class SaveBatteryTask(RideOutTask):
    """Go a way in a time with as little from the battery as a remote that knows on and off allows.

    A run is good if the robot has come as far as the course, within the tolerance; further does not count against it.
    """

    kind: ClassVar[str] = "save-battery"

    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:
        """A new controller; doing nothing leaves the drive on."""
        if name == "open-loop":
            return Steady(brief.duty, share=brief.schedule[0])
        return super().controller(name, brief, flow)

    def _closed(self, brief: Brief, flow: FlowPulse | None, *, knowing: bool) -> Controller:  # noqa: ARG002
        band = _RELAY * self.tolerance
        return SaveBattery(brief.lab, brief.speed, brief.duty, self.set_speed, band, knowing=knowing)

    def _is_good(self, error: float) -> bool:
        return error >= -self.tolerance


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
