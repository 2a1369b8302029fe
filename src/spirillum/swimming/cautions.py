"""Cautions of a predicted motion: Reynolds number, calibration, pose, and the drive behind it."""

from __future__ import annotations

import numpy as np

from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit
from spirillum.robot.robot import Robot
from spirillum.robot.tables import FrictionModel
from spirillum.robot.tube_pose import gap_of
from spirillum.swimming.band import left_open
from spirillum.swimming.model_choice import has_table
from spirillum.swimming.preparation import preparation_time, why_no_table
from spirillum.swimming.reynolds import reynolds_limits
from spirillum.swimming.steady import Swimming
from spirillum.units import show

NO_WEIGHT = Note.named("no-masses")  #: Caution of a free motion of a robot whose masses are unknown.


def accuracy_limits(batch: RobotBatch, model: SwimmerModel, result: Swimming) -> list[Limit]:
    """What has to hold for the answer to be accurate; each broken one is a warning."""
    return [*model.cautions(batch), *reynolds_limits(batch, result.reynolds_number, result.tail_reynolds_number)]


def film_limits(robot: Robot, model: SwimmerModel, batch: RobotBatch, result: Swimming) -> list[Limit]:
    """What has to hold for the linear film under a body that is held near the wall: the liquid does not cavitate.

    Under a turning cylinder the least pressure is -1.837 mu u sqrt(R')/h^1.5, with u = a Omega/2, R' = a R/(R - a).
    """
    bound, channel = robot.fluid.cavitation_pressure, robot.channel
    if not model.placed or bound is None or channel is None or robot.body.diameter >= channel.diameter:
        return []
    a, radius = 0.5 * robot.body.diameter, 0.5 * channel.diameter
    pulled = 0.5 * robot.fluid.viscosity * a * np.abs(result.body_rotation_rate)
    least = (1.837 * pulled * np.sqrt(a * radius / (radius - a)) / bound) ** (2.0 / 3.0)
    gap = np.atleast_1d(gap_of(batch.placement, 2.0 * a, radius))
    return [Limit.named("cavitation", gap, least)]


def calibration_warnings(robot: Robot, model: str) -> list[Note]:
    """What to be careful about in a robot's calibration for a model: none, or fitted to another geometry.

    A model that computes the walls takes none.
    """
    if find_swimmer_model(model).placed:
        return []
    entry = robot.calibration.get(model)
    if entry is None:
        return [] if robot.channel is None else [Note.named("not-calibrated", model=model)]  # no walls to represent
    fitted = entry.fitted_to
    channel = robot.channel.diameter if robot.channel else None
    pairs = (
        ("channel.diameter", channel, fitted.channel_diameter),
        ("body.diameter", robot.body.diameter, fitted.body_diameter),
        ("body.length", robot.body.length, fitted.body_length),
    )
    differing = [
        f"{name} = {'none' if value is None else show(value, 'mm')} (fitted to {show(fit, 'mm')})"
        for name, value, fit in pairs
        if value is None or not np.isclose(value, fit, rtol=1e-6)
    ]
    if not differing:
        return []
    more = f" and {len(differing) - 1} more" if len(differing) > 1 else ""
    fields = [words.partition(" = ")[0] for words in differing]
    return [Note.named("calibrated-elsewhere", model=model, differs=differing[0], more=more, fields=fields)]


def no_band_warnings(batch: RobotBatch, model: SwimmerModel) -> list[Note]:
    """Limits of an answer at one pose of several, with the remedy; nothing where the pose is known."""
    over = left_open(batch.pose, model)
    if not over:
        return []
    named = f"{' and '.join(over)} {'is' if len(over) == 1 else 'are'}"
    more = "--band gives the band over them, in minutes"
    if not has_table(batch) and not why_no_table(batch):
        whole, band = (preparation_time(batch, stage) for stage in ("yaw", "straight"))
        band = band.partition(" on ")[0]
        more = f"`spirillum prepare ROBOT` adds band, trial, steady in {whole} (--stage straight: band, {band})"
    return [Note.named("pose-open", open=named, more=more, fields=over)]


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
