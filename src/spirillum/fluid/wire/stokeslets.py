"""A thin wire of any curve: a line of regularised Stokeslets.

A blob of radius a sqrt(e) on the centreline gives the velocity that slender-body theory gives on a wire of radius a,
along and across it, to leading order in its curvature (Cortez and Nicholas, Commun. Appl. Math. Comput. Sci. 7:33,
2012); the matrix from forces to velocities is symmetric positive definite.

`standard` adds the torque of cross-sections that spin and tilt as if each were alone. `high` gives every
cross-section, besides its force, the first moments of its traction: those that resist its spin, its tilt, and its
strain. They act through the gradients of the same kernel; on a straight wire each has the resistance of a
cylinder. With them the effect of curvature on the traction is there: what remains falls off with its square.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from spirillum.arrays import PerRobot, Samples
from spirillum.fluid.algebra import dyad, skew

Accuracy = Literal["standard", "high"]

_BLOB = float(np.exp(0.5))
"""Blob radius over a: the velocity on a straight wire is that of slender-body theory, along and across."""
_SPACING = 0.75  # Spacing of stations over the blob radius: the smooth kernel's sums are then integrals to 2e-4.
_INSET = 0.375
"""Distance of the outermost stations from the wire's cut ends, over the blob radius. Rods of 10 to 50 diameters,
solved for with their edges, then have the right drag along and across to 0.4 %."""
_LEVI_CIVITA = np.cross(np.eye(3)[:, None], np.eye(3)[None])
_TILT = 0.5  # Torque of a tilting cross-section over that of a spinning one; see `_spin_torque`.


@dataclass(frozen=True)
class Wire:
    """Stations along a wire's centreline; SI."""

    points: Samples  #: (n, 3), m.
    tangents: Samples  #: Unit tangents, (n, 3).
    lengths: Samples  #: Arc length of each station, m, (n,).
    radius: float  #: Radius a of the wire, m.

    @property
    def blob(self) -> float:
        """Blob radius, m."""
        return _BLOB * self.radius

    def distance(self, points: Samples) -> Samples:
        """Distance of points (k, 3) from the centreline, m."""
        from scipy.spatial import cKDTree

        _, nearest = cKDTree(self.points).query(points)
        offset = points - self.points[nearest]
        half = 0.5 * self.lengths[nearest]
        along = np.clip(np.sum(offset * self.tangents[nearest], axis=1), -half, half)
        distance: Samples = np.linalg.norm(offset - along[:, None] * self.tangents[nearest], axis=1)
        return distance


def station_count(arc_length: PerRobot, radius: PerRobot) -> PerRobot:
    """Stations that wires of these lengths and radii take."""
    blob = _BLOB * radius
    return np.ceil(np.maximum(arc_length / blob - 2.0 * _INSET, 0.0) / _SPACING) + 1.0


def stations_along(curve: Samples, radius: float, spacing: float = 1.0) -> Wire:
    """The wire of radius a along points of a centreline (n, 3), dense against its bends; it may touch itself."""
    from scipy.interpolate import CubicSpline

    gaps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    apart = np.concatenate([[True], gaps > 1e-12 * np.sum(gaps)])
    curve = np.array(curve[apart])
    chord = np.concatenate([[0.0], np.cumsum(gaps[apart[1:]])])
    spline = CubicSpline(chord, curve, axis=0)
    node, weight = np.polynomial.legendre.leggauss(4)
    steps = np.diff(chord)
    speed = np.linalg.norm(spline(chord[:-1, None] + 0.5 * (1.0 + node) * steps[:, None], 1), axis=-1)
    arc = np.concatenate([[0.0], np.cumsum(0.5 * steps * (speed @ weight))])
    at, lengths = _stations(float(arc[-1]), _BLOB * radius, spacing)
    where = np.interp(at, arc, chord)
    tangents = spline(where, 1)
    tangents = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    return Wire(spline(where), tangents, lengths, radius)


def closest_approach(wire: Wire) -> float:
    """Least distance between stations further along a wire than half a tightest turn, m; inf: over a diameter."""
    from scipy.spatial import cKDTree

    at = np.cumsum(wire.lengths) - 0.5 * wire.lengths
    pairs = cKDTree(wire.points).query_pairs(2.0 * wire.radius, output_type="ndarray")
    along = np.abs(at[pairs[:, 0]] - at[pairs[:, 1]])
    close = pairs[along > np.pi * wire.radius]
    distances = np.linalg.norm(wire.points[close[:, 0]] - wire.points[close[:, 1]], axis=1)
    return float(np.min(distances, initial=np.inf))


def _stations(length: float, blob: float, spacing: float) -> tuple[Samples, Samples]:
    """Positions of the stations along the arc, and the arc length of each."""
    step = _SPACING * spacing * blob
    inset = min(_INSET * blob, 0.5 * length)
    at: Samples = np.linspace(inset, length - inset, int(np.ceil((length - 2.0 * inset) / step)) + 1)
    ends = np.concatenate([np.zeros(1), 0.5 * (at[1:] + at[:-1]), np.full(1, length)])
    lengths: Samples = np.diff(ends)
    return at, lengths


