"""Definition of a task (goal, controllers, score of a run), and scores of controllers over many runs.

Shares have Wilson's interval (Wilson 1927), means the bias-corrected bootstrap's (Efron 1987). The differences to the
task's own controller are of runs with the same robot, flow and errors of sensors: common random numbers.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from spirillum.answer_entries import content_of
from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab
from spirillum.controllers.learning import Learner, Learning
from spirillum.controllers.loop import LoopRun, run_loop
from spirillum.controllers.sensors import Controller, FlowPulse, SampledErrors, Senses, draw, plant_of
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.envelope import quantity
from spirillum.progress import Progress
from spirillum.robot.arguments import Options, within
from spirillum.robot.fields import Time
from spirillum.robot.robot import Robot

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
    duration: float  #: Of a run, s.
    speed: float  #: Predicted at the robot's own duty, m/s, with its sign.
    duty: float  #: The robot's own.
    schedule: tuple[float, float]  #: Of the open loop: until when it is on, s, and at which duty.
    carried: float  #: Displacement of the robot over that of the mean flow that carries it.

    @property
    def direction(self) -> float:
        """1 or -1, along which the robot swims."""
        return float(np.sign(self.speed))


@dataclass(frozen=True)
class Score:
    """How a run did; SI."""

    error: float  #: What the task judges by.
    good: bool  #: Whether it is good enough.
    energy: float  #: From the battery's terminals (without a motor: of the drive), J.


class Task(Options, argument="task", prefixed=True):
    """What a robot has to do."""

    kind: ClassVar[str]
    error_name: ClassVar[str]  #: What `Score.error` is, in words.
    error_unit: ClassVar[str]  #: SI.
    across: ClassVar[bool] = False  #: Whether it concerns the distance from the tube's axis, not the position along it.

    duration: Annotated[Time, within(0.1, _LONGEST, "s")] | None = None
    """Of a run; None: from the speed that is predicted."""

    @abstractmethod
    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> Brief:
        """Check the task against a robot, and compute what its controllers have to know; refuse what it cannot do."""

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
    """Distance of the robot, its drive off, over that of a mean flow that carries it; 0 without a flow."""
    if not velocity or not duration:
        return 0.0
    moved = []
    for flow in (None, velocity):
        other = plant.copy()
        other.impose_flow(flow)
        moved.append(float(uninterrupted(other.step(duration, duty=0.0)).pose.position[0]))
    return (moved[1] - moved[0]) / (velocity * duration)


@dataclass(frozen=True)
class ControlJob:
    """Complete input of a run; a separate process can compute it."""

    robot: Robot
    plant: Mapping[str, Any]  #: Further arguments of `spirillum.Plant`.
    task: Task
    brief: Brief
    controller: str
    seed: int


@dataclass(frozen=True)
class Outcome:
    """The score of a run, and its sampled parameters."""

    controller: str
    seed: int
    score: Score
    drawn: SampledErrors
    ended: str  #: Why it ended before its time; empty if it did not.


def draw_plant(job: ControlJob) -> tuple[Plant, SampledErrors]:
    """The plant of a run, at rest at its start, and its sampled parameters."""
    lab = job.brief.lab
    drawn = draw(lab.unknown, lab.pulse, job.seed, job.brief.duration)
    return plant_of(job.robot, job.plant, drawn), drawn


def run_job(
    job: ControlJob,
    plant: Plant,
    drawn: SampledErrors,
    learner: Learner | None = None,
    *,
    senses: Senses | None = None,
    pace: Callable[[float], None] | None = None,
    progress: Progress | None = None,
) -> LoopRun:
    """The loop of a run."""
    lab, controller = job.brief.lab, job.task.controller(job.controller, job.brief, drawn.pulse)
    if learner is not None:
        controller = Learning(controller, learner)
    return run_loop(
        plant,
        controller,
        lab,
        job.brief.duration,
        seed=job.seed,
        senses=senses,
        flow=drawn.pulse,
        pace=pace,
        progress=progress,
    )


def outcome_of(job: ControlJob) -> Outcome:
    """Do a run for its score alone; an interrupt is raised again."""
    plant, drawn = draw_plant(job)
    run = run_job(job, plant, drawn)
    if run.interrupted:
        raise KeyboardInterrupt
    return Outcome(job.controller, job.seed, job.task.score(run, job.brief), drawn, run.ended)


_LEVEL = 0.95
_RESAMPLES = 2000


@dataclass(frozen=True)
class ControllerScore:
    """How a controller did over the seeds; each triple is value, low, high of a 95 % interval."""

    name: str
    runs: int
    good: tuple[float, float, float]  #: Share of good runs.
    error: tuple[float, float, float]  #: Mean size of the task's error, SI.
    energy: tuple[float, float, float]  #: Mean energy, J.
    against: tuple[float, float, float]  #: Mean size of this controller's error less that of the task's own, by runs.


@dataclass(frozen=True)
class Scores:
    """Controllers over the same seeds."""

    task: Task
    controllers: tuple[ControllerScore, ...]
    outcomes: tuple[Outcome, ...]  #: Every run, by controller and seed.

    @property
    def failed(self) -> tuple[int, ...]:
        """Seeds at which the task's own controller was not good enough."""
        return tuple(one.seed for one in self.outcomes if one.controller == FEEDBACK and not one.score.good)

    def to_dict(self) -> dict[str, Any]:
        """Scores as data: quantities with their intervals, and every run."""
        unit = self.task.error_unit
        return {
            "level": _LEVEL,
            "error": self.task.error_name,
            "controllers": {
                one.name: {
                    "meaning": CONTROLLERS[one.name],
                    "runs": one.runs,
                    "good": _with_interval(one.good, "1"),
                    "error": _with_interval(one.error, unit),
                    "energy": _with_interval(one.energy, "J"),
                    "error_beyond_feedback": _with_interval(one.against, unit),
                }
                for one in self.controllers
            },
            "failed_seeds": list(self.failed),
            "runs": [content_of(one, unit=unit) for one in self.outcomes],
        }


