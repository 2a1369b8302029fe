"""Single layers on bodies of revolution, and the velocity that point forces on a wire induce on them.

The velocity on all surfaces is u(x) = 1/(8 pi mu) int G(x - y) f(y) dS (Pozrikidis, Boundary Integral and Singularity
Methods for Linearized Viscous Flow, 1992, section 4.1). For rigid motions f is the traction. The outline is cut
into panels with Gauss nodes; around the axis the Fourier modes decouple in unbounded fluid.
A point force at the angle theta' excites every mode m, with the phase exp(-i m theta'). The transposed operator,
weighted with the surface elements, is the reciprocal one (from surface tractions to velocities on the wire).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import pairwise

import numpy as np

from spirillum.arrays import Amplitudes, Samples
from spirillum.fluid.wire.stokeslets import Wire, WireSystem
from spirillum.robot.outline import Arc, Outline, Piece, Smooth

_FINE = 16  # nodes of the Gauss rule that integrates a panel near its target
_GRADING = 4  # panels at a sharp edge: distance from it as the fourth power of the parameter


@lru_cache(maxsize=8)
def _rule(order: int) -> tuple[Samples, Samples, Samples, Samples, Samples]:
    """Nodes and barycentric weights on [-1, 1], abscissas and weights of a finer rule, weights of the nodes."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    difference = nodes[:, None] - nodes[None, :] + np.eye(order)
    barycentric = 1.0 / np.prod(2.0 * difference, axis=1)
    fine, fine_weights = np.polynomial.legendre.leggauss(max(_FINE, order))
    return nodes, barycentric, fine, fine_weights, weights


@dataclass(frozen=True)
class Panels:
    """Gauss nodes on the outlines of several solids on one axis; lengths in m.

    The unknown density is g = f ds/du: traction times the speed of the outline's parameter.
    """

    x: Samples  #: (panels, p).
    rho: Samples  #: (panels, p).
    solid: np.ndarray  #: Index of the solid of each panel.

    @property
    def rule(self) -> tuple[Samples, Samples, Samples, Samples, Samples]:
        """Of its panels: see `_rule`."""
        return _rule(self.order)

    @property
    def order(self) -> int:
        """Nodes of a panel."""
        return int(self.x.shape[1])

    @property
    def size(self) -> int:
        """Number of nodes."""
        return int(self.x.size)

    @cached_property
    def area(self) -> Samples:
        """Element rho du at each node: surface element over ds dtheta/du, (nodes,)."""
        return (self.rule[4] * self.rho).ravel()

    @cached_property
    def solid_of_node(self) -> np.ndarray:
        """Index of the solid of each node."""
        return np.repeat(self.solid, self.order)

    def of_solids(self, wanted: np.ndarray) -> Panels:
        """The panels of some solids."""
        keep = wanted[self.solid]
        return self if np.all(keep) else Panels(self.x[keep], self.rho[keep], self.solid[keep])

    @cached_property
    def normal(self) -> Samples:
        """Normal times ds/du, outward for outlines that run from front to rear, (nodes, 2) in (x, rho)."""
        nodes, barycentric = self.rule[:2]
        difference = nodes[:, None] - nodes[None, :] + np.eye(self.order)
        derivative = barycentric[None, :] / barycentric[:, None] / difference
        np.fill_diagonal(derivative, 0.0)
        np.fill_diagonal(derivative, -derivative.sum(axis=1))
        return np.stack([self.rho @ derivative.T, -self.x @ derivative.T], axis=-1).reshape(-1, 2)

    def cardinals(self, places: Samples) -> Samples:
        """Lagrange polynomials of a panel's nodes at points in [-1, 1] that are no nodes, (points, p)."""
        nodes, barycentric = self.rule[:2]
        terms: Samples = barycentric / (places[:, None] - nodes)
        values: Samples = terms / terms.sum(axis=1, keepdims=True)
        return values

    def velocities(self, x: Samples, rho: Samples, modes: int, e2: float = 0.0, *, on_nodes: bool = False) -> Samples:
        """8 pi mu times the velocities at rings (x, rho) of unit densities, (modes, 3 rings, 3 nodes)."""
        from spirillum.kernels.core import layer_blocks

        own = np.arange(x.size) if on_nodes else np.full(x.size, -1)
        blocks = np.empty((modes, x.size, 3, *self.x.shape, 3))
        layer_blocks(x, rho, own, self.x, self.rho, e2, *self.rule, blocks)
        return blocks.reshape(modes, 3 * x.size, 3 * self.size)

    def matrices(self, modes: int) -> Samples:
        """Matrix of each mode, (modes, 3 nodes, 3 nodes), 8 pi mu times velocity over density."""
        blocks = self.velocities(self.x.ravel(), self.rho.ravel(), modes, on_nodes=True)
        # A pressure inside a solid is a density that moves nothing: in mode 0 a rank-one term for each takes it away.
        for solid in np.unique(self.solid):
            there = self.solid_of_node == solid
            null = np.zeros((self.size, 3))
            null[there, :2] = self.normal[there]
            dual = null * self.area[:, None]
            norm = float(np.sum(null * dual))
            blocks[0] += 8.0 * np.pi / norm * np.outer(null.ravel(), dual.ravel())
        return blocks