@dataclass(frozen=True)
class WireSystem:
    """Equations of wires that move with rigid parts, all without the factor 1/(8 pi mu).

    Forces at the stations, and with `high` accuracy first moments m after them, follow from A f = S V - u for unit
    twists V and the velocities (and gradients along the moments) u that others make there; the fluid's wrench on the
    parts is S' f + K V.
    """

    mobility: Samples  #: A, symmetric positive definite, (3 n + q n, 3 n + q n).
    motion: Samples  #: S, (3 n + q n, 12).
    own: Samples  #: K, (12, 12).
    moments: Samples  #: Tensors of the q first moments at each station, force by displacement, (n, q, 3, 3).

    @property
    def torques(self) -> Samples:
        """Torque of each unit moment, (n, 3, q)."""
        torques: Samples = np.einsum("ikb,nqbk->niq", _LEVI_CIVITA, self.moments)
        return torques


def wire_system(wires: Sequence[tuple[Wire, int]], accuracy: Accuracy) -> WireSystem:
    """Equations of wires, each with the part that it moves with, at `standard` or `high` accuracy."""
    from spirillum.kernels.core import force_matrix

    none, nothing = np.zeros((12, 12)), np.zeros((0, 0, 3, 3))
    if not wires:
        return WireSystem(np.zeros((0, 0)), np.zeros((0, 12)), none, nothing)
    points = np.concatenate([wire.points for wire, _ in wires])
    e2 = np.concatenate([np.full(len(wire.points), wire.blob**2) for wire, _ in wires])
    part = np.concatenate([np.full(len(wire.points), part) for wire, part in wires])
    shape = len(points), 3
    forces = np.empty(shape + shape)
    force_matrix(points, e2, forces)
    forces = forces.reshape(3 * len(points), -1)
    motion = _on_part(np.concatenate([np.tile(np.eye(3), (len(points), 1, 1)), -skew(points)], axis=-1), part)
    if accuracy == "standard":
        own: Samples = np.sum([_spin_torque(*item) for item in wires], axis=0) / (8.0 * np.pi)
        return WireSystem(forces, motion, own, np.zeros((len(points), 0, 3, 3)))
    moments, across, gradients = _first_moments([wire for wire, _ in wires], points, e2)
    spin = np.einsum("nqbl,kbl->nqk", moments, -_LEVI_CIVITA)  # gradient along l of a rotation about k: e_k x e_l
    rotation = _on_part(np.concatenate([np.zeros_like(spin), spin], axis=-1), part)
    mobility: Samples = np.block([[forces, across], [across.T, gradients]])
    return WireSystem(mobility, np.concatenate([motion, rotation]), none, moments)


def _on_part(rows: Samples, part: np.ndarray) -> Samples:
    """Rows (stations, k, 6) against the twist of the part that each station moves with, (k stations, 12)."""
    motion = np.zeros((*rows.shape[:2], 12))
    for which in (0, 1):
        motion[part == which, :, 6 * which : 6 * which + 6] = rows[part == which]
    return motion.reshape(-1, 12)


def _spin_torque(wire: Wire, part: int) -> Samples:
    """Torque over rotation of a wire's cross-sections, each alone, (12, 12); viscosity 1."""
    tangent = wire.tangents.T @ (wire.lengths[:, None] * wire.tangents)
    across = np.sum(wire.lengths) * np.eye(3) - tangent
    matrix = np.zeros((12, 12))
    at = slice(6 * part + 3, 6 * part + 6)
    # 4 pi a^2 per arc length about the tangent, as a spinning cylinder, and half of it across: first moments of the
    # traction tilt a cross-section as they would in the line's own flow.
    matrix[at, at] = 4.0 * np.pi * wire.radius**2 * (tangent + _TILT * across)
    return matrix


def _first_moments(wires: Sequence[Wire], points: Samples, e2: Samples) -> tuple[Samples, Samples, Samples]:
    """First moments that cross-sections bear, (n, 5, 3, 3), their velocities at the stations, and their gradients."""
    # Force by displacement: spin about the tangent, tangential forces displaced along each of two normals, and two
    # strains of the cross-section; trace-free, of unit norm, orthogonal. On an infinite cylinder a unit density of each
    # moves the gradient along it by 4, 4, 4, 2, 2 over 8 pi mu a^2; the kernel's own answer on an infinite straight
    # line is 2 (a/e)^2 of that, and what is missing is added to each station's own entry.
    from spirillum.kernels.core import moment_matrices

    tangents = np.concatenate([wire.tangents for wire in wires])
    helper = np.eye(3)[np.argmin(np.abs(tangents), axis=1)]
    first = np.cross(tangents, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(tangents, first)
    moments: Samples = np.stack(
        [
            np.sqrt(0.5) * (dyad(second, first) - dyad(first, second)),
            dyad(tangents, first),
            dyad(tangents, second),
            np.sqrt(0.5) * (dyad(first, first) - dyad(second, second)),
            np.sqrt(0.5) * (dyad(first, second) + dyad(second, first)),
        ],
        axis=1,
    )
    lengths = np.concatenate([wire.lengths for wire in wires])
    a2 = np.concatenate([np.full(len(wire.points), wire.radius**2) for wire in wires])
    stations, shape = (len(points), 3), moments.shape[:2]
    across, gradients = np.empty(stations + shape), np.empty(shape + shape)
    moment_matrices(points, e2, moments, across, gradients)
    across, gradients = across.reshape(points.size, -1), gradients.reshape(int(np.prod(shape)), -1)
    missing = ((1.0 / a2 - 2.0 / e2) / lengths)[:, None] * np.array([4.0, 4.0, 4.0, 2.0, 2.0])
    gradients[np.diag_indices_from(gradients)] += missing.ravel()
    return moments, across, gradients
