"""Solids of revolution in a tube: the wall's waves as Fourier modes on their rings, about their own axis.

Axes here: x along the robot, y up, z to the right; angles count from y.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from itertools import pairwise
from threading import Lock
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.wall import Waves, each, extensions, point_waves, times_layers, weighted_layers
from spirillum.fluid.wire.revolution import Panels
from spirillum.robot.seat import Seat

__all__ = ["LevelRings", "Rings", "Rows", "System", "TiltedRings"]

_FINER = 4
"""Nodes that average waves over a panel, over its own."""
_FINER_TILTED = 2
"""Nodes of that average where the axis is pitched: bodies then come close to the wall in one place only."""
_TIER = 1.6
"""Ratio of the distances from the wall in one tier of panels."""
_AVERAGED_TIERS = 3
"""Tiers near the wall in which waves are averaged over panels."""
_MOST_VALUES = 500_000
"""Values of waves around rings that are held at a time: they stay in the cache, and their memory is used again."""


class Rows(NamedTuple):
    """Unknowns of one parity: for each mode the rows, of 3 a node, that bear it."""

    parity: int
    """0 even, 1 odd."""
    of_mode: tuple[np.ndarray, ...]
    """For each mode."""
    dual: Samples
    """What makes an integral over the surface of an unknown, (unknowns,)."""

    @property
    def starts(self) -> np.ndarray:
        """First unknown of each mode, and their number."""
        return np.concatenate([[0], np.cumsum([rows.size for rows in self.of_mode])])

    def gathered(self, modes: Sequence[Samples]) -> Samples:
        """Values of all unknowns from values of each mode on all rows."""
        return np.concatenate([values[rows] for values, rows in zip(modes, self.of_mode, strict=True)])

    def only(self, unknowns: np.ndarray) -> Rows:
        """Some of the unknowns, in ascending order."""
        parts = [unknowns[(unknowns >= a) & (unknowns < b)] - a for a, b in pairwise(self.starts.tolist())]
        of_mode = tuple(rows[part] for rows, part in zip(self.of_mode, parts, strict=True))
        return Rows(self.parity, of_mode, self.dual[unknowns])


System = tuple[Rows, ...]
"""Families whose unknowns the wall couples, one after the other: each parity by itself, or both of them."""


class Rings(ABC):
    """What the wall does to solids of revolution: their rings see its waves as Fourier modes about their own axis."""

    @abstractmethod
    def subtract(self, waves: Waves, systems: Sequence[System], matrices: Sequence[Samples]) -> None:
        """Take what the wall reflects of the solids' tractions from their single layer's matrices.

        Args:
            waves: those that matter between the solids.
            systems: families of unknowns that the wall couples.
            matrices: one for each system, (unknowns, unknowns), changed in place.
        """

    @abstractmethod
    def sent(
        self, waves: Waves, systems: Sequence[System], points: Samples, forces: Samples, away: float
    ) -> list[Samples]:
        """Velocities on the solids from forces at points, by the wall, (unknowns, columns) for each system.

        Without the minus sign.

        Args:
            waves: those that matter between points and solids.
            systems: families of unknowns that the wall couples.
            points: about the tube's axis, in its axes, (n, 3), m.
            forces: in columns, (3 n, columns).
            away: smallest distance from the wall of what the points stand for, m.
        """

    @abstractmethod
    def received(self, waves: Waves, systems: Sequence[System], away: float) -> list[list[Samples]]:
        """Velocities on some unknowns from waves at points, with the wall's single layer, for each k and system.

        (unknowns, 2, parities, orders, 3), to be multiplied with `point_waves`; without the minus sign.

        Args:
            waves: those that matter between points and solids.
            systems: the unknowns.
            away: smallest distance of the points from the wall, m.
        """


class LevelRings(Rings):
    """Rings about an axis parallel to the tube's, `offset` below it.

    A wave is carried over to the second axis by its velocities on one cylinder about it, the reference: Fourier modes
    there follow from its values around the cylinder, and each mode extends to other rings as in a tube.
    """

    def __init__(self, panels: Panels, offset: float, modes: int) -> None:
        """Rings of solids.

        Args:
            panels: of the solids.
            offset: m.
            modes: Fourier modes about the second axis.
        """
        self.panels, self.offset, self.modes = panels, offset, modes
        self.reference = float(np.max(panels.rho))

    def subtract(self, waves: Waves, systems: Sequence[System], matrices: Sequence[Samples]) -> None:
        """See `Rings.subtract`."""
        at_nodes, averages = self._strengths(waves), self._strengths(waves, averaged=True)
        between = self._matrices(waves)

        def lessen(family: Rows) -> None:
            starts, matrix = family.starts, matrices[family.parity]
            for band, near in self._bands(waves):
                active = [np.flatnonzero(near[here]) for here in family.of_mode]
                size = waves.k[band].size
                sources = [
                    averages[n][there[some], band].reshape(some.size, 6 * size)
                    for n, (there, some) in enumerate(zip(family.of_mode, active, strict=True))
                ]
                for m, (here, some) in enumerate(zip(family.of_mode, active, strict=True)):
                    target = at_nodes[m][here[some], band].swapaxes(0, 1).reshape(size, 2 * some.size, 3)
                    pressed = target @ between[family.parity][band, m].reshape(size, 3, 3 * self.modes)
                    shaped = pressed.reshape(size, some.size, 2, self.modes, 3).transpose(3, 1, 0, 2, 4)
                    left = np.ascontiguousarray(shaped).reshape(self.modes, some.size, 6 * size)
                    for n, source in enumerate(sources):
                        block = source @ left[n].T
                        block *= family.dual[starts[n] + active[n], None]
                        _take(block, matrix.T, starts[n] + active[n], starts[m] + some)

        each(lessen, [family for (family,) in systems])

    def _bands(self, waves: Waves) -> Iterator[tuple[slice, np.ndarray]]:
        """Bands of k, each with the rows (of 3 a node) that its waves reach before they are damped, there and back."""
        distance = np.repeat(waves.radius - self.offset - self.panels.rho.ravel(), 3)
        edges = np.searchsorted(waves.k, waves.k[-1] * 0.5 ** np.arange(6.0, 0.0, -1.0))
        for low, high in pairwise([0, *edges.tolist(), waves.k.size]):
            if high > low:
                yield slice(low, high), waves.k[low] * (distance + distance.min()) < waves.cut + 3.0

    def sent(
        self, waves: Waves, systems: Sequence[System], points: Samples, forces: Samples, away: float
    ) -> list[Samples]:
        """See `Rings.sent`."""
        columns = forces.shape[1]
        middle = np.empty((2, self.modes, waves.k.size, 2, 3, columns))

        def fill(number: int) -> None:
            pressed = _pressed(waves, number, points, forces)
            for parity, trace in enumerate(self._traces(waves, number)):
                flat = trace.reshape(3 * self.modes, -1)
                both = flat @ pressed[:, :, parity].transpose(2, 3, 1, 0).reshape(flat.shape[1], -1)
                middle[parity, :, number] = both.reshape(self.modes, 3, 2, columns).swapaxes(1, 2)

        each(fill, range(waves.k.size))
        strengths = self._strengths(waves)
        found = []
        for (family,) in systems:
            parts = [
                strengths[m][here].reshape(here.size, -1) @ middle[family.parity, m].reshape(-1, columns)
                for m, here in enumerate(family.of_mode)
            ]
            found.append(np.concatenate(parts))
        return found

    def received(self, waves: Waves, systems: Sequence[System], away: float) -> list[list[Samples]]:
        """See `Rings.received`."""
        strengths = self._strengths(waves)

        def product(number: int) -> list[Samples]:
            found = []
            for (family,), traces in zip(systems, self._traces(waves, number), strict=True):
                fields = [
                    np.tensordot(values[rows, number], trace, axes=1)
                    for values, rows, trace in zip(strengths, family.of_mode, traces, strict=True)
                ]
                found.append(times_layers(np.concatenate(fields)[:, :, None], waves, number))
            return found

        return each(product, range(waves.k.size))

    def _traces(self, waves: Waves, number: int) -> tuple[Samples, Samples]:
        """Even and odd waves of one k as modes on the reference cylinder, (modes, 3, orders, 3) each."""
        from spirillum.kernels.tube_waves import circle_waves

        orders = waves.orders[number]
        theta = _angles(max(waves.orders), self.modes)
        y, z = self.reference * np.cos(theta) - self.offset, self.reference * np.sin(theta)
        angle = np.arctan2(z, y)
        values = extensions(float(waves.k[number]), waves.radius, np.hypot(y, z), orders)
        even, odd = (np.empty((3, theta.size, orders, 3)) for _ in range(2))
        circle_waves(values, angle, angle - theta, even, odd)
        found = []
        for parity, field in enumerate((even, odd)):
            flat = field.reshape(3, theta.size, -1)
            modes = [matrix @ part for matrix, part in zip(_projectors(theta, self.modes, parity), flat, strict=True)]
            found.append(np.stack(modes, axis=1).reshape(self.modes, 3, orders, 3))
        return found[0], found[1]

    def _matrices(self, waves: Waves) -> tuple[Samples, Samples]:
        """sum_p eps_p U S U' between modes, even and odd, (k, modes, 3, modes, 3), with the weights in k."""
        size = 3 * self.modes

        def product(number: int) -> list[Samples]:
            layers = weighted_layers(waves, number)
            found = []
            for trace in self._traces(waves, number):
                flat = trace.reshape(size, -1, 3)
                pressed = np.matmul(flat.swapaxes(0, 1), layers).swapaxes(0, 1)
                matrix = pressed.reshape(size, -1) @ flat.reshape(size, -1).T
                found.append(matrix.reshape(self.modes, 3, self.modes, 3))
            return found

        pairs = each(product, range(waves.k.size))
        return np.stack([pair[0] for pair in pairs]), np.stack([pair[1] for pair in pairs])

    def _strengths(self, waves: Waves, *, averaged: bool = False) -> list[Samples]:
        """Each mode on the nodes from unit modes on the reference cylinder, (3 nodes, k, 2, 3) each.

        The 2 stands for the real and the imaginary part of the wave. The film between a body and the wall may be
        thinner than nodes are apart: tractions enter by averages over the panels, with what each node contributes.
        """
        panels = self.panels
        x, rho, average = _finer(panels, _FINER) if averaged else (panels.x, panels.rho, None)
        found: list[Samples] = [np.empty((3 * panels.size, waves.k.size, 2, 3)) for _ in range(self.modes)]

        def fill(number: int) -> None:
            k = float(waves.k[number])
            values = extensions(k, self.reference, rho.ravel(), self.modes).reshape(*x.shape, self.modes, 3, 3)
            wave = np.exp(1j * k * x)[..., None] * np.array([1j, 1.0, 1.0])
            parts = np.stack([wave.real, wave.imag], axis=-1)[..., None]
            for q in range(self.modes):
                block = parts * values[:, :, q, :, None, :]
                if average is not None:
                    block = np.matmul(average, block.reshape(*x.shape, 18))
                found[q][:, number] = block.reshape(-1, 2, 3)

        each(fill, range(waves.k.size))
        return found


