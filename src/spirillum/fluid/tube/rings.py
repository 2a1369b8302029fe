"""Solids of revolution in a tube: Fourier modes of the wall's reflected waves on their rings.

`Rings` are about the body's own axis, `LevelRings` about an axis that is parallel to the tube's.
Axes here: x along the robot, y up, z to the right; angles count from y.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.wall import WallWaves, each, extensions, point_waves, times_layers, weighted_layers
from spirillum.fluid.wire.sources import Panels


class Rows(NamedTuple):
    """Unknowns of one parity: for each mode the rows, of 3 a node, that bear it."""

    parity: int  #: 0 even, 1 odd.
    of_mode: tuple[np.ndarray, ...]  #: For each mode.
    dual: Samples  #: Quadrature weights of the unknowns over the surface, (unknowns,).

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
    """Coupling of solids of revolution with the wall: its waves as Fourier modes about their own axis."""

    @abstractmethod
    def subtract(self, waves: WallWaves, systems: Sequence[System], matrices: Sequence[Samples]) -> None:
        """Take what the wall reflects of the solids' tractions from their single layer's matrices."""

    @abstractmethod
    def sent(
        self, waves: WallWaves, systems: Sequence[System], points: Samples, forces: Samples, away: float
    ) -> list[Samples]:
        """Velocities on the solids from forces at points, by the wall, (unknowns, columns) each, without the minus."""

    @abstractmethod
    def received(self, waves: WallWaves, systems: Sequence[System], away: float) -> list[list[Samples]]:
        """Velocities on some unknowns from waves at points, with the wall's single layer, for each k and system.

        (orders, parities, 2, 3, unknowns), to be multiplied with `point_waves`; without the minus sign.
        """


def sent_to_wall(waves: WallWaves, number: int, points: Samples, forces: Samples) -> Samples:
    """Forces at points as waves of one k, times the wall's single layer, (orders, 2, 2, 3, columns)."""
    at_points = point_waves(points, waves, number, precision=forces.dtype.type)
    return times_layers(np.tensordot(at_points, forces, axes=1), waves, number)


def midpoints(orders: int, modes: int, *, whole: bool = False) -> Samples:
    """Midpoints of a half circle, as many as waves need whose modes are then cut off, or of the whole one."""
    count = int(0.6 * (orders + modes)) + 12
    return np.pi * (np.arange(2 * count if whole else count) + 0.5) / count


def projectors(theta: Samples, modes: int, parity: int) -> tuple[Samples, Samples, Samples]:
    """From values (x, rho, theta) around a circle to Fourier modes (x, rho, g), (modes, angles) each."""
    q = np.arange(modes)[:, None]
    cos, sin = (function(q * theta) * (2.0 / theta.size) for function in (np.cos, np.sin))
    cos[0] *= 0.5
    return (cos, cos, -sin) if parity == 0 else (-sin, -sin, -cos)


def finer(panels: Panels, distances: Samples, cut: float, least: int) -> tuple[Samples, Samples, Samples]:
    """Positions x, rho of more nodes on each panel, (panels, q), and averages over them, (panels, p, q)."""
    # A wave is damped by exp(-cut) at k (d + d_min) = cut: up to there its Legendre coefficients are averaged to 1e-5.
    # With fewer nodes the resistance to pitching is 11 % low at 0.1 mm: thin films amplify what is missed.
    u = panels.rule[0]  # Gauss nodes resolve waves that shorten towards the ends of a panel, as they crowd there
    dense = np.sqrt(1.0 - (0.5 * (u[1:] + u[:-1])) ** 2) / np.diff(u)
    speeds = np.max(dense * np.hypot(np.diff(panels.x, axis=1), np.diff(panels.rho, axis=1)), axis=1)
    reach = cut * float(np.max(speeds / (distances + distances.min())))
    count = 0.5 * (panels.order + reach + 6.9 * np.cbrt(0.5 * reach))
    times = max(least, int(np.ceil(count / panels.order)))
    places, gauss = np.polynomial.legendre.leggauss(times * panels.order)
    cardinal = panels.cardinals(places)
    x, rho = panels.x @ cardinal.T, panels.rho @ cardinal.T
    average: Samples = cardinal.T * (gauss * rho)[:, None, :] / panels.area.reshape(*panels.x.shape, 1)
    return x, rho, average


_FINER = 4  # Nodes that average waves over a panel, over its own, at least.


