"""Solids of revolution in a tube whose axis is tilted against the tube's: the wall's waves on their rings."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from threading import Lock
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.rings import Rings, System, finer, midpoints, projectors, sent_to_wall
from spirillum.fluid.tube.wall import WallWaves, distances_of, each, times_layers
from spirillum.fluid.wire.sources import Panels
from spirillum.robot.tube_pose import TubePose

_FINER = 3
"""Nodes that average waves over a panel, over its own, at least: with 2, normal resistance was 9 % low at a gap of 0.04
radii."""
_TIER = 1.6  # Ratio of the distances from the wall in one tier of panels.
_AVERAGED_TIERS = 3  # Tiers near the wall in which waves are averaged over panels.
_MOST_VALUES = 500_000
"""Number of waves around rings that are evaluated at once: they fit into the cache, and their memory is reused."""


def _add_product(left: Samples, right: Samples, total: Samples) -> None:
    """Add left.T @ right in place to a matrix in column-major order; memory-bound for few columns."""
    from scipy.linalg.blas import dgemm, sgemm

    if total.size:
        product = sgemm if total.dtype == np.float32 else dgemm
        product(1.0, left.T, right.T, 1.0, total, trans_b=True, overwrite_c=True)


class _Tier(NamedTuple):
    """Panels at about one distance from the wall: steep waves do not reach those further away."""

    distance: float  #: Smallest distance from the wall, m.
    modes: int  #: Fourier modes that they bear.
    sample: _Sample  #: Their nodes.
    averaged: _Sample  #: More nodes, and averages over them; near the wall only.
    columns: tuple[np.ndarray, ...]
    """[system]: where its unknowns stand among the modes on these panels: component, node, family, mode."""
    unknowns: tuple[np.ndarray, ...]  #: [system]: the unknowns that these are.


class _Sample(NamedTuple):
    """Rings on which waves are evaluated, (panels, q), m."""

    x: Samples
    rho: Samples
    average: Samples | None  #: From them to the nodes, (panels, p, q); None where they are the nodes.


class TiltedRings(Rings):
    """Rings about an axis that is tilted against the tube's: every wave is projected on every ring that it reaches.

    Without yaw, rings and waves are mirror images of themselves, and half circles suffice. With yaw, waves of either
    parity move unknowns of both.
    """

    def __init__(self, panels: Panels, pose: TubePose, counts: np.ndarray, precision: type[np.floating]) -> None:
        """Rings of solids."""
        self.panels, self.pose, self.counts, self.precision = panels, pose, counts, precision

    def _tiers(self, waves: WallWaves, systems: Sequence[System], bearing: np.ndarray | None = None) -> list[_Tier]:
        """Panels sorted by their distance from the wall; with `bearing` some of their nodes only, never averaged."""
        nearest = self.pose.distances(self.panels.x, self.panels.rho).min(axis=1)
        fine = finer(self.panels, nearest, waves.cut, _FINER)
        distances = self.pose.distances(*fine[:2]).min(axis=1)
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
            columns, unknowns = [], []
            for system in systems:
                local = [[place[bearing] for bearing in family.of_mode] for family in system]
                columns.append(_columns(local, modes, int(np.count_nonzero(nodes))))
                unknowns.append(np.flatnonzero(np.concatenate([part for family in local for part in family]) >= 0))
            if bearing is None:
                sample = _Sample(self.panels.x[here], self.panels.rho[here], None)
            else:
                sample = _Sample(self.panels.x.ravel()[nodes, None], self.panels.rho.ravel()[nodes, None], None)
            near = bearing is None and number < _AVERAGED_TIERS
            averaged = _Sample(*(values[here] for values in fine)) if near else sample
            tiers.append(_Tier(float(distances[here].min()), modes, sample, averaged, tuple(columns), tuple(unknowns)))
        return tiers

    def subtract(self, waves: WallWaves, systems: Sequence[System], matrices: Sequence[Samples]) -> None:
        """See `Rings.subtract`."""
        from spirillum.kernels.core import subtract_block

        tiers = self._tiers(waves, systems)
        # What plain tiers and others do to each other is symmetric; the waves of averaged ones are averaged both ways.
        alike = [tier.averaged is tier.sample for tier in tiers]
        blocks = {
            (a, b, s): np.zeros((tiers[a].unknowns[s].size, tiers[b].unknowns[s].size), order="F", dtype=self.precision)
            for a in range(len(tiers))
            for b in range(len(tiers))
            for s in range(len(systems))
            if not alike[b] or (alike[a] and a <= b)
        }
        locks = {where: Lock() for where in blocks}
        nearest = min(tier.distance for tier in tiers)

        def lessen(number: int) -> None:
            orders = [waves.orders_between(number, 0.5 * (tier.distance + nearest)) for tier in tiers]
            reached = [(t, tier, count) for t, (tier, count) in enumerate(zip(tiers, orders, strict=True)) if count]
            sides = []
            for t, tier, count in reached:
                own = partial(
                    self._on_rings, waves, number, tier=tier, orders=count, away=nearest, precision=self.precision
                )
                targets = own(tier.sample)
                averages = targets if alike[t] else own(tier.averaged)
                sides.append((targets, averages))
            for (a, tier_a, count_a), (targets, _) in zip(reached, sides, strict=True):
                pressed = [times_layers(target, waves, number) for target in targets]
                for (b, tier_b, count_b), (_, sources) in zip(reached, sides, strict=True):
                    if (a, b, 0) not in blocks:
                        continue
                    far = waves.orders_between(number, 0.5 * (tier_a.distance + tier_b.distance))
                    count = min(count_a, count_b, far)
                    for s in range(len(systems)) if count else ():
                        left, right = (some[s][:count].reshape(-1, some[s].shape[-1]) for some in (pressed, sources))
                        with locks[a, b, s]:
                            _add_product(left, right, blocks[a, b, s])

        each(lessen, range(waves.k.size))
        duals = [np.concatenate([family.dual for family in system]) for system in systems]
        for (a, b, s), block in blocks.items():
            rows, columns = tiers[a].unknowns[s], tiers[b].unknowns[s]
            subtract_block(block.T, columns, rows, duals[s], matrices[s].T)
            if a != b and (b, a, s) not in blocks:
                subtract_block(block, rows, columns, duals[s], matrices[s].T)

    def sent(
        self, waves: WallWaves, systems: Sequence[System], points: Samples, forces: Samples, away: float
    ) -> list[Samples]:
        """See `Rings.sent`."""
        tiers = self._tiers(waves, systems)
        sizes = [sum(family.dual.size for family in system) for system in systems]
        found: list[Samples] = [np.zeros((size, forces.shape[1])) for size in sizes]
        parities = [[family.parity for family in system] for system in systems]
        lock, forces = Lock(), forces.astype(self.precision)

        def add(number: int) -> None:
            onto_wall = sent_to_wall(waves, number, points, forces)
            for tier in tiers:
                count = waves.orders_between(number, 0.5 * (tier.distance + away))
                reached = self._on_rings(waves, number, tier.sample, tier, count, away, self.precision) if count else ()
                for s, target in enumerate(reached):
                    right = onto_wall[:count, parities[s]].reshape(-1, forces.shape[1])
                    block = target.reshape(-1, target.shape[-1]).T @ right
                    with lock:
                        found[s][tier.unknowns[s]] += block

        each(add, range(waves.k.size))
        return found

    def received(self, waves: WallWaves, systems: Sequence[System], away: float) -> list[list[Samples]]:
        """See `Rings.received`."""
        bearing = np.zeros(self.panels.size, dtype=bool)
        for family in (family for system in systems for family in system):
            bearing[np.concatenate(family.of_mode) // 3] = True
        tiers = self._tiers(waves, systems, bearing)
        sizes = [sum(family.dual.size for family in system) for system in systems]

        def on(number: int) -> list[Samples]:
            counts = [waves.orders_between(number, 0.5 * (tier.distance + away)) for tier in tiers]
            shapes = [(max(1, *counts), len(system), 2, 3, size) for size, system in zip(sizes, systems, strict=True)]
            found = [np.zeros(shape) for shape in shapes]
            for tier, count in zip(tiers, counts, strict=True):
                fields = self._on_rings(waves, number, tier.sample, tier, count, away) if count else []
                for values, unknowns, field in zip(found, tier.unknowns, fields, strict=False):
                    values[:count, ..., unknowns] = field
            return [times_layers(values, waves, number) for values in found]

        return each(on, range(waves.k.size))

    def _on_rings(
        self,
        waves: WallWaves,
        number: int,
        sample: _Sample,
        tier: _Tier,
        orders: int,
        away: float,
        precision: type[np.floating] = np.float64,
    ) -> list[Samples]:
        """Waves of one k on the unknowns of a tier, for each system, (orders, parities, 2, 3, unknowns)."""
        # The 2 stands for the real and the imaginary part; parities of waves are those of the system's families. Steep
        # waves are damped but where a ring nears the wall: they are evaluated on that arc only.
        symmetric = bool(self.pose.yaw == 0)
        theta = midpoints(orders, tier.modes, whole=not symmetric)
        onto = _onto_modes(theta, tier.modes, precision, symmetric=symmetric)
        panels, order = len(sample.x), sample.x.shape[1] if sample.average is None else sample.average.shape[1]
        modes = np.zeros((orders, 2, 2, 3, 3, panels * order, onto.shape[-1]), precision)
        some = max(1, _MOST_VALUES // (36 * theta.size * sample.x.shape[1] * orders))
        for first in range(0, panels, some):
            chunk = slice(first, first + some)
            there = slice(first * order, (first + some) * order)
            average = None if sample.average is None else sample.average[chunk].astype(precision)
            rings = self._around(sample.x[chunk].ravel(), sample.rho[chunk].ravel(), theta)
            distances = distances_of(rings.reshape(-1, 3), waves.radius).reshape(rings.shape[:2]).min(axis=0)
            for low, high, arc in waves.bands(number, distances, away, orders):
                field = self._waves(waves, number, theta[arc], rings[:, arc], low, high, precision)
                values = np.matmul(field.reshape(2, 3, -1, arc.size), onto[:, :, arc])
                if average is not None:
                    values = np.matmul(average, values.reshape(2, 3, len(average), average.shape[2], -1))
                values = values.reshape(2, 3, -1, high - low, 2, 3, onto.shape[-1])
                modes[low:high, :, :, :, :, there] = values.transpose(3, 0, 4, 5, 1, 2, 6)
        flat = modes.reshape(orders, 2, 2, 3, -1)
        if symmetric:
            return [flat[:, p : p + 1].take(columns, axis=-1) for p, columns in enumerate(tier.columns)]
        return [flat.take(columns, axis=-1) for columns in tier.columns]

    def _around(self, x: Samples, rho: Samples, theta: Samples) -> Samples:
        """Points around rings, about the tube's axis, (rings, angles, 3), m."""
        shape = x.size, theta.size
        up, right = np.outer(rho, np.cos(theta)), np.outer(rho, np.sin(theta))
        points = np.stack([np.broadcast_to(x[:, None], shape), up, right], axis=-1)
        return self.pose.placed(points.reshape(-1, 3)).reshape(*shape, 3)

    def _waves(
        self,
        waves: WallWaves,
        number: int,
        theta: Samples,
        placed: Samples,
        low: int,
        high: int,
        precision: type[np.floating],
    ) -> Samples:
        """Waves of one k and some orders on arcs of rings, at points about the tube's axis, (rings, angles, 3), m."""
        from spirillum.kernels.core import ring_waves, single_ring_waves

        # Over even, odd; component; ring; order; real, imaginary; wall component; angle.
        out = np.empty((2, 3, len(placed), high - low, 2, 3, theta.size), precision)
        fill = ring_waves if precision is np.float64 else single_ring_waves
        fill(float(waves.k[number]), waves.radius, placed, theta, self.pose.rotation, low, out)
        return out


def _columns(families: Sequence[Sequence[np.ndarray]], modes: int, nodes: int) -> np.ndarray:
    """Where the unknowns of a system stand among component, node, family and mode; of each mode rows of 3 a node."""
    width = modes * len(families)
    places = [
        ((rows % 3) * nodes + rows // 3) * width + family * modes + mode
        for family, of_mode in enumerate(families)
        for mode, borne in enumerate(of_mode[:modes])
        for rows in [borne[borne >= 0]]
    ]
    return np.concatenate(places)


def _onto_modes(theta: Samples, modes: int, precision: type[np.floating], *, symmetric: bool) -> Samples:
    """From even and odd waves around rings to modes: parity of the wave, component, angle, mode."""
    # Even waves move the even family only where rings and waves are mirror images of themselves, else both families.
    even, odd = (np.stack(projectors(theta, modes, parity)).astype(precision) for parity in (0, 1))
    moved = [even, odd] if symmetric else [np.concatenate([even, odd], axis=1)] * 2
    return np.stack(moved).swapaxes(2, 3)
