"""Reduced basis for the coupling of wires and solids in a tube at any phase.

Over a turn, all that a wire sends to the solids lies in the span of some hundred fields: those of its ring forces in
unbounded fluid, mode by mode, and those that the wall reflects. The solids answer them once. A phase then needs only
the coefficients of its fields: in unbounded fluid they follow by turning, for the wall from as many unknowns as there
are fields (empirical interpolation: Chaturantabut and Sorensen, SIAM J. Sci. Comput. 32:2737, 2010; which unknowns, by
pivoted QR: Drmac and Gugercin, SIAM J. Sci. Comput. 38:A631, 2016).

Tails of one body may share a basis: what they send is much the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count, pairwise

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.rings import System
from spirillum.fluid.tube.solids import Solids
from spirillum.fluid.tube.wall import WallWaves, from_the_wall, point_waves, summed
from spirillum.fluid.wire.interaction import share
from spirillum.fluid.wire.sources import Sources

_LEAST, _MOST_LEAST = 2e-8, 2e-6
"""Fields below this share of the largest are left out: the square of a tenth of the tolerance, between these."""
_SNAPSHOTS = 300
"""Least number of points on what the wires sweep from which the wall's fields are found; two at each station."""
_GOLDEN = np.pi * (3.0 - np.sqrt(5.0))
"""Angle between the phases of neighbouring stations: together they cover what the wire sweeps."""
_SKETCH, _WALL_SKETCH = 96, 128
"""Random combinations from which fields of a mode, and of the wall (for each parity), are found; more if need be."""


@dataclass(frozen=True)
class Answers:
    """Solids' response for one system of unknowns: the basis, fields in unbounded fluid first, and responses to it."""

    tractions: Samples  #: Responses to unit fields, (unknowns, fields).
    work: Samples  #: Of those tractions against the fields, (fields, fields).
    drag: Samples  #: Work of the moving solids' tractions against the fields, (fields, motions).
    push: Samples  #: Work of the responses in the solids' motions, (motions, fields).
    free: tuple[tuple[int, int, Samples], ...]  #: Parity, mode, and coefficients from ring sources, (fields, sources).
    wall: tuple[Samples, ...]  #: Coefficients from waves at points, for each k, (orders, parities, 2, 3, fields).
    parities: tuple[int, ...]  #: Of those waves.

    def only(self, low: int, high: int, stations: int) -> Answers:
        """From the ring sources at stations `low` to `high` of `stations`."""
        free = []
        for parity, m, coefficients in self.free:
            kinds = coefficients.shape[1] // stations
            free.append((parity, m, np.ascontiguousarray(coefficients[:, kinds * low : kinds * high])))
        return replace(self, free=tuple(free))


