"""What a reader has to know about the drive behind an answer, a sentence each."""

from __future__ import annotations

import numpy as np

from spirillum.fluid.model import SwimmerModel
from spirillum.robot.robot import Robot
from spirillum.robot.tables import FrictionReading
from spirillum.swimming.steady_quantities import Swimming
from spirillum.units import show

CONSTANT_TORQUE = (
    "drive.kind = 'torque': constant torque is assumed at every rate, so that speed and rates fall as one over the "
    "viscosity; those of a motor whose torque falls with its rate fall less"
)
"""What a drive of given torque takes for granted."""


def drive_warnings(
    robot: Robot, model: SwimmerModel, reading: FrictionReading, result: Swimming, rate: float | None
) -> list[str]:
    """Warnings about friction, rate and drive of an answer.

    Args:
        robot: the robot.
        model: the hydrodynamic model.
        reading: reading of the friction.
        result: the answer.
        rate: prescribed tail rate, rad/s; None: the robot's own drive.
    """
    motor_driven = robot.drive is not None and robot.drive.kind == "dc-motor"
    step_out, follows = float(result.step_out_rate[0]), bool(np.isfinite(result.phase_lag[0]))
    if np.isfinite(step_out) and not follows:
        return [
            f"the field turns faster than the step-out rate of {show(step_out, 'Hz')}: the robot slips behind it again "
            "and again, and rates and speed are averages"
        ]
    factors = robot.calibration.get(model.name)
    found = []
    if reading == "paper" and factors is not None and factors.body_rotation < 1:
        found.append(
            f"calibration.{model.name}.body_rotation = {factors.body_rotation:g} already makes up for friction on "
            "the body; with friction reading 'paper' it is counted twice"
        )
    if rate is None and robot.drive is not None and robot.drive.kind == "torque":
        found.append(CONSTANT_TORQUE)
    if not motor_driven:
        return found
    if rate is None:
        return found + _unset_friction_warning(robot, reading)
    return found + _prescribed_rate_warnings(robot, reading, result)


def _against_the_drive(robot: Robot, result: Swimming) -> bool:
    reverse = robot.motor is not None and robot.motor.polarity == "reverse"
    return float(result.tail_rotation_rate[0]) * robot.hand * (-1.0 if reverse else 1.0) < 0


def _unset_friction_warning(robot: Robot, reading: FrictionReading) -> list[str]:
    if reading == "none":
        return ["without friction the motor turns faster than any real one: the rates are upper bounds"]
    if robot.friction.effective is not None or robot.motor is None:
        return []
    name = "B_m" if robot.motor.gear_ratio == 1 else "B_m G^2"
    own = f"the rotor's own {name} = {robot.motor.joint_rotor_friction:g} N m s/rad"
    if reading == "body":
        return [f"friction.effective is unset: no wall friction on the body, {own} in the joint"]
    return [f"friction.effective is unset: {own} alone is used, which makes the rates upper bounds"]


def _prescribed_rate_warnings(robot: Robot, reading: FrictionReading, result: Swimming) -> list[str]:
    found = []
    if reading in ("rotor", "paper"):
        if robot.friction.effective is not None:
            found.append("friction.effective is ignored: with a tail rate it is inferred from (17) and (18)")
        if _against_the_drive(robot, result):
            found.append(
                "the tail turns against the way that its motor drives (motor.polarity, tail.handedness): the inferred "
                "effective friction has no meaning"
            )
        elif result.effective_friction[0] < 0:
            found.append(
                "the inferred effective friction is negative: at this rate the model's hydrodynamic torque exceeds "
                "what the motor gives"
            )
    else:
        found.append(
            f"friction reading '{reading}' leaves {result.motor_residual_torque[0]:.3g} N m of motor torque unexplained"
        )
    if result.electrical_power[0] < 0:
        found.append("at this rate the tail drives the motor: current and electrical power are negative")
    return found
