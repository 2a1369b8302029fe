"""Instantaneous flow: the interface `FluidField` of all models, and `FlowField` of `slender` in unbounded fluid."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from spirillum.arrays import Amplitudes, Samples
from spirillum.errors import InputError
from spirillum.fluid.algebra import axis_rotation
from spirillum.fluid.wire.interaction import UnitTwistSolution
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.fluid.wire.slender import robot_solution
from spirillum.fluid.wire.sources import Panels
from spirillum.fluid.wire.stokeslets import Wire
from spirillum.robot.batch import RobotBatch
from spirillum.robot.outline import Outline

_FARTHEST = 1e9


class FluidField(ABC):
    """Flow at one instant in the lab frame; SI, body axes, origin at the body's mid-length."""

    @abstractmethod
    def part_at(self, points: Samples) -> np.ndarray:
        """Name of the part that contains each point, `glass` at and beyond a tube's wall, empty for the fluid, (n,)."""

    @abstractmethod
    def fields(self, points: Samples) -> tuple[Samples, Samples]:
        """Velocity, (n, 3), and pressure, (n,), together."""

    @abstractmethod
    def wrench(self) -> Samples:
        """Force (N) and torque about the origin (N m) that hold the whole robot to its motion, body axes, (6,)."""

    def inside(self, points: Samples) -> np.ndarray:
        """Whether each of the points (n, 3) is inside a solid or outside the tube, (n,)."""
        return np.asarray(self.part_at(points) != "")

    def velocity(self, points: Samples) -> Samples:
        """Velocity of the fluid at points (n, 3), m/s."""
        return self.fields(points)[0]

    def pressure(self, points: Samples) -> Samples:
        """Pressure of the fluid above that far away, in a tube above the mean of both ends, Pa, (n,)."""
        return self.fields(points)[1]

    def in_fluid(self, points: Samples) -> Samples:
        """Return the points (n, 3) if they are all in the fluid."""
        xyz = checked_points(points)
        names = self.part_at(xyz)
        if np.any(names != ""):
            first = int(np.argmax(names != ""))
            at = ", ".join(f"{1e3 * float(value):.4g}" for value in xyz[first])
            raise InputError(f"point {first} = ({at}) mm is inside the {names[first]}; allowed: points in the fluid")
        return xyz


def checked_points(points: Samples) -> Samples:
    """Points as floats, (n, 3)."""
    try:
        xyz = np.asarray(points, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError("points are no numbers; allowed: rows (x, y, z) in m") from error
    if xyz.ndim != 2 or xyz.shape[1] != 3:
        raise InputError(f"points have shape {xyz.shape}; allowed: finite coordinates in m, one row (x, y, z) each")
    if not np.all(np.isfinite(xyz)):
        first = int(np.argmin(np.all(np.isfinite(xyz), axis=1)))
        raise InputError(f"point {first} = {xyz[first].tolist()} is not finite; allowed: coordinates in m")
    if np.any(np.abs(xyz) > _FARTHEST):
        raise InputError(f"points are farther away than {_FARTHEST:g} m; allowed: nearer ones")
    return np.ascontiguousarray(xyz)


def name_parts(
    names: np.ndarray, points: Samples, wires: Iterable[Wire], solids: Iterable[tuple[str, Outline]]
) -> np.ndarray:
    """Enter the name of each part at the points inside it; returns `names`."""
    x, rho = points[:, 0], np.hypot(points[:, 1], points[:, 2])
    for wire in wires:
        names[wire.distance(points) < wire.radius] = "tail"
    for name, outline in solids:
        names[outline.contains(x, rho)] = name
    return names


def add_tractions(
    points: Samples,
    wires: Sequence[Wire],
    forces: Samples,
    layer: tuple[Panels, Amplitudes] | None,
    field: Samples,
    moments: Samples | None = None,
) -> None:
    """Add the flow of forces along wires and of a single layer in unbounded fluid to `field`: csrc/field.c."""
    # Tractions are those of the panels' modes, (panels, p, modes, 3); velocity and pressure, (n, 4), are without the
    # factors 1/(8 pi mu) and 1/(8 pi).
    from spirillum.kernels.core import add_blobs, add_layer, add_moments

    start = 0
    for wire in wires:
        count = len(wire.points)
        at, e2 = slice(start, start + count), np.full(count, wire.blob**2)
        add_blobs(points, wire.points, forces[at], e2, field)
        if moments is not None and np.any(moments):
            add_moments(points, wire.points, moments[at], e2, field)
        start += count
    if layer is not None:
        panels, density = layer
        add_layer(points, panels.x, panels.rho, density, *panels.rule, field)


@dataclass(frozen=True)
class FlowField(FluidField):
    """Flow at one instant in fluid that is at rest far away, SI."""

    solution: UnitTwistSolution = field(repr=False)  #: Tractions for unit twists, at phase 0.
    solids: tuple[tuple[str, Outline], ...]  #: Names and outlines of the solids of revolution.
    twists: Samples  #: Velocity and rotation of body, then of rotor, (12,).
    phase: float
    viscosity: float

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
        return (turned.reshape(2, 3) @ forth.T).ravel()

    def _tail_frame(self, points: Samples) -> Samples:
        """Turned back by the phase."""
        return points @ _rotation(self.phase)

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
    """Flow around one robot whose parts move with given twists about the origin, body axes: m/s and rad/s, (6,)."""
    twists = np.concatenate([np.asarray(body_twist, dtype=float), np.asarray(rotor_twist, dtype=float)])
    solids = tuple(RobotGeometry.of(batch).outlines.items())
    return FlowField(robot_solution(batch), solids, twists, float(phase), float(batch.viscosity[0]))
