"""From parameters to what is observed: the force balance for many draws and many robots at once.

The resistance of every robot is computed once, or looked up at each draw's place in the tube
(`spirillum.swimming.drawn_resistance`). What is left for a draw of the parameters is a 3x3 balance for each robot, in
closed form.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from spirillum.arrays import PerRobot, Samples, Values
from spirillum.errors import InputError
from spirillum.robot.batch import Electrics
from spirillum.swimming.balance import (
    TorqueBalance,
    body_per_tail,
    force_free,
    friction_torques,
    rates_per_torque,
    with_body_factors,
)
from spirillum.swimming.drawn_resistance import DrawnResistance, Draws
from spirillum.swimming.drives import steady_current
from spirillum.swimming.dry_friction import with_dry_friction


@dataclass(frozen=True)
class Predicted:
    """What draws of the parameters predict, (draws, robots)."""

    advance: Samples
    turning: Samples
    """Omega/omega."""
    load: Samples
    """T_h/omega: torque that turns the rotor against the fluid, N m s."""

    def over_motor(self) -> Samples:
        """U/omega_m, m/rad."""
        return self.advance / (1.0 - self.turning)


@dataclass(frozen=True)
class DryContact:
    """What dry friction under the robots depends on, beside its coefficient."""

    weight: PerRobot
    """Weight in the fluid, N."""
    radius: PerRobot
    """Of the body, m."""
    tail_rate: PerRobot
    """Observed rate of the tail, rad/s."""


@dataclass(frozen=True)
class Forward:
    """The robots of an experiment, prepared for evaluation."""

    resistance: DrawnResistance
    electrics: Electrics | None
    """Motor and battery of the robots."""
    viscosity: Samples
    """The robots' own, Pa s."""
    isolated: tuple[Values, Values] = (np.zeros(1), np.zeros(1))
    """D_x, N s/m, and E_x, N m s, of each robot's body alone at its own viscosity, on which the factors act."""
    factors: Mapping[str, Samples] = field(default_factory=dict)
    """The robots' own factors, where they are not free; 1 where they have none."""
    contact: DryContact | None = None
    """Ranges of dry friction under the robots."""

    def matrices(self, draws: Draws) -> Samples:
        """Balance matrices, (draws, robots, 3, 3), with all factors and dry friction in them."""
        scale = np.asarray(draws["viscosity"]) / self.viscosity if "viscosity" in draws else 1.0
        factors = [np.asarray(draws.get(name, self.factors.get(name, 1.0))) for name in ("body_drag", "body_rotation")]
        drag, rotation = self.isolated
        full = with_body_factors(
            self.resistance.whole(draws), (factors[0], factors[1]), (scale * drag, scale * rotation)
        )
        if self.contact is None or "friction_coefficient" not in draws:
            return full
        force = np.asarray(draws["friction_coefficient"]) * self.contact.weight
        return with_dry_friction(full, force, self.contact.radius, self.contact.tail_rate)

    def balance(self, draws: Draws) -> TorqueBalance:
        """Force-free torque balances, (draws, robots)."""
        return force_free(self.matrices(draws))

    def predict(self, draws: Draws) -> Predicted:
        """Kinematics (15) at the draws."""
        return kinematics(self.balance(draws))

    def motor_rate(self, balance: TorqueBalance, draws: Draws, friction: Samples) -> Samples:
        """omega_m at full throttle with B_eff in the joint, from (15), (17) and (18), rad/s, (draws, robots)."""
        motor = self._motor(draws)
        body, tail = rates_per_torque(balance, friction_torques("rotor", friction, friction))
        per_current = motor.joint_torque_constant * (tail - body)
        current = steady_current(motor, np.zeros(1), motor.joint_back_emf_constant * per_current)
        found: Samples = motor.polarity * per_current * current
        return found

    def friction(
        self, draws: Draws, motor_rate: Samples, tail_share: Samples | None = None, reading: str = "rotor"
    ) -> Samples:
        """B_eff of (18) at given motor rates, (draws, robots); `paper`: the body's torque row holds -K_m I.

        `tail_share` is the observed omega/omega_m of each robot; None or NaN: as the model turns the body.
        """
        s = self.balance(draws)
        turning = kinematics(s).turning
        torque, tail, rate = self._at_motor_rate(turning, draws, motor_rate, tail_share)
        body = turning * tail if reading == "rotor" else s.body_rate_as_printed(torque, tail)
        found: Samples = (torque - s.rotor_load(body, tail)) / rate
        return found

    def printed_turning(self, draws: Draws, motor_rate: Samples, tail_share: Samples) -> Samples:
        """Omega/omega by (19) as printed, E_x Omega = -K_m I, at given motor rates, (draws, robots)."""
        s = self.balance(draws)
        torque, tail, _ = self._at_motor_rate(kinematics(s).turning, draws, motor_rate, tail_share)
        found: Samples = s.body_rate_as_printed(torque, tail) / tail
        return found

    def _at_motor_rate(
        self, turning: Samples, draws: Draws, motor_rate: Samples, tail_share: Samples | None
    ) -> tuple[Samples, Samples, Samples]:
        """K_m I of (17), the tail's rate and the motor's, all in the motor's own sense."""
        motor = self._motor(draws)
        own = 1.0 / (1.0 - turning)
        share = own if tail_share is None else np.where(np.isnan(tail_share), own, tail_share)
        rate = np.abs(motor_rate)
        torque = motor.joint_torque_constant * steady_current(motor, motor.joint_back_emf_constant * rate, np.zeros(1))
        return torque, share * rate, rate

    def _motor(self, draws: Draws) -> Electrics:
        if self.electrics is None:
            raise InputError("the robots have no dc-motor; allowed: robots with [motor], [battery] and drive.kind")
        changed = {
            name: np.asarray(draws[name], dtype=float)
            for name in ("torque_constant", "back_emf_constant")
            if name in draws
        }
        return replace(self.electrics, **changed)

    def largest_difference(self, other: Forward, draws: Draws) -> float:
        """Largest relative difference of what both predict at draws."""
        ours, theirs = self.predict(draws), other.predict(draws)
        pairs = ((ours.advance, theirs.advance), (ours.turning, theirs.turning), (ours.load, theirs.load))
        return max(float(np.max(np.abs(a / b - 1.0))) for a, b in pairs)


def kinematics(balance: TorqueBalance) -> Predicted:
    """Kinematics (15) without an imposed flow: the motion per rate of the tail, from zero force and torque."""
    turning, _ = body_per_tail(balance)
    return Predicted(
        advance=balance.u_b * turning + balance.u_r, turning=turning, load=balance.rb * turning + balance.rr
    )
