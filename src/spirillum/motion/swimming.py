"""Steady swimming of a batch of robots: resistance and drive to speed, rates, torques and powers."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import cast, get_args

import numpy as np

from spirillum.arrays import Flags, PerRobot
from spirillum.errors import InputError
from spirillum.hydrodynamics import SwimmerModel, find_swimmer_model
from spirillum.hydrodynamics.perrin import body_axial
from spirillum.motion.balance import FrictionTorques, TorqueBalance, force_free, friction_torques, rates_per_torque
from spirillum.motion.motor import battery_voltage, run_time, steady_current
from spirillum.robot.actuation import FrictionReading
from spirillum.robot.batch import Electrics, RobotBatch
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
    dissipated_power: PerRobot = field(metadata={"unit": "W", "meaning": "viscous dissipation", "source": "eq. (9)"})
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
    return force_free(r)


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


@dataclass(frozen=True)
class _State:
    """Rates and what the motor does to keep them."""

    body_rate: PerRobot
    tail_rate: PerRobot
    current: PerRobot
    effective: PerRobot
    torques: FrictionTorques
    residual: PerRobot


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
            state = _one_piece(batch, balance, tail_rate)
        elif free:
            state = _driven(batch, balance, friction)
        else:
            state = _at_rate(batch, balance, tail_rate, motor_rate, friction)
        return _answer(batch, balance, state, valid)


def _joint_friction(batch: RobotBatch, friction: FrictionReading) -> tuple[PerRobot, PerRobot]:
    """(B_eff or B, B_m); unset, B_eff is the rotor's own B_m alone and the wall's B is zero."""
    rotor = batch.electrics.rotor_friction if batch.electrics else np.zeros(1)
    if friction == "none":
        return np.zeros(1), rotor
    unset = np.isnan(batch.effective_friction)
    return np.where(unset, 0.0 if friction == "body" else rotor, batch.effective_friction), rotor


def _driven(batch: RobotBatch, s: TorqueBalance, friction: FrictionReading) -> _State:
    """Motion under the robots' own drive: rates are linear in the joint torque, the motor closes it."""
    effective, rotor = _joint_friction(batch, friction)
    t = friction_torques(friction, effective, rotor)
    none = np.full(1, np.nan)
    if batch.drive == "rate":
        body_rate, tail = _rates_by_torque_sum(s, t, batch.drive_rate, none)
        return _State(body_rate, tail, none, effective, t, none)
    body_per_torque, tail_per_torque = rates_per_torque(s, t)
    if batch.drive == "torque":
        torque, current = batch.drive_torque, none
    elif batch.drive == "dc-motor" and batch.electrics is not None:
        motor = batch.electrics
        slip = tail_per_torque - body_per_torque
        per_current = motor.back_emf_constant * motor.torque_constant * slip
        current = motor.polarity * steady_current(motor, np.zeros(1), per_current)
        torque = motor.torque_constant * current
    else:
        raise InputError("drive is missing; allowed: a [drive] table, or a tail rate (--tail-rate)")
    # Reading `paper` pushes the tail backwards once B_eff exceeds E_x: no steady motion of that kind.
    tail_per_torque = np.where(tail_per_torque > 0, tail_per_torque, np.nan)
    return _State(body_per_torque * torque, tail_per_torque * torque, current, effective, t, none)


