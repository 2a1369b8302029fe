"""The axial force balance, for every model, drive and friction model, and the rates that solve it.

Unknowns are U (the whole robot, along x), Omega (body) and omega (rotor, in the lab). No axial force acts
from outside but the fluid's, F = -R V + L, so the force row gives U, and two torque rows are left:

    body:   S_bb Omega + S_br omega = -tau + T_b + t_b
    rotor:  S_rb Omega + S_rr omega =  tau + T_r + t_r

with the joint torque tau (motor on rotor), friction torques T_b, T_r that are linear in the rates, and the torques
t_b, t_r of an imposed flow, which are zero where none is. The rates are those of a robot that coasts in the flow
(tau = 0) plus what the joint torque adds in proportion.

Arrays may have any leading axes: robots, or draws of a posterior by robots.

Everything of the motor is in its own sense: current, rate and back-emf are positive the way that the applied voltage
drives. The pulse-width controller (400 kHz, far above R/L) is averaged: the motor sees duty V(I), the battery duty I.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, cast, get_args

import numpy as np

from spirillum.arrays import Axial, AxialLoad, AxialWhole, Matrix12, PerRobot, Samples, Values
from spirillum.errors import InputError, check_choice
from spirillum.kernels.core import MOST_POINTS, MOTOR_SIZE, curve_torques, steady_currents, windings
from spirillum.robot.batch import Electrics, RobotBatch
from spirillum.robot.tables import FrictionModel, TorqueCurve

_ZERO = np.zeros(1)
_ZERO.setflags(write=False)

_SPINS = np.zeros((12, 7))
"""Twists from (U, Omega_y, Omega_z) of both parts and their own rates about x, Omega and omega."""
for _column, _row in enumerate((0, 1, 2, 4, 5)):
    _SPINS[_row, _column] = _SPINS[6 + _row, _column] = 1.0
_SPINS[3, 5] = _SPINS[9, 6] = 1.0


class TorqueBalance(NamedTuple):
    """The robot free of axial force: torques against rates, and the speed that goes with them."""

    bb: Values
    br: Values
    rb: Values
    rr: Values  #: Torque on body (b) and rotor (r) per rate of body and rotor, N m s.
    u_b: Values
    u_r: Values  #: Speed per rate of body and rotor, m.
    u_0: Values = _ZERO  #: Speed at which an imposed flow carries the robot while nothing turns, m/s.
    t_b: Values = _ZERO
    t_r: Values = _ZERO  #: Torque of the imposed flow on body (b) and rotor (r) meanwhile, N m.

    def speed(self, body_rate: Values, tail_rate: Values) -> Values:
        """U, m/s."""
        return self.u_b * body_rate + self.u_r * tail_rate + self.u_0

    def body_load(self, body_rate: Values, tail_rate: Values) -> Values:
        """Torque that turns the body against the fluid, N m."""
        return self.bb * body_rate + self.br * tail_rate - self.t_b

    def rotor_load(self, body_rate: Values, tail_rate: Values) -> Values:
        """T_h of eq. (18): torque that turns the rotor against the fluid, N m."""
        return self.rb * body_rate + self.rr * tail_rate - self.t_r

    def body_rate_as_printed(self, motor_torque: Values, tail_rate: Values) -> Values:
        """Omega from the body's torque row with -K_m I in it, as (15) with (19) is printed, rad/s."""
        return -(motor_torque + self.br * tail_rate - self.t_b) / self.bb


class FrictionTorques(NamedTuple):
    """Friction torques as coefficients: -T_b = bb Omega + br omega, -T_r = rb Omega + rr omega."""

    bb: Values
    br: Values
    rb: Values
    rr: Values
    determinant: Values  #: bb rr - br rb, without the cancellation.

    def power(self, body_rate: Values, tail_rate: Values) -> Values:
        """Power that friction takes, W."""
        on_body = self.bb * body_rate + self.br * tail_rate
        return on_body * body_rate + (self.rb * body_rate + self.rr * tail_rate) * tail_rate


FRICTIONLESS = FrictionTorques(_ZERO, _ZERO, _ZERO, _ZERO, _ZERO)


def joined(axial: Axial) -> AxialWhole:
    """The axial resistance of both parts as that of the whole robot: the parts share U, and their forces are added."""
    m = np.empty((*axial.shape[:-2], 3, 3))
    m[..., 0, 0] = axial[..., 0, 0] + axial[..., 0, 2] + axial[..., 2, 0] + axial[..., 2, 2]
    for row, part in ((1, 1), (2, 3)):
        m[..., row, 0] = axial[..., part, 0] + axial[..., part, 2]
        m[..., 0, row] = axial[..., 0, part] + axial[..., 2, part]
        m[..., row, 1], m[..., row, 2] = axial[..., part, 1], axial[..., part, 3]
    return m


def with_body_factors(
    r: Samples, factors: tuple[Values, Values], isolated: tuple[Values, Values], entries: tuple[int, int] = (0, 1)
) -> Samples:
    """R with calibration factors on the body's drag: a factor f adds (f - 1) times the isolated body's drag."""
    more = [(factor - 1.0) * drag for factor, drag in zip(factors, isolated, strict=True)]
    shape = np.broadcast_shapes(r.shape[:-2], *(extra.shape for extra in more))
    r = np.array(np.broadcast_to(r, (*shape, *r.shape[-2:])))
    for entry, extra in zip(entries, more, strict=True):
        r[..., entry, entry] += extra
    return r


