"""Velocity and pressure around a robot in its tube, from the tractions that `tube` solves for.

The flow is that of tractions and forces in unbounded fluid, what the wall reflects of them (`fluid.tube.wall`),
and the mean flow through the tube. For the wall, tractions are many point forces, dense enough for the steepest wave
that reaches the wall; where they stand in rows along the tube, one wave meets the whole row at once.

Far from the robot only the mean flow and a uniform pressure on either side are left.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Amplitudes, Samples
from spirillum.errors import InputError
from spirillum.fields.fluid_field import FluidField, add_tractions, checked_points, name_parts
from spirillum.fluid.tube.confined import Strengths, UnitMotions, turned_motions
from spirillum.fluid.tube.domain import pose_of
from spirillum.fluid.tube.solids import Solids
from spirillum.fluid.tube.tube import unit_motions
from spirillum.fluid.tube.wall import waves_between
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.robot.batch import RobotBatch
from spirillum.robot.outline import Outline
from spirillum.robot.tube_pose import TubePose

_DECAY = 2.5  # Rate, times the radius, at which the flow of a force at least dies out along the tube.
_TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From body axes to those of the solution: x along the robot, y up, z to the right."""
_FADE = 1.25  # Steepest wave over that which matters: between them waves are faded out.
_CANCEL = 4.0  # Multiple of that range beyond which the waves of forces cancel.
_SHARES = 8  # Consecutive waves are distributed over the cores: flat ones cost most.


@dataclass(frozen=True)
class TubeFlowField(FluidField):
    """Flow at one instant in a tube.

    The pressure is that above the mean of both ends of a tube in whose middle the body lies.
    """

    held: UnitMotions = field(repr=False)  #: Tractions for unit motions, at this phase, viscosity 1.
    seat: TubePose  #: The tube and the robot's pose in it.
    solids: tuple[tuple[str, Outline], ...]
    twists: Samples  #: Velocity and rotation of body, then of rotor, (12,).
    mean_flow: float  #: Mean velocity of the fluid through the tube, m/s.
    viscosity: float

    def part_at(self, points: Samples) -> np.ndarray:
        """See `FluidField.part_at`."""
        turned = checked_points(points) @ _TURN.T
        placed = self.seat.placed(turned)
        outside = np.hypot(placed[:, 1], placed[:, 2]) >= self.seat.radius
        names = np.where(outside, "glass", "").astype("U8")
        return name_parts(names, turned, self.held.strengths.wires, self.solids)

    def fields(self, points: Samples) -> tuple[Samples, Samples]:
        """See `FluidField.fields`."""
        turned = self.in_fluid(points) @ _TURN.T
        placed = self.seat.placed(turned)
        found = self._through_flow(placed)
        near = np.abs(placed[:, 0] - self._wall.middle) < self._wall.reach
        found[:, 3] += 0.5 * self.pressure_rise * np.sign(placed[:, 0] - self._wall.middle) * ~near
        if np.any(near):
            disturbed = self._wall.field(np.ascontiguousarray(placed[near]))
            unbounded = self._unbounded(np.ascontiguousarray(turned[near]))
            disturbed[:, :3] += unbounded[:, :3] @ self.seat.rotation.T
            disturbed[:, 3] += unbounded[:, 3]
            disturbed[:, 3] *= self.viscosity
            found[near] += disturbed / (8.0 * np.pi)
        return found[:, :3] @ self.seat.rotation @ _TURN, found[:, 3]

    def wrench(self) -> Samples:
        """See `FluidField.wrench`."""
        both = self.viscosity * (self.held.matrix @ self.twists - self.mean_flow * self.held.load)
        return both[:6] + both[6:]

    @property
    def pressure_rise(self) -> float:
        """Pressure far ahead less that far behind, but for what drives the mean flow itself, Pa."""
        work = float(self.held.load @ self.twists) - self.mean_flow * self.held.drag
        return self.viscosity * work / (np.pi * self.seat.radius**2)

    def _through_flow(self, placed: Samples) -> Samples:
        """The mean flow undisturbed, velocity in the tube's axes and pressure, (n, 4)."""
        found = np.zeros((len(placed), 4))
        r = self.seat.radius
        found[:, 0] = self.mean_flow * (2.0 - 2.0 * (placed[:, 1] ** 2 + placed[:, 2] ** 2) / r**2)
        found[:, 3] = -8.0 * self.viscosity * self.mean_flow / r**2 * placed[:, 0]
        return found

    @cached_property
    def _motion(self) -> Samples:
        """Amounts of the unit motions, (13,)."""
        motion: Samples = turned_motions().T @ np.append(self.twists, -self.mean_flow)
        return motion

    @cached_property
    def _forces(self) -> Samples:
        """Along the wires, (stations, 3)."""
        return (self.held.strengths.forces @ self._motion).reshape(-1, 3)

    @cached_property
    def _density(self) -> Amplitudes:
        """Modes (f_x, f_rho, g) ds/du of the tractions, even real, odd imaginary, (panels, p, modes, 3)."""
        strengths = self.held.strengths
        solids = strengths.solids
        found = np.zeros((solids.modes, 3 * solids.panels.size), complex)
        for rows, tractions, phase in zip(solids.rows, strengths.tractions, (1.0, 1j), strict=True):
            values, starts = tractions @ self._motion, rows.starts
            for m, here in enumerate(rows.of_mode):
                found[m, here] += phase * values[starts[m] : starts[m + 1]]
        shaped = found.reshape(solids.modes, *solids.panels.x.shape, 3)
        return np.ascontiguousarray(np.moveaxis(shaped, 0, 2))

    @cached_property
    def _wall(self) -> _Reflection:
        return _Reflection.of(self.held.strengths, self._density, self._forces)

    def _unbounded(self, turned: Samples) -> Samples:
        """The flow without the wall, as csrc/field.c has it, (n, 4)."""
        strengths, field = self.held.strengths, np.zeros((len(turned), 4))
        layer = strengths.solids.panels, self._density
        add_tractions(turned, strengths.wires, self._forces, layer, field)
        return field


