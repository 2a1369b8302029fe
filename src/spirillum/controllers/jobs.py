"""One controlled run after another: the robot that a seed draws, the loop, and its score."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from spirillum.controllers.drawn_plant import plant_of
from spirillum.controllers.learner import Learner, Learning
from spirillum.controllers.loop import LoopRun, run_loop
from spirillum.controllers.sensors import Drawn, drawn
from spirillum.controllers.task import Brief, Score, Task
from spirillum.dynamics.plant import Plant
from spirillum.robot.robot import Robot

__all__ = ["Job", "Outcome", "begun", "done", "finished", "named"]


@dataclass(frozen=True)
class Job:
    """All that a run follows from; a process of its own can do it."""

    robot: Robot
    plant: Mapping[str, Any]
    """Further arguments of `spirillum.Plant`."""
    task: Task
    brief: Brief
    controller: str
    seed: int


@dataclass(frozen=True)
class Outcome:
    """What came of a run."""

    controller: str
    seed: int
    score: Score
    drawn: Drawn
    """What was drawn for it."""
    ended: str
    """Why it ended before its time; empty if it did not."""


def begun(job: Job) -> tuple[Plant, Drawn]:
    """The plant of a run, and what was drawn for it."""
    lab = job.brief.lab
    found = drawn(lab.unknown, lab.pulse, job.seed, job.brief.duration)
    return plant_of(job.robot, job.plant, found), found


def finished(job: Job) -> Outcome:
    """Do a run for its score alone."""
    plant, found = begun(job)
    run = done(job, plant, found)
    if run.interrupted:
        raise KeyboardInterrupt
    return Outcome(job.controller, job.seed, job.task.score(run, job.brief), found, run.ended)


def done(job: Job, plant: Plant, found: Drawn, learner: Learner | None = None, **told: Any) -> LoopRun:
    """The loop of a run.

    Args:
        job: the run.
        plant: its robot; it is moved.
        found: what was drawn for it.
        learner: learns beside the controller.
        told: `pace` and `progress` of `run_loop`.
    """
    controller = job.task.controller(job.controller, job.brief, found.pulse)
    if learner is not None:
        controller = Learning(controller, learner)
    return run_loop(plant, controller, job.brief.lab, job.brief.duration, seed=job.seed, flow=found.pulse, **told)


def named(job: Job, controller: str, seed: int) -> Job:
    """The same run by another controller or from another seed."""
    return replace(job, controller=controller, seed=seed)
