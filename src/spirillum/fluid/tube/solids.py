"""Solids of revolution in a circular tube: their single layer and the wall, factored.

The equations are those of `interaction`, mode by mode, plus the wall's reflection (`wall`), which couples the
modes of a body that lies off the axis. Mirror symmetry keeps two families of modes apart, even and odd to the sides;
with yaw there is none, and they form one system. Neither tails nor their phases enter: one factorisation serves all of
them.

Axes are x along the robot, y up, z to the right; angles count from y.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import check_memory
from spirillum.fluid.tube.rings import LevelRings, Rings, Rows, System
from spirillum.fluid.tube.tilted_rings import TiltedRings
from spirillum.fluid.tube.wall import CROWD, SLACK, WallWaves, each, waves_between
from spirillum.fluid.wire.interaction import longest_panels, one_thread, share, surface_motion
from spirillum.fluid.wire.sources import Panels, panels_of
from spirillum.fluid.wire.stokeslets import Accuracy, Wire
from spirillum.robot.outline import Outline, Segment
from spirillum.robot.tube_pose import TubePose

MOTIONS = 13  #: Right-hand sides: 12 unit twists, and the flow of unit mean velocity through the tube, opposed.


@dataclass(frozen=True)
class Fineness:
    """Resolution of the flow in a tube."""

    wire: Accuracy = "standard"
    tolerance: float = 1e-4  #: At which Fourier modes are cut off.
    order: int = 8
    panel: float = 2.5  #: Longest panels over the length on which the film's traction varies.
    growth: float = 0.0
    """How much longer panels of a level solid's straight side may be, over their distance from its ends."""
    wires: float = 1e-3  #: Coarsest tolerance of waves to and from wires.
    slack: float = SLACK
    crowd: float = CROWD

    @property
    def damping(self) -> float:
        """At which waves are cut off: at a gap of 0.2 mm a hundredth costs less than 1e-5, a tenth several percent."""
        return _damping(self.tolerance)

    @property
    def wire_damping(self) -> float:
        """At which waves to and from wires are cut off: what pushes the robot needs more of them than what holds it."""
        return _damping(min(self.tolerance, self.wires))

    def waves(self, radius: float, x: Samples, distance: float, damping: float) -> WallWaves:
        """The waves that matter between things that are at x, m; see `waves_between`."""
        return waves_between(radius, float(np.ptp(x)), distance, damping, self.slack, self.crowd)

    @property
    def precision(self) -> type[np.floating]:
        """Of the wall's part of tilted solids: single precision is far below a coarse tolerance, and twice as fast."""
        return np.float32 if self.tolerance >= _SINGLE else np.float64


def _damping(tolerance: float) -> float:
    return float(min(10.0 * tolerance, 0.2 * np.sqrt(tolerance)))


_SINGLE = 5e-3  # Finest tolerance at which single precision will do.