class _Sources(NamedTuple):
    """Point forces in columns along the tube, about its axis: (c,) places across it, (c, n) along it."""

    rho: Samples
    angle: Samples
    x: Samples
    forces: Samples  #: Even and odd part, along x, rho and the angle, (c, n, 2, 3).

    @classmethod
    def of(cls, points: Samples, forces: Samples) -> _Sources:
        """From points (c, n, 3), of one column each, and forces (c, n, 2, 3) along the tube's axes."""
        angle = np.arctan2(points[:, 0, 2], points[:, 0, 1])
        c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
        along, up, side = np.moveaxis(forces, -1, 0)
        parts = np.stack([along, up * c + side * s, side * c - up * s], axis=-1)
        return cls(np.hypot(points[:, 0, 1], points[:, 0, 2]), angle, points[..., 0], parts)


@dataclass(frozen=True)
class _Reflection:
    """Reflection at the wall: waves and their amplitudes, see csrc/tube_field.c."""

    radius: float
    waves: tuple[Samples, np.ndarray]  #: k, 1/m, and number of orders p of each.
    classes: tuple[tuple[float, Any], ...]
    """Smallest distance from the wall of a group of forces, m, twice that of the previous, and a tree of positions.
    """
    cut: float  #: Waves that are damped by exp(-cut) no longer matter.
    middle: float  #: Between both ends of the robot, along the tube, m.
    reach: float  #: Where, from there, the flow has died out, m.
    steps: Samples
    amplitudes: Samples  #: Of `core.wave_amplitudes`.

    @classmethod
    def of(cls, strengths: Strengths, density: Amplitudes, forces: Samples) -> _Reflection:
        """Add up the waves of all forces at the stations and of the tractions on the panels of the solids."""
        from scipy.special import k0e, k1e

        from spirillum.kernels.core import wave_amplitudes

        seat, tolerance = strengths.solids.pose, strengths.solids.fineness.tolerance
        cut = -float(np.log(tolerance))
        columns = list(_columns(strengths, density, forces, cut))
        low = min(float(part.x.min()) for part in columns)
        high = max(float(part.x.max()) for part in columns)
        nearest = min(seat.radius - float(part.rho.max()) for part in columns)
        beyond = cut / _DECAY * seat.radius
        waves = waves_between(seat.radius, high - low + beyond, 0.5 * nearest, tolerance)
        turn = np.argsort(np.arange(waves.k.size) % _SHARES, kind="stable")
        k, weight, orders = waves.k[turn], waves.weight[turn], np.array(waves.orders)[turn]
        rho, angle = (np.concatenate([part[number] for part in columns]) for number in (0, 1))
        first = np.concatenate([np.full(len(part.x), part.x.shape[1]) for part in columns])
        steps = np.zeros((k.size, orders.max()))
        amplitudes = np.zeros((k.size, 2, 2, orders.max(), 3))
        wave_amplitudes(
            k,
            weight,
            orders,
            k1e(k * seat.radius) / k0e(k * seat.radius),
            seat.radius,
            rho,
            angle,
            cut / (seat.radius - rho),
            np.concatenate([[0], np.cumsum(first)]),
            np.concatenate([part.x.ravel() for part in columns]),
            np.concatenate([part.forces.reshape(-1, 2, 3) for part in columns]),
            steps,
            amplitudes,
        )
        middle, reach = 0.5 * (low + high), 0.5 * (high - low) + beyond
        return cls(seat.radius, (k, orders), _classes(columns, seat.radius), cut, middle, reach, steps, amplitudes)

    def field(self, placed: Samples) -> Samples:
        """Velocity and pressure at points about the tube's axis, in its axes, (n, 4)."""
        from spirillum.kernels.core import add_waves

        field = np.zeros((len(placed), 4))
        distance = np.maximum(self.radius - np.hypot(placed[:, 1], placed[:, 2]), 0.0)
        steepest = _FADE * self.cut / self._range(placed, distance)
        add_waves(placed, steepest, *self.waves, self.radius, self.steps, self.amplitudes, field)
        return field

    def _range(self, placed: Samples, distance: Samples) -> Samples:
        """Damping distance of waves between forces, wall and points, (n,); those of far forces cancel."""
        found = np.full(len(placed), np.inf)
        for least, tree in self.classes:
            apart, _ = tree.query(placed)
            found = np.minimum(found, np.maximum(distance + least, apart / _CANCEL))
        return found


