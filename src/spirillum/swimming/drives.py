"""Motor, battery and the rates of body and tail: from the robots' drive, or prescribed.

Everything of the motor is in its own sense: current, rate and back-emf are positive the way that the
applied voltage drives. The pulse-width controller (400 kHz, far above R/L) is averaged: the motor sees
duty V(I), the battery gives duty I.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from spirillum.arrays import PerRobot, Samples, Values
from spirillum.errors import InputError
from spirillum.kernels.core import MOST_POINTS, MOTOR_SIZE, curve_torques, steady_currents, windings
from spirillum.robot.batch import Electrics, RobotBatch
from spirillum.robot.tables import FrictionModel, TorqueCurve
from spirillum.swimming.balance import (
    FRICTIONLESS,
    FrictionTorques,
    TorqueBalance,
    body_per_tail,
    coasting_rates,
    friction_torques,
    rates_per_torque,
)


def winding_resistance(motor: Electrics, current: Values) -> Values:
    """R(I) of Table II, ohm; takes |I|."""
    rows, shape = _rows(motor, current)
    found = np.empty((rows.shape[0], 2))
    windings(np.ascontiguousarray(rows[:, :MOTOR_SIZE]), np.ascontiguousarray(rows[:, MOTOR_SIZE]), found)
    return found[:, 0].reshape(shape)


def battery_voltage(motor: Electrics, current: Values) -> Values:
    """V(I) of Table II at the terminals, V; takes |I|."""
    return motor.voltage - motor.internal_resistance * np.abs(current)


def steady_current(motor: Electrics, back_emf: Values, back_emf_per_current: Values) -> Values:
    """Steady root of (17), R(I) I = duty V(I) - (back_emf + back_emf_per_current I): one while the motor drives."""
    # Negative where the tail drives the motor, NaN where it does so beyond any root, or beyond the battery's voltage.
    rows, shape = _rows(motor, motor.duty, back_emf, back_emf_per_current)
    found = np.empty(rows.shape[0])
    steady_currents(rows, found)
    return found.reshape(shape)


def _rows(motor: Electrics, *more: Values) -> tuple[Samples, tuple[int, ...]]:
    """Motors as C takes them, each with further numbers, (n, 12 + ...), and the shape that all of them share."""
    columns = [*motor.columns, *more]
    shape = np.broadcast_shapes(*(column.shape for column in columns))
    rows = np.empty((*shape, len(columns)))
    for place, column in enumerate(columns):
        rows[..., place] = column
    return rows.reshape(-1, len(columns)), shape


def packed_curve(curve: TorqueCurve) -> Samples:
    """A curve as C takes it, (25,)."""
    found = np.zeros(1 + 2 * MOST_POINTS)
    found[0] = len(curve.rates)
    found[1:].reshape(-1, 2)[: len(curve.rates)] = np.transpose((curve.rates, curve.torques))
    return found


def run_time(motor: Electrics, current: Values) -> Values:
    """Time for which the rated charge lasts at a constant motor current, s; NaN without a rating."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return motor.capacity / (motor.duty * np.abs(current))


@dataclass(frozen=True)
class DriveState:
    """Rates and what the motor does to keep them."""

    body_rate: PerRobot
    tail_rate: PerRobot
    current: PerRobot
    effective: PerRobot
    torques: FrictionTorques
    residual: PerRobot
    step_out: PerRobot = field(default_factory=lambda: np.full(1, np.nan))
    """Magnetic drive: fastest rotation of the field that the robot follows, rad/s."""
    lag: PerRobot = field(default_factory=lambda: np.full(1, np.nan))
    """Magnetic drive: angle of the moment behind the turning field, rad; NaN where the robot does not follow."""
    driving_rate: PerRobot = field(default_factory=lambda: np.full(1, np.nan))
    """Magnetic drive: rate of the field, against which its torque works, rad/s."""