class Solids:
    """Solids of revolution and the wall."""

    def __init__(
        self,
        solids: Sequence[tuple[Outline, int]],  # outlines, and the part (0 body, 1 rotor) with which each moves
        pose: TubePose,
        fineness: Fineness,
        lines: Samples | None = None,  # points of wires (x, rho, blob radius) that come close, (n, 3), m
    ) -> None:
        """Cut into panels and count modes, without solving."""
        self.pose, self.fineness = pose, fineness
        self.parts = np.array([part for _, part in solids])
        self.kept: dict[str, object] = {}  # what others derive from the factors and want to use again
        self.tails: tuple[tuple[Wire, ...], ...] = ()  # those that share a basis, see `confined`
        near = np.zeros((0, 3)) if lines is None else lines
        if not solids:
            return
        longest = _longest(solids, pose, fineness, near)
        self.panels = panels_of([outline for outline, _ in solids], longest, fineness.order)
        self.counts = _mode_counts(self.panels, pose, fineness, near)

    @property
    def none(self) -> bool:
        """Whether there are no solids; then only `pose` and `fineness` are defined."""
        return self.parts.size == 0

    @property
    def modes(self) -> int:
        """Number of Fourier modes."""
        return int(self.counts.max())

    @property
    def size(self) -> int:
        """Number of unknowns of each parity."""
        return 0 if self.none else int(3 * self.counts.sum())

    @cached_property
    def memory(self) -> float:
        """Memory that the equations with their waves take, bytes, estimated before any of it is taken."""
        if self.none:
            return 0.0
        rows, waves, modes = 3.0 * self.panels.size, self.waves(self.gap).k.size, self.modes
        factors = (4.0 if self.pose.yaw else 2.0) * float(self.size) ** 2  # one system of both families, or two
        free = modes * rows**2
        level = waves * (12.0 * modes * rows + 2.0 * (3.0 * modes) ** 2) if self.pose.level else 0.0
        return 8.0 * (factors + free + level)

    @cached_property
    def gap(self) -> float:
        """Smallest distance from the wall, m."""
        return float(np.min(self.pose.distances(self.panels.x, self.panels.rho)))

    @cached_property
    def rows(self) -> tuple[Rows, Rows]:
        """Unknowns, even and odd: mode 0 of the even ones has no swirl, that of the odd ones has only swirl."""
        area = np.repeat(self.panels.area, 3)
        swirls = np.tile([False, False, True], self.panels.size)
        found = []
        for parity in (0, 1):
            of_mode = [np.flatnonzero(np.repeat(self.counts > m, 3)) for m in range(self.modes)]
            of_mode[0] = np.flatnonzero(swirls == bool(parity))
            dual = np.concatenate([area[rows] / share(m) for m, rows in enumerate(of_mode)])
            found.append(Rows(parity, tuple(of_mode), dual))
        return found[0], found[1]

    @property
    def systems(self) -> tuple[System, ...]:
        """Families of unknowns that are solved for together: both where the robot is yawed."""
        even, odd = self.rows
        return ((even, odd),) if self.pose.yaw else ((even,), (odd,))

    @cached_property
    def rings(self) -> Rings:
        """Coupling of the solids' rings with the wall's waves."""
        if self.pose.level:
            return LevelRings(self.panels, self.pose.offset, self.modes)
        return TiltedRings(self.panels, self.pose, self.counts, self.fineness.precision)

    def waves(self, distance: float, wires: Samples | None = None) -> WallWaves:
        """The waves that matter between the solids, or solids and wires, at a mean distance from the wall."""
        x, fineness = self.panels.x.ravel(), self.fineness
        if wires is None:
            return fineness.waves(self.pose.radius, x, distance, fineness.damping)
        return fineness.waves(self.pose.radius, np.concatenate([x, wires]), distance, fineness.wire_damping)

    @cached_property
    def motion(self) -> tuple[Samples, Samples]:
        """Velocities on the surfaces, even and odd, (unknowns, 13); see `MOTIONS`."""
        twists = surface_motion(self.panels, self.parts)
        found = []
        for rows, part in zip(self.rows, (twists.real, twists.imag), strict=True):
            modes = [np.zeros((3 * self.panels.size, MOTIONS)) for _ in range(self.modes)]
            for m in (0, 1):
                modes[m][:, : MOTIONS - 1] = part[m]
            for m, values in enumerate(self._through_flow(rows.parity)):
                modes[m][:, MOTIONS - 1] = values
            found.append(rows.gathered(modes))
        return found[0], found[1]

    def _through_flow(self, parity: int) -> list[Samples]:
        """Modes 0 to 3 of the flow of unit mean velocity, which is quadratic, on tilted rings: `stokes_flow`."""
        if parity and not self.pose.yaw:
            return []
        modes = min(4, self.modes)
        theta = 2.0 * np.pi * (np.arange(16) + 0.5) / 16
        x, rho = (values.ravel()[:, None] for values in (self.panels.x, self.panels.rho))
        cos, sin = np.cos(theta), np.sin(theta)
        places = np.stack(np.broadcast_arrays(x, rho * cos, rho * sin), axis=-1)
        placed = self.pose.placed(places.reshape(-1, 3))
        speed = (2.0 - 2.0 * (placed[:, 1] ** 2 + placed[:, 2] ** 2) / self.pose.radius**2).reshape(x.size, -1)
        along, up, right = self.pose.rotation[0]
        parts = [speed * along, speed * (up * cos + right * sin), speed * (right * cos - up * sin)]
        q = np.arange(modes)[:, None]
        weights = np.where(q == 0, 1.0, 2.0) / theta.size
        c, s = weights * np.cos(q * theta), weights * np.sin(q * theta)
        projectors = (c, c, -s) if parity == 0 else (-s, -s, -c)
        found = np.stack([part @ matrix.T for part, matrix in zip(parts, projectors, strict=True)], axis=1)
        return [found[:, :, m].ravel() for m in range(modes)]

    @cached_property
    def factors(self) -> tuple[tuple[Samples, np.ndarray], ...]:
        """LU factors of the equations of each of `systems`."""
        from scipy.linalg import lu_factor

        def factored(matrix: Samples) -> tuple[Samples, np.ndarray]:
            factors: tuple[Samples, np.ndarray] = lu_factor(matrix, overwrite_a=True, check_finite=False)
            return factors

        check_fits(self.memory)
        with one_thread():
            sizes = [sum(family.dual.size for family in system) for system in self.systems]
            matrices = [np.zeros((size, size), order="F") for size in sizes]
            self.rings.subtract(self.waves(self.gap), self.systems, matrices)
            for m, free in enumerate(self._free()):
                for system, matrix in zip(self.systems, matrices, strict=True):
                    first = 0
                    for family in system:
                        here, (start, stop) = family.of_mode[m], first + family.starts[m : m + 2]
                        matrix[start:stop, start:stop] += free[np.ix_(here, here)]
                        first += family.dual.size
            return tuple(each(factored, matrices))

    def _free(self) -> list[Samples]:
        """The single layer in unbounded fluid, one matrix a mode."""
        found: list[Samples] = []
        for last, bearing in self.tiers:
            blocks = self.panels.of_solids(bearing).matrices(last)
            rows = np.flatnonzero(np.repeat(bearing[self.panels.solid_of_node], 3))
            for m in range(len(found), last):
                whole = np.zeros((3 * self.panels.size,) * 2)
                whole[np.ix_(rows, rows)] = blocks[m]
                found.append(whole)
        return found

    @cached_property
    def tiers(self) -> list[tuple[int, np.ndarray]]:
        """Numbers of modes up to which the same solids bear them, and which those are."""
        most = np.array([self.counts[self.panels.solid_of_node == solid].max() for solid in range(len(self.parts))])
        return [(int(last), most >= last) for last in sorted(set(most.tolist()))]

    def solve_system(self, number: int, velocities: Samples) -> Samples:
        """Tractions from velocities on the surfaces, both as modes of one of `systems`, (unknowns, n)."""
        from scipy.linalg import lu_solve

        tractions: Samples = lu_solve(self.factors[number], velocities, check_finite=False)
        return tractions

    def solve(self, velocities: Sequence[Samples]) -> tuple[Samples, Samples]:
        """Tractions from velocities on the surfaces, both as modes, even and odd, (unknowns, n)."""
        if len(self.systems) == 1:
            both = self.solve_system(0, np.concatenate(velocities))
            return self.families([both])
        return self.families([self.solve_system(number, values) for number, values in enumerate(velocities)])

    def families(self, values: Sequence[Samples]) -> tuple[Samples, Samples]:
        """Values on the unknowns of each of `systems` as those of the even and the odd family."""
        even, odd = values if len(values) == 2 else np.split(values[0], [self.rows[0].dual.size])
        return even, odd

    @cached_property
    def moving(self) -> tuple[Samples, Samples]:
        """Tractions for `motion`."""
        return self.solve(self.motion)

    def wrenches(self, tractions: Sequence[Samples]) -> Samples:
        """Work of tractions, even and odd, against `motion`, (13, n)."""
        halves = zip(self.rows, self.motion, tractions, strict=True)
        total: Samples = np.sum([v.T @ (rows.dual[:, None] * f) for rows, v, f in halves], axis=0)
        return total


