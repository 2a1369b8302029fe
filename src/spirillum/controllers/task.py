"""What a task is: what it asks of a robot, which controllers it has, and how a run is judged."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator

from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.robot.arguments import Options, refusal
from spirillum.robot.fields import Time

__all__ = ["CONTROLLERS", "FEEDBACK", "Brief", "Score", "Task", "carried_by_flow", "energy", "positive"]

FEEDBACK = "feedback"
CONTROLLERS = {
    FEEDBACK: "the task's controller",
    "nothing": "does nothing: the drive stays as the task finds it",
    "open-loop": "commands computed beforehand for the robot as its file says, without a look",
    "knowing": "knows place, speed and coming flow without error",
}
"""Controllers of every task: the one that it is about, and those that it is judged against."""
_LONGEST = 24.0 * 3600.0


def _length(value: float) -> float:
    if not 0.1 <= value <= _LONGEST:
        raise refusal(f"= {value:g} s; allowed: 0.1 to {_LONGEST:g} s")
    return value


def positive(value: float, unit: str) -> float:
    """A check of values above 0; `unit` is for the sentence of an error."""
    if not value > 0.0:
        raise refusal(f"= {value:g} {unit}; allowed: above 0 {unit}")
    return value


@dataclass(frozen=True)
class Brief:
    """What is worked out once for all runs of a task, from the robot as its file says; SI."""

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
    """What the task judges by; NaN if the run has none."""
    good: bool
    """Whether it is good enough."""
    energy: float
    """From the battery's terminals (without a motor: of the drive), J."""


class Task(Options):
    """What is asked of a robot."""

    argument: ClassVar[str] = "task"
    prefixed: ClassVar[bool] = True
    kind: ClassVar[str]
    error_name: ClassVar[str]
    """What `Score.error` is, in words."""
    error_unit: ClassVar[str]
    """SI."""

    duration: Annotated[Time | None, AfterValidator(lambda value: value if value is None else _length(value))] = None
    """Of a run; None: from the speed that is predicted."""

    @abstractmethod
    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> Brief:
        """Check the task against a robot, and work out what its controllers have to know.

        Raises:
            InputError: if the robot cannot be asked that.
        """

    @abstractmethod
    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:
        """A new controller by its name in `CONTROLLERS`; only `knowing` looks at the flow."""

    @abstractmethod
    def score(self, run: LoopRun, brief: Brief) -> Score:
        """Judge a run."""

    @abstractmethod
    def target(self, time: Samples, way: float) -> tuple[Samples, float]:
        """For figures: the place that is aimed at, m, (n,), by a robot that swims along `way`, and what is good, m."""


def energy(run: LoopRun) -> float:
    """Energy that a run took, J."""
    values = run.moments[-1].values
    return float(values.get("electrical_energy", values["drive_energy"]))


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