def panels_of(outlines: Sequence[Outline], longest: Callable[[int, Samples, Samples], Samples], order: int) -> Panels:
    """Cut outlines into panels."""
    x, rho, solid = [], [], []
    for index, outline in enumerate(outlines):
        sharp = (False, *outline.corners, False)
        for number, piece in enumerate(outline.pieces):
            joints = (sharp[number], sharp[number + 1])
            beside = tuple(
                outline.pieces[other].length if 0 <= other < len(outline.pieces) and not edge else np.inf
                for other, edge in zip((number - 1, number + 1), joints, strict=True)
            )
            for t in _panel_parameters(piece, joints, beside, partial(longest, index), order):
                points = piece.points(t)
                x.append(points[0])
                rho.append(points[1])
                solid.append(index)
    return Panels(np.array(x), np.array(rho), np.array(solid))


def _panel_parameters(
    piece: Piece,
    sharp: tuple[bool, bool],
    beside: tuple[float, ...],
    longest: Callable[[Samples, Samples], Samples],
    order: int,
) -> list[Samples]:
    """Parameters t of the nodes of each panel of a piece; they crowd where its start or end is a sharp edge."""
    # Panels shrink towards the ends of a long piece, and towards a short neighbour, such as a fillet, to its length.
    edges = [0.0, 1.0]
    if isinstance(piece, Arc):  # at most 60 degrees
        parts = int(np.ceil(abs(piece.angles[1] - piece.angles[0]) / (np.pi / 3 + 1e-9)))
        edges = list(np.linspace(0.0, 1.0, parts + 1))
    elif isinstance(piece, Smooth):
        t, turned = piece.fine[0], piece.turned
        steps = np.linspace(0.0, turned[-1], 1 + int(np.ceil(turned[-1] / (np.pi / 3))))
        edges = [0.0, *np.interp(steps[1:-1], turned, t).tolist(), 1.0]
    elif all(sharp):
        edges = [0.0, 0.5, 1.0]
    length = piece.length
    widest = float(np.max(piece.points(np.linspace(0.0, 1.0, 9))[1]))
    at = 0
    while at < len(edges) - 1:
        low, high = edges[at], edges[at + 1]
        inside = np.linspace(low, high, 9)
        allowed = float(np.min(longest(*piece.points(inside))))
        from_ends = low * length, (1.0 - high) * length
        allowed = min(allowed, 3.0 * widest + min(from_ends), beside[0] + from_ends[0], beside[1] + from_ends[1])
        if (high - low) * length > allowed:
            edges.insert(at + 1, 0.5 * (low + high))
        else:
            at += 1
    nodes = 0.5 * (1.0 + _rule(order)[0])
    found = []
    for low, high in pairwise(edges):
        if sharp[0] and low == 0.0:
            found.append(high * nodes**_GRADING)
        elif sharp[1] and high == 1.0:
            found.append(1.0 - (1.0 - low) * (1.0 - nodes) ** _GRADING)
        else:
            found.append(low + (high - low) * nodes)
    return found