def _classes(columns: Sequence[_Sources], radius: float) -> tuple[tuple[float, Any], ...]:
    """Forces sorted by their distance from the wall."""
    from scipy.spatial import cKDTree

    rho = np.concatenate([np.repeat(part.rho, part.x.shape[1]) for part in columns])
    angle = np.concatenate([np.repeat(part.angle, part.x.shape[1]) for part in columns])
    x = np.concatenate([part.x.ravel() for part in columns])
    points = np.stack([x, rho * np.cos(angle), rho * np.sin(angle)], axis=1)
    points = np.concatenate([points, points * [1.0, 1.0, -1.0]])  # half circles stand for whole ones
    distance = radius - np.concatenate([rho, rho])
    number = np.floor(np.log2(distance / distance.min())).astype(int)
    return tuple((float(distance[number == n].min()), cKDTree(points[number == n])) for n in np.unique(number))


def _columns(strengths: Strengths, density: Amplitudes, forces: Samples, cut: float) -> Iterator[_Sources]:
    """Point forces equivalent to the tractions, and those along the wires."""
    seat = strengths.solids.pose
    if strengths.wires:
        points = seat.placed(np.concatenate([wire.points for wire in strengths.wires]))
        both = np.stack([forces, forces], axis=1) @ seat.rotation.T
        yield _Sources.of(points[:, None], both[:, None])
    for panel in range(len(density)):
        yield from _panel_columns(strengths.solids, panel, density[panel], cut)


