"""Steady swimming of a batch of robots: resistance and drive to speed, rates, torques and powers."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import cast, get_args

import numpy as np

from spirillum.arrays import Flags, MeanFlow, PerRobot
from spirillum.errors import InputError
from spirillum.hydrodynamics import SwimmerModel, find_swimmer_model
from spirillum.hydrodynamics.perrin import body_axial
from spirillum.motion.balance import TorqueBalance, force_free
from spirillum.motion.drives import DriveState, at_rate, driven, one_piece
from spirillum.motion.motor import battery_voltage, run_time
from spirillum.robot.actuation import FrictionReading
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, all_hold, assembly_limits

__all__ = ["Swimming", "calibrated_balance", "friction_reading", "requirements", "speed_difference", "swim"]

_BLOCK = 1 << 15  # robots worked on at once: their columns stay in the processor's cache


@dataclass(frozen=True)
class Swimming:
    """Steady motion of a batch, one value for each robot, SI, rates signed about +x; NaN where not `valid`."""

    forward_velocity: PerRobot = field(
        metadata={"unit": "m/s", "meaning": "forward velocity U_x", "source": "eqs (1), (8), (15)"}
    )
    advance_per_radian: PerRobot = field(
        metadata={"unit": "m/rad", "meaning": "forward velocity over tail rate", "source": "eqs (1), (15)"}
    )
    tail_rotation_rate: PerRobot = field(
        metadata={
            "unit": "rad/s",
            "meaning": "rotation rate omega of the tail (lab)",
            "source": "eqs (15), (18)",
        }
    )
    body_rotation_rate: PerRobot = field(
        metadata={"unit": "rad/s", "meaning": "rotation rate Omega_x of the body", "source": "eqs (2), (15)"}
    )
    motor_rotation_rate: PerRobot = field(
        metadata={"unit": "rad/s", "meaning": "motor rate omega_m = omega - Omega_x", "source": "Table II"}
    )
    tail_torque: PerRobot = field(
        metadata={
            "unit": "N m",
            "meaning": "hydrodynamic torque T_h on the rotor, magnitude",
            "source": "eqs (12), (18)",
        }
    )
    drive_torque: PerRobot = field(
        metadata={"unit": "N m", "meaning": "torque that turns the rotor against the fluid", "source": "eq. (18)"}
    )
    motor_current: PerRobot = field(metadata={"unit": "A", "meaning": "motor current I", "source": "eq. (17)"})
    battery_voltage: PerRobot = field(
        metadata={"unit": "V", "meaning": "battery voltage V(I) at the terminals", "source": "Table II"}
    )
    effective_friction: PerRobot = field(
        metadata={
            "unit": "N m s/rad",
            "meaning": "effective rotary friction B_eff (reading body: B of the wall)",
            "source": "eq. (18)",
        }
    )
    motor_residual_torque: PerRobot = field(
        metadata={
            "unit": "N m",
            "meaning": "motor torque that the friction reading leaves unexplained",
            "source": "eq. (18)",
        }
    )
    electrical_power: PerRobot = field(
        metadata={"unit": "W", "meaning": "electrical power at the battery's terminals", "source": "Table II"}
    )
    shaft_power: PerRobot = field(
        metadata={"unit": "W", "meaning": "drive torque times motor rate", "source": "eq. (18)"}
    )
    friction_power: PerRobot = field(
        metadata={"unit": "W", "meaning": "power lost to friction", "source": "eqs (18), (19)"}
    )
    dissipated_power: PerRobot = field(
        metadata={
            "unit": "W",
            "meaning": "viscous dissipation (in an imposed flow: what the robot adds to it)",
            "source": "eq. (9)",
        }
    )
    hydrodynamic_efficiency: PerRobot = field(
        metadata={
            "unit": "1",
            "meaning": "isolated uncalibrated body drag times U^2 over shaft power",
            "source": "eq. (16)",
        }
    )
    reynolds_number: PerRobot = field(
        metadata={"unit": "1", "meaning": "Reynolds number on the body's diameter", "source": "definition"}
    )
    tail_reynolds_number: PerRobot = field(
        metadata={
            "unit": "1",
            "meaning": "Reynolds number rho |omega| B_o^2/mu on the tail's amplitude",
            "source": "definition",
        }
    )
    battery_run_time: PerRobot = field(
        metadata={"unit": "s", "meaning": "time until the rated charge is spent", "source": "Table II"}
    )
    plug_velocity: PerRobot = field(
        metadata={
            "unit": "m/s",
            "meaning": "mean velocity of the fluid through the channel",
            "source": "models with a channel",
        }
    )
    valid: Flags = field(
        metadata={
            "unit": "1",
            "meaning": "robot can be built and lies inside the model's domain",
            "source": "domain of the model",
        }
    )


def requirements(batch: RobotBatch, model: SwimmerModel) -> list[Limit]:
    """What every robot has to fulfil for this model to answer."""
    return assembly_limits(batch) + model.domain(batch)


def calibrated_balance(batch: RobotBatch, model: SwimmerModel, *, calibrated: bool = True) -> TorqueBalance:
    """The force-free torque balance; a calibration factor f adds (f - 1) times the isolated body's drag."""
    r = model.axial(batch)
    factors = batch.calibration.get(model.name) if calibrated else None
    if factors is not None:
        drag, rotation = body_axial(batch)
        r = np.array(np.broadcast_to(r, (np.broadcast_shapes(r.shape[:1], factors.body_drag.shape)[0], 4, 4)))
        r[:, 0, 0] += (factors.body_drag - 1.0) * drag
        r[:, 1, 1] += (factors.body_rotation - 1.0) * rotation
    return force_free(r, model.axial_load(batch))