def _at_rate(
    batch: RobotBatch,
    s: TorqueBalance,
    tail_rate: PerRobot,
    motor_rate: PerRobot,
    friction: FrictionReading,
) -> _State:
    """Motion at prescribed rates; with a DC-motor the friction follows from (17) and (18)."""
    effective, rotor = _joint_friction(batch, friction)
    none = np.full(1, np.nan)
    motor = batch.electrics
    if batch.drive != "dc-motor" or motor is None:
        t = friction_torques(friction, effective, rotor)
        body_rate, tail = _rates_by_torque_sum(s, t, tail_rate, motor_rate)
        return _State(body_rate, tail, none, effective, t, none)
    if friction == "paper":
        return _at_rate_paper(s, motor, tail_rate, motor_rate)
    wall = effective if friction == "body" else np.zeros(1)
    # What acts inside the joint cancels in the sum of both torques and does not change the motion.
    body_rate, tail = _rates_by_torque_sum(s, friction_torques("body", wall, np.zeros(1)), tail_rate, motor_rate)
    slip = np.where(np.isnan(motor_rate), tail - body_rate, motor_rate)
    current = _current_at(motor, slip)
    spare = motor.torque_constant * current - s.rotor_load(body_rate, tail)
    if friction == "rotor":
        inferred = spare / slip
        t = friction_torques("rotor", inferred, rotor)
        return _State(body_rate, tail, current, inferred, t, none)
    t = friction_torques(friction, effective, rotor)
    residual = spare - (rotor * slip if friction == "body" else 0.0)
    return _State(body_rate, tail, current, effective, t, residual)


def _rates_by_torque_sum(
    s: TorqueBalance, t: FrictionTorques, tail_rate: PerRobot, motor_rate: PerRobot
) -> tuple[PerRobot, PerRobot]:
    """(Omega, omega) from the sum of both torque rows, in which the joint torque cancels."""
    on_body, on_tail = (s.bb + s.rb) + (t.bb + t.rb), (s.br + s.rr) + (t.br + t.rr)
    on_body = np.where(on_body > 0, on_body, np.nan)  # `paper` beyond E_x: as in `_driven`
    tail = np.where(np.isnan(tail_rate), motor_rate * on_body / (on_body + on_tail), tail_rate)
    return -on_tail / on_body * tail, tail


def _at_rate_paper(s: TorqueBalance, motor: Electrics, tail_rate: PerRobot, motor_rate: PerRobot) -> _State:
    """Reading `paper`: the body row holds -K_m I alone, so the current decides the body's rate."""
    k, k_b = motor.torque_constant, motor.back_emf_constant
    observed = ~np.isnan(motor_rate)
    emf = k_b * motor.polarity * np.where(observed, motor_rate, tail_rate * (1.0 + s.br / s.bb))
    current = motor.polarity * steady_current(motor, emf, np.where(observed, 0.0, k_b * k / s.bb))
    from_motor = -(k * current + s.br * motor_rate) / (s.bb + s.br)
    body_rate = np.where(np.isnan(tail_rate), from_motor, -(k * current + s.br * tail_rate) / s.bb)
    tail = np.where(np.isnan(tail_rate), body_rate + motor_rate, tail_rate)
    slip = np.where(observed, motor_rate, tail - body_rate)
    tail = np.where(tail * slip > 0, tail, np.nan)  # B_eff beyond E_x pushes the tail backwards: as in `_driven`
    inferred = (k * current - s.rotor_load(body_rate, tail)) / slip
    t = friction_torques("paper", inferred, motor.rotor_friction)
    return _State(body_rate, tail, current, inferred, t, np.full(1, np.nan))


def _current_at(motor: Electrics, motor_rate: PerRobot) -> PerRobot:
    """Signed current at a given motor rate, from (17)."""
    return motor.polarity * steady_current(motor, motor.back_emf_constant * motor.polarity * motor_rate, np.zeros(1))


def _one_piece(batch: RobotBatch, s: TorqueBalance, tail_rate: PerRobot) -> _State:
    """Fixed joint: body and tail turn together under an external torque or rate."""
    load = s.bb + s.br + s.rb + s.rr
    own = batch.drive_rate if batch.drive == "rate" else batch.drive_torque / load
    rate = np.where(np.isnan(tail_rate), own, tail_rate)
    zero = np.zeros(1)
    none = np.full(1, np.nan)
    return _State(rate, rate, none, none, FrictionTorques(zero, zero, zero, zero, zero), none)


def _answer(batch: RobotBatch, s: TorqueBalance, state: _State, valid: Flags) -> Swimming:
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
        "advance_per_radian": speed / tail_rate,
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
