"""The robot as two rigid links that move freely: all that its rates follow from, ready for the compiled equations.

The correct form of (15) with its motor: seven rates (U, Omega_b, omega_m) against weight, buoyancy, the films at the
wall, friction, and the torque of motor or field. See `spirillum.kernels.two_links`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.acting import Acting, drive_of, friction_of, torque_scale, weight_of
from spirillum.dynamics.films import films_of
from spirillum.fluid.model import SwimmerModel
from spirillum.kernels import rigid_links
from spirillum.kernels import two_links as kernel
from spirillum.robot.batch import RobotBatch
from spirillum.robot.robot import Robot
from spirillum.robot.tables import FrictionReading
from spirillum.swimming.freedom import LINKS
from spirillum.swimming.steady import calibrated_resistance


@dataclass(frozen=True)
class TwoLinks(Acting):
    """What `spirillum.kernels.two_links` needs, SI, about the origin in body axes."""

    drag: Samples
    """Resistance of both links against the seven rates at phase 0 of the tail (7, 7)."""
    wall: Samples
    """The channel's wall (4,), see `spirillum.dynamics.films`."""
    spots: Samples
    """Rings that may near the wall (n, 6), see `spirillum.dynamics.films`."""

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
        return torque_scale(self.drag, self.weight, self.drive)


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
    heavy, drive = weight_of(robot) if weight else np.zeros(rigid_links.WEIGHT), drive_of(batch)
    films = films_of(robot, roughness, float(drag[1, 1]), torque_scale(drag, heavy, drive) / _length(drag))
    return TwoLinks(
        drag=drag,
        friction=friction_of(batch, friction, effective),
        weight=heavy,
        wall=films.wall,
        spots=films.spots,
        drive=drive,
    )


def _length(drag: Samples) -> float:
    return float(np.sqrt(drag[4, 4] / drag[1, 1]))
