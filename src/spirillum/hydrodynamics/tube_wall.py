"""The wall of a circular tube: what it reflects of the forces inside, as waves along and around it.

A force at y moves the fluid at x, besides by the Stokeslet, by -2/pi int dk sum_p eps_p U_p(x) S_p U_p(y)', over
k > 0 and the even and odd waves of order p, with eps_0 = 1, else 2, and without the factor 1/(8 pi mu); see
`kernels.tube_waves`. No net flux passes along the tube. Near k = 0 the integrand goes as A + B log k: the nodes in k
crowd there, and what lies below the first is summed.

Axes here: x along the tube, y up, z to the right; angles count from y.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple, TypeVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.hydrodynamics.revolution import Panels

__all__ = [
    "LevelRings",
    "Rings",
    "Rows",
    "Seat",
    "TiltedRings",
    "Waves",
    "point_reflection",
    "point_waves",
    "waves_between",
]

_DECAY = 2.5
"""Rate, times the radius, at which the flow of a force dies out along the tube: images in the sum over k lie beyond."""
_LOWEST = 1e-5
"""First node in k, over the step."""
_CROWD = 1.5
"""Where nodes in k begin to crowd towards 0, over the step."""
_FINER = 4
"""Nodes that average waves over a panel, over its own."""
_FINER_TILTED = 2
"""The same where the axis is pitched: bodies then come close to the wall in one place only."""
_THREADS = 2

_T = TypeVar("_T")
_S = TypeVar("_S")


@dataclass(frozen=True)
class Waves:
    """Which waves are kept: nodes in k with their weights, and the number of orders p at each."""

    radius: float
    """Of the tube, m."""
    k: Samples
    """1/m."""
    weight: Samples
    """1/m; with the factor 2/pi of the reflection."""
    orders: tuple[int, ...]
    """Orders p = 0 to orders - 1."""


def waves_between(radius: float, reach: float, distance: float, tolerance: float) -> Waves:
    """The waves that matter between things in a tube.

    Args:
        radius: of the tube, m.
        reach: largest axial distance between them, m.
        distance: mean of their smallest distances from the wall, m.
        tolerance: waves are kept until they are damped by this much, there and back.
    """
    steepest = -np.log(tolerance) / (2.0 * distance)
    step = 2.0 * np.pi / (reach - np.log(tolerance) / _DECAY * radius)
    # k = c log(1 + exp(t/c)), even steps in t: exponentially close to k = 0, even where k > c
    crowd = _CROWD * step
    t = step * np.arange(-np.ceil(-_CROWD * np.log(_LOWEST)), np.ceil(steepest / step) + 1.0)
    k = crowd * np.logaddexp(0.0, t / crowd)
    weight = step / (1.0 + np.exp(-t / crowd))
    # below the first node the integrand is linear in t, and weights fall off as a geometric series
    ratio = np.exp(-1.0 / _CROWD)
    slope = weight[0] * ratio / (1.0 - ratio) ** 2
    weight[0] += weight[0] * ratio / (1.0 - ratio) + slope
    weight[1] -= slope
    around = radius * np.sqrt(np.maximum(steepest**2 - k**2, 0.0))
    return Waves(radius, k, 2.0 / np.pi * weight, tuple(int(p) for p in np.ceil(around) + 3.0))


def _each(function: Callable[[_S], _T], items: Iterable[_S]) -> list[_T]:
    """Compiled loops and linear algebra let other threads run."""
    with ThreadPoolExecutor(_THREADS) as pool:
        return list(pool.map(function, items))


def _extensions(k: float, radius: float, rho: Samples, orders: int) -> Samples:
    from scipy.special import i0e

    from spirillum.kernels.tube_waves import wave_extensions

    scale = i0e(k * rho) / i0e(k * radius) * np.exp(k * (rho - radius))
    extensions: Samples = wave_extensions(k, radius, rho, scale, orders)
    return extensions


def _layers(waves: Waves, number: int) -> Samples:
    """eps_p S_p at one k times its weight, (orders, 3, 3)."""
    from scipy.special import k0e, k1e

    from spirillum.kernels.tube_waves import wall_layers

    z = float(waves.k[number] * waves.radius)
    layers: Samples = wall_layers(z, float(k1e(z) / k0e(z)), waves.orders[number])
    layers[1:] *= 2.0
    layers *= waves.weight[number]
    return layers


@dataclass(frozen=True)
class Seat:
    """A tube, and where in it the robot's axis runs; axes here are x along each, y up, z to the right."""

    radius: float
    """Of the tube, m."""
    offset: float
    """How far the body's mid-length lies below the tube's axis, m."""
    pitch: float = 0.0
    """Angle by which the nose is raised, rad."""

    @property
    def rotation(self) -> Samples:
        """From the robot's axes to the tube's, 3x3."""
        c, s = np.cos(self.pitch), np.sin(self.pitch)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def placed(self, points: Samples) -> Samples:
        """Points in the robot's axes as points about the tube's axis, (n, 3)."""
        moved: Samples = points @ self.rotation.T - np.array([0.0, self.offset, 0.0])
        return moved

    def distances(self, x: Samples, rho: Samples) -> Samples:
        """Smallest distances from the wall of rings about the robot's axis."""
        theta = np.linspace(0.0, np.pi, 181)
        height = x[..., None] * np.sin(self.pitch) + rho[..., None] * np.cos(theta) * np.cos(self.pitch) - self.offset
        farthest = np.max(np.hypot(height, rho[..., None] * np.sin(theta)), axis=-1)
        nearest: Samples = self.radius - farthest
        return nearest


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


