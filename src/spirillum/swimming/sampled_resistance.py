"""Sampled resistance: as a function of fitted values, wire, viscosity and pose.

Fits and posteriors ask for the resistance of a few robots at thousands of values of a few numbers. What does not change
is computed once. Over the wire's diameter resistances are interpolated by polynomials through Chebyshev points; RFT is
linear in its coefficients, and every model in the viscosity. In the tube the robots' tables answer for each place.

Draws are a mapping from a number's name to values (draws, robots) or (draws, 1); what is not drawn is the robot's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from spirillum.arrays import PerRobot, Samples
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.tube.library import TabledTube, mean_resistances_along
from spirillum.robot.batch import RobotBatch
from spirillum.robot.tube_pose import gap_of
from spirillum.swimming.balance import joined

Draws = Mapping[str, Samples]  #: Number to values, (draws, robots) or (draws, 1).

_COEFFICIENTS = ("normal_factor", "tangential_factor")


class DrawnResistance(Protocol):
    """Resistance of some robots at draws."""

    def whole(self, draws: Draws) -> Samples:
        """R of the whole robot against U, Omega and omega, (draws, robots, 3, 3); (1, ...) where draws share it."""


def chebyshev_points(count: int, low: float, high: float) -> Samples:
    """Chebyshev points of the first kind between two positive numbers, along the logarithm; the numbers."""
    angle = (2.0 * np.arange(count) + 1.0) * np.pi / (2.0 * count)
    ends = np.log([low, high])
    found: Samples = np.exp(0.5 * ends.sum() - 0.5 * (ends[1] - ends[0]) * np.cos(angle))
    return found


@dataclass(frozen=True)
class AxialTable:
    """Resistance by a model without a pose, over wire diameter, RFT's coefficients and viscosity."""

    parts: tuple[Samples, ...]
    """Summands (points, robots, 3, 3): the first with factor one, the others with those of RFT's coefficients."""
    wires: Samples  #: Wire diameters of the points, m; a single one where the wire is not sampled.
    viscosity: Samples  #: The robots' own, to which the parts belong, Pa s, (robots,) or (1,).
    coefficients: Mapping[str, float]

    @classmethod
    def of(
        cls,
        batch: RobotBatch,
        model: SwimmerModel,
        *,
        wires: Samples | None = None,
        coefficients: bool = False,
        on_progress: Callable[[int, int], None] | None = None,
    ) -> AxialTable:
        """Compute the resistances."""
        found = []
        values = [None] if wires is None else wires.tolist()
        for done, wire in enumerate(values):
            if on_progress is not None:
                on_progress(done, len(values))
            there = batch if wire is None else batch.with_values({"tail.wire_diameter": wire})
            found.append(_parts(there, model, coefficients=coefficients))
        return cls(
            parts=tuple(np.stack(part) for part in zip(*found, strict=True)),
            wires=batch.wire_diameter[:1] if wires is None else wires,
            viscosity=batch.viscosity,
            coefficients={name: getattr(batch.options.rft, name) for name in _COEFFICIENTS},
        )

    def whole(self, draws: Draws) -> Samples:
        """See `DrawnResistance.whole`."""
        first, *others = [self._at(part, draws) for part in self.parts]
        found = first
        for part, name in zip(others, _COEFFICIENTS, strict=False):
            found = found + np.asarray(draws.get(name, self.coefficients[name]))[..., None, None] * part
        if "viscosity" in draws:
            found = found * (np.asarray(draws["viscosity"]) / self.viscosity)[..., None, None]
        return found

    def _at(self, part: Samples, draws: Draws) -> Samples:
        """Interpolate a part at the draws, (draws, robots, 3, 3)."""
        if self.wires.size == 1:
            return part
        from scipy.interpolate import BarycentricInterpolator

        wire = np.asarray(draws["wire_diameter"])
        between = BarycentricInterpolator(np.log(self.wires), np.eye(self.wires.size), rng=0)
        weights = between(np.log(np.broadcast_to(wire, (wire.shape[0], part.shape[1]))))
        found: Samples = np.einsum("wja,ajkl->wjkl", weights, part)
        return found