class LevelRings(Rings):
    """Rings about an axis parallel to the tube's, `offset` below it.

    A wave is carried over to the second axis by its velocities on one cylinder about it, the reference: Fourier modes
    there follow from its values around the cylinder, and each mode extends to other rings as in a tube.
    """

    def __init__(self, panels: Panels, offset: float, modes: int) -> None:
        """Rings of solids."""
        self.panels, self.offset, self.modes = panels, offset, modes
        self.reference = float(np.max(panels.rho))

    def subtract(self, waves: WallWaves, systems: Sequence[System], matrices: Sequence[Samples]) -> None:
        """See `Rings.subtract`."""
        from spirillum.kernels.core import subtract_block

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
                        columns, rows = starts[n] + active[n], starts[m] + some
                        subtract_block(source @ left[n].T, columns, rows, family.dual, matrix.T)

        each(lessen, [family for (family,) in systems])

    def _bands(self, waves: WallWaves) -> Iterator[tuple[slice, np.ndarray]]:
        """Bands of k, each with the rows (of 3 a node) that its waves reach before they are damped, there and back."""
        distance = np.repeat(waves.radius - self.offset - self.panels.rho.ravel(), 3)
        edges = np.searchsorted(waves.k, waves.k[-1] * 0.5 ** np.arange(6.0, 0.0, -1.0))
        for low, high in pairwise([0, *edges.tolist(), waves.k.size]):
            if high > low:
                yield slice(low, high), waves.k[low] * (distance + distance.min()) < waves.cut + waves.slack

    def sent(
        self, waves: WallWaves, systems: Sequence[System], points: Samples, forces: Samples, away: float
    ) -> list[Samples]:
        """See `Rings.sent`."""
        columns = forces.shape[1]
        middle = np.empty((2, self.modes, waves.k.size, 2, 3, columns))

        def fill(number: int) -> None:
            onto_wall = sent_to_wall(waves, number, points, forces)
            for parity, trace in enumerate(self._traces(waves, number)):
                flat = trace.reshape(3 * self.modes, -1)
                both = flat @ onto_wall[:, parity].swapaxes(1, 2).reshape(flat.shape[1], -1)
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

    def received(self, waves: WallWaves, systems: Sequence[System], away: float) -> list[list[Samples]]:
        """See `Rings.received`."""
        strengths = self._strengths(waves)

        def product(number: int) -> list[Samples]:
            found = []
            for (family,), traces in zip(systems, self._traces(waves, number), strict=True):
                fields = [
                    np.tensordot(values[rows, number], trace, axes=1)
                    for values, rows, trace in zip(strengths, family.of_mode, traces, strict=True)
                ]
                found.append(times_layers(np.concatenate(fields).transpose(2, 1, 3, 0)[:, None], waves, number))
            return found

        return each(product, range(waves.k.size))

    def _traces(self, waves: WallWaves, number: int) -> tuple[Samples, Samples]:
        """Even and odd waves of one k as modes on the reference cylinder, (modes, 3, orders, 3) each."""
        from spirillum.kernels.core import circle_waves

        orders = waves.orders[number]
        theta = midpoints(max(waves.orders), self.modes)
        waved = np.empty((2, 3, theta.size, orders, 3))
        circle_waves(float(waves.k[number]), waves.radius, self.reference, self.offset, theta, waved)
        found = []
        for parity, field in enumerate(waved):
            flat = field.reshape(3, theta.size, -1)
            modes = [matrix @ part for matrix, part in zip(projectors(theta, self.modes, parity), flat, strict=True)]
            found.append(np.stack(modes, axis=1).reshape(self.modes, 3, orders, 3))
        return found[0], found[1]

    def _matrices(self, waves: WallWaves) -> tuple[Samples, Samples]:
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

    def _strengths(self, waves: WallWaves, *, averaged: bool = False) -> list[Samples]:
        """Each mode on the nodes from real and imaginary unit modes on the cylinder, (3 nodes, k, 2, 3) each."""
        panels = self.panels
        x, rho, average = panels.x, panels.rho, None
        # The film between a body and the wall may be thinner than nodes are apart: tractions enter by averages over the
        # panels, with what each node contributes.
        if averaged:
            distances = waves.radius - self.offset - panels.rho.max(axis=1)
            x, rho, average = finer(panels, distances, waves.cut, _FINER)
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
