"""One controlled run from its job: the robot that its seed draws, the loop, and the score."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from spirillum.controllers.drawn_plant import plant_of
from spirillum.controllers.learner import Learner, Learning
from spirillum.controllers.loop import LoopRun, run_loop
from spirillum.controllers.sensors import SampledErrors, Senses, draw
from spirillum.controllers.task import Brief, Score, Task
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant
from spirillum.robot.robot import Robot


@dataclass(frozen=True)
class ControlJob:
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
    """The score of a run, and what it had drawn."""

    controller: str
    seed: int
    score: Score
    drawn: SampledErrors
    ended: str
    """Why it ended before its time; empty if it did not."""


def draw_plant(job: ControlJob) -> tuple[Plant, SampledErrors]:
    """The plant of a run, at rest where it starts, and what was drawn for it."""
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
    """The loop of a run.

    Args:
        job: the run.
        plant: its robot; it is moved.
        drawn: what was drawn for it.
        learner: learns beside the controller.
        senses: camera, meter and remote in place of the modelled ones.
        pace: told the time of each decision before it is taken, s; it may wait.
        progress: told what is being computed, how much is done, and of how much.
    """
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
    """Do a run for its score alone.

    Raises:
        KeyboardInterrupt: if the run was interrupted.
    """
    plant, drawn = draw_plant(job)
    run = run_job(job, plant, drawn)
    if run.interrupted:
        raise KeyboardInterrupt
    return Outcome(job.controller, job.seed, job.task.score(run, job.brief), drawn, run.ended)