@dataclass(frozen=True)
class Reduced:
    """Coupling of wires and solids at any phase in the reduced basis."""

    sources: Sources
    waves: WallWaves
    away: float  #: Smallest distance of the solids from the wall, m.
    answers: tuple[Answers, ...]

    @classmethod
    def of(cls, solids: Solids, tails: Sequence[Sources]) -> list[Reduced]:
        """The basis of wires that turn about the solids' axis, for each of some tails."""
        sources = Sources.joined(tails)
        times = max(2, -(-_SNAPSHOTS // len(sources.x)))
        x, rho = np.tile(sources.x, times), np.tile(sources.rho, times)
        theta = _GOLDEN * np.arange(len(x))
        pose, placed = solids.pose, solids.pose.placed(np.stack([x, rho * np.cos(theta), rho * np.sin(theta)], axis=1))
        away = float(np.min(pose.distances(sources.x, sources.rho)))
        along = pose.rotation[0, 0]
        beside = sources.rho * np.sqrt(1.0 - along**2)
        reach = np.concatenate([along * sources.x - beside, along * sources.x + beside])
        waves = solids.waves(0.5 * (solids.gap + away), reach)
        crossing = _unbounded(solids, sources)
        walls, picked = [], []
        for system, basis in zip(solids.systems, _reflected(solids, waves, placed, away), strict=True):
            root = np.sqrt(_duals(system))[:, None]
            walls.append(basis / root)
            rows = _rows(root * walls[-1])
            picked.append((rows, tuple(f.only(some) for f, some in zip(system, _split(system, rows), strict=True))))
        received = solids.rings.received(waves, [system for _, system in picked], away)
        found = []
        for number, (wall, (rows, _)) in enumerate(zip(walls, picked, strict=True)):
            gather = np.linalg.pinv(wall[rows]).T
            fields = [
                np.tensordot(values[number], gather, axes=1).astype(solids.fineness.precision) for values in received
            ]
            blob = np.concatenate([np.full((len(wire.points), 3), wire.blob) for wire in sources.wires])
            sizes = np.concatenate([np.ones_like(blob), blob], axis=1)
            found.append(_answers(solids, number, crossing, sizes, wall, fields))
        edges = np.cumsum([0, *(tail.x.size for tail in tails)]).tolist()
        return [
            cls(tail, waves, solids.gap, tuple(answers.only(low, high, sources.x.size) for answers in found))
            for tail, (low, high) in zip(tails, pairwise(edges), strict=True)
        ]

    def serves(self, sources: Sources) -> bool:
        """Whether these wires are the ones of the basis, at any phase."""
        return self.sources.sweep_same_circles(sources)

    def coefficients(self, sources: Sources, placed: Samples, along: Samples) -> list[Samples]:
        """Fields from unit forces and moments at the stations, for each system, (fields, 3 n + q n)."""
        found = []
        for answers, wall in zip(self.answers, self._reflected(placed), strict=True):
            free: list[Samples] = [np.zeros((0, len(placed) * (3 + sources.torques.shape[2])))]
            for parity, m, coefficients in answers.free:
                turn = sources.turn(m, coefficients.shape[1])
                free.append(sources.columns(coefficients * (turn.imag if parity else turn.real)))
            both = np.concatenate(free)
            padded = np.zeros((len(wall), both.shape[1]))
            padded[:, : len(along)] = -wall @ along
            found.append(np.concatenate([both, padded]))
        return found

    def _reflected(self, placed: Samples) -> list[Samples]:
        """Fields that the wall reflects of unit forces at points about its axis, for each system, (fields, 3 n)."""
        points, distances, back = from_the_wall(placed, self.waves.radius)
        precision = self.answers[0].wall[0].dtype.type

        def reflected(numbers: range) -> list[Samples]:
            found: list[Samples] = [np.zeros((answers.wall[0].shape[-1], placed.size)) for answers in self.answers]
            for number in numbers:
                for low, high, there in self.waves.bands(number, distances, self.away, self.waves.orders[number]):
                    here = 3 * there.size
                    at_points = point_waves(points[: there.size], self.waves, number, low, high, precision)
                    for total, answers in zip(found, self.answers, strict=True):
                        matrix = answers.wall[number][low:high]
                        sent = at_points[: len(matrix), answers.parities].reshape(-1, here)
                        total[:, :here] += matrix.reshape(-1, len(total)).T @ sent
            return found

        shares = summed(reflected, self.waves.k.size)
        return [sum(some)[:, back] for some in zip(*shares, strict=True)]


def _unbounded(solids: Solids, sources: Sources) -> list[Samples]:
    """Velocities of each mode on all nodes from ring sources in unbounded fluid, (3 nodes, sources)."""
    found: list[Samples] = []
    screen = np.repeat(_screen(solids, sources), 3, axis=0)[:, :, None]
    for last, bearing in solids.tiers:
        cross = sources.velocities(solids.panels.of_solids(bearing), last)
        rows = np.flatnonzero(np.repeat(bearing[solids.panels.solid_of_node], 3))
        for m in range(len(found), last):
            whole = np.zeros((*screen.shape[:2], cross[m].shape[1] // sources.x.size))
            whole[rows] = share(m) * cross[m].reshape(len(rows), sources.x.size, -1)
            whole[:, :, 3:] *= screen
            found.append(whole.reshape(len(whole), -1))
    return found


def _screen(solids: Solids, sources: Sources) -> Samples:
    """Velocity on the solids from torques at the wires, including the wall's reflection, (nodes, stations)."""
    # The velocity falls off as the square of the distance, and nearly vanishes in a film at the wall: an image behind a
    # plane wall takes it away. Without it torques of a fraction of a percent would press the film under the body.
    x, rho = (values.ravel()[:, None] for values in (solids.panels.x, solids.panels.rho))
    apart = (x - sources.x) ** 2 + (rho - sources.rho) ** 2
    clear = solids.pose.distances(x.ravel(), rho.ravel())[:, None] * solids.pose.distances(sources.x, sources.rho)
    return 1.0 - apart / (apart + 4.0 * np.maximum(clear, 0.0))


def _reflected(solids: Solids, waves: WallWaves, placed: Samples, away: float) -> list[Samples]:
    """Basis of what the wall reflects of forces at points, with roots of surface elements, for each system."""
    systems, size = solids.systems, 3 * len(placed)
    step = _WALL_SKETCH * len(systems[0])
    fields: list[Samples] = [np.zeros((_duals(system).size, 0)) for system in systems]
    for seed in count():
        forces = _mixing(size, step, seed) if fields[0].shape[1] + step < size else np.eye(size)
        sent = solids.rings.sent(waves, systems, placed, forces, away)
        sent = [np.sqrt(_duals(system))[:, None] * some for system, some in zip(systems, sent, strict=True)]
        whole = forces.shape[1] == size
        fields = sent if whole else [np.concatenate(both, axis=1) for both in zip(fields, sent, strict=True)]
        found = [_basis(some, _least(solids)) for some in fields]
        if whole or max(basis.shape[1] for basis in found) < fields[0].shape[1]:
            break
    return found


def _least(solids: Solids) -> float:
    return min(max((0.1 * solids.fineness.tolerance) ** 2, _LEAST), _MOST_LEAST)


def _mixing(size: int, columns: int, seed: int = 0) -> Samples:
    """Random combinations, (size, columns); the unit matrix where they are no fewer."""
    if columns >= size:
        return np.eye(size)
    mixed: Samples = np.random.default_rng(seed).standard_normal((size, columns)) / np.sqrt(columns)
    return mixed


def _duals(system: System) -> Samples:
    return np.concatenate([family.dual for family in system])


def _answers(
    solids: Solids, number: int, crossing: list[Samples], sizes: Samples, wall: Samples, coefficients: list[Samples]
) -> Answers:
    """Solids' response of one system to fields that the wall reflects, (unknowns, fields), and their coefficients."""
    system = solids.systems[number]
    dual = _duals(system)
    root = np.sqrt(dual)[:, None]
    weighted, places = [], []
    first = 0
    for family in system:
        for m, rows in enumerate(family.of_mode):
            here = slice(first + family.starts[m], first + family.starts[m + 1])
            values = root[here] * crossing[m][rows]
            weighted.append(values * sizes[:, : values.shape[1] // len(sizes)].ravel() if values.size else values)
            places.append((family.parity, m, here))
        first += family.dual.size
    largest = max(float(np.max(np.linalg.norm(values, axis=0), initial=0.0)) for values in weighted)
    blocks, free = [], []
    for (parity, m, here), values in zip(places, weighted, strict=True):
        fields = _basis(values, _least(solids), largest)
        block = np.zeros((dual.size, fields.shape[1]))
        block[here] = fields
        blocks.append(block)
        if fields.size:
            free.append((parity, m, fields.T @ values / sizes[:, : values.shape[1] // len(sizes)].ravel()))
    basis = np.concatenate([np.concatenate(blocks, axis=1) / root, wall], axis=1)
    tractions = solids.solve_system(number, basis)
    acting = (dual[:, None] * basis).T
    moving, motion = (
        np.concatenate([values[family.parity] for family in system]) for values in (solids.moving, solids.motion)
    )
    return Answers(
        tractions,
        acting @ tractions,
        acting @ moving,
        (dual[:, None] * motion).T @ tractions,
        tuple(free),
        tuple(coefficients),
        tuple(family.parity for family in system),
    )


def _basis(fields: Samples, least: float, largest: float | None = None) -> Samples:
    """Orthonormal columns that span fields, but for what is small against the largest, (n, fields)."""
    from scipy.linalg import qr

    size = largest or float(np.max(np.linalg.norm(fields, axis=0), initial=0.0))
    columns = _SKETCH
    while True:
        if not fields.size or size == 0.0:
            return fields[:, :0]
        sketched = fields @ _mixing(fields.shape[1], columns) if 2 * columns < fields.shape[1] else fields
        basis, upper, _ = qr(sketched, mode="economic", pivoting=True)
        kept = int(np.count_nonzero(np.abs(np.diag(upper)) > least * size))
        if kept < sketched.shape[1] or sketched is fields:
            found: Samples = basis[:, :kept]
            return found
        columns *= 2


def _rows(basis: Samples) -> np.ndarray:
    """Rows from which a field's coefficients are found, half as many again as there are fields."""
    from scipy.linalg import qr

    rows = np.arange(len(basis))
    found: list[int] = []
    for wanted in (basis.shape[1], basis.shape[1] // 2):
        left = np.setdiff1d(rows, found)
        _, order = qr(basis[left].T, mode="r", pivoting=True)[-2:]
        found += left[order[:wanted]].tolist()
    return np.sort(np.array(found, dtype=int))


def _split(system: System, rows: np.ndarray) -> list[np.ndarray]:
    """Unknowns of a system as unknowns of its families."""
    edges = np.cumsum([0, *(family.dual.size for family in system)])
    return [rows[(rows >= low) & (rows < high)] - low for low, high in pairwise(edges)]
