"""Swimming in a tube in time: after release, with walls, film, contact, ends and flow."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.integration import INTERRUPTED, RANGE_LEFT, Checkpoint, Event, Reach, Trajectory, integrate
from spirillum.dynamics.record import dataset_of, free_attributes, tail_angle_of
from spirillum.dynamics.release import reach_of
from spirillum.dynamics.run_file import numbers_of
from spirillum.dynamics.timing import Switch, Timetable
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.errors import InputError
from spirillum.kernels import core
from spirillum.notes import Note
from spirillum.progress import Progress
from spirillum.swimming.prediction import Prediction

if TYPE_CHECKING:
    import xarray as xr

ENDS = {core.CLOSED: "closed", core.OPEN: "open", core.IMPOSED: "imposed flow"}  #: Ends of the channel in words.

_FEWEST = 2  # Moments of the shortest run.
_UNIT = 1e-6  # Error of a quaternion's length that is rounding.
_MOST = 1e9  # Largest number of a checkpoint that is taken, SI.
_ASIDE = 1e-3  # Largest distance of a checkpoint's position from the samples around it, beyond the path of the run, m.


def tube_run(
    steady: Prediction,
    robot: TubeRobot,
    start: Samples | xr.Dataset,
    times: Timetable,
    *,
    wait: float = 0.0,
    progress: Progress | None = None,
) -> xr.Dataset:
    """The run of a robot in its tube from a state, (19,), or from where an earlier one ended, with a `checkpoint`."""
    # Time 0 is when the remote may first switch the drive on. A robot that waits before, with its drive off, does so at
    # negative times, which the run does not hold: path, energies and angles count from time 0, and what happened while
    # it waited is among the events. A flow over time has the value of its first row until then.
    reach = reach_of(steady.robot)
    before: tuple[Event, ...] = ()
    moments = np.union1d(times.time, [switch.time for switch in times.switches])
    first: Samples | Checkpoint
    if isinstance(start, np.ndarray):
        first, before = _waited(robot, start, wait, reach, progress)
    else:
        first = _checkpoint(start)
        moments = np.append(float(start["time"][-1]), moments[moments > float(start["time"][-1])])
        if moments.size <= _FEWEST:
            raise InputError(
                f"the run already ends at t = {moments[0]:.6g} s, and less than {_FEWEST} samples lie between it and "
                f"{moments[-1]:.8g} s; allowed: a longer duration, to continue it"
            )
    run = integrate(robot, first, moments, times.switches, reach, progress)
    if run.time.size < _FEWEST:
        what = run.events[-1].what if run.events else "the equations have no next step"
        if isinstance(start, np.ndarray):
            raise InputError(f"the run ends where it starts: {what}; allowed: another start, or a longer channel")
        raise InputError(f"the run cannot be continued: {what}; allowed: a run that ended where it can go on")
    ended = float(run.time[-1])
    notes = [note for note in steady.warnings if note.code != "robot-floats"]  # its weight acts
    if ended < times.end:
        notes.append(Note.named("run-ended-early", ended=ended, end=times.end, what=run.events[-1].what))
    notes += times.notes
    title = f"Free swimming of {steady.robot.name} in its tube (six degrees of freedom)"
    attrs = free_attributes(steady, robot, run, reach, title, notes)
    ordered = sorted((*before, *run.events), key=lambda event: event.time)
    attrs |= {
        "roughness": robot.roughness,
        "friction_coefficient": float(robot.tube[core.TUBE_COEFFICIENT]),
        "sliding_speed": float(robot.tube[core.TUBE_SLIDING]),
        "ends": ENDS[int(robot.tube[core.TUBE_ENDS])],
        "wait": wait,
        "events": json.dumps([{"time": event.time, "what": event.what} for event in ordered]),
    }
    attrs["checkpoint"] = json.dumps(run.last._asdict())
    found = series_in_tube(run)
    if not isinstance(start, np.ndarray):
        last = start.isel(time=-1)
        begun = float(last["body_angle"] + last["tail_phase"] - last["tail_angle"])
        found["tail_angle"] = tail_angle_of(run.states, begun)
        turns = np.round((float(start["azimuth"][-1]) - found["azimuth"][0]) / (2.0 * np.pi))
        found["azimuth"] = found["azimuth"] + 2.0 * np.pi * turns
    dataset = dataset_of(steady, robot, run, times.switches, found, attrs)
    kept = np.isin(run.time, times.time) | (run.time == ended)
    return dataset if kept.all() else dataset.isel(time=kept)


def _waited(
    robot: TubeRobot, state: Samples, wait: float, reach: Reach, progress: Progress | None
) -> tuple[Samples, tuple[Event, ...]]:
    """The state after waiting with the drive off, and what happened meanwhile, at negative times."""
    if wait <= 0.0:
        return state, ()
    run = integrate(robot, state, np.array([-wait, 0.0]), [Switch(-wait, 0.0)], reach, progress)
    if run.time[-1] < 0.0 and not run.events[-1].what.startswith(RANGE_LEFT):
        if run.events[-1].what == INTERRUPTED:
            raise KeyboardInterrupt
        raise InputError(
            f"wait = {wait:g} s: {run.events[-1].what} after {wait + run.time[-1]:.4g} s; allowed: a shorter time"
        )
    found = run.states[-1].copy()
    found[core.STATE_POSITION], found[core.STATE_ROLL] = state[core.STATE_POSITION], 0.0
    found[core.STATE_CURRENT : core.STATE_SIZE] = 0.0
    return found, tuple(event for event in run.events if not event.what.startswith("duty"))


def _checkpoint(dataset: xr.Dataset) -> Checkpoint:
    """Where a run can be continued."""
    allowed = "allowed: a run in a tube as `spirillum simulate` wrote it"
    try:
        found = Checkpoint(**json.loads(str(dataset.attrs.get("checkpoint", ""))))
        time, step, state = float(found.time), float(found.step), np.array([float(value) for value in found.state])
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise InputError(f"the run has no checkpoint; {allowed}") from error
    if len(state) != core.STATE_SIZE:
        raise InputError(f"the run's checkpoint has {len(state)} numbers; allowed: {core.STATE_SIZE}")
    quaternion = state[core.STATE_ATTITUDE : core.STATE_PHASE]
    sound = np.isfinite([time, step, *state]).all() and abs(float(np.linalg.norm(quaternion)) - 1.0) < _UNIT
    within = 0.0 <= time <= float(dataset["time"][-1]) and step > 0.0 and np.abs(state).max() <= _MOST
    if not sound or not within or not _near(dataset, time, state):
        raise InputError(f"the run's checkpoint is not where the run ends; {allowed}")
    return Checkpoint(time, step, tuple(state.tolist()))


def _near(dataset: xr.Dataset, time: float, state: Samples) -> bool:
    """Whether a checkpoint's position is near that of the samples around it."""
    positions, times = numbers_of(dataset, "position", ("axis",), (3,)), numbers_of(dataset, "time")
    there = np.array([np.interp(time, times, along) for along in positions.T])
    way = np.ptp(positions, axis=0) + _ASIDE
    return bool(np.all(np.abs(state[core.STATE_POSITION : core.STATE_POSITION + 3] - there) <= way))


