"""The robot as two rigid links that move freely: all that its rates follow from, ready for the compiled equations.

The correct form of (15) with its motor: seven rates (U, Omega_b, omega_m) against weight, buoyancy, the films at the
wall, friction, and the torque of motor or field. See `spirillum.kernels.two_links`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.films import films_of
from spirillum.fluid.model import SwimmerModel
from spirillum.kernels import two_links as kernel
from spirillum.robot.actuation import FrictionReading
from spirillum.robot.batch import RobotBatch
from spirillum.robot.links import links_of
from spirillum.robot.robot import STANDARD_GRAVITY, Robot
from spirillum.swimming.balance import friction_torques
from spirillum.swimming.freedom import LINKS
from spirillum.swimming.steady import calibrated_resistance

__all__ = ["TwoLinks", "two_links"]

_KINDS = {"dc-motor": kernel.MOTOR, "torque": kernel.TORQUE, "rate": kernel.RATE, "magnetic": kernel.MAGNETIC}
_ELECTRICS = {
    "polarity": kernel.POLARITY,
    "torque_constant": kernel.TORQUE_CONSTANT,
    "back_emf_constant": kernel.BACK_EMF,
    "inductance": kernel.INDUCTANCE,
    "constant": kernel.CONSTANT,
    "decay": kernel.DECAY,
    "decay_rate": kernel.DECAY_RATE,
    "growth": kernel.GROWTH,
    "growth_rate": kernel.GROWTH_RATE,
    "slope": kernel.SLOPE,
    "voltage": kernel.VOLTAGE,
    "internal_resistance": kernel.INTERNAL_RESISTANCE,
    "duty": kernel.DUTY,
}


@dataclass(frozen=True)
class TwoLinks:
    """What `spirillum.kernels.two_links` needs, SI, about the origin in body axes."""

    drag: Samples
    """Resistance of both links against the seven rates at phase 0 of the tail (7, 7)."""
    friction: Samples
    """Friction of joint and wall against the seven rates (7, 7)."""
    weight: Samples
    """Submerged weight of body and rotor, N, and first moments about the origin at phase 0, N m (8,)."""
    wall: Samples
    """The channel's wall (4,), see `spirillum.dynamics.films`."""
    spots: Samples
    """Rings that may near the wall (n, 6), see `spirillum.dynamics.films`."""
    drive: Samples
    """Drive and motor (20,)."""

    @property
    def data(self) -> Samples:
        """All of them in one array, for `kernels.two_links.rates`."""
        return kernel.packed(self.drag, self.friction, self.weight, self.wall, self.spots, self.drive)

    @property
    def length(self) -> float:
        """A length of the robot's order, m."""
        return _length(self.drag)

    @property
    def torque(self) -> float:
        """A torque of the order of those that act, N m."""
        return _torque(self.drag, self.weight, self.drive)

    def at_duty(self, duty: float) -> TwoLinks:
        """The robot while the remote asks for a duty; a field or a prescribed rate is on at any duty but 0."""
        drive = self.drive.copy()
        drive[kernel.DUTY] = duty
        return replace(self, drive=drive)


def two_links(
    robot: Robot,
    batch: RobotBatch,
    model: SwimmerModel,
    *,
    friction: FrictionReading,
    effective: float,
    calibrated: bool,
    weight: bool,
    roughness: float | None,
) -> TwoLinks:
    """Everything that a robot's rates follow from.

    Args:
        robot: the robot.
        batch: that robot as a batch of one.
        model: a model that knows all entries of R.
        friction: reading of the friction.
        effective: its B_eff, or B of the wall, N m s/rad.
        calibrated: apply the robot's calibration factors.
        weight: with weight and buoyancy, if the robot's masses are known.
        roughness: of the wall's films, m; None: the default of `films_of`.
    """
    resistance = calibrated_resistance(batch, model, calibrated=calibrated)[0]
    drag = np.ascontiguousarray(LINKS.T @ resistance @ LINKS)
    heavy, drive = _weight(robot) if weight else np.zeros(kernel.WEIGHT), _drive(batch)
    films = films_of(robot, roughness, float(drag[1, 1]), _torque(drag, heavy, drive) / _length(drag))
    return TwoLinks(
        drag=drag,
        friction=_friction(batch, friction, effective),
        weight=heavy,
        wall=films.wall,
        spots=films.spots,
        drive=drive,
    )


def _length(drag: Samples) -> float:
    return float(np.sqrt(drag[4, 4] / drag[1, 1]))


def _torque(drag: Samples, weight: Samples, drive: Samples) -> float:
    """Largest of the motor's stall torque, m B, a prescribed torque or that of a prescribed rate, and weight's."""
    kind = drive[kernel.KIND]
    field = float(np.linalg.norm(drive[kernel.MOMENT : kernel.FIELD])) * drive[kernel.FIELD]
    given = abs(drive[kernel.GIVEN]) * (float(drag[kernel.JOINT, kernel.JOINT]) if kind == kernel.RATE else 1.0)
    heavy = float(np.abs(weight[: kernel.MOMENT_BODY]).sum()) * _length(drag)
    resistance = drive[kernel.CONSTANT]
    stall = drive[kernel.TORQUE_CONSTANT] * drive[kernel.VOLTAGE] / resistance if resistance > 0 else 0.0
    return float(max(stall, field, given if kind in (kernel.TORQUE, kernel.RATE) else 0.0, heavy, 1e-300))


def _friction(batch: RobotBatch, reading: FrictionReading, effective: float) -> Samples:
    """The readings of (18) and (19) as torques against Omega_b about x (on the whole) and omega_m (in the joint)."""
    rotor = batch.electrics.rotor_friction if batch.electrics else np.zeros(1)
    t = friction_torques(reading, np.array([effective]), rotor)
    bb, br, rb, rr = (float(entry[0]) for entry in (t.bb, t.br, t.rb, t.rr))
    found = np.zeros((7, 7))
    roll, joint = kernel.ROTATION, kernel.JOINT
    found[roll, roll], found[roll, joint] = (bb + br) + (rb + rr), br + rr
    found[joint, roll], found[joint, joint] = rb + rr, rr
    return found


def _weight(robot: Robot) -> Samples:
    """Weight less buoyancy of both links; zero where the masses are not known."""
    links = links_of(robot)
    if not np.isfinite([link.mass for link in links]).all():
        return np.zeros(kernel.WEIGHT)
    density = robot.fluid.density
    sizes = [link.mass - density * link.volume for link in links]
    moments = [link.mass * link.centre - density * link.volume * link.centroid for link in links]
    return STANDARD_GRAVITY * np.concatenate([sizes, *moments])


def _drive(batch: RobotBatch) -> Samples:
    drive = np.zeros(kernel.DRIVE)
    drive[kernel.KIND], drive[kernel.FIXED] = _KINDS[str(batch.drive)], float(batch.joint == "fixed")
    drive[kernel.DUTY] = 1.0
    if batch.drive == "torque":
        drive[kernel.GIVEN] = batch.drive_torque[0]
    elif batch.drive == "rate":
        drive[kernel.GIVEN] = batch.drive_rate[0]
    elif batch.drive == "magnetic":
        moment, angle = float(batch.magnetic_moment[0]), float(batch.moment_angle[0])
        drive[kernel.MOMENT : kernel.FIELD] = moment * np.cos(angle), 0.0, moment * np.sin(angle)
        drive[kernel.FIELD], drive[kernel.FIELD_RATE] = batch.magnetic_field[0], batch.field_rate[0]
    elif batch.electrics is not None:
        for name, column in _ELECTRICS.items():
            drive[column] = getattr(batch.electrics, name)[0]
    return drive
