"""From parameters to what is observed: the force balance for many draws and many robots at once.

The resistance of every robot is computed once. What is left for a draw of the parameters is a 3x3 balance for each
robot, in closed form. Over parameters that change the geometry (wire, gap, pitch) resistances are interpolated by
polynomials through Chebyshev points, whose error is measured at points in between.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.fluid.closed.perrin import body_axial
from spirillum.fluid.model import SwimmerModel
from spirillum.robot.batch import Electrics, RobotBatch
from spirillum.swimming.balance import (
    TorqueBalance,
    body_per_tail,
    force_free,
    friction_torques,
    joined,
    rates_per_torque,
    with_body_factors,
)
from spirillum.swimming.motor import steady_current

__all__ = ["Draws", "Forward", "Predicted", "Table", "TableError", "axis_points", "kinematics", "tabulated"]

Draws = Mapping[str, Samples]
"""Parameter to values, (draws, robots) or (draws, 1)."""


@dataclass(frozen=True)
class Predicted:
    """What draws of the parameters predict, (draws, robots)."""

    advance: Samples
    """U/omega, m/rad."""
    turning: Samples
    """Omega/omega."""
    load: Samples
    """T_h/omega: torque that turns the rotor against the fluid, N m s."""

    def over_motor(self) -> Samples:
        """U/omega_m, m/rad."""
        return self.advance / (1.0 - self.turning)


@dataclass(frozen=True)
class Table:
    """Balance matrices over tabulated parameters; with none of them a single point.

    `parts` are summands: the first with factor one, the others with those of RFT's coefficients.
    """

    names: tuple[str, ...]
    """Tabulated parameters."""
    nodes: tuple[Samples, ...]
    """The points of each axis, as `axis_points` gives them."""
    parts: tuple[Samples, ...]
    """(points..., robots, 3, 3): rows force on the whole, torque on body, on rotor; columns U, Omega, omega."""
    drag: Samples
    """D_x of each robot, N s/m."""
    rotation: Samples
    """E_x of each robot, N m s."""


@dataclass(frozen=True)
class TableError:
    """Largest relative errors of what a table predicts, at a place between its points; zeros without a table."""

    interpolation: float = 0.0
    """Against the model solved there as finely as at the points."""
    resolution: float = 0.0
    """Of the model solved as finely as at the points, against its own resolution."""
    total: float = 0.0
    """Of the table, against the model at its own resolution."""

    @property
    def largest(self) -> float:
        """What no prediction is taken to be better than; the parts may happen to cancel at one place."""
        return max(self.interpolation, self.resolution, self.total)


def _parts(batch: RobotBatch, model: SwimmerModel, *, coefficients: bool) -> tuple[Samples, ...]:
    """Summands of the balance matrix; RFT is linear in both of its coefficients."""
    whole = np.broadcast_to(joined(model.axial(batch)), (batch.size, 3, 3))
    if not coefficients:
        return (whole,)
    own = batch.options.rft
    found = []
    for name in ("normal_factor", "tangential_factor"):
        value = getattr(own, name)
        doubled = own.model_copy(update={name: 2.0 * value})
        other = replace(batch, options=batch.options.model_copy(update={"rft": doubled}))
        found.append((joined(model.axial(other)) - whole) / value)
    rest = whole - own.normal_factor * found[0] - own.tangential_factor * found[1]
    return rest, found[0], found[1]


def axis_points(name: str, count: int, low: float, high: float) -> tuple[Samples, Samples]:
    """Chebyshev points of the first kind along a parameter: along its logarithm for lengths, and its values there."""
    ends = _along(name, np.array([low, high]))
    angle = (2.0 * np.arange(count) + 1.0) * np.pi / (2.0 * count)
    points = 0.5 * (ends[0] + ends[1]) - 0.5 * (ends[1] - ends[0]) * np.cos(angle)
    return points, points if name in _LINEAR else np.exp(points)


_LINEAR = ("pitch",)
"""Tabulated parameters that may be zero."""


def _along(name: str, values: Samples) -> Samples:
    return values if name in _LINEAR else np.log(values)


def tabulated(
    batches: Iterable[RobotBatch],
    model: SwimmerModel,
    names: Sequence[str] = (),
    nodes: Sequence[Samples] = (),
    *,
    coefficients: bool = False,
) -> Table:
    """Compute the resistances at every point of the table.

    Args:
        batches: the robots at each point, the last axis fastest; one batch where nothing is tabulated.
        model: the hydrodynamic model.
        names: tabulated parameters.
        nodes: points of each axis.
        coefficients: whether RFT's coefficients are free.
    """
    shape = tuple(axis.size for axis in nodes)
    found, first = [], None
    for batch in batches:
        first = first or batch
        found.append(_parts(batch, model, coefficients=coefficients))
    assert first is not None  # noqa: S101 - a table has a point
    size = first.size
    drag, rotation = body_axial(first)
    return Table(
        names=tuple(names),
        nodes=tuple(nodes),
        parts=tuple(np.stack(part).reshape(*shape, size, 3, 3) for part in zip(*found, strict=True)),
        drag=np.broadcast_to(drag, (size,)),
        rotation=np.broadcast_to(rotation, (size,)),
    )


def _weights(nodes: Samples, at: Samples) -> Samples:
    """Weights of the points for polynomial interpolation (barycentric form), with one more axis at the end."""
    count = nodes.size
    angle = (2.0 * np.arange(count) + 1.0) * np.pi / (2.0 * count)
    signs = (-1.0) ** np.arange(count) * np.sin(angle)
    distance = at[..., None] - nodes
    hit = np.abs(distance) < 1e-14 * np.ptp(nodes)
    raw = signs / np.where(hit, 1.0, distance)
    raw = np.where(np.any(hit, axis=-1, keepdims=True), hit, raw)
    found: Samples = raw / raw.sum(axis=-1, keepdims=True)
    return found


@dataclass(frozen=True)
class Forward:
    """The robots of an experiment, ready to be asked."""

    table: Table
    electrics: Electrics | None
    """Motor and battery of the robots."""
    viscosity: Samples
    """The robots' own, to which the table belongs, Pa s."""
    factors: Mapping[str, Samples] = field(default_factory=dict)
    """The robots' own factors, where they are not free; 1 where they have none."""

    def matrices(self, draws: Draws) -> Samples:
        """Balance matrices, (draws, robots, 3, 3), with all factors in them."""
        table = self.table
        parts = [self._at(part, draws) for part in table.parts]
        m = parts[0]
        for part, name in zip(parts[1:], ("normal_factor", "tangential_factor"), strict=False):
            m = m + np.asarray(draws.get(name, self.factors.get(name, 1.0)))[..., None, None] * part
        drag, rotation = (
            np.asarray(draws.get(name, self.factors.get(name, 1.0))) for name in ("body_drag", "body_rotation")
        )
        full = with_body_factors(m, (drag, rotation), (table.drag, table.rotation))
        if "viscosity" in draws:
            full = full * (np.asarray(draws["viscosity"]) / self.viscosity)[..., None, None]
        return full

    def _at(self, part: Samples, draws: Draws) -> Samples:
        """Interpolate a part at the draws, (draws, robots, 3, 3)."""
        if not self.table.names:
            return part[None]
        robots = part.shape[-3]
        weights = [
            _weights(nodes, _along(name, np.broadcast_to(draws[name], (draws[name].shape[0], robots))))
            for name, nodes in zip(self.table.names, self.table.nodes, strict=True)
        ]
        if len(weights) == 1:
            along: Samples = np.einsum("wja,ajkl->wjkl", weights[0], part)
            return along
        both: Samples = np.einsum("wja,wjb,abjkl->wjkl", weights[0], weights[1], part, optimize=True)
        return both

    def balance(self, draws: Draws) -> TorqueBalance:
        """Force-free torque balances, (draws, robots)."""
        return force_free(self.matrices(draws))

    def predict(self, draws: Draws) -> Predicted:
        """Kinematics (15) at the draws."""
        return kinematics(self.balance(draws))

    def motor_rate(self, balance: TorqueBalance, draws: Draws, friction: Samples) -> Samples:
        """omega_m at full throttle with B_eff in the joint, from (15), (17) and (18), rad/s, (draws, robots).

        Args:
            balance: `balance` of the draws.
            draws: parameters.
            friction: B_eff, N m s/rad.
        """
        motor = self._motor(draws)
        body, tail = rates_per_torque(balance, friction_torques("rotor", friction, friction))
        per_current = motor.joint_torque_constant * (tail - body)
        current = steady_current(motor, np.zeros(1), motor.joint_back_emf_constant * per_current)
        found: Samples = motor.polarity * per_current * current
        return found

    def friction(
        self, draws: Draws, motor_rate: Samples, tail_share: Samples | None = None, reading: str = "rotor"
    ) -> Samples:
        """B_eff of (18) at given motor rates, N m s/rad, (draws, robots).

        Args:
            draws: parameters.
            motor_rate: omega_m, rad/s.
            tail_share: observed omega/omega_m of each robot; None or NaN: as the model turns the body.
            reading: `rotor`, or `paper`, in which the body's torque row holds -K_m I.
        """
        s = self.balance(draws)
        turning = kinematics(s).turning
        torque, tail, rate = self._at_motor_rate(turning, draws, motor_rate, tail_share)
        body = turning * tail if reading == "rotor" else s.body_rate_as_printed(torque, tail)
        found: Samples = (torque - s.rotor_load(body, tail)) / rate
        return found

    def printed_turning(self, draws: Draws, motor_rate: Samples, tail_share: Samples) -> Samples:
        """Omega/omega by (19) as printed, E_x Omega = -K_m I, at given motor rates; arguments as `friction`."""
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

    def interpolation_error(self, other: Forward, draws: Draws) -> float:
        """Largest relative difference of advance and turning from resistances that were computed at the draws."""
        ours, theirs = self.predict(draws), other.predict({k: v for k, v in draws.items() if k not in self.table.names})
        pairs = ((ours.advance, theirs.advance), (ours.turning, theirs.turning), (ours.load, theirs.load))
        return max(float(np.max(np.abs(a / b - 1.0))) for a, b in pairs)


def kinematics(balance: TorqueBalance) -> Predicted:
    """Kinematics (15) without an imposed flow: the motion per rate of the tail, from zero force and torque."""
    turning, _ = body_per_tail(balance)
    return Predicted(
        advance=balance.u_b * turning + balance.u_r, turning=turning, load=balance.rb * turning + balance.rr
    )