def _panel_columns(solids: Solids, number: int, density: Amplitudes, cut: float) -> Iterator[_Sources]:
    """Forces at Gauss points of one panel, on half circles about the robot's axis: the other half mirrors them."""
    # Of a yawed robot, which has no mirror image in its tube, they stand on whole circles.
    panels, seat = solids.panels, solids.pose
    x_p, rho_p = panels.x[number], panels.rho[number]
    length = float(np.sum(np.hypot(np.diff(x_p), np.diff(rho_p))))
    steepest = cut / float(np.min(seat.distances(x_p, rho_p)))
    nodes, gauss = np.polynomial.legendre.leggauss(panels.order + 4 + int(0.3 * steepest * length))
    cardinal = panels.cardinals(nodes)
    x, rho = cardinal @ x_p, cardinal @ rho_p
    modes = np.tensordot(cardinal, density, axes=(1, 0))  # (n, modes, 3)
    level = seat.level and float(np.ptp(rho_p)) < 1e-9 * seat.radius
    around = np.pi if seat.yaw == 0 else 2.0 * np.pi
    distances = seat.distances(x, rho)
    for some in [slice(None)] if level else [slice(at, at + 1) for at in range(x.size)]:
        orders = seat.radius * cut / float(np.min(distances[some]))
        count = int(0.6 * (orders + density.shape[1])) + 12
        count = round(count * around / np.pi)
        theta = around * (np.arange(count) + 0.5) / count
        across = rho[some] * np.cos(theta)[:, None], rho[some] * np.sin(theta)[:, None]
        points = np.stack(np.broadcast_arrays(x[some], *across), axis=-1)
        weight = 2.0 * np.pi / count * gauss[some] * rho[some]
        acting = _ring_forces(weight[:, None, None] * modes[some], theta) @ seat.rotation.T
        if seat.yaw:  # a force is the sum of its even and its odd half, which cancel in its mirror image
            acting = np.repeat(acting.sum(axis=2, keepdims=True), 2, axis=2)
        yield _Sources.of(seat.placed(points.reshape(-1, 3)).reshape(points.shape), acting)


def _ring_forces(modes: Amplitudes, theta: Samples) -> Samples:
    """Even and odd part in Cartesian axes, (angles, n, 2, 3), from modes (n, modes, 3)."""
    m = np.arange(modes.shape[1])
    c, s = np.cos(theta)[:, None, None], np.sin(theta)[:, None, None]
    cos, sin = np.cos(theta[:, None] * m), np.sin(theta[:, None] * m)
    found = []
    for part, like, other in ((modes.real, cos, -sin), (modes.imag, -sin, -cos)):
        along, out = (np.einsum("nm,tm->tn", part[..., d], like)[:, :, None] for d in (0, 1))
        around = np.einsum("nm,tm->tn", part[..., 2], other)[:, :, None]
        found.append(np.concatenate([along, out * c - around * s, out * s + around * c], axis=2))
    return np.stack(found, axis=2)


def tube_flow_field(
    batch: RobotBatch, body_twist: Samples, rotor_twist: Samples, phase: float, mean_flow: float
) -> TubeFlowField:
    """Flow around one robot in its tube whose parts move with given twists, as in `flow_field`, in a mean flow, m/s."""
    twists = np.concatenate([np.asarray(body_twist, dtype=float), np.asarray(rotor_twist, dtype=float)])
    held = unit_motions(batch, 0, phase)
    solids = tuple(RobotGeometry.of(batch).outlines.items())
    if not solids:
        raise InputError("the flow around a bare tail in a tube is not computed; allowed: model slender, or a body")
    return TubeFlowField(held, pose_of(batch), solids, twists, float(mean_flow), float(batch.viscosity[0]))
