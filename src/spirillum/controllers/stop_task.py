"""The task `stop-at`: go to a place and stop there."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller
from spirillum.controllers.stopping import KnowingStop, StopAt, Timed
from spirillum.controllers.task import FEEDBACK, Brief, Task, carried_by_flow
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.dynamics.start import reach_of
from spirillum.errors import InputError
from spirillum.robot.fields import Length, SignedLength
from spirillum.units import show

__all__ = ["StopAtTask"]

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
        """`at`, m.

        Raises:
            InputError: if it is not given.
        """
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
            return StopAt(brief.lab, brief.speed, brief.duty, self.goal, self.tolerance)
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
