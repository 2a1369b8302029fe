"""What a trial measures of a robot that is released in its tube, and the steady motion that it approaches.

A trial: the robot is laid down, waits with its motor off while its film drains, and swims with the motor on. Its values
are means over the time with the motor on, as `spirillum.measure` gives them of a video: those of `spirillum.simulate`
by its defaults (`mean_..._on`). The steady motion is that of `spirillum.settle`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.dynamics.run_state import is_held, state_of
from spirillum.envelope import quantity
from spirillum.errors import InputError
from spirillum.notes import notes_in
from spirillum.quantities import QUANTITIES
from spirillum.robot.batch import RobotBatch
from spirillum.swimming.model_choice import WALLED, has_table
from spirillum.swimming.prediction import Prediction
from spirillum.swimming.preparation import why_no_table
from spirillum.swimming.released_motion import ReleasedMotion
from spirillum.swimming.steady_quantities import STEADY

if TYPE_CHECKING:
    import xarray as xr

ASSUMPTION = "contact assumed, not validated"
"""What a released motion rests on."""
_POSE = {"gap": "wall_gap", "pitch": "wall_pitch", "yaw": "wall_yaw", "azimuth": "azimuth"}
"""The pose of an answer, and where a run has it."""
_MOST_TURNS = 2000
"""Turns of the tail that a trial may take beside an answer."""


def why_not_released(held: Prediction, *, fitted: bool) -> str:
    """Return why there is no released motion beside a held answer, in a sentence; empty where there is one.

    Args:
        held: the answer.
        fitted: whether draws of a posterior are behind it.
    """
    if held.robot.channel is None:
        return "the robot has no channel in which it could be released"
    if held.model.name != WALLED:
        return f"model '{held.model.name}' has no walls on which a robot could rest; use model '{WALLED}'"
    if held.tail_rate is not None:
        return "a tail rate is prescribed, and trials follow from the drive; use drive.kind = 'rate', or motion 'free'"
    if fitted:
        return "the draws of a posterior are followed by `simulate --posterior` and by motion 'free'"
    batch = RobotBatch.of(held.robot, held.batch.placement)
    if not has_table(batch, "yaw"):
        made = "its tube has no table with yawed poses yet; `spirillum prepare` makes it, `simulate` and `settle` too"
        return why_no_table(batch) or made
    return ""


def trial_of(held: Prediction, run: Callable[[], xr.Dataset], duration: float) -> ReleasedMotion:
    """Return the means of a trial.

    Args:
        held: the robot, held where it is laid down.
        run: follows the robot, as `spirillum.simulate` does by its defaults.
        duration: for how long, s.
    """
    turns = abs(held.tail_rotation_rate) * duration / (2.0 * np.pi)
    if turns > _MOST_TURNS:
        return ReleasedMotion(reason=f"its tail turns {turns:.4g} times in {duration:g} s; use `simulate`")
    try:
        dataset = run()
    except InputError as error:
        return ReleasedMotion(reason=str(error))
    from spirillum.dynamics.integration import INTERRUPTED  # loads compiled loops

    if INTERRUPTED in str(dataset.attrs["events"]):
        raise KeyboardInterrupt
    return trial_means(dataset)


def trial_means(run: xr.Dataset) -> ReleasedMotion:
    """Return the means of a run in a tube over the time with its drive on, and its mean pose."""
    names = [item.name for item in STEADY if item.name in run and run[item.name].dims == ("time",)]
    columns = {name: name for name in names} | _POSE | {"contact_force": "contact_force"}
    length = float(run["time"][-1] - run["time"][0])
    values = {name: float(run[of].integrate("time")) / length for name, of in columns.items()}
    exact = {name: f"mean_{name}_on" for name in names}
    values |= {name: float(run[of]) for name, of in exact.items() if of in run}
    notes = notes_in(run.attrs)
    basis = {
        "assumption": ASSUMPTION,
        "state": "standing" if is_held(notes) else "swimming",
        "wait": quantity(float(run.attrs["wait"]), QUANTITIES["wait"].unit),
        "duration": quantity(length, "s"),
        "warnings": [str(note) for note in notes],
    }
    return ReleasedMotion(values, basis)


def steady_of(follow: Callable[[], Prediction]) -> ReleasedMotion:
    """Return the steady motion of a released robot.

    Args:
        follow: predicts its free motion in the tube.
    """
    try:
        motion = follow()
    except InputError as error:
        return ReleasedMotion(reason=str(error))
    lying = motion.lying
    assert lying is not None  # noqa: S101 - a free motion in the tube has one
    basis: dict[str, Any] = {
        "assumption": ASSUMPTION,
        "state": state_of(lying, motion.warnings),
        "statement": lying.statement,
        "time_constant": quantity(lying.approach_time, "s"),
        "warnings": [str(note) for note in motion.warnings],
    }
    pose = {name: float(getattr(lying, name)) for name in (*_POSE, "contact_force")}
    moving: Mapping[str, float] = {}
    if lying.state != "changing":  # its means depend on when they are taken
        moving = {item.name: value for item in STEADY if np.isfinite(value := float(getattr(motion, item.name)))}
    return ReleasedMotion({**moving, **pose}, basis)