def force_free(m: AxialWhole, load: AxialLoad | None = None) -> TorqueBalance:
    """Eliminate U from F = -R V + L with zero total force; L is the wrench of an imposed flow, or None."""
    drag, body_u, rotor_u = m[..., 0, 0], m[..., 1, 0], m[..., 2, 0]
    u_b, u_r = -m[..., 0, 1] / drag, -m[..., 0, 2] / drag
    balance = TorqueBalance(
        bb=m[..., 1, 1] + body_u * u_b,
        br=m[..., 1, 2] + body_u * u_r,
        rb=m[..., 2, 1] + rotor_u * u_b,
        rr=m[..., 2, 2] + rotor_u * u_r,
        u_b=u_b,
        u_r=u_r,
    )
    if load is None:
        return balance
    u_0 = (load[..., 0] + load[..., 2]) / drag
    return balance._replace(u_0=u_0, t_b=load[..., 1] - body_u * u_0, t_r=load[..., 3] - rotor_u * u_0)


def released(r: Matrix12) -> tuple[TorqueBalance, Samples]:
    """The torque balance about the motor axis of (n, 12, 12), and U, Omega_y, Omega_z per rates, (n, 5, 2)."""
    # U, Omega_y and Omega_z are eliminated: no force and no lateral torque acts on the whole robot.
    shared = np.swapaxes(_SPINS, 0, 1) @ r @ _SPINS
    rates: Samples = -np.asarray(np.linalg.solve(shared[..., :5, :5], shared[..., :5, 5:]), dtype=np.float64)
    s = shared[..., 5:, 5:] + shared[..., 5:, :5] @ rates
    entries = s[..., 0, 0], s[..., 0, 1], s[..., 1, 0], s[..., 1, 1]
    return TorqueBalance(*entries, u_b=rates[..., 0, 0], u_r=rates[..., 0, 1]), rates


def body_per_tail(s: TorqueBalance, t: FrictionTorques | None = None) -> tuple[Values, Values]:
    """Kinematics (15): Omega/omega, and the rate Omega that an imposed flow adds, rad/s."""
    # From the sum of both torque rows, in which the joint torque cancels. NaN where reading `paper` has a B_eff beyond
    # E_x, which would push the tail backwards.
    on_body, on_tail = s.bb + s.rb, s.br + s.rr
    if t is not None:
        on_body, on_tail = on_body + (t.bb + t.rb), on_tail + (t.br + t.rr)
        on_body = np.where(on_body > 0, on_body, np.nan)
    return -on_tail / on_body, (s.t_b + s.t_r) / on_body


def rates_per_torque(s: TorqueBalance, t: FrictionTorques) -> tuple[Values, Values]:
    """(Omega, omega) per joint torque: the solution of both torque rows for tau alone."""
    # Friction is kept apart from the fluid's torques, since most of it cancels: added to them first, a large one would
    # take their digits away.
    determinant = _determinant(s, t)
    body = -((s.rr + s.br) + (t.rr + t.br))
    tail = (s.bb + s.rb) + (t.bb + t.rb)
    return body / determinant, tail / determinant


def coasting_rates(s: TorqueBalance, t: FrictionTorques) -> tuple[Values, Values]:
    """(Omega, omega) in an imposed flow without joint torque, rad/s: the solution of both torque rows for tau = 0."""
    determinant = _determinant(s, t)
    body = (s.rr * s.t_b - s.br * s.t_r) + (t.rr * s.t_b - t.br * s.t_r)
    tail = (s.bb * s.t_r - s.rb * s.t_b) + (t.bb * s.t_r - t.rb * s.t_b)
    return body / determinant, tail / determinant


def _determinant(s: TorqueBalance, t: FrictionTorques) -> Values:
    """Of both torque rows, fluid and friction together."""
    fluid = s.bb * s.rr - s.br * s.rb
    mixed = s.bb * t.rr + t.bb * s.rr - s.br * t.rb - t.br * s.rb
    return fluid + mixed + t.determinant


def find_friction_model(name: str) -> FrictionModel:
    """Return the friction model of that name."""
    check_choice("friction", name, get_args(FrictionModel))
    return cast("FrictionModel", name)


def friction_torques(reading: FrictionModel, effective: Values, rotor_friction: Values) -> FrictionTorques:
    """The readings of eqs (18) and (19), by B_eff (it contains B_m), or B for `body`, and B_m, N m s/rad."""
    if reading == "rotor":  # B_eff inside the joint, as (18) says
        return FrictionTorques(effective, -effective, -effective, effective, _ZERO)
    if reading == "body":  # B_m inside the joint and a wall coefficient B on the body's rate
        joint, wall = rotor_friction, effective
        return FrictionTorques(joint + wall, -joint, -joint, joint, joint * wall)
    if reading == "paper":  # as (19) is printed, tenable only as an external torque -B_eff omega_m on the rotor
        return FrictionTorques(_ZERO, _ZERO, -effective, effective, _ZERO)
    return FRICTIONLESS


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