def _parts(batch: RobotBatch, model: SwimmerModel, *, coefficients: bool) -> tuple[Samples, ...]:
    """Summands of the balance matrix; RFT is linear in both of its coefficients."""
    whole = np.broadcast_to(joined(model.axial(batch)), (batch.size, 3, 3))
    if not coefficients:
        return (whole,)
    own = batch.options.rft
    found = []
    for name in _COEFFICIENTS:
        value = getattr(own, name)
        doubled = own.model_copy(update={name: 2.0 * value})
        other = replace(batch, options=batch.options.model_copy(update={"rft": doubled}))
        found.append((joined(model.axial(other)) - whole) / value)
    rest = whole - own.normal_factor * found[0] - own.tangential_factor * found[1]
    return rest, found[0], found[1]


@dataclass(frozen=True)
class TubeResistance:
    """Resistance in the tube by the robots' tables over gap, pitch and viscosity, not sampled: the robots' own."""

    tables: Samples  #: Packed tables, a row for each robot, the shorter ones filled up.
    against: PerRobot
    """Pressure drop of the mean flow through each tube with open ends, over viscosity and velocity, times the tube's
    cross-section, m; infinite for closed ends."""
    viscosity: PerRobot  #: The robots' own, Pa s.
    gap: PerRobot
    pitch: PerRobot
    yaw: float = 0.0

    @classmethod
    def of(cls, batch: RobotBatch, model: TabledTube) -> TubeResistance:
        """For the robots of a batch, in their tubes."""
        packed = [model.table_of(batch, index).packed for index in range(batch.size)]
        longest = max(table.size for table in packed)
        place = batch.placement
        diameter, radius = (
            np.broadcast_to(values, (batch.size,)) for values in (batch.body_diameter, 0.5 * batch.channel_diameter)
        )
        gaps = [gap_of(place, float(d), float(r)) for d, r in zip(diameter, radius, strict=True)]
        return cls(
            tables=np.stack([np.pad(table, (0, longest - table.size)) for table in packed]),
            against=model.against(batch),
            viscosity=np.broadcast_to(batch.viscosity, (batch.size,)),
            gap=np.array(gaps),
            pitch=np.full(batch.size, place.pitch or 0.0),
            yaw=place.yaw,
        )

    def whole(self, draws: Draws) -> Samples:
        """See `DrawnResistance.whole`; ends condensed, NaN where a pose is outside a robot's table."""
        full = self._full(draws)
        flow = full[..., -1, :-1] / (self.against + full[..., -1, -1])[..., None]
        found = full[..., :-1, :-1] - full[..., :-1, -1, None] * flow[..., None, :]
        return found * self._viscosities(draws)[..., None, None]

    def load(self, draws: Draws, flow: float) -> Samples:
        """Force and torques of an imposed mean flow on the robot at rest, (draws, robots, 3); as `whole`."""
        return flow * self._full(draws)[..., :-1, -1] * self._viscosities(draws)[..., None]

    def _viscosities(self, draws: Draws) -> Samples:
        return np.asarray(draws["viscosity"]) if "viscosity" in draws else self.viscosity

    def _full(self, draws: Draws) -> Samples:
        """R against U, Omega, omega and the mean flow for viscosity 1, (draws, robots, 4, 4)."""
        gap, pitch = np.asarray(draws.get("gap", self.gap)), np.asarray(draws.get("pitch", self.pitch))
        count = max(gap.shape[0] if gap.ndim > 1 else 1, pitch.shape[0] if pitch.ndim > 1 else 1)
        shape = (count, len(self.tables))
        return mean_resistances_along(
            self.tables, np.broadcast_to(gap, shape), np.broadcast_to(pitch, shape), np.full(shape, self.yaw)
        )
