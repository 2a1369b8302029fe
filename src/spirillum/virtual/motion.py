"""The motion that a virtual trial shows: a model's steady swimming, prescribed rates, or a run."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note
from spirillum.progress import Progress
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import gap_of
from spirillum.swimming.motions import ASSUMPTION, HELD, RELEASED
from spirillum.swimming.preparation import AUTO, WALLED, choose_model
from spirillum.virtual.optics import tube_height
from spirillum.virtual.trajectory import TrialTrajectory, lab_to_camera, run_trajectory, steady_trajectory
from spirillum.virtual.trial_options import CameraOptions, MotionOptions, TrialOptions

if TYPE_CHECKING:
    import xarray as xr

_USUAL = 20.0  # length of a video of steady swimming, s
_LARGEST_STEP = 0.5 * np.pi
"""Largest turn of the tail between two samples of a run above which a video states that it interpolates, rad."""


@dataclass(frozen=True)
class TrialMotion:
    """A trajectory and its source."""

    trajectory: TrialTrajectory
    model: str  #: Model, `prescribed`, or both; of a run `run` and its model.
    warnings: tuple[Note, ...] = ()
    reason: str = ""  #: Why the model was taken; empty where it was named.
    motion: str = HELD  #: `held`, `trial`, `run`, or `prescribed`.
    assumption: str = ""  #: What the motion rests on, of a robot released in its tube.


def steady_rates(
    robot: Robot, motion: MotionOptions, default_model: str = AUTO, placement: Placement | None = None
) -> tuple[dict[str, float], str, tuple[Note, ...], str]:
    """Rates by name, SI, prescribed or a model's, with their source, notes, and why the model was chosen."""
    given = {
        "forward_velocity": motion.forward_velocity,
        "body_rotation_rate": motion.body_rate,
        "tail_rotation_rate": motion.tail_rate,
    }
    fixed = {name: value for name, value in given.items() if value is not None}
    if len(fixed) == len(given):
        if motion.friction is not None or motion.model not in (None, AUTO):
            idle = "model" if motion.friction is None else "friction"
            raise InputError(
                f"{idle} = {str(getattr(motion, idle))[:40]!r} with a prescribed forward velocity, body and tail rate, "
                "which determine the motion; allowed: at most two of them"
            )
        return fixed, "prescribed", (), ""
    from spirillum.swimming.prediction import predict_steady

    choice = choose_model(motion.model or default_model, robot, placement=placement)
    steady = predict_steady(
        robot,
        model=choice.model,
        tail_rate=motion.tail_rate,
        friction=motion.friction,
        placement=placement if find_swimmer_model(choice.model).placed else None,
        band=False,
    )
    found = {name: float(getattr(steady, name)) for name in given} | fixed
    prescribed = [name for name in fixed if name != "tail_rotation_rate"]
    source = f"{choice.model}, prescribed: {', '.join(prescribed)}" if prescribed else choice.model
    notes = steady.warnings
    if "forward_velocity" not in fixed and robot.channel is not None and not find_swimmer_model(choice.model).placed:
        notes += (Note.named("film-without-walls", model=choice.model, walled=WALLED),)
    return found, source, notes, choice.reason


def motion_of(robot: Robot, motion: MotionOptions, trial: TrialOptions, camera: CameraOptions) -> TrialMotion:
    """Steady swimming in a trial."""
    room = _clearance(robot)
    if trial.wobble > room:
        most = f"0 to {1e3 * room:.4g} mm, the room in the channel"
        raise InputError(f"wobble = {1e3 * trial.wobble:.4g} mm; allowed: {most}")
    position = lab_to_camera(camera.view, leftwards=camera.leftwards) @ _resting_pose(robot, trial.gap, trial.lateral)
    placement = None if trial.gap is None else Placement.of({"gap": trial.gap, "pitch": 0.0})
    rates, source, warnings, reason = steady_rates(robot, motion, placement=placement)
    trajectory = steady_trajectory(
        _USUAL if trial.duration is None else trial.duration,
        **rates,
        position=position + np.array([0.0, 0.0, tube_height(robot, camera.view)]),
        heading=trial.heading,
        wobble=trial.wobble,
        body_angle=trial.body_angle,
        tail_phase=trial.tail_phase,
    )
    return TrialMotion(trajectory, source, warnings, reason, "prescribed" if source == "prescribed" else HELD)