class Rings(ABC):
    """What the wall does to solids of revolution: their rings see its waves as Fourier modes about their own axis."""

    @abstractmethod
    def subtract(self, waves: Waves, rows: Sequence[Rows], matrices: Sequence[Samples]) -> None:
        """Take what the wall reflects of the solids' tractions from their single layer's matrices.

        Args:
            waves: those that matter between the solids.
            rows: of both parities.
            matrices: of both parities, (unknowns, unknowns), changed in place.
        """

    @abstractmethod
    def sent(self, waves: Waves, rows: Sequence[Rows], points: Samples) -> list[Samples]:
        """Velocities on the solids from unit forces at points, by the wall, (unknowns, 3 n) for each of `rows`.

        Without the minus sign.

        Args:
            waves: those that matter between points and solids.
            rows: of both parities.
            points: about the tube's axis, in its axes, (n, 3), m.
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

    def subtract(self, waves: Waves, rows: Sequence[Rows], matrices: Sequence[Samples]) -> None:
        """See `Rings.subtract`."""
        at_nodes, averages = self._strengths(waves), self._strengths(waves, averaged=True)
        between = self._matrices(waves)

        def lessen(family: Rows) -> None:
            starts, matrix = family.starts, matrices[family.parity]
            for m, here in enumerate(family.of_mode):
                target = at_nodes[m][here].transpose(1, 0, 2, 3).reshape(waves.k.size, -1, 3)
                for n, there in enumerate(family.of_mode):
                    pressed = np.matmul(target, np.ascontiguousarray(between[family.parity][:, m, :, n, :]))
                    left = pressed.reshape(waves.k.size, here.size, 6).swapaxes(0, 1).reshape(here.size, -1)
                    block = left @ averages[n][there].reshape(there.size, -1).T
                    columns = slice(starts[n], starts[n + 1])
                    matrix[starts[m] : starts[m + 1], columns] -= block * family.dual[columns]

        _each(lessen, rows)

    def sent(self, waves: Waves, rows: Sequence[Rows], points: Samples) -> list[Samples]:
        """See `Rings.sent`."""
        columns = 3 * len(points)
        middle = np.empty((2, self.modes, waves.k.size, 2, 3, columns))

        def fill(number: int) -> None:
            pressed = _pressed(point_waves(points, waves, number), waves, number)
            for parity, trace in enumerate(self._traces(waves, number)):
                flat = trace.reshape(3 * self.modes, -1)
                both = flat @ pressed[:, :, parity].transpose(2, 3, 1, 0).reshape(flat.shape[1], -1)
                middle[parity, :, number] = both.reshape(self.modes, 3, 2, columns).swapaxes(1, 2)

        _each(fill, range(waves.k.size))
        strengths = self._strengths(waves)
        found = []
        for family in rows:
            parts = [
                strengths[m][here].reshape(here.size, -1) @ middle[family.parity, m].reshape(-1, columns)
                for m, here in enumerate(family.of_mode)
            ]
            found.append(np.concatenate(parts))
        return found

    def _traces(self, waves: Waves, number: int) -> tuple[Samples, Samples]:
        """Even and odd waves of one k as modes on the reference cylinder, (modes, 3, orders, 3) each."""
        from spirillum.kernels.tube_waves import circle_waves

        orders = waves.orders[number]
        theta = _angles(waves, self.modes)
        y, z = self.reference * np.cos(theta) - self.offset, self.reference * np.sin(theta)
        angle = np.arctan2(z, y)
        values = _extensions(float(waves.k[number]), waves.radius, np.hypot(y, z), orders)
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
            layers = _layers(waves, number)
            found = []
            for trace in self._traces(waves, number):
                flat = trace.reshape(size, -1, 3)
                pressed = np.matmul(flat.swapaxes(0, 1), layers).swapaxes(0, 1)
                matrix = pressed.reshape(size, -1) @ flat.reshape(size, -1).T
                found.append(matrix.reshape(self.modes, 3, self.modes, 3))
            return found

        pairs = _each(product, range(waves.k.size))
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
            values = _extensions(k, self.reference, rho.ravel(), self.modes).reshape(*x.shape, self.modes, 3, 3)
            wave = np.exp(1j * k * x)[..., None] * np.array([1j, 1.0, 1.0])
            parts = np.stack([wave.real, wave.imag], axis=-1)[..., None]
            for q in range(self.modes):
                block = parts * values[:, :, q, :, None, :]
                if average is not None:
                    block = np.matmul(average, block.reshape(*x.shape, 18))
                found[q][:, number] = block.reshape(-1, 2, 3)

        _each(fill, range(waves.k.size))
        return found


class TiltedRings(Rings):
    """Rings about an axis that is pitched against the tube's: every wave is projected on every ring."""

    def __init__(self, panels: Panels, seat: Seat, modes: int) -> None:
        """Rings of solids.

        Args:
            panels: of the solids.
            seat: where their axis runs in the tube.
            modes: Fourier modes about it.
        """
        self.panels, self.seat, self.modes = panels, seat, modes

    def subtract(self, waves: Waves, rows: Sequence[Rows], matrices: Sequence[Samples]) -> None:
        """See `Rings.subtract`."""
        fine = _finer(self.panels, _FINER_TILTED)
        distances = self.seat.distances(*fine[:2]).min(axis=1)
        steepest = max(float(waves.k[-1]), max(waves.orders) / waves.radius)
        lock = Lock()

        def lessen(number: int) -> None:
            # panels whose waves of this k are damped away, there and back, are left out
            near = waves.k[number] * (distances + distances.min()) < 2.0 * steepest * distances.min()
            some = Panels(self.panels.x[near], self.panels.rho[near], self.panels.solid[near])
            target = self._on_rings(waves, number, some, some.x, some.rho, None)
            source = self._on_rings(waves, number, some, fine[0][near], fine[1][near], fine[2][near])
            kept = np.flatnonzero(np.repeat(near, 3 * self.panels.order))
            place = np.full(3 * self.panels.size, -1)
            place[kept] = np.arange(kept.size)
            for family in rows:
                local = [place[here] for here in family.of_mode]
                bear = np.flatnonzero(np.concatenate(local) >= 0)
                picked = [part[part >= 0] for part in local]
                left, right = (
                    np.concatenate([side[family.parity][m][part] for m, part in enumerate(picked)])
                    for side in (target, source)
                )
                pressed = _pressed(left[:, :, None], waves, number)[:, :, 0]
                block = pressed.reshape(bear.size, -1) @ right.reshape(bear.size, -1).T
                block *= family.dual[bear]
                with lock:
                    matrices[family.parity][np.ix_(bear, bear)] -= block

        _each(lessen, range(waves.k.size))

    def sent(self, waves: Waves, rows: Sequence[Rows], points: Samples) -> list[Samples]:
        """See `Rings.sent`."""

        def product(number: int) -> list[Samples]:
            pressed = _pressed(point_waves(points, waves, number), waves, number)
            fields = self._on_rings(waves, number, self.panels, self.panels.x, self.panels.rho, None)
            found = []
            for family in rows:
                left = family.gathered(fields[family.parity])
                right = pressed[:, :, family.parity].reshape(len(pressed), -1)
                found.append(left.reshape(len(left), -1) @ right.T)
            return found

        return [np.sum(parts, axis=0) for parts in zip(*_each(product, range(waves.k.size)), strict=True)]

    def _on_rings(
        self, waves: Waves, number: int, panels: Panels, x: Samples, rho: Samples, average: Samples | None
    ) -> list[list[Samples]]:
        """Modes of the waves of one k, even and odd, on the nodes: [parity][mode] (3 nodes, 2, orders, 3)."""
        theta = _angles(waves, self.modes)
        cos, sin = np.cos(theta), np.sin(theta)
        places = np.stack(np.broadcast_arrays(x[..., None], rho[..., None] * cos, rho[..., None] * sin), axis=-1)
        values = point_waves(self.seat.placed(places.reshape(-1, 3)), waves, number)
        orders = values.shape[3]
        shaped = values.reshape(x.size, theta.size, 3, 2, 2, orders, 3)
        turned = np.einsum("ab,ntbepcw->ntaepcw", self.seat.rotation.T, shaped, optimize=True)
        along, up, side = np.moveaxis(turned, 2, 0)
        shape = (-1, 1, 1, 1, 1)
        c, s = cos.reshape(shape), sin.reshape(shape)
        parts = (along, up * c + side * s, side * c - up * s)
        found: list[list[Samples]] = []
        for parity in (0, 1):
            modes = [
                np.tensordot(matrix, part[:, :, :, parity], axes=(1, 1))
                for matrix, part in zip(_projectors(theta, self.modes, parity), parts, strict=True)
            ]
            both = np.stack(modes, axis=2)  # (modes, nodes, 3, 2, orders, 3)
            if average is not None:
                both = both.reshape(self.modes, *x.shape, -1)
                both = np.matmul(average, both)
            found.append(list(both.reshape(self.modes, 3 * panels.size, 2, orders, 3)))
        return found


