"""Why models differ: from Lighthill's theory to the trial, what each effect does to the speed of one robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Axial, PerRobot
from spirillum.errors import InputError
from spirillum.fluid.algebra import two_parts_axial
from spirillum.fluid.wire.slender import Slender
from spirillum.robot.batch import RobotBatch
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.model_choice import UNBOUNDED, WALLED
from spirillum.swimming.prediction import Prediction, predict
from spirillum.swimming.steady import swim

LIGHTHILL = "sbt"
"""The theory from which the effects are counted."""


class Effect(NamedTuple):
    """One step from Lighthill's theory to the trial."""

    name: str
    """Effect that is included from here on."""
    speed: float
    """Forward velocity with this effect and all before it, m/s."""


class _ApartFromEachOther(Slender):
    """Body and rotor resolved, each alone in the fluid; the rotor with or without its coupling."""

    def __init__(self, *, coupling: bool) -> None:
        super().__init__()
        self._rotor = ("tail", "coupling") if coupling else ("tail",)

    def axial(self, batch: RobotBatch) -> Axial:
        """See `SwimmerModel.axial`."""
        body = self._entries(batch, "body")
        parts = [self._entries(batch, part) for part in self._rotor]
        drag, coupling, rotation = (sum(entries) for entries in zip(*parts, strict=True))
        return two_parts_axial(body, (drag, coupling, rotation))

    def _entries(self, batch: RobotBatch, part: str) -> tuple[PerRobot, PerRobot, PerRobot]:
        matrix = self.part_matrix(batch, part, np.zeros(1))
        return matrix[..., 0, 0], matrix[..., 0, 3], matrix[..., 3, 3]


def effects_of(robot: Robot, answers: Mapping[str, Prediction], friction: str) -> tuple[Effect, ...]:
    """Return the speed with one effect after the other, from Lighthill's theory to the trial.

    Each step keeps all before it: body and wire resolved, each alone; the coupling; the flow between the parts; the
    walls, held at the robot's pose; the pose of the trial, that is the lubrication film there; its yaw; contact, dry
    friction and motion in time. Steps that the robot does not have, or that cannot be computed, are left out.

    Args:
        robot: the robot, with a drive.
        answers: by model; `sbt` and `slender` have to be among them.
        friction: friction model of all steps.
    """
    return tuple(_steps(robot, answers, friction))


def _steps(robot: Robot, answers: Mapping[str, Prediction], friction: str) -> Iterator[Effect]:
    if LIGHTHILL not in answers or UNBOUNDED not in answers:
        return
    batch = RobotBatch.of(robot)
    rate = answers[UNBOUNDED].tail_rate
    rates = None if rate is None else np.array([rate])

    def apart(*, coupling: bool) -> float:
        model = _ApartFromEachOther(coupling=coupling)
        found = swim(batch, model, tail_rate=rates, friction=friction, calibrated=False)
        return float(found.forward_velocity[0])

    yield Effect("Lighthill's theory", answers[LIGHTHILL].forward_velocity)
    yield Effect("body and wire resolved", apart(coupling=False))
    if robot.coupling.length > 0.0 and robot.coupling.diameter > 0.0:
        yield Effect("coupling", apart(coupling=True))
    yield Effect("interaction of the parts", answers[UNBOUNDED].forward_velocity)
    held = answers.get(WALLED)
    if held is None:
        return
    yield Effect("walls", held.forward_velocity)
    trial = held.trial
    if trial is None or trial.reason:
        return
    yield from _released(held, trial.values, friction)


def _released(held: Prediction, trial: Mapping[str, float], friction: str) -> Iterator[Effect]:
    """From the held answer to the trial: held at the trial's mean pose, level and then yawed, and the trial."""
    pose = {name: trial[name] for name in ("gap", "pitch", "yaw")}
    for name, left_out in (("film at the pose of the trial", {"yaw": 0.0}), ("yaw", {})):
        placement = Placement.of({**pose, **left_out, "ends": held.batch.placement.ends})
        try:
            there = predict(
                held.robot, model=WALLED, friction=friction, calibrated=held.calibrated, placement=placement, band=False
            )
        except InputError:  # nearer to the wall than the table answers for: part of the next step
            continue
        yield Effect(name, there.forward_velocity)
    yield Effect("contact and motion in time", trial["forward_velocity"])
