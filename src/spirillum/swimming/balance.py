"""The axial force balance, for every model, drive and reading of the friction.

Unknowns are U (the whole robot, along x), Omega (body) and omega (rotor, in the lab). No axial force acts
from outside but the fluid's, F = -R V + L, so the force row gives U, and two torque rows are left:

    body:   S_bb Omega + S_br omega = -tau + T_b + t_b
    rotor:  S_rb Omega + S_rr omega =  tau + T_r + t_r

with the joint torque tau (motor on rotor), friction torques T_b, T_r that are linear in the rates, and the torques
t_b, t_r of an imposed flow, which are zero where none is. The rates are those of a robot that coasts in the flow
(tau = 0) plus what the joint torque adds in proportion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Axial, AxialLoad, PerRobot
from spirillum.robot.actuation import FrictionReading

__all__ = [
    "FrictionTorques",
    "TorqueBalance",
    "coasting_rates",
    "force_free",
    "friction_torques",
    "rates_per_torque",
]


class TorqueBalance(NamedTuple):
    """The robot free of axial force: torques against rates, and the speed that goes with them."""

    bb: PerRobot
    br: PerRobot
    rb: PerRobot
    rr: PerRobot
    """Torque on body (b) and rotor (r) per rate of body and rotor, N m s."""
    u_b: PerRobot
    u_r: PerRobot
    """Speed per rate of body and rotor, m."""
    u_0: PerRobot
    """Speed at which an imposed flow carries the robot while nothing turns, m/s."""
    t_b: PerRobot
    t_r: PerRobot
    """Torque of the imposed flow on body (b) and rotor (r) meanwhile, N m."""

    def speed(self, body_rate: PerRobot, tail_rate: PerRobot) -> PerRobot:
        """U, m/s."""
        return self.u_b * body_rate + self.u_r * tail_rate + self.u_0

    def body_load(self, body_rate: PerRobot, tail_rate: PerRobot) -> PerRobot:
        """Torque that turns the body against the fluid, N m."""
        return self.bb * body_rate + self.br * tail_rate - self.t_b

    def rotor_load(self, body_rate: PerRobot, tail_rate: PerRobot) -> PerRobot:
        """T_h of eq. (18): torque that turns the rotor against the fluid, N m."""
        return self.rb * body_rate + self.rr * tail_rate - self.t_r


class FrictionTorques(NamedTuple):
    """Friction torques as coefficients: -T_b = bb Omega + br omega, -T_r = rb Omega + rr omega."""

    bb: PerRobot
    br: PerRobot
    rb: PerRobot
    rr: PerRobot
    determinant: PerRobot
    """bb rr - br rb, without the cancellation."""

    def power(self, body_rate: PerRobot, tail_rate: PerRobot) -> PerRobot:
        """Power that friction takes, W."""
        on_body = self.bb * body_rate + self.br * tail_rate
        return on_body * body_rate + (self.rb * body_rate + self.rr * tail_rate) * tail_rate


def rates_per_torque(s: TorqueBalance, t: FrictionTorques) -> tuple[PerRobot, PerRobot]:
    """(Omega, omega) per joint torque: the solution of both torque rows for tau alone.

    Friction is kept apart from the fluid's torques, since most of it cancels: added to them first, a large
    one would take their digits away.
    """
    determinant = _determinant(s, t)
    body = -((s.rr + s.br) + (t.rr + t.br))
    tail = (s.bb + s.rb) + (t.bb + t.rb)
    return body / determinant, tail / determinant


def coasting_rates(s: TorqueBalance, t: FrictionTorques) -> tuple[PerRobot, PerRobot]:
    """(Omega, omega) in an imposed flow without joint torque, rad/s: the solution of both torque rows for tau = 0."""
    determinant = _determinant(s, t)
    body = (s.rr * s.t_b - s.br * s.t_r) + (t.rr * s.t_b - t.br * s.t_r)
    tail = (s.bb * s.t_r - s.rb * s.t_b) + (t.bb * s.t_r - t.rb * s.t_b)
    return body / determinant, tail / determinant


def _determinant(s: TorqueBalance, t: FrictionTorques) -> PerRobot:
    """Of both torque rows, fluid and friction together."""
    fluid = s.bb * s.rr - s.br * s.rb
    mixed = s.bb * t.rr + t.bb * s.rr - s.br * t.rb - t.br * s.rb
    return fluid + mixed + t.determinant


def force_free(r: Axial, load: AxialLoad) -> TorqueBalance:
    """Eliminate U from F = -R V + L with zero total force.

    Args:
        r: R, the axial resistance of both parts.
        load: L, the wrench of an imposed flow on the robot at rest.
    """
    body_u, rotor_u = r[..., 1, 0] + r[..., 1, 2], r[..., 3, 0] + r[..., 3, 2]
    drag = r[..., 0, 0] + r[..., 0, 2] + r[..., 2, 0] + r[..., 2, 2]
    u_b = -(r[..., 0, 1] + r[..., 2, 1]) / drag
    u_r = -(r[..., 0, 3] + r[..., 2, 3]) / drag
    u_0 = (load[..., 0] + load[..., 2]) / drag
    return TorqueBalance(
        bb=r[..., 1, 1] + body_u * u_b,
        br=r[..., 1, 3] + body_u * u_r,
        rb=r[..., 3, 1] + rotor_u * u_b,
        rr=r[..., 3, 3] + rotor_u * u_r,
        u_b=u_b,
        u_r=u_r,
        u_0=u_0,
        t_b=load[..., 1] - body_u * u_0,
        t_r=load[..., 3] - rotor_u * u_0,
    )


def friction_torques(reading: FrictionReading, effective: PerRobot, rotor_friction: PerRobot) -> FrictionTorques:
    """The readings of eqs (18) and (19).

    Args:
        reading: `none`; `rotor`: B_eff inside the joint, as (18) says; `body`: B_m inside the joint and a wall
            coefficient B on the body's rate; `paper`: as (19) is printed, tenable only as an external torque
            -B_eff omega_m on the rotor.
        effective: B_eff (it contains B_m), or B for `body`, N m s/rad.
        rotor_friction: B_m, N m s/rad.
    """
    zero = np.zeros(1)
    if reading == "rotor":
        return FrictionTorques(effective, -effective, -effective, effective, zero)
    if reading == "body":
        joint, wall = rotor_friction, effective
        return FrictionTorques(joint + wall, -joint, -joint, joint, joint * wall)
    if reading == "paper":
        return FrictionTorques(zero, zero, -effective, effective, zero)
    return FrictionTorques(zero, zero, zero, zero, zero)