def _take(block: Samples, matrix: Samples, rows: np.ndarray, columns: np.ndarray) -> None:
    """Subtract a block from rows and columns of a matrix; ascending ones without gaps as a slice, ten times faster."""
    if not block.size:
        return
    where = [
        slice(int(lines[0]), int(lines[-1]) + 1) if lines[-1] - lines[0] == lines.size - 1 else lines
        for lines in (rows, columns)
    ]
    if all(isinstance(lines, np.ndarray) for lines in where):
        matrix[np.ix_(rows, columns)] -= block
    else:
        matrix[where[0], where[1]] -= block


def _add_product(left: Samples, right: Samples, total: Samples) -> None:
    """Add left @ right.T to a matrix in column-major order, in place: products of few columns cost their memory."""
    from scipy.linalg.blas import dgemm

    if total.size:
        dgemm(1.0, left.T, right.T, 1.0, total, trans_a=True, overwrite_c=True)


class _Tier(NamedTuple):
    """Panels at about one distance from the wall: steep waves do not reach those further away."""

    distance: float
    """Smallest distance from the wall, m."""
    modes: int
    """Fourier modes that they bear."""
    sample: _Sample
    """Their nodes."""
    averaged: _Sample
    """More nodes, and averages over them; near the wall only."""
    rows: tuple[tuple[np.ndarray, ...], ...]
    """[parity][mode]: which of their 3 nodes bear it."""
    unknowns: tuple[np.ndarray, ...]
    """[system]: the unknowns that these are."""


