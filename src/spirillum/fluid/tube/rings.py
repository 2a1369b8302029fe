"""Solids of revolution in a tube: the wall's waves as Fourier modes on their rings, about their own axis.

Axes here: x along the robot, y up, z to the right; angles count from y.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.wall import WallWaves, point_waves, times_layers
from spirillum.fluid.wire.revolution import Panels


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
    def subtract(self, waves: WallWaves, systems: Sequence[System], matrices: Sequence[Samples]) -> None:
        """Take what the wall reflects of the solids' tractions from their single layer's matrices.

        Args:
            waves: those that matter between the solids.
            systems: families of unknowns that the wall couples.
            matrices: one for each system, (unknowns, unknowns), changed in place.
        """

    @abstractmethod
    def sent(
        self, waves: WallWaves, systems: Sequence[System], points: Samples, forces: Samples, away: float
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
    def received(self, waves: WallWaves, systems: Sequence[System], away: float) -> list[list[Samples]]:
        """Velocities on some unknowns from waves at points, with the wall's single layer, for each k and system.

        (unknowns, 2, parities, orders, 3), to be multiplied with `point_waves`; without the minus sign.

        Args:
            waves: those that matter between points and solids.
            systems: the unknowns.
            away: smallest distance of the points from the wall, m.
        """


def sent_to_wall(waves: WallWaves, number: int, points: Samples, forces: Samples) -> Samples:
    """Forces at points as waves of one k, times the wall's single layer, (columns, 2, 2, orders, 3)."""
    at_points = point_waves(points, waves, number)
    mixed = forces.T @ at_points.reshape(len(at_points), -1)
    return times_layers(mixed.reshape(-1, *at_points.shape[1:]), waves, number)


def midpoints(orders: int, modes: int, *, whole: bool = False) -> Samples:
    """Midpoints of a half circle, as many as waves need whose modes are then cut off, or of the whole one."""
    count = int(0.6 * (orders + modes)) + 12
    angles: Samples = np.pi * (np.arange(2 * count if whole else count) + 0.5) / count
    return angles


def projectors(theta: Samples, modes: int, parity: int) -> tuple[Samples, Samples, Samples]:
    """From values (x, rho, theta) around a circle to Fourier modes (x, rho, g), (modes, angles) each."""
    q = np.arange(modes)[:, None]
    cos, sin = (function(q * theta) * (2.0 / theta.size) for function in (np.cos, np.sin))
    cos[0] *= 0.5
    return (cos, cos, -sin) if parity == 0 else (-sin, -sin, -cos)


def finer(panels: Panels, times: int) -> tuple[Samples, Samples, Samples]:
    """Places x, rho of more nodes on each panel, (panels, q), and averages over them, (panels, p, q)."""
    places, gauss = np.polynomial.legendre.leggauss(times * panels.order)
    cardinal = panels.cardinals(places)
    x, rho = panels.x @ cardinal.T, panels.rho @ cardinal.T
    average: Samples = cardinal.T * (gauss * rho)[:, None, :] / panels.area.reshape(*panels.x.shape, 1)
    return x, rho, average