def swim(
    batch: RobotBatch,
    model: str | SwimmerModel = "sbt",
    *,
    tail_rate: PerRobot | None = None,
    motor_rate: PerRobot | None = None,
    friction: str | None = None,
    calibrated: bool = True,
) -> Swimming:
    """Steady swimming of every robot of a batch.

    Args:
        batch: the robots; a million is one call.
        model: a hydrodynamic model, or its name.
        tail_rate: prescribed lab rates of the tail, rad/s; without them the robots' drive decides. With a
            DC-motor the current then follows from (17) and the effective friction from (18).
        motor_rate: prescribed (observed) motor rates omega_m, rad/s, alone or together with `tail_rate`.
        friction: reading of the friction; None: the robots' own.
        calibrated: apply the robots' calibration factors for this model.

    Returns:
        One value for each robot; NaN and `valid = False` where a robot cannot be built or is outside the
        model's domain.

    Raises:
        InputError: for an unknown model or reading, rates that do not match the batch, or robots whose drive
            leaves the motion open.
    """
    chosen = find_swimmer_model(model) if isinstance(model, str) else model
    if batch.joint == "fixed" and motor_rate is not None:
        raise InputError("motor_rate with drive.joint = 'fixed': nothing turns in the joint; allowed: a tail rate")
    tail, motor = _per_robot(tail_rate, batch, "tail_rate"), _per_robot(motor_rate, batch, "motor_rate")
    free = tail_rate is None and motor_rate is None
    reading = friction_reading(friction or batch.friction)
    parts = [
        _swim_block(block, chosen, tail[cut], motor[cut], reading, free=free, calibrated=calibrated)
        for cut, block in batch.blocks(_BLOCK)
    ]
    return Swimming(**{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Swimming)})


