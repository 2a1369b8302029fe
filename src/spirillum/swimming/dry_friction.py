"""Dry friction of a robot that rests on its asperities, as an added resistance of its body.

The floor carries the robot's weight in the fluid N through asperities at the body's lowest point, which slides along
the tube at U and around it at a Omega, with the body's radius a. Coulomb friction acts against the sliding:

    F_x = -mu_c N U/s,   T_x = -mu_c N a^2 Omega/s,   s = sqrt(U^2 + (a Omega)^2 + v_r^2),

smooth below the sliding speed v_r. That is the resistance k = mu_c N/s against U and k a^2 against Omega, added to the
body's, with k at the robot's own sliding speed. Unlike all fluid resistance it depends on how fast the tail turns. The
film's forces across the tube are not in N: they vanish for a level robot at the lowest place of its tube.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from spirillum.arrays import Axial, AxialLoad, AxialWhole, MeanFlow, PerRobot, Samples, Values
from spirillum.errors import InputError
from spirillum.fluid.model import SwimmerModel
from spirillum.kernels.core import contact_drag
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit
from spirillum.robot.links import links_of
from spirillum.robot.robot import STANDARD_GRAVITY, Robot
from spirillum.swimming.balance import joined, with_body_factors
from spirillum.swimming.steady import Swimming, swim

_SMOOTH = 1e-4
"""v_r over the sliding speed of a body that turns as fast as its tail, as in a run with six degrees of freedom."""
_ROUNDS = 60
_SETTLED = 1e-12
_WHOLE = (0, 1, 3)
"""Indices of U, Omega and omega in the axial form of both parts, where the force on the whole belongs to the body."""


def weights_in_fluid(robots: Sequence[Robot]) -> PerRobot:
    """Weight less buoyancy of whole robots, N; NaN where a mass is not known."""
    return np.array(
        [
            STANDARD_GRAVITY * sum(link.mass - robot.fluid.density * link.volume for link in links_of(robot))
            for robot in robots
        ]
    )


def with_dry_friction(r: AxialWhole, force: Values, radius: Values, tail_rate: Values) -> Samples:
    """R of whole robots, (..., 3, 3), with dry friction mu_c N at the sliding speed that the tail's rate gives."""
    shape = np.broadcast_shapes(r.shape[:-2], *(np.shape(item) for item in (force, radius, tail_rate)))
    full = np.broadcast_to(r, (*shape, 3, 3)).reshape(-1, 3, 3)
    pressed, radii, rates = (np.broadcast_to(item, shape).ravel() for item in (force, radius, tail_rate))
    drag = np.empty(len(full))
    contact_drag(full, pressed, radii, rates, _SMOOTH, drag)
    k, two = drag.reshape(shape), np.full(1, 2.0)
    return with_body_factors(r, (two, two), (k, k * np.asarray(radius) ** 2))


class KnownResistance(SwimmerModel):
    """A model whose resistances along the axis are known beforehand, for each robot of a batch."""

    parts = ()

    def __init__(
        self, model: SwimmerModel, whole: Samples, load: Samples | None = None, flow: MeanFlow | None = None
    ) -> None:
        """Answer with resistances of whole robots, (robots, 3, 3); `model` answers all else."""
        self.name = model.name
        self.placed = model.placed  # type: ignore[misc]
        self.model, self.whole, self._load, self._flow = model, whole, load, flow

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """See `ResistanceModel.domain`."""
        return self.model.domain(batch)

    def axial(self, batch: RobotBatch) -> Axial:  # noqa: ARG002 - one interface for all models
        """See `SwimmerModel.axial`."""
        found = np.zeros((*self.whole.shape[:-2], 4, 4))
        found[..., np.array(_WHOLE)[:, None], _WHOLE] = self.whole
        return found

    def axial_load(self, batch: RobotBatch) -> AxialLoad:
        """See `SwimmerModel.axial_load`."""
        if self._load is None:
            return super().axial_load(batch)
        found = np.zeros((*self._load.shape[:-1], 4))
        found[..., _WHOLE] = self._load
        return found

    def mean_flow(self, batch: RobotBatch) -> MeanFlow | None:  # noqa: ARG002 - as above
        """See `SwimmerModel.mean_flow`."""
        return self._flow

    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Any:
        """See `SwimmerModel.resistance`."""
        return self.model.resistance(batch, phase)

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Any:
        """See `ResistanceModel.part_matrix`."""
        return self.model.part_matrix(batch, part, phase)


def swim_on_floor(
    batch: RobotBatch, model: SwimmerModel, robots: Sequence[Robot], coefficient: Values | float | None, **asked: Any
) -> Swimming:
    """Steady swimming with dry friction, which dissipates too, under the whole weight; free, or without, as `swim`."""
    mu = np.zeros(1) if coefficient is None else np.atleast_1d(np.asarray(coefficient, dtype=float))
    free = swim(batch, model, **asked)
    if not np.any(mu > 0) or asked.get("motion") == "free":
        return free
    weight = weights_in_fluid(robots)
    if batch.joint == "fixed" or not np.all(weight > 0):
        why = "drive.joint = 'fixed'" if batch.joint == "fixed" else "a robot that has no weight in the fluid"
        raise InputError(f"friction_coefficient = {mu[0]:.3g} with {why}; allowed: 0, or a revolute joint and a weight")
    whole, load = joined(model.axial(batch)), model.axial_load(batch)
    held = None if not np.any(load) else np.asarray(load)[..., _WHOLE]
    rate, found = free.tail_rotation_rate, free
    for _ in range(_ROUNDS):
        rubbed = with_dry_friction(whole, mu * weight, 0.5 * batch.body_diameter, np.nan_to_num(rate))
        found = swim(batch, KnownResistance(model, rubbed, held, model.mean_flow(batch)), **asked)
        before, rate = rate, found.tail_rotation_rate
        if not np.any(np.abs(rate - before) > _SETTLED * np.abs(rate)):
            break
    return found
