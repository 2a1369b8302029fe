"""The wall of a circular tube: what it reflects of the forces inside, as waves along and around it.

A force at y moves the fluid at x, besides by the Stokeslet, by -2/pi int dk sum_p eps_p U_p(x) S_p U_p(y)', over
k > 0 and the even and odd waves of order p, with eps_0 = 1, else 2, and without the factor 1/(8 pi mu); see
csrc/tube_waves.c. No net flux passes along the tube. Near k = 0 the integrand goes as A + B log k: the nodes in k
crowd there, and below the first of them it is extrapolated in log k.

Axes here: x along the tube, y up, z to the right; angles count from y.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from spirillum.arrays import Samples

_DECAY = 2.5  # Decay rate of a force's flow along the tube, times the radius: images in the sum over k are beyond it.
_LOWEST, _MOST_LOWEST, _NEGLIGIBLE = 1e-5, 1e-3, 1e-12
"""First node in k over the step, a tenth of the tolerance between these, and the least k to which the integral below it
is extrapolated."""
CROWD = 1.5  #: Where nodes in k begin to crowd towards 0, over the step.
_BANDS = (0.35, 0.65)  # Orders over all of them at which a new band begins.
_FURTHER = 3.0
"""Damping, as an exponent over that at which waves are cut, from which things are out of reach while others are not."""
SLACK = 3.0  #: Default of `WallWaves.slack`: what waves beyond it miss is below the error of fine solutions.
_AT_WALL = 1e-9  # Distance over the radius below which things are at the wall, where every wave reaches them.
_THREADS = 2
_BLOCK = 96  # columns of a symmetric product that are computed at a time

_T = TypeVar("_T")
_S = TypeVar("_S")


@dataclass(frozen=True)
class WallWaves:
    """Which waves are kept: nodes in k with their weights, and the number of orders p at each."""

    radius: float  #: Of the tube, m.
    k: Samples  #: 1/m.
    weight: Samples  #: 1/m; with the factor 2/pi of the reflection.
    orders: tuple[int, ...]  #: Orders p = 0 to orders - 1.
    cut: float  #: Waves are kept until they are damped by exp(-cut), there and back.
    slack: float = SLACK
    """Exponent over `cut`, up to which waves are kept between things further from the wall than the nearest: there are
    many of them, and what each lacks adds up to half a percent of what holds and pushes the robot without any."""

    def orders_between(self, number: int, distance: float) -> int:
        """Orders that matter at one k between things at this mean distance from the wall, m; 0 for none."""
        steepest, k = (self.cut + self.slack) / (2.0 * distance), float(self.k[number])
        if k > steepest:
            return 0
        return min(int(np.ceil(self.radius * np.sqrt(steepest**2 - k**2)) + 3.0), self.orders[number])

    def bands(self, number: int, distances: Samples, other: float, orders: int) -> Iterator[WaveBand]:
        """Which of some things the waves of one k reach: the steeper the wave, the fewer of them."""
        steepest = _FURTHER * self.cut / np.maximum(distances + other, _AT_WALL * self.radius)
        k = float(self.k[number])
        around = self.radius * np.sqrt(np.maximum(steepest**2 - k**2, 0.0))
        reached = np.where(k > steepest, 0.0, np.ceil(around) + 3.0)
        for low, high in pairwise(sorted({0, *(int(np.ceil(share * orders)) for share in _BANDS), orders})):
            there = np.flatnonzero(reached > low)
            if there.size:
                yield WaveBand(low, high, there)


class WaveBand(NamedTuple):
    """Some orders of waves of one k, and what they reach."""

    low: int  #: First order.
    high: int  #: Order after the last.
    there: np.ndarray  #: Indices of what they reach before they are damped.


def waves_between(
    radius: float, reach: float, distance: float, tolerance: float, slack: float = SLACK, crowd: float = CROWD
) -> WallWaves:
    """The waves that matter between things in a tube, until they are damped by a tolerance there and back."""
    steepest = -np.log(tolerance) / (2.0 * distance)
    step = 2.0 * np.pi / (reach - np.log(tolerance) / _DECAY * radius)
    lowest = float(np.clip(0.1 * tolerance, _LOWEST, _MOST_LOWEST))
    k, weight = _nodes(step, crowd * step, lowest, steepest)
    around = radius * np.sqrt(np.maximum(steepest**2 - k**2, 0.0))
    orders = tuple(int(p) for p in np.ceil(around) + 3.0)
    return WallWaves(radius, k, 2.0 / np.pi * weight, orders, -np.log(tolerance), slack)


def _nodes(step: float, crowd: float, lowest: float, steepest: float) -> tuple[Samples, Samples]:
    """Nodes in k and weights, 1/m, of the trapezoidal rule in t, k = c log(1 + exp(t/c)), and of what is below it."""
    # Even steps in t come exponentially close to k = 0, even where k > c. Below the first node the integrand is
    # extrapolated linearly in log k from the first two.
    first, least = (int(np.ceil(crowd / step * np.log(share))) for share in (lowest, _NEGLIGIBLE))
    t = step * np.arange(least, np.ceil(steepest / step) + 1.0)
    k = crowd * np.logaddexp(0.0, t / crowd)
    weight = step / (1.0 + np.exp(-t / crowd))
    below, k = np.split(k, [first - least])
    lost, weight = np.split(weight, [first - least])
    share = np.log(below / k[0]) / np.log(k[1] / k[0])
    weight[0] += np.sum(lost * (1.0 - share))
    weight[1] += np.sum(lost * share)
    return k, weight


def each(function: Callable[[_S], _T], items: Iterable[_S]) -> list[_T]:
    """Compiled loops and linear algebra let other threads run."""
    from spirillum.kernels.native import in_one_thread

    if in_one_thread():
        return [function(item) for item in items]
    with ThreadPoolExecutor(_THREADS) as pool:
        return list(pool.map(function, items))


def summed(function: Callable[[range], _T], count: int) -> list[_T]:
    """Sums over the nodes in k, a few of them: what each thread adds up needs no more memory than one of its terms."""
    return each(function, [range(first, count, _THREADS) for first in range(min(_THREADS, count))])


def extensions(k: float, radius: float, rho: Samples, orders: int) -> Samples:
    """Velocities (X, u_rho, v) at rho for unit velocities on the cylinder of that radius, (n, orders, 3, 3)."""
    from spirillum.kernels.core import wave_extensions

    found = np.empty((rho.size, orders, 3, 3))
    wave_extensions(k, radius, rho, found)
    return found


def weighted_layers(waves: WallWaves, number: int) -> Samples:
    """eps_p S_p at one k times its weight, (orders, 3, 3)."""
    from scipy.special import k0e, k1e

    from spirillum.kernels.core import wall_layers

    z = float(waves.k[number] * waves.radius)
    layers = np.empty((waves.orders[number], 3, 3))
    wall_layers(z, float(k1e(z) / k0e(z)), layers)
    layers[1:] *= 2.0
    layers *= waves.weight[number]
    return layers


def times_layers(values: Samples, waves: WallWaves, number: int, first: int = 0) -> Samples:
    """Waves (orders, parities, 2, 3, columns) times the wall's single layer, from an order on: it is symmetric."""
    layers = weighted_layers(waves, number)[first : first + len(values)].astype(values.dtype)
    pressed: Samples = np.matmul(layers[:, None, None], values)
    return pressed