def check_fits(memory: float) -> None:
    """Refuse solids whose equations do not fit."""
    cause = "the flow in the tube at this gap and tolerance (placement.gap, channel.diameter, body.length)"
    check_memory(cause, memory / 2**30, "GiB of equations", 2.0**30, "as with a wider gap or a narrower channel")


def _mode_counts(panels: Panels, pose: TubePose, fineness: Fineness, lines: Samples) -> np.ndarray:
    """Number of modes at each node; 0 and 1 represent all rigid motions."""
    # What a ring of radius rho at a distance e from the axis sends to the wall and back in mode m falls off as
    # exp(-2 m zeta), cosh(zeta) = (R^2 - rho^2 - e^2)/(2 e rho), where the film's thickness vanishes at complex angles;
    # for a film that is squeezed times powers of m, hence some more. So with wires, see `interaction`.
    x, rho = panels.x.ravel(), panels.rho.ravel()
    r = pose.radius
    e = r - rho - np.maximum(pose.distances(x, rho), 1e-12 * r)
    zeta = np.arccosh(np.maximum((r**2 - rho**2 - e**2) / np.maximum(2.0 * e * rho, 1e-300), 1.0 + 1e-12))
    cut = -0.5 * np.log(fineness.tolerance)
    counts = 3 + np.ceil(_SQUEEZED * cut / zeta)
    if len(lines):
        near2 = (lines[:, :1] - x) ** 2 + (lines[:, 1:2] - rho) ** 2 + lines[:, 2:3] ** 2
        between = np.arccosh(1.0 + near2 / (2.0 * np.maximum(lines[:, 1:2] * rho, 1e-300)))
        counts = np.maximum(counts, 1 + np.ceil(cut / np.min(between, axis=0)))
    found: np.ndarray = np.minimum(counts, _MOST_MODES).astype(int)
    return found


_MOST_MODES = 64
_SQUEEZED = 1.4
"""Factor on the number of modes from their decay: the normal resistance at 0.2 mm is then good to 0.5 %."""


def _longest(
    solids: Sequence[tuple[Outline, int]], pose: TubePose, fineness: Fineness, lines: Samples
) -> Callable[[int, Samples, Samples], Samples]:
    """Longest panels allowed at (x, rho): close to other solids, the film at the wall, and wires."""
    unbounded = longest_panels(solids, lines)

    def longest(solid: int, x: Samples, rho: Samples) -> Samples:
        film = np.maximum(pose.distances(x, rho), 0.0)
        varies = fineness.panel * np.sqrt(2.0 * film * np.maximum(rho, film))
        if pose.level and fineness.growth:
            sides = [p for p in solids[solid][0].pieces if isinstance(p, Segment) and p.start[1] == p.end[1]]
            apart = [np.minimum(x - min(p.start[0], p.end[0]), max(p.start[0], p.end[0]) - x) for p in sides]
            varies += fineness.growth * np.max(apart, axis=0, initial=0.0)
        return np.asarray(np.minimum(unbounded(solid, x, rho), varies))

    return longest
