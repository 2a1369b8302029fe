"""Body, coupling and tail together: the flow between them, for all rigid motions of both parts at once.

Unknowns are the Fourier modes of the traction on the solids of revolution (`revolution`) and the forces along the
wires (`wire`). The modes decouple on the solids; eliminating them one by one leaves a symmetric positive definite
system for the wires' forces. Its solution gives the 12x12 resistance matrix, constant in the tail's frame.

Real fields are written as Re sum_m c_m exp(i m theta), m >= 0, with f_theta = i g; see csrc/rings.c.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spirillum.arrays import Amplitudes, Samples
from spirillum.fluid.wire.sources import Panels, Sources, panels_of
from spirillum.fluid.wire.stokeslets import Accuracy, Wire, WireSystem, wire_system
from spirillum.robot.outline import Outline

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

_EIGHT_PI = 8.0 * np.pi


@dataclass(frozen=True)
class Discretisation:
    """Resolution of the flow."""

    wire: Accuracy = "standard"  #: Form of the wires.
    spacing: float = 1.0  #: Spacing of the wires' stations, relative to the usual one.
    order: int = 10  #: Gauss nodes of a panel.
    tolerance: float = 1e-5
    """Fourier modes are kept until their share in the interaction of wires and solids falls below this."""
    most_modes: int = 40  #: Largest number of modes.


@dataclass(frozen=True)
class UnitTwistSolution:
    """Tractions and forces for each of the 12 unit twists (of the body, then of the rotor), viscosity 1."""

    matrix: Samples  #: R, 12x12, made symmetric; zero for a part that is not there.
    asymmetry: float  #: Deviation from symmetry (reciprocity), relative to the geometric mean of diagonal entries.
    panels: Panels | None = field(repr=False)  #: Nodes on the solids.
    wires: tuple[Wire, ...] = field(repr=False)  #: The wires.
    densities: Amplitudes = field(repr=False)
    """Modes (f_x, f_rho, g) ds/du of the traction on the nodes, complex, (modes, 3 nodes, 12)."""
    forces: Samples = field(repr=False)  #: Forces at the wires' stations, (3 stations, 12).
    moments: Samples = field(repr=False)
    """First moments of the forces there, force by displacement, with `high` accuracy, (stations, 3, 3, 12)."""


def solve(
    solids: Sequence[tuple[Outline, int]], wires: Sequence[tuple[Wire, int]], resolution: Discretisation
) -> UnitTwistSolution:
    """Resistance of two rigid parts in unbounded fluid of viscosity 1, twists about the origin."""
    with one_thread():
        lines = tuple(wire for wire, _ in wires)
        points = np.concatenate([wire.points for wire in lines]) if lines else np.zeros((0, 3))
        system = wire_system(wires, resolution.wire)
        if not solids:
            strengths = solve_wires(system.mobility, system.motion)
            matrix = system.motion.T @ strengths + system.own
            return _solution(matrix, None, lines, np.zeros((0, 0, 12), complex), strengths, system)
        blobs = np.concatenate([np.full(len(wire.points), wire.blob) for wire in lines]) if lines else np.zeros(0)
        near = np.stack([points[:, 0], np.hypot(points[:, 1], points[:, 2]), blobs], axis=1)
        panels = panels_of([outline for outline, _ in solids], longest_panels(solids, near), resolution.order)
        images = _Images.of(panels, np.array([part for _, part in solids]), lines, system, resolution)
        strengths = solve_wires(system.mobility - images.mobility, system.motion - images.drift)
        matrix = images.resistance + (system.motion - images.drag).T @ strengths + system.own
        return _solution(matrix, panels, lines, images.densities(strengths), strengths, system)


def one_thread() -> AbstractContextManager[object]:
    """One thread of linear algebra: matrices of some hundred rows gain little from more, and lose on a busy machine."""
    limited: AbstractContextManager[object] = _thread_pools().limit(limits=1, user_api="blas")
    return limited


@lru_cache(maxsize=1)
def _thread_pools() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 - brings its own linear algebra
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def solve_wires(mobility: Samples, motion: Samples) -> Samples:
    """Forces and moments from velocities, by Cholesky factors: the matrix is symmetric positive definite."""
    from scipy.linalg import cho_factor, cho_solve

    if mobility.size == 0:
        return np.zeros_like(motion)
    strengths: Samples = cho_solve(cho_factor(mobility, lower=True, check_finite=False), motion, check_finite=False)
    return strengths


def _solution(
    matrix: Samples,
    panels: Panels | None,
    wires: tuple[Wire, ...],
    densities: Amplitudes,
    strengths: Samples,
    system: WireSystem,
) -> UnitTwistSolution:
    matrix = _EIGHT_PI * matrix
    stations, kinds = system.moments.shape[:2]
    amounts = strengths[3 * stations :].reshape(stations, kinds, 12)
    return UnitTwistSolution(
        matrix=0.5 * (matrix + matrix.T),
        asymmetry=asymmetry_of(matrix),
        panels=panels,
        wires=wires,
        densities=_EIGHT_PI * densities,
        forces=_EIGHT_PI * strengths[: 3 * stations],
        moments=_EIGHT_PI * np.einsum("nqbk,nqt->nbkt", system.moments, amounts),
    )


def asymmetry_of(matrix: Samples) -> float:
    """Deviation from symmetry (reciprocity), relative to the geometric mean of diagonal entries."""
    there = np.diag(matrix) > 0
    scale = np.sqrt(np.diag(matrix)[there])
    lack = (matrix - matrix.T)[np.ix_(there, there)] / np.outer(scale, scale)
    return float(np.max(np.abs(lack), initial=0.0))


def longest_panels(solids: Sequence[tuple[Outline, int]], lines: Samples) -> Callable[[int, Samples, Samples], Samples]:
    """Longest panels allowed on each solid at (x, rho): against the gap to others, and to wires (x, rho, blob)."""

    def longest(solid: int, x: Samples, rho: Samples) -> Samples:
        found = np.full(np.shape(x), np.inf)
        for other, (outline, _) in enumerate(solids):
            if other != solid:
                found = np.minimum(found, 2.0 * outline.distance(x, rho))
        if len(lines):
            near = np.min(np.hypot(x[:, None] - lines[:, 0], rho[:, None] - lines[:, 1]), axis=1)
            found = np.minimum(found, 4.0 * np.hypot(near, lines[:, 2].min()))
        return found

    return longest


def _mode_counts(panels: Panels, wires: tuple[Wire, ...], resolution: Discretisation) -> list[int]:
    """Number of modes on each solid; 0 and 1 represent all rigid motions."""
    # With cosh(zeta) = (X^2 + rho^2 + rho'^2 + e^2)/(2 rho rho'), what mode m sends from a wire to a surface and back
    # falls off as exp(-2 m zeta).
    x, rho = panels.x.ravel(), panels.rho.ravel()
    counts = np.full(int(panels.solid.max()) + 1, 2)
    for wire in wires:
        line_rho = np.hypot(wire.points[:, 1], wire.points[:, 2])[:, None]
        near2 = (wire.points[:, :1] - x) ** 2 + (line_rho - rho) ** 2 + wire.blob**2
        zeta = np.min(np.arccosh(1.0 + near2 / (2.0 * np.maximum(line_rho * rho, 1e-300))), axis=0)
        for solid in range(counts.size):
            nearest = float(np.min(zeta[panels.solid_of_node == solid]))
            counts[solid] = max(counts[solid], int(np.ceil(-0.5 * np.log(resolution.tolerance) / nearest)) + 1)
    return [min(int(count), resolution.most_modes) for count in counts]


def surface_motion(panels: Panels, part_of_solid: np.ndarray) -> Amplitudes:
    """Modes 0 and 1 of the surfaces' velocities for each unit twist, complex, (2, 3 nodes, 12)."""
    x, rho, part = panels.x.ravel(), panels.rho.ravel(), part_of_solid[panels.solid_of_node]
    motion = np.zeros((2, panels.size, 3, 12), complex)
    for which in (0, 1):
        there, first = part == which, 6 * which
        x_p, rho_p = x[there, None], rho[there]
        along, across = np.array([0.0, 1.0, 1.0]), np.concatenate([-rho_p[:, None], x_p, x_p], axis=1)
        motion[0, there, 0, first] = 1.0
        motion[0, there, 2, first + 3] = -1j * rho_p
        motion[1, there, :, first + 1] = along
        motion[1, there, :, first + 2] = -1j * along
        motion[1, there, :, first + 4] = 1j * across
        motion[1, there, :, first + 5] = across
    return motion.reshape(2, -1, 12)


