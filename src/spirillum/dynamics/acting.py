"""What acts on the two links of a robot beside the fluid: friction, weight and buoyancy, and the drive."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels import rigid_links
from spirillum.robot.batch import RobotBatch
from spirillum.robot.links import links_of
from spirillum.robot.robot import STANDARD_GRAVITY, Robot
from spirillum.robot.tables import FrictionReading
from spirillum.swimming.balance import friction_torques

_KINDS = {
    "dc-motor": rigid_links.MOTOR,
    "torque": rigid_links.TORQUE,
    "rate": rigid_links.RATE,
    "magnetic": rigid_links.MAGNETIC,
}
_ELECTRICS = {
    "polarity": rigid_links.POLARITY,
    "joint_torque_constant": rigid_links.TORQUE_CONSTANT,
    "joint_back_emf_constant": rigid_links.BACK_EMF,
    "inductance": rigid_links.INDUCTANCE,
    "constant": rigid_links.CONSTANT,
    "decay": rigid_links.DECAY,
    "decay_rate": rigid_links.DECAY_RATE,
    "growth": rigid_links.GROWTH,
    "growth_rate": rigid_links.GROWTH_RATE,
    "slope": rigid_links.SLOPE,
    "voltage": rigid_links.VOLTAGE,
    "internal_resistance": rigid_links.INTERNAL_RESISTANCE,
    "duty": rigid_links.DUTY,
}


_A = TypeVar("_A", bound="Acting")


@dataclass(frozen=True)
class Acting:
    """Friction, weight and drive as `spirillum.kernels.rigid_links` reads them, SI, about the origin in body axes."""

    friction: Samples
    """Friction of joint and wall against the seven rates (7, 7)."""
    weight: Samples
    """Submerged weight of body and rotor, N, and first moments about the origin at phase 0, N m (8,)."""
    drive: Samples
    """Drive and motor (23,)."""

    def at_duty(self: _A, duty: float) -> _A:
        """The robot while the remote asks for a duty; a field or a prescribed rate is on at any duty but 0."""
        drive = self.drive.copy()
        drive[rigid_links.DUTY] = duty
        return replace(self, drive=drive)


def friction_of(batch: RobotBatch, reading: FrictionReading, effective: float) -> Samples:
    """The readings of (18) and (19) as torques against Omega_b about x (on the whole) and omega_m (in the joint)."""
    rotor = batch.electrics.joint_rotor_friction if batch.electrics else np.zeros(1)
    t = friction_torques(reading, np.array([effective]), rotor)
    bb, br, rb, rr = (float(entry[0]) for entry in (t.bb, t.br, t.rb, t.rr))
    found = np.zeros((7, 7))
    roll, joint = rigid_links.ROTATION, rigid_links.JOINT
    found[roll, roll], found[roll, joint] = (bb + br) + (rb + rr), br + rr
    found[joint, roll], found[joint, joint] = rb + rr, rr
    return found


def weight_of(robot: Robot) -> Samples:
    """Weight less buoyancy of both links; zero where the masses are not known."""
    links = links_of(robot)
    if not np.isfinite([link.mass for link in links]).all():
        return np.zeros(rigid_links.WEIGHT)
    density = robot.fluid.density
    sizes = [link.mass - density * link.volume for link in links]
    moments = [link.mass * link.centre - density * link.volume * link.centroid for link in links]
    return STANDARD_GRAVITY * np.concatenate([sizes, *moments])


def drive_of(batch: RobotBatch) -> Samples:
    """Drive and motor of a batch of one at full duty (23,)."""
    drive = np.zeros(rigid_links.DRIVE)
    drive[rigid_links.KIND], drive[rigid_links.FIXED] = _KINDS[str(batch.drive)], float(batch.joint == "fixed")
    drive[rigid_links.DUTY] = 1.0
    if batch.drive == "torque":
        drive[rigid_links.GIVEN] = batch.drive_torque[0]
    elif batch.drive == "rate":
        drive[rigid_links.GIVEN] = batch.drive_rate[0]
    elif batch.drive == "magnetic":
        moment, angle = float(batch.magnetic_moment[0]), float(batch.moment_angle[0])
        drive[rigid_links.MOMENT : rigid_links.FIELD] = moment * np.cos(angle), 0.0, moment * np.sin(angle)
        drive[rigid_links.FIELD], drive[rigid_links.FIELD_RATE] = batch.magnetic_field[0], batch.field_rate[0]
    elif batch.electrics is not None:
        for name, column in _ELECTRICS.items():
            drive[column] = getattr(batch.electrics, name)[0]
    return drive


def torque_scale(drag: Samples, weight: Samples, drive: Samples) -> float:
    """A torque of the order of those that act, N m.

    The largest of the motor's stall torque, m B, a prescribed torque or that of a prescribed rate, and weight's.

    Args:
        drag: resistance against the seven rates (7, 7).
        weight: submerged weight and moments (8,).
        drive: drive and motor (23,).
    """
    kind = drive[rigid_links.KIND]
    field = float(np.linalg.norm(drive[rigid_links.MOMENT : rigid_links.FIELD])) * drive[rigid_links.FIELD]
    given = abs(drive[rigid_links.GIVEN]) * (
        float(drag[rigid_links.JOINT, rigid_links.JOINT]) if kind == rigid_links.RATE else 1.0
    )
    heavy = float(np.abs(weight[: rigid_links.MOMENT_BODY]).sum()) * float(np.sqrt(drag[4, 4] / drag[1, 1]))
    resistance = drive[rigid_links.CONSTANT]
    stall = drive[rigid_links.TORQUE_CONSTANT] * drive[rigid_links.VOLTAGE] / resistance if resistance > 0 else 0.0
    return float(max(stall, field, given if kind in (rigid_links.TORQUE, rigid_links.RATE) else 0.0, heavy, 1e-300))


def state_sizes(drive: Samples, length: float, torque: float, states: int) -> Samples:
    """Sizes of a state's components below which nothing matters, (states,).

    Args:
        drive: drive and motor (23,).
        length: of the robot's order, m.
        torque: of the order of those that act, N m.
        states: number of components; those behind the ones of `rigid_links` are works, J.
    """
    resistance = drive[rigid_links.CONSTANT]
    current = drive[rigid_links.VOLTAGE] / resistance if resistance > 0 else 1.0
    found = np.ones(states)
    found[rigid_links.POSITION : rigid_links.POSITION + 3] = length
    found[rigid_links.CURRENT] = found[rigid_links.CHARGE] = current
    found[rigid_links.ELECTRICAL : rigid_links.CHARGE] = max(drive[rigid_links.VOLTAGE] * current, torque)
    found[rigid_links.DRIVEN :] = torque
    return found
