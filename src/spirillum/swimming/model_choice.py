"""Choice of the hydrodynamic model where none is named.

One robot has one answer. What a calibration or a posterior was fitted with answers for what it has fitted. Else a robot
with a channel is predicted in its channel, by `tube`, or refused there, and a robot without one is predicted by
`slender`, which resolves the same robot in unbounded fluid.
"""

from __future__ import annotations

from dataclasses import dataclass

from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit
from spirillum.fluid.registry import SWIMMER_MODELS, find_swimmer_model
from spirillum.fluid.tube.stages import StageName
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.steady import requirements

AUTO = "auto"  #: Name that leaves the choice of the model to `choose_model`.
WALLED, UNBOUNDED = "tube", "slender"  #: What answers for a robot in a channel, and for one without.
IN_CHANNEL = "the robot is in a channel, whose walls this model computes"  #: Why the model with walls is taken.
NO_CHANNEL = "the robot has no channel"  #: Why the model of unbounded fluid is taken.


def fitted_with(source: str) -> str:
    """Return the reason of a model that a calibration or a posterior of that name was fitted with."""
    return f"{source} was fitted with it"


@dataclass(frozen=True)
class ModelChoice:
    """A hydrodynamic model, and why it was taken."""

    model: str
    reason: str = ""  #: Its reason, in half a sentence; empty where it was named.
    fitted: bool = False  #: Whether it is the model of a calibration or a posterior.


def choose_model(asked: str, robot: Robot, *, placement: Placement | None = None, fit: Fit = NO_FIT) -> ModelChoice:
    """The named model, or with `auto` that of a fit, else the one with the walls of the robot's channel."""
    if asked != AUTO:
        return ModelChoice(find_swimmer_model(asked, AUTO).name)
    names = fit.models
    if len(names) > 1:
        raise InputError(f"{fit.name} holds factors for models {', '.join(names)}; allowed: --model with one of them")
    if names:
        return ModelChoice(names[0], fitted_with(fit.name), fitted=True)
    if robot.channel is None:
        return ModelChoice(UNBOUNDED, NO_CHANNEL)
    batch = RobotBatch.of(robot, placement or Placement())
    outside = broken(requirements(batch, find_swimmer_model(WALLED)))
    if outside and (placement is None or not placement.is_set):  # a pose is refused by the model that takes poses
        said = f"{robot.name} with model '{WALLED}', which answers in a channel: {outside[0].sentence()}"
        for name in (UNBOUNDED, *(name for name, model in SWIMMER_MODELS.items() if not model.placed)):
            if not broken(requirements(batch, find_swimmer_model(name))):
                raise InputError(f"{said}; or model '{name}', which leaves out the walls")
        raise InputError(said)
    return ModelChoice(WALLED, IN_CHANNEL)


def models_without_answer(robot: Robot) -> list[str]:
    """A sentence on each model whose domain does not contain the robot, level in its channel."""
    batch = RobotBatch.of(robot)
    found = []
    for name, model in SWIMMER_MODELS.items():
        if model.placed and robot.channel is None:
            continue
        outside = broken(requirements(batch, model))
        if outside:
            found.append(f"model '{name}' has no answer for it: {outside[0].sentence()}")
    return found


def has_table(batch: RobotBatch, stage: StageName = "straight") -> bool:
    """Whether the first robot of a batch, which has a channel, has a table for its tube, of a stage at least."""
    from spirillum.fluid.tube.library import find_table  # loads compiled loops, which few models need

    return find_table(RobotGeometry.of(batch), 0.5 * float(batch.channel_diameter[0]), stage) is not None