@dataclass(frozen=True)
class _Images:
    """Images: velocity at the wires due to the solids at rest or in motion; all without the factor 1/(8 pi)."""

    resistance: Samples  #: Of the solids alone, (12, 12).
    mobility: Samples  #: Reduction of the wires' mobility by the solids at rest; as A of `WireSystem`.
    drift: Samples  #: Velocities and gradients at the stations from the solids' motion; as S of `WireSystem`.
    drag: Samples  #: Forces on the moving solids per force and moment at the stations; equal to `drift` by reciprocity.
    moving: Amplitudes  #: Densities from the solids' motion, (2, 3 nodes, 12).
    held: tuple[tuple[np.ndarray, Samples], ...]
    """For each mode the rows (3 nodes of the solids that bear it), and the densities there for ring sources at the
    stations, (rows, stations of 3 forces or 3 forces and 3 torques)."""
    sources: Sources  #: Sources at the stations.

    @classmethod
    def of(
        cls, panels: Panels, parts: np.ndarray, wires: tuple[Wire, ...], system: WireSystem, resolution: Discretisation
    ) -> _Images:
        """Solve mode by mode."""
        sources = Sources.of(wires, system)
        motion = surface_motion(panels, parts)
        size = len(system.mobility)
        resistance, mobility = np.zeros((12, 12)), np.zeros((size, size))
        drift, drag = np.zeros((size, 12)), np.zeros((size, 12))
        moving, held = [], []
        for m, rows, mode in _modes(panels, sources, _mode_counts(panels, wires, resolution)):
            image = mode.solve(mode.cross)
            back = (mode.weight * mode.cross).T
            turn = sources.turn(m, image.shape[1])
            bounce = share(m) * (back @ image) * np.real(np.conj(turn)[:, None] * turn)
            mobility += sources.columns(sources.columns(0.5 * (bounce + bounce.T)).T)
            if m < 2:
                answer = mode.solve(motion[m].real) + 1j * mode.solve(motion[m].imag)
                dual = (mode.weight * motion[m]).conj().T
                resistance += np.real(dual @ answer) / share(m)
                drift += sources.columns(np.real(np.conj(turn)[:, None] * (back @ answer)).T).T
                drag += sources.columns(np.real((dual @ image) * turn)).T
                moving.append(answer)
            held.append((rows, image))
        return cls(resistance, mobility, drift, drag, np.array(moving), tuple(held), sources)

    def densities(self, strengths: Samples) -> Amplitudes:
        """Densities of each mode for each unit twist, (modes, 3 nodes, 12)."""
        found = np.zeros((len(self.held), *self.moving.shape[1:]), complex)
        found[:2] = self.moving
        for m, (rows, image) in enumerate(self.held):
            rings = self.sources.rings(strengths, image.shape[1])
            turn = self.sources.turn(m, image.shape[1])[:, None]
            found[m, rows] -= share(m) * (image @ (turn * rings))
        return found


