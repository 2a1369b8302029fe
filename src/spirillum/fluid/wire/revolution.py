"""Bodies of revolution on one axis: single layer, spectral along the outline and around the axis.

The velocity on all surfaces is u(x) = 1/(8 pi mu) int G(x - y) f(y) dS (Pozrikidis, Boundary Integral and Singularity
Methods for Linearized Viscous Flow, 1992, section 4.1). For rigid motions f is the traction. The outline is cut
into panels with Gauss nodes; around the axis the Fourier modes decouple in unbounded fluid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import pairwise

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.outline import Arc, Outline, Segment

_FINE = 16  # nodes of the Gauss rule that integrates a panel near its target
_GRADING = 4  # panels at a sharp edge: distance from it as the fourth power of the parameter


@lru_cache(maxsize=8)
def _rule(order: int) -> tuple[Samples, Samples, Samples, Samples, Samples]:
    """Nodes, barycentric weights and Gauss weights of a panel; abscissas and weights of the finer rule."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    difference = nodes[:, None] - nodes[None, :] + np.eye(order)
    barycentric = 1.0 / np.prod(2.0 * difference, axis=1)
    fine, fine_weights = np.polynomial.legendre.leggauss(max(_FINE, order))
    return nodes, barycentric, weights, fine, fine_weights


@dataclass(frozen=True)
class Panels:
    """Gauss nodes on the outlines of several solids on one axis; lengths in m.

    The unknown density is g = f ds/du: traction times the speed of the outline's parameter.
    """

    x: Samples
    """(panels, p)."""
    rho: Samples
    """(panels, p)."""
    solid: np.ndarray
    """Index of the solid of each panel."""

    @property
    def rule(self) -> tuple[Samples, Samples, Samples, Samples, Samples]:
        """Nodes and barycentric weights on [-1, 1], abscissas and weights of a finer rule, weights of the nodes."""
        nodes, barycentric, weights, fine, fine_weights = _rule(self.order)
        return nodes, barycentric, fine, fine_weights, weights

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
        weights = _rule(self.order)[2]
        area: Samples = (weights * self.rho).ravel()
        return area

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
        nodes, barycentric = _rule(self.order)[:2]
        difference = nodes[:, None] - nodes[None, :] + np.eye(self.order)
        derivative = barycentric[None, :] / barycentric[:, None] / difference
        np.fill_diagonal(derivative, 0.0)
        np.fill_diagonal(derivative, -derivative.sum(axis=1))
        return np.stack([self.rho @ derivative.T, -self.x @ derivative.T], axis=-1).reshape(-1, 2)

    def cardinals(self, places: Samples) -> Samples:
        """Lagrange polynomials of a panel's nodes at places in [-1, 1] that are no nodes, (places, p)."""
        nodes, barycentric = _rule(self.order)[:2]
        terms: Samples = barycentric / (places[:, None] - nodes)
        values: Samples = terms / terms.sum(axis=1, keepdims=True)
        return values

    def velocities(self, x: Samples, rho: Samples, modes: int, e2: float = 0.0, *, on_nodes: bool = False) -> Samples:
        """8 pi mu times the velocities at rings (x, rho) of unit densities, (modes, 3 rings, 3 nodes)."""
        from spirillum.kernels.panels import layer_blocks

        nodes, barycentric, fine, fine_weights, weights = self.rule
        rule = (nodes, barycentric, fine, fine_weights)
        own = np.arange(x.size) if on_nodes else np.full(x.size, -1)
        blocks: Samples = layer_blocks(x, rho, own, self.x, self.rho, e2, modes, rule, weights)
        return blocks

    def matrices(self, modes: int) -> Samples:
        """Matrix of each mode, (modes, 3 nodes, 3 nodes), 8 pi mu times velocity over density.

        A pressure inside a solid is a density that moves nothing: in mode 0 a rank-one term for each solid
        takes it away.
        """
        blocks = self.velocities(self.x.ravel(), self.rho.ravel(), modes, on_nodes=True)
        for solid in np.unique(self.solid):
            there = self.solid_of_node == solid
            null = np.zeros((self.size, 3))
            null[there, :2] = self.normal[there]
            dual = null * self.area[:, None]
            norm = float(np.sum(null * dual))
            blocks[0] += 8.0 * np.pi / norm * np.outer(null.ravel(), dual.ravel())
        return blocks


def panels_of(outlines: Sequence[Outline], longest: Callable[[int, Samples, Samples], Samples], order: int) -> Panels:
    """Cut outlines into panels.

    Args:
        outlines: one for each solid.
        longest: longest panel allowed at points (x, rho) of a solid, m.
        order: nodes of a panel.
    """
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
    piece: Segment | Arc,
    sharp: tuple[bool, bool],
    beside: tuple[float, ...],
    longest: Callable[[Samples, Samples], Samples],
    order: int,
) -> list[Samples]:
    """Parameters t of the nodes of each panel of a piece; they crowd where its start or end is a sharp edge.

    Panels shrink towards the ends of a long piece, and towards a short neighbour, such as a fillet, to its length.
    """
    edges = [0.0, 1.0]
    if isinstance(piece, Arc):  # at most 60 degrees
        parts = int(np.ceil(abs(piece.angles[1] - piece.angles[0]) / (np.pi / 3 + 1e-9)))
        edges = list(np.linspace(0.0, 1.0, parts + 1))
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
