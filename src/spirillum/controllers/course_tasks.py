"""The tasks of speed: `hold-speed`, `ride-out` and `save-battery`.

Controllers of speed: by PWM at a set speed, along a course through pulses of flow, and with the remote alone.
The position filter (`spirillum.controllers.estimators`) gives position x, speed s at full duty and drift w of the
fluid; v is the set speed, t the time, d = 1 or -1 the robot's way.

`KeepCourse`, place by a cascade whose inner loop inverts the robot as it is estimated, drift included, for a course r:

    u = sat((d v + (r - x) / T - w) / s),   dr/dt = d v,   T = 3 s.

On a leash it holds the speed, not the course: r is held within l of x (conditional integration, Astrom and Hagglund
2006), so that a way that a pulse of flow took is not made up for beyond a share l / (T v) of the speed. The residual
r - x is the integral of the speed's error: a robot that slows down evenly is followed without one.

`SaveBattery`, a relay around the course, for a remote that knows on and off: on below d v t - h, off above d v t + h.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator

from spirillum.arrays import Samples
from spirillum.controllers.estimators import PositionController
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun
from spirillum.controllers.sensors import Controller, FlowPulse, Message
from spirillum.controllers.task import FEEDBACK, Brief, Task, carried_by_flow
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.errors import InputError
from spirillum.progress import Progress, tell
from spirillum.robot.arguments import refusal
from spirillum.robot.fields import Length, Velocity
from spirillum.units import show

_CATCH_UP = 3.0  # T, s
LEASH = 0.3  #: l / (T v) of a controller that holds a speed.
_WALK, _DRIFT = 0.05, 3e-5
"""Of the follower. Where the duty changes little, s and w show in the same way: a w that may be large would take what
belongs to s, and forget it."""
_SLOWEST = 0.05  # the estimated speed at full duty counts as at least this share of the predicted one
_EXACT = {"camera": {"position_noise": 1e-6, "position_wander": 0.0}}


class _CourseController(PositionController):
    """A controller of a course, whose speed changes little."""

    def __init__(self, lab: Lab, speed: float, duty: float, *, knowing: bool = False) -> None:
        seen = lab if not knowing else Lab.of(_EXACT).model_copy(update={"remote": lab.remote})
        super().__init__(seen, speed, duty, knowing=knowing, walk=_WALK, drift=_DRIFT)

    def _follow(self, news: Message) -> Samples:
        """See `PositionController`; the speed counts as at least a share of the predicted one."""
        ahead = super()._follow(news)
        ahead[1] = self._way * max(self._way * ahead[1], _SLOWEST * abs(self._full))
        return ahead


class KeepCourse(_CourseController):
    """A course at a set speed, by PWM; bounded, it holds the speed and gives up what a pulse of flow took."""

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
        super().__init__(lab, speed, duty, knowing=knowing)
        self._set_speed, self._flow, self._carried = self._way * set_speed, flow, carried
        self._leash, self._course, self._until = leash * _CATCH_UP * set_speed, 0.0, 0.0

    def decide(self, news: Message) -> float:
        """Duty that returns to the course within T, for the estimated robot."""
        ahead, acts = self._follow(news), news.time + self._delay
        self._course += self._set_speed * (acts - self._until)
        self._course, self._until = float(np.clip(self._course, ahead[0] - self._leash, ahead[0] + self._leash)), acts
        drift = ahead[2]
        if self._flow is not None and self._flow.start <= acts <= self._flow.end:
            drift = self._carried * self._flow.velocity
        unlimited = (self._set_speed + (self._course - ahead[0]) / _CATCH_UP - drift) / ahead[1]
        return self._sent(news, float(np.clip(unlimited, 0.0, 1.0)))


class SaveBattery(_CourseController):
    """A course at a set mean speed, with a remote that knows on and off."""

    def __init__(
        self, lab: Lab, speed: float, duty: float, set_speed: float, band: float, *, knowing: bool = False
    ) -> None:
        super().__init__(lab, speed, duty, knowing=knowing)
        self._set_speed, self._band = set_speed, band
        self._on = True

    def decide(self, news: Message) -> float:
        """On where the robot has fallen behind, off where it is ahead."""
        ahead = self._follow(news)
        left = self._set_speed * (news.time + self._delay) - self._way * ahead[0]
        self._on = left > (-self._band if self._on else self._band)
        return self._sent(news, self._duty if self._on else 0.0)


class Steady(Controller):
    """Open loop: a duty throughout, or on for a share of each cycle."""

    blind = True

    def __init__(self, duty: float, *, share: float = 1.0, cycle: float = 5.0) -> None:
        self._duty, self._share, self._cycle = duty, share, cycle

    def decide(self, news: Message) -> float:
        """The duty in the first part of each cycle, off in the rest."""
        return self._duty if (news.time / self._cycle) % 1.0 < self._share else 0.0


_DURATION = 40.0  # of a run, s
_FAR = 3.0  # multiple of the speed of the held robot that no run reaches
_STEP = 0.5  # step of the runs by which the open loop is found, s
_SPEED_OVER = 2.0  # time over which a speed is taken, s
_WITHIN = 0.05  # relative error of a speed that is good
_BAND = 5e-4  # half the width of the band around the course: what is good in `ride-out`, m
_RELAY = 0.4  # half the width of the relay's band over the tolerance


def _check_forward(speed: float) -> float:
    if not speed > 0.0:
        raise refusal(f"= {speed:g} m/s; allowed: above 0 m/s")
    return speed


class _CourseTask(Task):
    """What the tasks of speed share."""

    leash: ClassVar[float] = np.inf  #: See `KeepCourse`: whether the displacement by a pulse of flow is recovered.

    speed: Annotated[Velocity, AfterValidator(_check_forward)] | None = None
    """Speed along the robot's path. It has to be given."""

    @property
    def set_speed(self) -> float:
        """`speed`, m/s."""
        if self.speed is None:
            raise InputError("task.speed is missing; allowed: a speed, such as 0.1 mm/s")
        return self.speed

    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> Brief:
        """Check that the robot of the file swims so fast, and find the duty at which it does."""
        asked = self.set_speed  # before anything is run
        duration = _DURATION if self.duration is None else self.duration
        speed, full_duty = float(plant.steady.forward_velocity), plant.state.command
        way = float(np.sign(speed))
        if asked > _FAR * abs(speed):  # before the robot is followed, which takes seconds
            raise InputError(
                f"task.speed = {show(asked, 'mm/s')}; allowed: below {show(abs(speed), 'mm/s')}, the robot's speed "
                "held at its pose"
            )
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
    error_name: ClassVar[str] = "median speed of the second half less that requested"
    error_unit: ClassVar[str] = "m/s"
    leash: ClassVar[float] = LEASH

    def _error(self, run: LoopRun, brief: Brief) -> float:
        time, place = run.time, run.position[:, 0]
        starts = np.arange(0.5 * brief.duration, brief.duration - _SPEED_OVER, 0.25)
        ways = np.interp(starts + _SPEED_OVER, time, place) - np.interp(starts, time, place)
        return float(np.median(brief.direction * ways / _SPEED_OVER)) - self.set_speed

    def _is_good(self, error: float) -> bool:
        return abs(error) <= _WITHIN * self.set_speed