def series_in_tube(run: Trajectory) -> dict[str, Samples]:
    """What a run in a tube has beside that of any free run, by name, each (n,); SI."""
    seen, states = run.observed, run.states
    tail = seen[:, core.SEEN_TAIL_GAP]
    return {
        "offset": seen[:, core.SEEN_OFFSET],
        "azimuth": np.unwrap(seen[:, core.SEEN_AZIMUTH]),
        "wall_pitch": seen[:, core.SEEN_PITCH],
        "wall_yaw": seen[:, core.SEEN_YAW],
        "wall_gap": seen[:, core.SEEN_FILM],
        "tail_gap": np.where(np.isfinite(tail), tail, np.nan),
        "contact_force": seen[:, core.SEEN_CONTACT_FORCE],
        "contact_friction": seen[:, core.SEEN_CONTACT_FRICTION],
        "weight_load": seen[:, core.SEEN_WEIGHT_LOAD],
        "film_load": seen[:, core.SEEN_FILM_LOAD],
        "outer_load": seen[:, core.SEEN_OUTER_LOAD],
        "contact_load": seen[:, core.SEEN_CONTACT_LOAD],
        "lift": seen[:, core.SEEN_LIFT],
        "contact_power": seen[:, core.SEEN_CONTACT_POWER],
        "contact_energy": states[:, core.STATE_CONTACT],
        "mean_flow": seen[:, core.SEEN_MEAN_FLOW],
        "flow_energy": states[:, core.STATE_FLOW],
    }
