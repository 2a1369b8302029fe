"""Which hydrodynamic model answers where nobody names one.

One robot has one answer. What a calibration or a posterior was fitted with answers for what it has fitted. Else a robot
with a channel is predicted in its channel, by `tube`, and a robot without one by `slender`, which resolves the same
robot in unbounded fluid.
"""

from __future__ import annotations

from dataclasses import dataclass

from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit
from spirillum.fluid.registry import SWIMMER_MODELS, find_swimmer_model
from spirillum.fluid.tube.stages import StageName
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.steady import requirements

AUTO = "auto"
"""Name that leaves the choice of the model to `choose_model`."""
WALLED, UNBOUNDED = "tube", "slender"
"""What answers for a robot in a channel, and for one without."""


@dataclass(frozen=True)
class ModelChoice:
    """A hydrodynamic model, and why it was taken."""

    model: str
    """Name of the model."""
    reason: str = ""
    """Why it was taken, in half a sentence; empty where it was asked for."""
    caution: Note | None = None
    """The note where the robot has a channel that the model does not know; else None."""
    fitted: bool = False
    """Whether it is the model of a calibration or a posterior."""
    outside: bool = False
    """Whether the robot breaks a requirement of the model with walls, which would answer for it otherwise."""


def choose_model(
    asked: str,
    robot: Robot,
    *,
    placement: Placement | None = None,
    fit: Fit = NO_FIT,
    table: StageName | None = None,
    among: bool = False,
) -> ModelChoice:
    """The model that is asked for, or with `auto` the one that knows most about the robot.

    Args:
        asked: name of a model, or `auto`.
        robot: the robot.
        placement: where it lies in its channel, which only a model with walls can answer for.
        fit: fitted values that are used.
        table: stage of a table without which the model with walls would take minutes, and is not taken; None: it needs
            no table, or makes its own.
        among: the robot is one of several that are compared.
    """
    if asked != AUTO:
        return ModelChoice(find_swimmer_model(asked, AUTO).name)
    fitted = _fitted_choice(fit)
    if fitted is not None:
        return fitted
    if robot.channel is None:
        return ModelChoice(UNBOUNDED, "the robot has no channel")
    batch = RobotBatch.of(robot, placement or Placement())
    outside = broken(requirements(batch, find_swimmer_model(WALLED)))
    if outside and (placement is None or not placement.is_given):
        reason = f"model '{WALLED}' has no answer for this robot on the floor of its channel"
        caution = walls_left_out(outside[0].sentence(), among=among)
    elif not outside and table is not None and not has_table(batch, table):
        lacks = f"all robots need a table for their tubes, and one ({robot.with_tail}) has none"
        reason = f"{lacks if among else 'the robot has no table for its tube'} yet"
        without = f"{robot.with_tail} has no table" if among else "it has no table for its tube"
        caution = walls_left_out(f"{without}; run `spirillum prepare`", among=among)
    else:  # a place that was asked for is refused by the model that knows places
        return ModelChoice(WALLED, "the robot is in a channel, whose walls this model computes")
    return ModelChoice(UNBOUNDED, reason, caution, outside=bool(outside))


def models_without_answer(robot: Robot) -> list[str]:
    """A sentence on each model whose domain a robot lies outside of, lying level in its channel."""
    batch = RobotBatch.of(robot)
    found = []
    for name, model in SWIMMER_MODELS.items():
        if model.placed and robot.channel is None:
            continue
        outside = broken(requirements(batch, model))
        if outside:
            found.append(f"model '{name}' has no answer for it: {outside[0].sentence()}")
    return found


def walls_left_out(why: str, *, among: bool) -> Note:
    """The caution where a robot in a channel is answered for without its walls."""
    effect = "speeds are too high, and their order may change" if among else "the predicted speed is too high"
    return Note("walls-left-out", f"wall effects are not modelled, {effect}: {why}", ("model", "channel"))


def has_table(batch: RobotBatch, stage: StageName = "straight") -> bool:
    """Whether the first robot of a batch, which has a channel, has a table for its tube, of a stage at least."""
    from spirillum.fluid.tube.library import find_table  # loads compiled loops, which few models need

    return find_table(RobotGeometry.of(batch), 0.5 * float(batch.channel_diameter[0]), stage) is not None


def _fitted_choice(fit: Fit) -> ModelChoice | None:
    names = fit.models
    if len(names) > 1:
        raise InputError(f"{fit.name} holds factors for models {', '.join(names)}; allowed: --model with one of them")
    return ModelChoice(names[0], f"{fit.name} was fitted with it", fitted=True) if names else None