def _angles(waves: Waves, modes: int) -> Samples:
    """Midpoints of a half circle, as many as waves need whose modes are then cut off."""
    count = int(0.6 * (max(waves.orders) + modes)) + 12
    angles: Samples = np.pi * (np.arange(count) + 0.5) / count
    return angles


def _projectors(theta: Samples, modes: int, parity: int) -> tuple[Samples, Samples, Samples]:
    """From values (x, rho, theta) on a half circle to Fourier modes (x, rho, g), (modes, angles) each."""
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


def _pressed(waves_at: Samples, waves: Waves, number: int) -> Samples:
    """Waves (n, 2, parities, orders, 3) times the wall's single layer."""
    flat = np.moveaxis(waves_at, 3, 0)
    orders = len(flat)
    product = np.matmul(flat.reshape(orders, -1, 3), _layers(waves, number))
    pressed: Samples = np.moveaxis(product.reshape(flat.shape), 0, 3)
    return pressed


def point_waves(points: Samples, waves: Waves, number: int) -> Samples:
    """Velocities of the waves of one k at points, (3 n, 2, 2, orders, 3): real, imaginary; even, odd.

    Args:
        points: about the tube's axis, (n, 3), m.
        waves: which.
        number: of the node in k.
    """
    from spirillum.kernels.tube_waves import station_waves

    k, orders = float(waves.k[number]), waves.orders[number]
    values = _extensions(k, waves.radius, np.hypot(points[:, 1], points[:, 2]), orders)
    out = np.empty((len(points), 3, 2, 2, orders, 3))
    station_waves(values, np.arctan2(points[:, 2], points[:, 1]), k * points[:, 0], out)
    return out.reshape(3 * len(points), 2, 2, orders, 3)


def point_reflection(points: Samples, waves: Waves) -> Samples:
    """Velocities at points from forces at the same points, symmetric, (3 n, 3 n); without the minus sign."""

    def product(number: int) -> Samples:
        found = point_waves(points, waves, number)
        rows = len(found)
        matrix: Samples = _pressed(found, waves, number).reshape(rows, -1) @ found.reshape(rows, -1).T
        return matrix

    total: Samples = np.sum(_each(product, range(waves.k.size)), axis=0)
    return total