def point_waves(
    points: Samples,
    waves: WallWaves,
    number: int,
    first: int = 0,
    last: int | None = None,
    precision: type[np.floating] = np.float64,
) -> Samples:
    """Velocities of waves of one k at points, (last - first, 2, 2, 3, 3 n): even, odd; real, imaginary."""
    from spirillum.kernels import core

    last = waves.orders[number] if last is None else last
    out = np.empty((last - first, 2, 2, 3, *points.shape), precision)
    fill = core.point_waves if precision is np.float64 else core.single_point_waves
    fill(float(waves.k[number]), waves.radius, points, first, out)
    return out.reshape(*out.shape[:4], -1)


def distances_of(points: Samples, radius: float) -> Samples:
    """Distances of points from the wall, (n,), m."""
    return radius - np.hypot(points[:, 1], points[:, 2])


def from_the_wall(points: Samples, radius: float) -> tuple[Samples, Samples, np.ndarray]:
    """Sort points by their distance from the wall; return them, their distances, and the inverse permutation."""
    # What waves reach are then the first of the points: sums over them need no index.
    distances = distances_of(points, radius)
    order = np.argsort(distances, kind="stable")
    rows: np.ndarray = (3 * np.argsort(order)[:, None] + np.arange(3)).ravel()
    return points[order], distances[order], rows


def point_reflection(points: Samples, waves: WallWaves, precision: type[np.floating] = np.float64) -> Samples:
    """Velocities at points from forces at the same points, symmetric, (3 n, 3 n); without the minus sign."""
    placed, distances, back = from_the_wall(points, waves.radius)

    def reflected(numbers: range) -> Samples:
        total = np.zeros((3 * len(points),) * 2)
        for number in numbers:
            for low, high, there in waves.bands(number, distances, float(distances[0]), waves.orders[number]):
                at_points = point_waves(placed[: there.size], waves, number, low, high, precision)
                onto_wall = times_layers(at_points, waves, number, low)
                _add_lower(onto_wall.reshape(-1, 3 * there.size), at_points.reshape(-1, 3 * there.size), total)
        return total

    lower = np.tril(sum(summed(reflected, waves.k.size)))
    whole = lower + np.tril(lower, -1).T
    found: Samples = whole[np.ix_(back, back)]
    return found


def _add_lower(a: np.ndarray, b: np.ndarray, total: Samples) -> None:
    """Add a' b, which is symmetric, to the first rows and columns of `total`, where only the lower half counts."""
    size = a.shape[1]
    for first in range(0, size, _BLOCK):
        last = min(first + _BLOCK, size)
        total[first:size, first:last] += a[:, first:].T @ b[:, first:last]