class _Mode(NamedTuple):
    """The single layer in one mode."""

    factors: tuple[Samples, np.ndarray]  #: LU factors of the matrix.
    weight: Samples  #: Surface element of each row, (rows, 1).
    cross: Samples  #: Velocities on the surface from ring sources at the stations, (rows, sources).

    def solve(self, velocities: Samples) -> Samples:
        """Densities from velocities."""
        from scipy.linalg import lu_solve

        densities: Samples = lu_solve(self.factors, velocities, check_finite=False)
        return densities


def _modes(panels: Panels, sources: Sources, counts: Sequence[int]) -> Iterator[tuple[int, np.ndarray, _Mode]]:
    """Each mode with its rows and equations, on the solids that bear it: the others are left out."""
    from scipy.linalg import lu_factor

    first = 0
    for last in sorted(set(counts)):
        bearing = np.array(counts) >= last
        some = panels.of_solids(bearing)
        rows = np.flatnonzero(np.repeat(bearing[panels.solid_of_node], 3))
        blocks, cross = some.matrices(last), sources.velocities(some, last)
        weight = np.repeat(some.area, 3)[:, None]
        for m in range(first, last):
            yield m, rows, _Mode(lu_factor(blocks[m], check_finite=False), weight, cross[m])
        first = last


def share(m: int) -> float:
    """Fourier coefficient of a point force over that of a ring of the same total."""
    return (1.0 if m == 0 else 2.0) / (2.0 * np.pi)
