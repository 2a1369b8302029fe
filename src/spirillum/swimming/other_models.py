"""Predictions of the other models for a robot: the paper's models and the unbounded fluid beside the answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.envelope import quantity
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import SWIMMER_MODELS
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.robot import Robot
from spirillum.robot.tables import FrictionModel
from spirillum.swimming.cautions import calibration_warnings
from spirillum.swimming.released_motion import Motion
from spirillum.swimming.steady import requirements, swim


@dataclass(frozen=True)
class OtherModel:
    """Speed of a robot by another model."""

    model: str
    calibrated: bool  #: Whether the robot's calibration factors, which represent the walls, were applied.
    forward_velocity: float  #: U, m/s.
    ratio: float  #: U over that of the answer beside which it stands.


@dataclass(frozen=True)
class OtherModels:
    """Predictions of simpler models for the same request."""

    answers: tuple[OtherModel, ...]
    """One for each model, and one more for each that has calibration factors of this geometry."""
    statement: str  #: All in one line, and why they differ.

    def to_dict(self) -> dict[str, Any]:
        """As it stands in JSON."""
        answers = [
            {
                "model": item.model,
                "calibrated": item.calibrated,
                "forward_velocity": quantity(item.forward_velocity, "m/s"),
                "ratio": quantity(item.ratio, "1"),
            }
            for item in self.answers
        ]
        return {"statement": self.statement, "answers": answers}


def other_models(
    robot: Robot,
    model: SwimmerModel,
    speed: float,
    *,
    tail_rate: float | None,
    friction: FrictionModel,
    motion: Motion,
    flow: float | None,
) -> OtherModels | None:
    """Predictions of models that leave out effects which the answering one includes; None where none is comparable."""
    if model.closed_form or flow is not None or not math.isfinite(speed) or speed == 0:
        return None
    simpler = [
        other
        for other in SWIMMER_MODELS.values()
        if other.name != model.name and not other.placed and (model.placed or other.closed_form)
    ]
    batch = RobotBatch.of(robot)
    rates = None if tail_rate is None else np.array([tail_rate])
    found = []
    for other in simpler:
        if (motion == "free" and other.axial_only) or broken(requirements(batch, other)):
            continue
        of_this = other.name in robot.calibration and not calibration_warnings(robot, other.name)
        for calibrated in (False, True) if of_this else (False,):
            result = swim(batch, other, tail_rate=rates, friction=friction, calibrated=calibrated, motion=motion)
            own = float(result.forward_velocity[0])
            if result.valid[0] and own / speed > 0:
                found.append(OtherModel(other.name, calibrated, own, own / speed))
    coupled = robot.coupling.length > 0.0
    return OtherModels(tuple(found), _statement(found, model, coupled=coupled)) if found else None


def _statement(found: list[OtherModel], model: SwimmerModel, *, coupled: bool) -> str:
    bare = _times([item for item in found if not item.calibrated])
    lacking = f"{'the coupling and ' if coupled else ''}the flow between body and tail"
    if not model.placed:
        return f"closed forms predict {bare}: they leave out {lacking}"
    fitted = [item for item in found if item.calibrated]
    more = f"; with calibration factors, which represent the walls, {_times(fitted)}" if fitted else ""
    names = [name for name in dict.fromkeys(item.model for item in found) if SWIMMER_MODELS[name].closed_form]
    leave = f"{' and '.join(names)} {'leaves' if len(names) == 1 else 'leave'}"
    apart = f" ({leave} out {lacking}, too)" if names else ""
    return f"models without walls predict {bare}{apart}{more}"


def _times(items: list[OtherModel]) -> str:
    names = ", ".join(f"{item.model} {item.ratio:.2g}" for item in items)
    return f"{names} times this speed"