def _joint_friction(batch: RobotBatch, friction: FrictionModel) -> tuple[PerRobot, PerRobot]:
    """(B_eff or B, B_m); unset, B_eff is the rotor's own B_m alone and the wall's B is zero."""
    rotor = batch.electrics.joint_rotor_friction if batch.electrics else np.zeros(1)
    if friction == "none":
        return np.zeros(1), rotor
    unset = np.isnan(batch.effective_friction)
    return np.where(unset, 0.0 if friction == "body" else rotor, batch.effective_friction), rotor


def driven(batch: RobotBatch, s: TorqueBalance, friction: FrictionModel) -> DriveState:
    """Motion under the robots' own drive: what the joint torque adds to coasting; the motor closes it."""
    effective, rotor = _joint_friction(batch, friction)
    t = friction_torques(friction, effective, rotor)
    none = np.full(1, np.nan)
    if batch.drive == "rate":
        body_rate, tail = _rates_at(s, t, batch.drive_rate, none)
        return DriveState(body_rate, tail, none, effective, t, none)
    body_coasting, tail_coasting = coasting_rates(s, t)
    body_per_torque, tail_per_torque = rates_per_torque(s, t)
    if batch.drive == "torque":
        torque, current = batch.drive_torque, none
    elif batch.curve is not None:
        sense, current = batch.curve.sense * batch.hand, none
        slip, coasting = tail_per_torque - body_per_torque, sense * (tail_coasting - body_coasting)
        rates, slopes = np.broadcast_arrays(coasting, slip)
        found = np.empty(rates.size)
        curve_torques(packed_curve(batch.curve), rates.ravel(), slopes.ravel(), 1.0, found)
        torque = sense * found.reshape(rates.shape)
    elif batch.drive == "dc-motor" and batch.electrics is not None:
        motor = batch.electrics
        slip = tail_per_torque - body_per_torque
        per_current = motor.joint_back_emf_constant * motor.joint_torque_constant * slip
        coasting = motor.joint_back_emf_constant * motor.polarity * (tail_coasting - body_coasting)
        current = motor.polarity * steady_current(motor, coasting, per_current)
        torque = motor.joint_torque_constant * current
    else:
        raise InputError("drive is missing; allowed: a [drive] table, or a tail rate (--tail-rate)")
    # Reading `paper` pushes the tail backwards once B_eff exceeds E_x: no steady motion of that kind.
    tail_per_torque = np.where(tail_per_torque > 0, tail_per_torque, np.nan)
    body_rate, tail = body_per_torque * torque + body_coasting, tail_per_torque * torque + tail_coasting
    return DriveState(body_rate, tail, current, effective, t, none)


def at_rate(
    batch: RobotBatch, s: TorqueBalance, tail_rate: PerRobot, motor_rate: PerRobot, friction: FrictionModel
) -> DriveState:
    """Motion at prescribed rates; with a DC-motor the friction follows from (17) and (18)."""
    effective, rotor = _joint_friction(batch, friction)
    none = np.full(1, np.nan)
    motor = batch.electrics
    if batch.drive != "dc-motor" or motor is None:
        t = friction_torques(friction, effective, rotor)
        body_rate, tail = _rates_at(s, t, tail_rate, motor_rate)
        return DriveState(body_rate, tail, none, effective, t, none)
    if friction == "paper":
        return _at_rate_paper(s, motor, tail_rate, motor_rate)
    wall = effective if friction == "body" else np.zeros(1)
    # What acts inside the joint cancels in the sum of both torques and does not change the motion.
    body_rate, tail = _rates_at(s, friction_torques("body", wall, np.zeros(1)), tail_rate, motor_rate)
    slip = np.where(np.isnan(motor_rate), tail - body_rate, motor_rate)
    current = current_at(motor, slip)
    spare = motor.joint_torque_constant * current - s.rotor_load(body_rate, tail)
    if friction == "rotor":
        inferred = spare / slip
        t = friction_torques("rotor", inferred, rotor)
        return DriveState(body_rate, tail, current, inferred, t, none)
    t = friction_torques(friction, effective, rotor)
    residual = spare - (rotor * slip if friction == "body" else 0.0)
    return DriveState(body_rate, tail, current, effective, t, residual)


