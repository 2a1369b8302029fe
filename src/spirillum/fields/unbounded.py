"""Velocity and pressure of the fluid around a moving robot, from the tractions that `slender` solves for."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from spirillum.arrays import Samples
from spirillum.fields.fluid_field import FluidField, add_tractions, checked_points, name_parts
from spirillum.fluid.algebra import axis_rotation
from spirillum.fluid.wire.interaction import UnitTwistSolution
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.fluid.wire.slender import robot_solution
from spirillum.robot.batch import RobotBatch
from spirillum.robot.outline import Outline


@dataclass(frozen=True)
class FlowField(FluidField):
    """Flow at one instant in fluid that is at rest far away."""

    solution: UnitTwistSolution = field(repr=False)
    """Tractions for unit twists, at phase 0."""
    solids: tuple[tuple[str, Outline], ...]
    """Names and outlines of the solids of revolution."""
    twists: Samples
    """Velocity and rotation of body, then of rotor, (12,)."""
    phase: float
    """Phase of the tail, rad."""
    viscosity: float
    """Pa s."""

    def part_at(self, points: Samples) -> np.ndarray:
        """See `FluidField.part_at`."""
        turned = self._tail_frame(checked_points(points))
        return name_parts(np.full(len(turned), "", dtype="U8"), turned, self.solution.wires, self.solids)

    def fields(self, points: Samples) -> tuple[Samples, Samples]:
        """See `FluidField.fields`; the pressure is zero far away."""
        turned = self._tail_frame(self.in_fluid(points))
        field = self._sum(turned)
        velocity = field[:, :3] @ _rotation(self.phase).T / (8.0 * np.pi)
        return velocity, self.viscosity * field[:, 3] / (8.0 * np.pi)

    def wrench(self) -> Samples:
        """See `FluidField.wrench`."""
        rows = self.solution.matrix
        matrix = self.viscosity * (rows[:6] + rows[6:])
        back, forth = _rotation(-self.phase), _rotation(self.phase)
        turned = matrix @ (self.twists.reshape(4, 3) @ back.T).ravel()
        held: Samples = (turned.reshape(2, 3) @ forth.T).ravel()
        return held

    def _tail_frame(self, points: Samples) -> Samples:
        """Turned back by the phase."""
        turned: Samples = points @ _rotation(self.phase)
        return turned

    def _sum(self, points: Samples) -> Samples:
        s = self.solution
        back = _rotation(-self.phase)
        twists = (self.twists.reshape(4, 3) @ back.T).ravel()
        field = np.zeros((len(points), 4))
        forces, moments = (s.forces @ twists).reshape(-1, 3), s.moments @ twists
        layer = None
        if s.panels is not None:
            modes = (s.densities @ twists).reshape(len(s.densities), *s.panels.x.shape, 3)
            layer = s.panels, np.ascontiguousarray(np.moveaxis(modes, 0, 2))
        add_tractions(points, s.wires, forces, layer, field, moments)
        return field


def _rotation(angle: float) -> Samples:
    """Rotation about the x axis, 3x3."""
    rotation: Samples = axis_rotation(np.array([angle]))[0]
    return rotation


def flow_field(batch: RobotBatch, body_twist: Samples, rotor_twist: Samples, phase: float) -> FlowField:
    """Flow around one robot whose parts move with given twists.

    Args:
        batch: one robot, inside the domain of the model `slender`.
        body_twist: velocity (m/s) and rotation (rad/s) of the body about the origin, body axes, (6,).
        rotor_twist: velocity (m/s) and rotation (rad/s) of the rotor about the origin, body axes, (6,).
        phase: phase phi of the tail, rad.
    """
    twists = np.concatenate([np.asarray(body_twist, dtype=float), np.asarray(rotor_twist, dtype=float)])
    solids = tuple(RobotGeometry.of(batch).outlines.items())
    return FlowField(robot_solution(batch), solids, twists, float(phase), float(batch.viscosity[0]))