def speed_difference(check: Swimming, result: Swimming) -> PerRobot:
    """Relative difference of the forward velocities: the error estimate of a model that `checked_by` another."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.abs(check.forward_velocity / result.forward_velocity - 1.0)


def friction_reading(name: str) -> FrictionReading:
    """The reading of that name.

    Raises:
        InputError: if there is none.
    """
    for reading in get_args(FrictionReading):
        if name == reading:
            return cast("FrictionReading", reading)
    raise InputError(f"friction = {name!r}; allowed: {', '.join(get_args(FrictionReading))}")


def _per_robot(rate: PerRobot | None, batch: RobotBatch, name: str) -> PerRobot:
    """One rate for each robot; NaN where there is none."""
    array = np.atleast_1d(np.asarray(np.nan if rate is None else rate, dtype=float))
    if array.ndim != 1 or array.size not in (1, batch.size):
        raise InputError(f"{name} has shape {array.shape}; allowed: one value, or {batch.size}, one for each robot")
    return np.broadcast_to(array, (batch.size,))


def _swim_block(
    batch: RobotBatch,
    model: SwimmerModel,
    tail_rate: PerRobot,
    motor_rate: PerRobot,
    friction: FrictionReading,
    *,
    free: bool,
    calibrated: bool,
) -> Swimming:
    valid = batch.known & all_hold(requirements(batch, model))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        balance = calibrated_balance(batch, model, calibrated=calibrated)
        if batch.joint == "fixed":
            state = one_piece(batch, balance, tail_rate)
        elif free:
            state = driven(batch, balance, friction)
        else:
            state = at_rate(batch, balance, tail_rate, motor_rate, friction)
        return _answer(batch, balance, state, valid, model.mean_flow(batch))


def _answer(
    batch: RobotBatch, s: TorqueBalance, state: DriveState, valid: Flags, mean_flow: MeanFlow | None
) -> Swimming:
    body_rate, tail_rate = state.body_rate, state.tail_rate
    speed = s.speed(body_rate, tail_rate)
    slip = tail_rate - body_rate
    load = s.rotor_load(body_rate, tail_rate)
    dissipated = load * tail_rate + s.body_load(body_rate, tail_rate) * body_rate
    if batch.joint == "fixed":
        drive = load + s.body_load(body_rate, tail_rate)
        shaft = drive * tail_rate
    else:
        drive, shaft = load, load * slip
    drag, _ = body_axial(batch)
    motor, current = batch.electrics, state.current
    none: PerRobot = np.full(1, np.nan)
    voltage = electrical = lasting = none
    if motor is not None and batch.drive == "dc-motor":
        voltage = battery_voltage(motor, current)
        electrical = motor.duty * motor.polarity * current * voltage
        lasting = run_time(motor, current)
    values = {
        "forward_velocity": speed,
        "advance_per_radian": np.where(tail_rate == 0, np.nan, speed / tail_rate),
        "tail_rotation_rate": tail_rate,
        "body_rotation_rate": body_rate,
        "motor_rotation_rate": slip,
        "tail_torque": np.abs(load),
        "drive_torque": drive,
        "motor_current": current,
        "battery_voltage": voltage,
        "effective_friction": state.effective,
        "motor_residual_torque": state.residual,
        "electrical_power": electrical,
        "shaft_power": shaft,
        "friction_power": state.torques.power(body_rate, tail_rate),
        "dissipated_power": dissipated,
        "hydrodynamic_efficiency": drag * speed**2 / shaft,
        "reynolds_number": batch.density * np.abs(speed) * batch.body_diameter / batch.viscosity,
        "tail_reynolds_number": batch.density * np.abs(tail_rate) * batch.amplitude**2 / batch.viscosity,
        "battery_run_time": lasting,
        "plug_velocity": none if mean_flow is None else _plug_velocity(mean_flow, speed, body_rate, tail_rate),
    }
    # A motor driven beyond any root of (17), or a friction inferred at rest, is no answer either.
    moving = valid & np.isfinite(speed) & ~np.isinf(state.effective)
    if motor is not None and batch.drive == "dc-motor" and batch.joint == "revolute":
        moving = moving & np.isfinite(current)
    shaped = {name: np.where(moving, value, np.nan) for name, value in values.items()}
    size = batch.size
    return Swimming(
        **{name: np.array(np.broadcast_to(value, (size,))) for name, value in shaped.items()},
        valid=np.array(np.broadcast_to(moving, (size,))),
    )


def _plug_velocity(mean_flow: MeanFlow, speed: PerRobot, body_rate: PerRobot, tail_rate: PerRobot) -> PerRobot:
    """Mean velocity of the fluid through the channel, m/s, as `SwimmerModel.mean_flow` gives it per unit motion."""
    per_speed = mean_flow[..., 0] + mean_flow[..., 2]
    return per_speed * speed + mean_flow[..., 1] * body_rate + mean_flow[..., 3] * tail_rate + mean_flow[..., 4]