def motion_of_trial(
    robot: Robot,
    motion: MotionOptions,
    trial: TrialOptions,
    camera: CameraOptions,
    progress: Progress | None = None,
) -> TrialMotion:
    """The motion of a trial in the robot's tube, as `spirillum.simulate` has it by its defaults."""
    from spirillum.dynamics.simulation import simulate

    choice = choose_model(motion.model or AUTO, robot)
    if choice.model != WALLED:
        raise InputError(
            f"run = 'trial' with model '{choice.model}', which has no walls to rest on; allowed: a robot in a channel "
            f"with model '{WALLED}'"
        )
    given = [name for name in ("forward_velocity", "body_rate", "tail_rate") if getattr(motion, name) is not None]
    if given:
        raise InputError(f"{given[0]} with run = 'trial', which follows from the drive; allowed: one of them")
    run = simulate(
        robot,
        model=WALLED,
        friction=motion.friction,
        timing={} if trial.duration is None else {"duration": trial.duration},
        placement=None if trial.gap is None else {"gap": trial.gap},
        progress=progress,
    )
    return replace(motion_of_run(robot, run, trial, camera), motion=RELEASED, reason=choice.reason)


def motion_of_run(robot: Robot, run: xr.Dataset, trial: TrialOptions, camera: CameraOptions) -> TrialMotion:
    """The motion of a run."""
    from spirillum.dynamics.run_file import robot_of

    own = robot_of(run)
    if own != robot:
        raise InputError(f"the run's robot {own.name!r} is not {robot.name!r}; allowed: the robot of the run")
    level = float(_resting_pose(robot, None, 0.0)[2])  # for a run without a gap of its own
    axis = tube_height(robot, camera.view)
    trajectory = run_trajectory(run, camera.view, leftwards=camera.leftwards, axis=axis, level=level)
    model = str(run.attrs.get("model", ""))[:60]
    if trial.duration is not None:
        trajectory = trajectory.until(trial.duration)
    source = f"run, {model}" if model else "run"
    step = float(np.abs(np.diff(trajectory.tail_phase)).max())
    notes = (Note.named("interpolated-poses", angle=np.degrees(step)),) if step > _LARGEST_STEP else ()
    assumption = ASSUMPTION if "azimuth" in run and robot.channel is not None else ""
    return TrialMotion(trajectory, source, notes, motion="run", assumption=assumption)


def _clearance(robot: Robot) -> float:
    """Gap between the body on the channel's axis and the channel, m."""
    return math.inf if robot.channel is None else 0.5 * (robot.channel.diameter - robot.body.diameter)


def _resting_pose(robot: Robot, requested: float | None, lateral: float) -> Samples:
    """(3,) middle of the body in the channel's axes, low in the tube at a gap and a horizontal offset, m."""
    if robot.channel is None:
        return np.array([0.0, lateral, 0.0])
    room = _clearance(robot)
    gap = gap_of(Placement(), robot.body.diameter, 0.5 * robot.channel.diameter) if requested is None else requested
    if gap > room:
        raise InputError(f"gap = {1e3 * gap:.4g} mm; allowed: 0 to {1e3 * room:.4g} mm, where the body is on the axis")
    if abs(lateral) > room - gap:
        most = 1e3 * (room - gap)
        raise InputError(f"lateral = {1e3 * lateral:.4g} mm; allowed: at most {most:.4g} mm to either side at this gap")
    return np.array([0.0, lateral, -float(np.sqrt((room - gap) ** 2 - lateral**2))])
