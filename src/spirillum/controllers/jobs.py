"""One controlled run after another: the robot that a seed draws, the loop, and its score."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from spirillum.controllers.loop import LoopRun, run_loop
from spirillum.controllers.sensors import Drawn, drawn
from spirillum.controllers.task import Brief, Score, Task
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant
from spirillum.errors import InputError
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.seat import gap_of

__all__ = ["Job", "Outcome", "begun", "done", "finished", "named", "plant_of"]


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
    friction: float
    """Factor of the friction that was drawn."""
    gap: float
    """Factor of the gap that was drawn."""
    ended: str
    """Why it ended before its time; empty if it did not."""


def plant_of(robot: Robot, arguments: Mapping[str, Any], found: Drawn, progress: Progress | None = None) -> Plant:
    """The robot that a run has drawn, at rest where it starts.

    Args:
        robot: as its file says.
        arguments: further arguments of `spirillum.Plant`.
        found: what was drawn.
        progress: told how far a table is that has to be made.

    Raises:
        InputError: for wrong arguments, or a friction or gap factor where there is nothing to multiply.
    """
    arguments = dict(arguments)
    if found.gap != 1.0:
        if robot.channel is None:
            raise InputError("unknown.gap_factor is given for a robot without a channel; allowed: 1")
        placed = Placement.of(arguments.get("placement"))
        if placed.eccentricity is not None:
            raise InputError(
                "unknown.gap_factor is given together with an eccentricity; allowed: a gap, or a factor of 1"
            )
        own = gap_of(placed, robot.body.diameter, 0.5 * robot.channel.diameter)
        arguments["placement"] = placed.model_copy(update={"gap": own * found.gap})
    if found.friction != 1.0:
        robot = _rubbing(robot, found.friction)
    return Plant(robot, **arguments, progress=progress)


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
    return Outcome(job.controller, job.seed, job.task.score(run, job.brief), found.friction, found.gap, run.ended)


def done(job: Job, plant: Plant, found: Drawn, **told: Any) -> LoopRun:
    """The loop of a run.

    Args:
        job: the run.
        plant: its robot; it is moved.
        found: what was drawn for it.
        told: `pace` and `progress` of `run_loop`.
    """
    controller = job.task.controller(job.controller, job.brief, found.pulse)
    return run_loop(plant, controller, job.brief.lab, job.brief.duration, seed=job.seed, flow=found.pulse, **told)


def _rubbing(robot: Robot, factor: float) -> Robot:
    """A robot with another friction."""
    own = robot.friction.effective
    if own is None and robot.motor is not None:
        own = robot.motor.joint_rotor_friction
    if not own:
        raise InputError(
            f"unknown.friction_factor is given, but {robot.name} has no friction; allowed: a factor of 1, or a "
            "friction.effective"
        )
    return robot.model_copy(update={"friction": robot.friction.model_copy(update={"effective": factor * own})})


def named(job: Job, controller: str, seed: int) -> Job:
    """The same run by another controller or from another seed."""
    return replace(job, controller=controller, seed=seed)
