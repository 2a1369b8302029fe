"""The axial force balance, for every model, drive and reading of the friction.

Unknowns are U (the whole robot, along x), Omega (body) and omega (rotor, in the lab). No axial force acts
from outside, so the force row gives U, and two torque rows are left:

    body:   S_bb Omega + S_br omega = -tau + T_b
    rotor:  S_rb Omega + S_rr omega =  tau + T_r

with the joint torque tau (motor on rotor) and friction torques T_b, T_r that are linear in the rates.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spirillum.arrays import Axial, PerRobot
from spirillum.robot.actuation import FrictionReading

__all__ = ["FrictionTorques", "TorqueBalance", "force_free", "friction_torques", "rates_per_torque"]


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

    def speed(self, body_rate: PerRobot, tail_rate: PerRobot) -> PerRobot:
        """U, m/s."""
        return self.u_b * body_rate + self.u_r * tail_rate

    def body_load(self, body_rate: PerRobot, tail_rate: PerRobot) -> PerRobot:
        """Torque that turns the body against the fluid, N m."""
        return self.bb * body_rate + self.br * tail_rate

    def rotor_load(self, body_rate: PerRobot, tail_rate: PerRobot) -> PerRobot:
        """T_h of eq. (18): torque that turns the rotor against the fluid, N m."""
        return self.rb * body_rate + self.rr * tail_rate


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
    """(Omega, omega) per joint torque: the solution of both torque rows with tau = 1.

    Friction is kept apart from the fluid's torques, since most of it cancels: added to them first, a large
    one would take their digits away.
    """
    fluid = s.bb * s.rr - s.br * s.rb
    mixed = s.bb * t.rr + t.bb * s.rr - s.br * t.rb - t.br * s.rb
    determinant = fluid + mixed + t.determinant
    body = -((s.rr + s.br) + (t.rr + t.br))
    tail = (s.bb + s.rb) + (t.bb + t.rb)
    return body / determinant, tail / determinant


def force_free(r: Axial) -> TorqueBalance:
    """Eliminate U from the axial 4x4 with zero total force."""
    body_u, rotor_u = r[..., 1, 0] + r[..., 1, 2], r[..., 3, 0] + r[..., 3, 2]
    drag = r[..., 0, 0] + r[..., 0, 2] + r[..., 2, 0] + r[..., 2, 2]
    u_b = -(r[..., 0, 1] + r[..., 2, 1]) / drag
    u_r = -(r[..., 0, 3] + r[..., 2, 3]) / drag
    return TorqueBalance(
        bb=r[..., 1, 1] + body_u * u_b,
        br=r[..., 1, 3] + body_u * u_r,
        rb=r[..., 3, 1] + rotor_u * u_b,
        rr=r[..., 3, 3] + rotor_u * u_r,
        u_b=u_b,
        u_r=u_r,
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