_TORQUE_MODES = 3  # torques along a wire are felt through modes 0 to 2 only: the others fade too fast
_OF_STATIONS = ("x", "rho", "theta", "frames", "torques")
_STEP = 1e-3  # of the differences that make couples from forces, over the blob radius


@dataclass(frozen=True)
class Sources:
    """Forces and torques at the wires' stations, in cylindrical components, as sources for the solids.

    Torques are those of the first moments; the moments' strains fade so fast that solids do not feel them.
    """

    wires: tuple[Wire, ...]  #: Wires.
    x: Samples  #: (stations,).
    rho: Samples  #: (stations,).
    theta: Samples  #: (stations,).
    frames: Samples  #: Rows e_x, e_rho, e_theta, (stations, 3, 3).
    torques: Samples  #: Cylindrical torque of each unit moment, (stations, 3, q).

    @classmethod
    def of(cls, wires: tuple[Wire, ...], system: WireSystem) -> Sources:
        """Of all wires."""
        points = np.concatenate([wire.points for wire in wires]) if wires else np.zeros((0, 3))
        theta = np.arctan2(points[:, 2], points[:, 1])
        cos, sin, zero = np.cos(theta), np.sin(theta), np.zeros(len(theta))
        rows = [[zero + 1.0, zero, zero], [zero, cos, sin], [zero, -sin, cos]]
        frames = np.moveaxis(np.array(rows), -1, 0)
        rho = np.hypot(points[:, 1], points[:, 2])
        return cls(wires, points[:, 0], rho, theta, frames, frames @ system.torques)

    @classmethod
    def joined(cls, several: Sequence[Sources]) -> Sources:
        """All of them as one; of one accuracy."""
        rows = [np.concatenate([getattr(one, name) for one in several]) for name in _OF_STATIONS]
        return cls(tuple(wire for one in several for wire in one.wires), *rows)

    def sweep_same_circles(self, other: Sources) -> bool:
        """Whether both sweep the same circles as they turn."""
        near = 1e-9 * float(np.max(self.rho, initial=0.0))
        return self.x.shape == other.x.shape and all(
            np.allclose(one, two, rtol=0.0, atol=near) for one, two in ((self.x, other.x), (self.rho, other.rho))
        )

    def turn(self, m: int, size: int) -> Amplitudes:
        """Phase exp(-i m theta) of each of `size` sources in mode m, and -i more for f_theta, T_x and T_rho."""
        factor = np.array([1.0, 1.0, -1j, -1j, -1j, 1.0])[: size // max(len(self.x), 1)]
        turns: Amplitudes = (np.exp(-1j * m * self.theta)[:, None] * factor).ravel()
        return turns

    def columns(self, matrix: Samples) -> Samples:
        """Convert columns of sources into columns for the stations' forces, then moments."""
        stations, kinds = len(self.x), self.torques.shape[2]
        if stations == 0:
            return matrix
        split = matrix.reshape(len(matrix), stations, matrix.shape[1] // stations)
        found = np.zeros((len(matrix), (3 + kinds) * stations))
        found[:, : 3 * stations] = _each(split[:, :, :3], self.frames)
        if split.shape[2] > 3:
            found[:, 3 * stations :] = _each(split[:, :, 3:], self.torques)
        return found

    def rings(self, strengths: Samples, size: int) -> Samples:
        """Sources from the stations' forces and moments, (size, 12)."""
        stations, kinds = len(self.x), self.torques.shape[2]
        forces = np.matmul(self.frames, strengths[: 3 * stations].reshape(stations, 3, 12))
        torques = np.matmul(self.torques, strengths[3 * stations :].reshape(stations, kinds, 12))
        both: Samples = np.concatenate([forces, torques], axis=1)[:, : size // max(stations, 1)]
        return both.reshape(size, 12)

    def velocities(self, panels: Panels, modes: int) -> list[Samples]:
        """Velocities of each mode on the nodes from ring sources, (3 nodes, 3 or 6 stations) each."""
        forces = self._from(panels, modes)
        if self.torques.shape[2] == 0:
            return list(forces)
        torques = self._torque_velocities(panels, forces[:_TORQUE_MODES])
        both = [_interleaved(*pair) for pair in zip(forces, torques, strict=False)]
        return both + list(forces[_TORQUE_MODES:])

    def _from(self, panels: Panels, modes: int, dx: float = 0.0, drho: float = 0.0) -> Samples:
        """Velocities from ring forces at stations moved by dx and drho blob radii, (modes, 3 nodes, 3 stations)."""
        from spirillum.kernels.core import ring_blocks

        x, rho = panels.x.ravel(), panels.rho.ravel()
        found: list[Samples] = [np.zeros((modes, 3 * panels.size, 0))]
        start = 0
        for wire in self.wires:
            at = slice(start, start + len(wire.points))
            moved = self.x[at] + dx * wire.blob, self.rho[at] + drho * wire.blob
            blocks = np.empty((modes, x.size, 3, len(wire.points), 3))
            ring_blocks(x, rho, *moved, wire.blob**2, blocks)
            found.append(blocks.reshape(modes, 3 * x.size, -1))
            start += len(wire.points)
        return np.concatenate(found, axis=2)

    def _torque_velocities(self, panels: Panels, forces: Samples) -> Samples:
        """Velocities from ring torques (T_x, T_rho, T_theta), (modes, 3 nodes, 3 stations)."""
        # A torque is half the difference of two couples of forces: T_x = [f_theta along rho - f_rho along theta]/2 and
        # so on. Derivatives along x and rho are central differences; along theta, phase and unit vectors turn.
        modes, rows = forces.shape[:2]
        blob = np.concatenate([np.full(len(wire.points), wire.blob) for wire in self.wires])
        rho = np.maximum(self.rho, _STEP * blob)[:, None]
        shape = (modes, rows, len(self.x), 3)
        by_x = (self._from(panels, modes, dx=_STEP) - self._from(panels, modes, dx=-_STEP)).reshape(shape)
        by_x /= 2.0 * _STEP * blob[:, None]
        by_rho = (self._from(panels, modes, drho=_STEP) - self._from(panels, modes, drho=-_STEP)).reshape(shape)
        by_rho /= 2.0 * _STEP * blob[:, None]
        m = np.arange(modes)[:, None, None]
        k_x, k_rho, k_g = np.moveaxis(forces.reshape(shape), -1, 0)
        around = rho[:, 0]
        torques = (
            by_rho[..., 2] - (m * k_rho - k_g) / around,
            m * k_x / around - by_x[..., 2],
            by_x[..., 1] - by_rho[..., 0],
        )
        return 0.5 * np.stack(torques, axis=-1).reshape(modes, rows, -1)


def _each(split: Samples, blocks: Samples) -> Samples:
    """Multiply (k, n, c) with a block (c, d) for each of n, to (k, n d)."""
    found: Samples = np.matmul(split.swapaxes(0, 1), blocks).swapaxes(0, 1).reshape(len(split), -1)
    return found


def _interleaved(forces: Samples, torques: Samples) -> Samples:
    """Columns of three forces and three torques for each station."""
    rows = len(forces)
    pairs = np.concatenate([forces.reshape(rows, -1, 3), torques.reshape(rows, -1, 3)], axis=2)
    return pairs.reshape(rows, -1)
