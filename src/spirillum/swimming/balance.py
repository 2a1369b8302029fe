"""The axial force balance, for every model, drive and friction model.

Unknowns are U (the whole robot, along x), Omega (body) and omega (rotor, in the lab). No axial force acts
from outside but the fluid's, F = -R V + L, so the force row gives U, and two torque rows are left:

    body:   S_bb Omega + S_br omega = -tau + T_b + t_b
    rotor:  S_rb Omega + S_rr omega =  tau + T_r + t_r

with the joint torque tau (motor on rotor), friction torques T_b, T_r that are linear in the rates, and the torques
t_b, t_r of an imposed flow, which are zero where none is. The rates are those of a robot that coasts in the flow
(tau = 0) plus what the joint torque adds in proportion.

Arrays may have any leading axes: robots, or draws of a posterior by robots.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Axial, AxialLoad, AxialWhole, Matrix12, Samples, Values
from spirillum.robot.tables import FrictionModel

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
