"""Definition of a task: goal, controllers, and score of a run."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.robot.arguments import Options, within
from spirillum.robot.fields import Time

FEEDBACK = "feedback"
CONTROLLERS = {
    FEEDBACK: "the task's controller",
    "nothing": "does nothing: the drive stays as the task finds it",
    "open-loop": "commands computed beforehand for the robot as its file says, without a look",
    "knowing": "knows position, speed and coming flow without error",
}
"""Controllers of every task: its own, and the baselines."""
_LONGEST = 24.0 * 3600.0


@dataclass(frozen=True)
class Brief:
    """Values computed once for all runs of a task, from the robot of the file; SI."""

    lab: Lab
    duration: float
    """Of a run, s."""
    speed: float
    """Predicted at the robot's own duty, m/s, with its sign."""
    duty: float
    """The robot's own."""
    schedule: tuple[float, float]
    """Of the open loop: until when it is on, s, and at which duty."""
    carried: float
    """Way of the robot over the way of the mean flow that carries it."""

    @property
    def way(self) -> float:
        """1 or -1, along which the robot swims."""
        return float(np.sign(self.speed))


@dataclass(frozen=True)
class Score:
    """How a run did; SI."""

    error: float
    """What the task judges by."""
    good: bool
    """Whether it is good enough."""
    energy: float
    """From the battery's terminals (without a motor: of the drive), J."""


class Task(Options):
    """What a robot has to do."""

    argument: ClassVar[str] = "task"
    prefixed: ClassVar[bool] = True
    kind: ClassVar[str]
    error_name: ClassVar[str]
    """What `Score.error` is, in words."""
    error_unit: ClassVar[str]
    """SI."""
    across: ClassVar[bool] = False
    """Whether it concerns the distance from the tube's axis, not the position along it."""

    duration: Annotated[Time, within(0.1, _LONGEST, "s")] | None = None
    """Of a run; None: from the speed that is predicted."""

    @abstractmethod
    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> Brief:
        """Check the task against a robot, and compute what its controllers have to know.

        Raises:
            InputError: if the robot cannot do it.
        """

    @abstractmethod
    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:
        """A new controller by its name in `CONTROLLERS`; only `knowing` looks at the flow."""

    def score(self, run: LoopRun, brief: Brief) -> Score:
        """Judge a run; one that ended before its time is not good."""
        error = self._error(run, brief)
        return Score(error, self._is_good(error) and not run.ended, run.energy)

    @abstractmethod
    def _error(self, run: LoopRun, brief: Brief) -> float:
        """Error of a run, in `error_unit`."""

    @abstractmethod
    def _is_good(self, error: float) -> bool:
        """Whether an error is small enough."""

    @abstractmethod
    def target(self, time: Samples, way: float) -> tuple[Samples, float]:
        """For figures: the target position, m, (n,), of a robot on a trajectory `way`, and the tolerance, m."""


def carried_by_flow(plant: Plant, velocity: float, duration: float) -> float:
    """Way of the robot, its drive off, over that of a mean flow that carries it; 0 without a flow.

    Args:
        plant: the robot where it starts; it is not moved.
        velocity: mean flow, m/s.
        duration: how long it lasts, s.
    """
    if not velocity or not duration:
        return 0.0
    moved = []
    for flow in (None, velocity):
        other = plant.copy()
        other.impose_flow(flow)
        moved.append(float(uninterrupted(other.step(duration, duty=0.0)).pose.position[0]))
    return (moved[1] - moved[0]) / (velocity * duration)