def scored(task: Task, outcomes: Sequence[Outcome]) -> Scores:
    """Sum up runs."""
    ordered = sorted(outcomes, key=lambda one: (list(CONTROLLERS).index(one.controller), one.seed))
    by_controller: dict[str, dict[int, Outcome]] = {}
    for outcome in ordered:
        by_controller.setdefault(outcome.controller, {})[outcome.seed] = outcome
    feedback = by_controller.get(FEEDBACK, {})
    scores = []
    for name, runs in by_controller.items():
        errors = {seed: abs(one.score.error) for seed, one in runs.items()}
        paired = [error - abs(feedback[seed].score.error) for seed, error in errors.items() if seed in feedback]
        scores.append(
            ControllerScore(
                name=name,
                runs=len(runs),
                good=_share([one.score.good for one in runs.values()]),
                error=_mean(np.array([*errors.values()])),
                energy=_mean(np.array([one.score.energy for one in runs.values()])),
                against=_mean(np.array(paired)),
            )
        )
    return Scores(task, tuple(scores), tuple(ordered))


def _share(good: Sequence[bool]) -> tuple[float, float, float]:
    from scipy.stats import binomtest

    interval = binomtest(sum(good), len(good)).proportion_ci(_LEVEL, method="wilson")
    return sum(good) / len(good), float(interval.low), float(interval.high)


def _mean(values: Samples) -> tuple[float, float, float]:
    """Mean with its interval; NaN where there are too few values or one has none."""
    from scipy.stats import bootstrap

    middle = float(np.mean(values)) if values.size else np.nan
    if values.size < 3 or not np.isfinite(values).all() or np.ptp(values) == 0.0:
        same = middle if values.size >= 3 and np.isfinite(middle) else np.nan
        return middle, same, same
    found = bootstrap((values,), np.mean, confidence_level=_LEVEL, n_resamples=_RESAMPLES, rng=0).confidence_interval
    return middle, float(found.low), float(found.high)


def _with_interval(value: tuple[float, float, float], unit: str) -> dict[str, Any]:
    middle, low, high = (item if np.isfinite(item) else None for item in value)
    return quantity(middle, unit, low=low, high=high, kind="interval")