class _Sample(NamedTuple):
    """Rings on which waves are evaluated."""

    x: Samples
    """(panels, q), m."""
    rho: Samples
    """(panels, q), m."""
    average: Samples | None
    """From them to the nodes, (panels, p, q); None where they are the nodes."""


class TiltedRings(Rings):
    """Rings about an axis that is tilted against the tube's: every wave is projected on every ring that it reaches.

    Without yaw, rings and waves are mirror images of themselves, and half circles suffice. With yaw, waves of either
    parity move unknowns of both.
    """

    def __init__(self, panels: Panels, seat: Seat, counts: np.ndarray) -> None:
        """Rings of solids.

        Args:
            panels: of the solids.
            seat: where their axis runs in the tube.
            counts: Fourier modes about it that each node bears.
        """
        self.panels, self.seat, self.counts = panels, seat, counts

    def _tiers(self, systems: Sequence[System], bearing: np.ndarray | None = None) -> list[_Tier]:
        """Panels sorted by their distance from the wall; with `bearing` some of their nodes only, never averaged."""
        fine = _finer(self.panels, _FINER_TILTED)
        distances = self.seat.distances(*fine[:2]).min(axis=1)
        step = np.floor(np.log(distances / distances.min()) / np.log(_TIER))
        tiers = []
        for number in np.unique(step):
            here = step == number
            nodes = np.repeat(here, self.panels.order)
            if bearing is not None:
                nodes &= bearing
                if not np.any(nodes):
                    continue
            place = np.full(3 * self.panels.size, -1)
            place[np.repeat(nodes, 3)] = np.arange(3 * np.count_nonzero(nodes))
            modes = int(self.counts[nodes].max())
            of_mode, unknowns = [], []
            for system in systems:
                local = [[place[bearing] for bearing in family.of_mode] for family in system]
                of_mode += [tuple(part[part >= 0] for part in family[:modes]) for family in local]
                unknowns.append(np.flatnonzero(np.concatenate([part for family in local for part in family]) >= 0))
            if bearing is None:
                sample = _Sample(self.panels.x[here], self.panels.rho[here], None)
            else:
                sample = _Sample(self.panels.x.ravel()[nodes, None], self.panels.rho.ravel()[nodes, None], None)
            near = bearing is None and number < _AVERAGED_TIERS
            averaged = _Sample(*(values[here] for values in fine)) if near else sample
            tiers.append(_Tier(float(distances[here].min()), modes, sample, averaged, tuple(of_mode), tuple(unknowns)))
        return tiers

    def subtract(self, waves: Waves, systems: Sequence[System], matrices: Sequence[Samples]) -> None:
        """See `Rings.subtract`."""
        tiers = self._tiers(systems)
        alike = [tier.averaged is tier.sample for tier in tiers]  # among those the wall's part is symmetric
        blocks = {
            (a, b, s): np.zeros((tiers[a].unknowns[s].size, tiers[b].unknowns[s].size), order="F")
            for a in range(len(tiers))
            for b in range(len(tiers))
            for s in range(len(systems))
            if not (alike[a] and alike[b] and a > b)
        }
        locks = {where: Lock() for where in blocks}

        def lessen(number: int) -> None:
            nearest = min(tier.distance for tier in tiers)
            orders = [waves.orders_between(number, 0.5 * (tier.distance + nearest)) for tier in tiers]
            reached = [(t, tier, count) for t, (tier, count) in enumerate(zip(tiers, orders, strict=True)) if count]
            sides = []
            for t, tier, count in reached:
                targets = self._on_rings(waves, number, tier, tier.sample, count)
                averages = targets if alike[t] else self._on_rings(waves, number, tier, tier.averaged, count)
                sides.append((targets, averages))
            for (a, tier_a, count_a), (targets, _) in zip(reached, sides, strict=True):
                pressed = [times_layers(target, waves, number) for target in targets]
                for (b, tier_b, count_b), (_, sources) in zip(reached, sides, strict=True):
                    if (a, b, 0) not in blocks:
                        continue
                    far = waves.orders_between(number, 0.5 * (tier_a.distance + tier_b.distance))
                    count = min(count_a, count_b, far)
                    for s in range(len(systems)) if count else ():
                        left, right = pressed[s][..., :count, :], sources[s][..., :count, :]
                        with locks[a, b, s]:
                            _add_product(left.reshape(len(left), -1), right.reshape(len(right), -1), blocks[a, b, s])

        each(lessen, range(waves.k.size))
        duals = [np.concatenate([family.dual for family in system]) for system in systems]
        for (a, b, s), block in blocks.items():
            rows, columns = tiers[a].unknowns[s], tiers[b].unknowns[s]
            matrices[s][np.ix_(rows, columns)] -= block * duals[s][columns]
            if a != b and (b, a, s) not in blocks:
                matrices[s][np.ix_(columns, rows)] -= block.T * duals[s][rows]

    def sent(
        self, waves: Waves, systems: Sequence[System], points: Samples, forces: Samples, away: float
    ) -> list[Samples]:
        """See `Rings.sent`."""
        tiers = self._tiers(systems)
        sizes = [sum(family.dual.size for family in system) for system in systems]
        found: list[Samples] = [np.zeros((size, forces.shape[1])) for size in sizes]
        parities = [[family.parity for family in system] for system in systems]
        lock = Lock()

        def add(number: int) -> None:
            pressed = _pressed(waves, number, points, forces)
            for tier in tiers:
                count = waves.orders_between(number, 0.5 * (tier.distance + away))
                for s, target in enumerate(self._on_rings(waves, number, tier, tier.sample, count) if count else ()):
                    right = pressed[:, :, parities[s], :count].reshape(len(pressed), -1)
                    block = target.reshape(len(target), -1) @ right.T
                    with lock:
                        found[s][tier.unknowns[s]] += block

        each(add, range(waves.k.size))
        return found

    def received(self, waves: Waves, systems: Sequence[System], away: float) -> list[list[Samples]]:
        """See `Rings.received`."""
        bearing = np.zeros(self.panels.size, dtype=bool)
        for family in (family for system in systems for family in system):
            bearing[np.concatenate(family.of_mode) // 3] = True
        tiers = self._tiers(systems, bearing)
        sizes = [sum(family.dual.size for family in system) for system in systems]

        def on(number: int) -> list[Samples]:
            counts = [waves.orders_between(number, 0.5 * (tier.distance + away)) for tier in tiers]
            shapes = [(size, 2, len(system), max(1, *counts), 3) for size, system in zip(sizes, systems, strict=True)]
            found = [np.zeros(shape) for shape in shapes]
            for tier, count in zip(tiers, counts, strict=True):
                fields = self._on_rings(waves, number, tier, tier.sample, count) if count else []
                for values, unknowns, field in zip(found, tier.unknowns, fields, strict=False):
                    values[unknowns, :, :, :count] = field
            return [times_layers(values, waves, number) for values in found]

        return each(on, range(waves.k.size))

    def _on_rings(self, waves: Waves, number: int, tier: _Tier, sample: _Sample, orders: int) -> list[Samples]:
        """Waves of one k on the unknowns of a tier, for each system, (unknowns, 2, parities, orders, 3).

        The 2 stands for the real and the imaginary part; parities of waves are those of the system's families.
        """
        symmetric = self.seat.yaw == 0
        theta = _angles(orders, tier.modes, whole=not symmetric)
        projectors = [_projectors(theta, tier.modes, parity) for parity in (0, 1)]
        sources = [(0,), (1,)] if symmetric else [(0, 1)] * 2  # waves that move the even and the odd family
        panels, order = len(sample.x), sample.x.shape[1] if sample.average is None else sample.average.shape[1]
        modes = [np.empty((tier.modes, panels * order, 3, 2, len(waved), orders, 3)) for waved in sources]
        some = max(1, _MOST_VALUES // (36 * theta.size * sample.x.shape[1] * orders))
        for first in range(0, panels, some):
            chunk = slice(first, first + some)
            nodes = slice(first * order, (first + some) * order)
            field = self._around(waves, number, sample.x[chunk].ravel(), sample.rho[chunk].ravel(), theta, orders)
            average = None if sample.average is None else sample.average[chunk]
            for family, waved in enumerate(sources):
                for column, parity in enumerate(waved):
                    for component, projector in enumerate(projectors[family]):
                        part = projector @ field[component, parity].reshape(theta.size, -1)
                        if average is not None:
                            part = np.matmul(average, part.reshape(tier.modes, *average.shape[::2], -1))
                        shaped = part.reshape(tier.modes, -1, 2, orders, 3)
                        modes[family][:, nodes, component, :, column] = shaped
        flat = [values.reshape(tier.modes, -1, *values.shape[3:]) for values in modes]
        families = [
            np.concatenate([values[rows] for values, rows in zip(family, of_mode, strict=True)])
            for family, of_mode in zip(flat, tier.rows, strict=True)
        ]
        return families if symmetric else [np.concatenate(families)]

    def _around(self, waves: Waves, number: int, x: Samples, rho: Samples, theta: Samples, orders: int) -> Samples:
        """Waves of one k around rings: component; even, odd; angle; ring; real, imaginary; order; wall component."""
        from spirillum.kernels.tube_waves import tilted_waves

        shape = theta.size, x.size
        along = np.broadcast_to(x, shape)
        up, right = np.cos(theta)[:, None] * rho, np.sin(theta)[:, None] * rho
        placed = self.seat.placed(np.stack([along, up, right], axis=-1).reshape(-1, 3))
        k = float(waves.k[number])
        values = extensions(k, waves.radius, np.hypot(placed[:, 1], placed[:, 2]), orders)
        angle, phase = np.arctan2(placed[:, 2], placed[:, 1]).reshape(shape), (k * placed[:, 0]).reshape(shape)
        out = np.empty((3, 2, *shape, 2, orders, 3))
        tilted_waves(values.reshape(*shape, orders, 3, 3), angle, phase, theta, self.seat.rotation, out)
        return out


def _pressed(waves: Waves, number: int, points: Samples, forces: Samples) -> Samples:
    """Forces at points as waves of one k, times the wall's single layer, (columns, 2, 2, orders, 3)."""
    at_points = point_waves(points, waves, number)
    mixed = forces.T @ at_points.reshape(len(at_points), -1)
    return times_layers(mixed.reshape(-1, *at_points.shape[1:]), waves, number)


def _angles(orders: int, modes: int, *, whole: bool = False) -> Samples:
    """Midpoints of a half circle, as many as waves need whose modes are then cut off, or of the whole one."""
    count = int(0.6 * (orders + modes)) + 12
    angles: Samples = np.pi * (np.arange(2 * count if whole else count) + 0.5) / count
    return angles


def _projectors(theta: Samples, modes: int, parity: int) -> tuple[Samples, Samples, Samples]:
    """From values (x, rho, theta) around a circle to Fourier modes (x, rho, g), (modes, angles) each."""
    q = np.arange(modes)[:, None]
    cos, sin = (function(q * theta) * (2.0 / theta.size) for function in (np.cos, np.sin))
    cos[0] *= 0.5
    return (cos, cos, -sin) if parity == 0 else (-sin, -sin, -cos)


def _finer(panels: Panels, times: int) -> tuple[Samples, Samples, Samples]:
    """Places x, rho of more nodes on each panel, (panels, q), and averages over them, (panels, p, q)."""
    places, gauss = np.polynomial.legendre.leggauss(times * panels.order)
    cardinal = panels.cardinals(places)
    x, rho = panels.x @ cardinal.T, panels.rho @ cardinal.T
    average: Samples = cardinal.T * (gauss * rho)[:, None, :] / panels.area.reshape(*panels.x.shape, 1)
    return x, rho, average
