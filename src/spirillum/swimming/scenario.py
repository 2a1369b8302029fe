"""A case of steady motion: its errors, its cautions, and what models that leave out effects predict beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spirillum.errors import InputError
from spirillum.fitted.fit import Fit
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import SWIMMER_MODELS
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, broken, in_stokes_flow, reynolds_limits, stokes_flow_problem
from spirillum.robot.robot import Robot
from spirillum.robot.tables import FrictionModel
from spirillum.robot.tube_pose import gap_of
from spirillum.swimming.cautions import accuracy_cautions, calibration_warnings
from spirillum.swimming.motions import Motion, Swimming
from spirillum.swimming.steady import calibrated_balance, speed_error, swim, swim_on_floor
from spirillum.units import show

NO_WEIGHT = Note.named("no-masses")  #: Caution of a free motion of a robot whose masses are unknown.


def film_limits(robot: Robot, model: SwimmerModel, batch: RobotBatch, result: Swimming) -> list[Limit]:
    """Return the limits of the linear film under a body held near the wall: the liquid does not cavitate."""
    bound, channel = robot.fluid.cavitation_pressure, robot.channel
    if not model.placed or bound is None or channel is None or robot.body.diameter >= channel.diameter:
        return []
    # Under a turning cylinder the least pressure is -1.837 mu u sqrt(R')/h^1.5, with u = a Omega/2, R' = a R/(R - a).
    a, radius = 0.5 * robot.body.diameter, 0.5 * channel.diameter
    pulled = 0.5 * robot.fluid.viscosity * a * np.abs(result.body_rotation_rate)
    least = (1.837 * pulled * np.sqrt(a * radius / (radius - a)) / bound) ** (2.0 / 3.0)
    gap = np.atleast_1d(gap_of(batch.placement, 2.0 * a, radius))
    return [Limit.named("cavitation", gap, least)]


CONSTANT_TORQUE = Note.named("constant-torque")  #: What a drive of given torque takes for granted.


def drive_warnings(
    robot: Robot, model: SwimmerModel, reading: FrictionModel, result: Swimming, rate: float | None
) -> list[Note]:
    """Warnings about friction, rate and drive of an answer."""
    motor_driven = robot.drive is not None and robot.drive.kind == "dc-motor"
    step_out, follows = float(result.step_out_rate[0]), bool(np.isfinite(result.phase_lag[0]))
    if np.isfinite(step_out) and not follows:
        return [Note.named("field-slips", rate=show(step_out, "Hz"))]
    factors = robot.calibration.get(model.name)
    found = []
    if reading == "paper" and factors is not None and factors.body_rotation < 1:
        found.append(Note.named("friction-twice", model=model.name, factor=factors.body_rotation))
    if rate is None and robot.drive is not None and robot.drive.kind == "torque":
        found.append(CONSTANT_TORQUE)
    if not motor_driven:
        return found
    if rate is None:
        return found + _unset_friction_warning(robot, reading)
    return found + _prescribed_rate_warnings(robot, reading, result)


def _unset_friction_warning(robot: Robot, reading: FrictionModel) -> list[Note]:
    if reading == "none":
        return [Note.named("frictionless-motor")]
    if robot.friction.effective is not None or robot.motor is None:
        return []
    name = "B_m" if robot.motor.gear_ratio == 1 else "B_m G^2"
    own = f"{name} = {robot.motor.joint_rotor_friction:g} N m s/rad"
    return [Note.named("no-wall-friction" if reading == "body" else "rotor-friction-alone", own=own)]


def _prescribed_rate_warnings(robot: Robot, reading: FrictionModel, result: Swimming) -> list[Note]:
    found = []
    if reading in ("rotor", "paper"):
        if robot.friction.effective is not None:
            found.append(Note.named("friction-inferred"))
        reverse = robot.motor is not None and robot.motor.polarity == "reverse"
        if float(result.tail_rotation_rate[0]) * robot.hand * (-1.0 if reverse else 1.0) < 0:
            found.append(Note.named("against-motor"))
        elif result.effective_friction[0] < 0:
            found.append(Note.named("friction-negative"))
    else:
        found.append(Note.named("torque-left", reading=reading, torque=result.motor_residual_torque[0]))
    if result.electrical_power[0] < 0:
        found.append(Note.named("motor-driven"))
    return found


@dataclass(frozen=True)
class Scenario:
    """A robot in its pose, its model, and all else that its steady motion follows from; SI."""

    robot: Robot  #: The robot, with fitted values in place of its own.
    model: SwimmerModel
    batch: RobotBatch  #: The robot in its pose, as a batch of one.
    friction: FrictionModel
    tail_rate: float | None  #: Lab rate of the tail, rad/s; None: the robot's drive.
    calibrated: bool  #: Whether calibration factors are applied.
    motion: str  #: Lateral motion and tilt constrained (`held`), or `free`.
    fit: Fit  #: Fitted values that act on the robot.
    names_friction: bool  #: Whether the robot itself, before the fit, states its effective friction.

    def swim(self, batch: RobotBatch, model: SwimmerModel | None = None) -> Swimming:
        """Steady swimming of the robot at some poses, by its model or by another."""
        model = model or self.model
        return swim_on_floor(
            batch,
            model,
            [self.robot],
            self.fit.dry_friction(model),
            tail_rate=None if self.tail_rate is None else np.array([self.tail_rate]),
            friction=self.friction,
            calibrated=self.calibrated,
            motion=self.motion,
        )

    def solved(self) -> tuple[Swimming, float, list[Note]]:
        """The steady motion, the relative error of its forward velocity, and what to be careful about."""
        # The finer resolution last: a flow around the robot then finds its factors at hand.
        checks = [self.swim(self.batch, other) for other in self.model.checked_by(self.batch)]
        result = self.swim(self.batch)
        limits = reynolds_limits(self.batch, result.reynolds_number, result.tail_reynolds_number)
        if not result.valid[0]:
            raise InputError(self._why_not(limits))
        error = self.model.stated_speed_error(self.batch)
        if checks:
            speeds = [one.forward_velocity for one in (result, *checks)]
            error = float(speed_error(speeds, self.model.unchecked_error(self.batch))[0])
        return result, in_stokes_flow(error, *limits), self._warnings(result)

    def _warnings(self, result: Swimming) -> list[Note]:
        """What to be careful about: calibration, accuracy, drive, what a free motion leaves out."""
        robot, model, batch, rate = self.robot, self.model, self.batch, self.tail_rate
        known = robot  # of the user's file: without the B_eff of a calibration
        if rate and not self.names_friction:
            known = robot.model_copy(update={"friction": robot.friction.model_copy(update={"effective": None})})
        assumed = "assumed-on-floor" if robot.has_body else "assumed-on-axis"
        placed = batch.placement.gap is not None or batch.placement.eccentricity is not None
        placed |= robot.body.mass is not None and robot.tail.density is not None  # its weight keeps it on the floor
        return [
            *(calibration_warnings(robot, model.name) if self.calibrated else ()),
            *(found.note for found in accuracy_cautions(model, batch, result)),
            *(limit.caution() for limit in broken(film_limits(robot, model, batch, result))),
            *drive_warnings(known, model, self.friction, result, rate),
            *(self._left_out() if self.motion == "free" else ()),
            *([Note.named("in-a-flow")] if batch.placement.flow else []),
            *([Note.named(assumed)] if model.placed and not placed else []),
        ]

    def _left_out(self) -> list[Note]:
        """What a free motion leaves out."""
        if self.robot.channel is not None:
            return [Note.named("free-without-walls")]
        weight = self.robot.derived().get("submerged_weight")
        if weight is None or not weight.value:
            return []
        moves = "sinks" if weight.value > 0 else "rises"
        return [Note.named("free-without-weight", weight=show(weight.value, "N"), moves=moves)]

    def _why_not(self, limits: Sequence[Limit]) -> str:
        """Why there is no steady motion."""
        if problem := stokes_flow_problem(self.batch, limits):
            return problem
        if self.tail_rate is not None:
            paper = ", and with friction model 'paper' not so slow that B_eff exceeds E_x"
            return (
                f"tail-rate = {self.tail_rate:.4g} rad/s: motor and battery have no steady state there; allowed: a "
                "rate at which (17) has a root with a positive battery voltage"
                f"{paper if self.friction == 'paper' else ''}"
            )
        if self.friction == "paper":
            limit = calibrated_balance(self.batch, self.model, calibrated=self.calibrated).bb[0]
            return (
                f"friction.effective = {self.batch.effective_friction[0]:.4g} N m s/rad; allowed: less than "
                f"E_x = {limit:.4g} N m s/rad with friction model 'paper', which would turn the tail backwards"
            )
        return f"model '{self.model.name}' finds no steady motion for this robot; allowed: a robot inside its domain"


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
        if (motion == "free" and other.axial_only) or broken(other.requirements(batch)):
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