class RideOutTask(_CourseTask):
    """Keep a course at a speed through a pulse of flow, by PWM."""

    kind: ClassVar[str] = "ride-out"
    error_name: ClassVar[str] = "distance from the course at the end"
    error_unit: ClassVar[str] = "m"

    tolerance: Length = _BAND  #: How far from the course is good.

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:
        """The course, and the tolerance around it."""
        return super().target(time, way)[0], self.tolerance

    def _error(self, run: LoopRun, brief: Brief) -> float:
        time, place = run.time, run.position[:, 0]
        travelled = float(np.interp(brief.duration, time, place) - place[0])
        return brief.direction * travelled - self.set_speed * brief.duration

    def _is_good(self, error: float) -> bool:
        return abs(error) <= self.tolerance


class SaveBatteryTask(RideOutTask):
    """Cover a distance in a time with as little from the battery as a remote that knows on and off allows.

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


def _mean_speed(plant: Plant, duty: float, duration: float, progress: Progress | None) -> float:
    """Mean speed of a robot from rest at a duty, m/s."""
    other, count = plant.copy(), int(np.ceil(duration / _STEP))
    moment = other.observe()
    start = float(moment.pose.position[0])
    for number in range(count):
        moment = uninterrupted(other.step(duration / count, duty=duty))
        tell(progress, "robot as its file says", number + 1, count)
        if moment.ended:
            raise InputError(
                f"task.duration = {duration:g} s: {moment.ended} after {moment.time:.4g} s; allowed: a shorter time"
            )
    return (float(moment.pose.position[0]) - start) / duration