def _rates_at(
    s: TorqueBalance, t: FrictionTorques, tail_rate: PerRobot, motor_rate: PerRobot
) -> tuple[PerRobot, PerRobot]:
    """(Omega, omega) at a tail rate, or where that is NaN at a motor rate."""
    turning, drift = body_per_tail(s, t)
    tail = np.where(np.isnan(tail_rate), (motor_rate + drift) / (1.0 - turning), tail_rate)
    return turning * tail + drift, tail


def _at_rate_paper(s: TorqueBalance, motor: Electrics, tail_rate: PerRobot, motor_rate: PerRobot) -> DriveState:
    """Reading `paper`: the body row holds -K_m I and the flow's torque, so the current decides the body's rate."""
    k, k_b = motor.joint_torque_constant, motor.joint_back_emf_constant
    observed = ~np.isnan(motor_rate)
    emf = k_b * motor.polarity * np.where(observed, motor_rate, tail_rate * (1.0 + s.br / s.bb) - s.t_b / s.bb)
    current = motor.polarity * steady_current(motor, emf, np.where(observed, 0.0, k_b * k / s.bb))
    from_motor = -(k * current + s.br * motor_rate - s.t_b) / (s.bb + s.br)
    body_rate = np.where(np.isnan(tail_rate), from_motor, s.body_rate_as_printed(k * current, tail_rate))
    tail = np.where(np.isnan(tail_rate), body_rate + motor_rate, tail_rate)
    slip = np.where(observed, motor_rate, tail - body_rate)
    inferred = (k * current - s.rotor_load(body_rate, tail)) / slip
    t = friction_torques("paper", inferred, motor.joint_rotor_friction)
    body_coasting, tail_coasting = coasting_rates(s, t)
    with_motor = (tail - tail_coasting) * (slip - (tail_coasting - body_coasting)) > 0
    tail = np.where(with_motor, tail, np.nan)  # B_eff beyond E_x pushes the tail backwards: as in `driven`
    return DriveState(body_rate, tail, current, inferred, t, np.full(1, np.nan))


def current_at(motor: Electrics, motor_rate: PerRobot) -> PerRobot:
    """Signed current at a given motor rate, from (17)."""
    emf = motor.joint_back_emf_constant * motor.polarity * motor_rate
    return motor.polarity * steady_current(motor, emf, np.zeros(1))


def one_piece(batch: RobotBatch, s: TorqueBalance, tail_rate: PerRobot) -> DriveState:
    """Fixed joint: body and tail turn together under an external torque or rate."""
    load, flow = s.bb + s.br + s.rb + s.rr, s.t_b + s.t_r
    none = np.full(1, np.nan)
    if batch.drive == "magnetic" and np.all(np.isnan(tail_rate)):
        strength = batch.magnetic_moment * np.sin(batch.moment_angle) * batch.magnetic_field
        wanted = batch.field_rate - flow / load  # what the field has to drive beyond the flow's own turning
        step_out = strength / load
        follows = np.abs(wanted) <= step_out
        lag = np.where(follows, np.arcsin(np.where(follows, np.abs(wanted) / step_out, 0.0)), np.nan)
        slipping = wanted - np.sign(wanted) * np.sqrt(np.where(follows, 0.0, wanted**2 - step_out**2))
        rate = np.where(follows, wanted, slipping) + flow / load
        return DriveState(rate, rate, none, none, FRICTIONLESS, none, step_out, lag, batch.field_rate)
    own = batch.drive_rate if batch.drive == "rate" else (batch.drive_torque + flow) / load
    rate = np.where(np.isnan(tail_rate), own, tail_rate)
    return DriveState(rate, rate, none, none, FRICTIONLESS, none)
