"""Velocity and pressure of the fluid around a moving robot, from the tractions that `slender` solves for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from spirillum.arrays import Amplitudes, Samples
from spirillum.errors import InputError
from spirillum.fluid.algebra import axis_rotation
from spirillum.fluid.wire.interaction import Solution
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.fluid.wire.slender import robot_solution
from spirillum.robot.batch import RobotBatch
from spirillum.robot.outline import Outline

__all__ = ["FlowField", "checked_points", "flow_field", "in_fluid"]


_FARTHEST = 1e9


@dataclass(frozen=True)
class FlowField:
    """Flow at one instant, in the lab frame, fluid at rest far away; SI, body axes, origin at the body's mid-length."""

    solution: Solution = field(repr=False)
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
        """Name of the part in which each point lies, empty for the fluid, (n,).

        Args:
            points: (n, 3), m.
        """
        turned = self._tail_frame(checked_points(points))
        x, rho = turned[:, 0], np.hypot(turned[:, 1], turned[:, 2])
        names = np.full(len(turned), "", dtype="U8")
        for wire in self.solution.wires:
            names[wire.distance(turned) < wire.radius] = "tail"
        for name, outline in self.solids:
            names[outline.contains(x, rho)] = name
        return names

    def inside(self, points: Samples) -> np.ndarray:
        """Whether each point lies in body, coupling or wire, (n,)."""
        return np.asarray(self.part_at(points) != "")

    def velocity(self, points: Samples) -> Samples:
        """Velocity of the fluid, m/s, (n, 3).

        Args:
            points: (n, 3), m.

        Raises:
            InputError: if a point lies inside a solid, or is not finite.
        """
        return self.fields(points)[0]

    def pressure(self, points: Samples) -> Samples:
        """Pressure of the fluid, zero far away, Pa, (n,).

        Args:
            points: (n, 3), m.

        Raises:
            InputError: if a point lies inside a solid, or is not finite.
        """
        return self.fields(points)[1]

    def fields(self, points: Samples) -> tuple[Samples, Samples]:
        """Velocity, (n, 3), and pressure, (n,), together.

        Raises:
            InputError: if a point lies inside a solid, or is not finite.
        """
        turned = self._tail_frame(in_fluid(points, self.part_at))
        field = self._sum(turned)
        velocity = field[:, :3] @ _rotation(self.phase).T / (8.0 * np.pi)
        return velocity, self.viscosity * field[:, 3] / (8.0 * np.pi)

    def wrench(self) -> Samples:
        """Force (N) and torque about the origin (N m) that hold the whole robot to its motion, body axes, (6,)."""
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
        from spirillum.kernels.field import add_blobs, add_layer, add_moments

        s = self.solution
        back = _rotation(-self.phase)
        twists = (self.twists.reshape(4, 3) @ back.T).ravel()
        field = np.zeros((len(points), 4))
        forces, moments = (s.forces @ twists).reshape(-1, 3), s.moments @ twists
        start = 0
        for wire in s.wires:
            count = len(wire.points)
            at, e2 = slice(start, start + count), np.full(count, wire.blob**2)
            add_blobs(points, wire.points, forces[at], e2, field)
            if np.any(moments):
                add_moments(points, wire.points, moments[at], e2, field)
            start += count
        if s.panels is not None:
            modes = (s.densities @ twists).reshape(len(s.densities), *s.panels.x.shape, 3)
            density: Amplitudes = np.ascontiguousarray(np.moveaxis(modes, 0, 2))
            add_layer(points, s.panels.x, s.panels.rho, density, s.panels.rule, field)
        return field


def _rotation(angle: float) -> Samples:
    """Rotation about the x axis, 3x3."""
    rotation: Samples = axis_rotation(np.array([angle]))[0]
    return rotation


def checked_points(points: Samples) -> Samples:
    """Points as floats, (n, 3).

    Raises:
        InputError: if they have another shape, are not finite or lie too far away.
    """
    try:
        places = np.asarray(points, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError("points are no numbers; allowed: rows (x, y, z) in m") from error
    if places.ndim != 2 or places.shape[1] != 3 or not np.all(np.isfinite(places)):
        raise InputError(f"points have shape {places.shape}; allowed: finite coordinates in m, one row (x, y, z) each")
    if np.any(np.abs(places) > _FARTHEST):
        raise InputError(f"points lie farther away than {_FARTHEST:g} m; allowed: nearer ones")
    return np.ascontiguousarray(places)


def in_fluid(points: Samples, part_at: Callable[[Samples], np.ndarray]) -> Samples:
    """Points that lie in the fluid.

    Args:
        points: (n, 3), m.
        part_at: gives the name of the part in which each point lies, empty for the fluid.

    Raises:
        InputError: if one of them does not, or as `checked_points`.
    """
    places = checked_points(points)
    names = part_at(places)
    if np.any(names != ""):
        first = int(np.argmax(names != ""))
        at = ", ".join(f"{1e3 * float(value):.4g}" for value in places[first])
        raise InputError(f"point {first} = ({at}) mm lies inside the {names[first]}; allowed: points in the fluid")
    return places


def flow_field(batch: RobotBatch, body_twist: Samples, rotor_twist: Samples, phase: float) -> FlowField:
    """Flow around one robot whose parts move with given twists.

    Args:
        batch: one robot, inside the domain of the model `slender`.
        body_twist: velocity (m/s) and rotation (rad/s) of the body about the origin, body axes, (6,).
        rotor_twist: the same of the rotor.
        phase: phase phi of the tail, rad.
    """
    twists = np.concatenate([np.asarray(body_twist, dtype=float), np.asarray(rotor_twist, dtype=float)])
    solids = tuple(RobotGeometry.of(batch).outlines.items())
    return FlowField(robot_solution(batch), solids, twists, float(phase), float(batch.viscosity[0]))
