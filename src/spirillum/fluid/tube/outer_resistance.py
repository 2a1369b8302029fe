"""Outer resistance of a robot in its tube (without the lubrication film) at the nodes of a table.

The flow is solved for at every place and phase (`tube`), the film is taken away, and what is left, which is smooth up
to contact, is kept as a Cholesky factor with logarithms on the diagonal.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.fluid.tube.solids import MOTIONS, Fineness
from spirillum.fluid.tube.tube import is_solved, solved_together
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels.core import MOTIONS as RATES
from spirillum.kernels.core import cut_of_film
from spirillum.kernels.tube_table import MIRROR
from spirillum.progress import Progress
from spirillum.robot.tube_pose import TubePose
from spirillum.units import show
from spirillum.worker_pool import imap_unordered

HARMONICS = 4  #: Harmonics of the tail's phase that a table stores.
PHASES = 2 * HARMONICS + 1  #: Phases of the tail that give them all.
_PHASES_OF_STARTS = 5  # Phases of a tail with several starts: two harmonics of its period.

_RATES = np.zeros((MOTIONS, RATES))  # The 12 twists and the flow from the 8 rates (U, Omega, omega_m, mean flow).
_RATES[:6, :6] = _RATES[6:12, :6] = np.eye(6)
_RATES[9, 6] = _RATES[12, 7] = 1.0


class NodeSolution(NamedTuple):
    """Node to solve for."""

    tails: tuple[tuple[RobotGeometry, tuple[float, ...]], ...]
    """Robots that differ in their tails, each with the phases of its tail, rad."""
    pose: TubePose
    fineness: Fineness


def matrix_of(full: Samples) -> Samples:
    """The 8x8 over U, Omega, omega_m and the mean flow from the (13, 13) of `tube`, over leading axes."""
    return _RATES.T @ full @ _RATES


def _solve(numbered: tuple[int, NodeSolution]) -> list[Samples]:
    """Solve for every tail at one node: (phases, 8, 8), viscosity 1."""
    place = numbered[1]
    return [matrix_of(full) for full in solved_together(place.tails, place.pose, place.fineness)]


def solutions(
    places: Sequence[NodeSolution], what: str, progress: Progress | None = None, workers: int = 2
) -> list[list[Samples]]:
    """Return the 8x8 at every node, of every tail, (phases, 8, 8), some of them from the cache."""
    shared = solved_as_one(places)
    together = [
        places[numbers[0]]._replace(tails=tuple(tail for number in numbers for tail in places[number].tails))
        for numbers in shared
    ]
    found: list[list[Samples]] = [[] for _ in places]
    for numbers, answers in zip(shared, _solutions(together, what, progress, workers), strict=True):
        ahead = iter(answers)
        for number in numbers:
            found[number] = [next(ahead) for _ in places[number].tails]
    return found


def solved_as_one(places: Sequence[NodeSolution]) -> list[list[int]]:
    """Indices of nodes that differ in their tails only and are solved for together."""
    shared: dict[tuple[RobotGeometry, TubePose, Fineness], list[int]] = {}
    for number, place in enumerate(places):
        bodies = {g.without_tail for g, _ in place.tails}
        shared.setdefault((bodies.pop(), place.pose, place.fineness), []).append(number)
    return list(shared.values())


def all_cached(places: Sequence[NodeSolution]) -> bool:
    """Whether the solutions at some nodes are cached for all phases of all their tails."""
    return all(
        is_solved(g, place.pose, place.fineness, p) for place in places for g, phases in place.tails for p in phases
    )


def _solutions(
    places: Sequence[NodeSolution], what: str, progress: Progress | None, workers: int
) -> list[list[Samples]]:
    """As `solutions`, node by node."""
    tell = progress or (lambda _what, _done, _total: None)
    found: list[list[Samples]] = [[] for _ in places]
    numbered, saved = list(enumerate(places)), "; completed poses are saved"
    known = [number for number, place in numbered if all_cached([place])]  # they take no time, and tell of no pace
    for number in known:
        found[number] = _solve(numbered[number])
    tell(what, len(known), len(places))
    missing = _mixed([one for one in numbered if one[0] not in known])
    answers = imap_unordered(_solve, missing, workers, besides=saved, single=True)
    for done, ((number, _), answer) in enumerate(answers, start=len(known) + 1):
        found[number] = answer
        tell(what, done, len(places))
    return found


def _mixed(numbered: Sequence[tuple[int, NodeSolution]]) -> list[tuple[int, NodeSolution]]:
    """Cheap and expensive nodes evenly spread, those of each resolution, tilt and number of tails in their order."""
    # The time that is left is then that of the mean pace; it would else be judged by the most expensive ones.
    kinds: dict[tuple[Fineness, bool, bool, int], list[tuple[int, NodeSolution]]] = {}
    for one in numbered:
        node = one[1]
        kinds.setdefault((node.fineness, node.pose.level, node.pose.yaw == 0.0, len(node.tails)), []).append(one)
    spread = [((rank + 0.5) / len(kind), one) for kind in kinds.values() for rank, one in enumerate(kind)]
    return [one for _, one in sorted(spread, key=lambda pair: (pair[0], pair[1][0]))]


_LOWER = np.tril_indices(RATES)
_DIAGONAL = np.flatnonzero(_LOWER[0] == _LOWER[1])


def factor_of(matrix: Samples, where: str) -> Samples:
    """Cholesky factor of positive definite matrices, row by row, with logarithms on the diagonal, (..., 36)."""
    try:
        factor = np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
    except np.linalg.LinAlgError as error:
        raise InputError(
            f"the flow in the tube is resolved too coarsely {where}: the outer resistance is not positive "
            "definite; allowed: a finer tolerance"
        ) from error
    found = factor[..., _LOWER[0], _LOWER[1]]
    found[..., _DIAGONAL] = np.log(found[..., _DIAGONAL])
    return found


def fourier(values: Samples, size: int = 0, starts: int = 1) -> Samples:
    """Coefficients 1, cos, sin, cos 2, sin 2, ... of values at evenly spread phases from 0, an odd number, axis 0."""
    # A tail with several starts has harmonics of its turn over them only; those that so few phases do not show are 0.
    count = len(values)
    phase = 2.0 * np.pi * np.arange(count) / count
    size = max(size, count)
    rows = np.zeros((size, count))
    rows[0] = 1.0 / count
    for harmonic in range(1, (count - 1) // 2 + 1):
        if (at := 2 * starts * harmonic) < size:
            rows[at - 1], rows[at] = np.cos(harmonic * phase) * 2.0 / count, np.sin(harmonic * phase) * 2.0 / count
    return np.tensordot(rows, values, axes=1)


def matrices_at(coefficients: Samples, phases: Samples) -> Samples:
    """The matrices at phases, (n, 8, 8), whose factors have these Fourier coefficients, (m, 36)."""
    order = np.arange(len(coefficients))
    turns = np.outer(phases, (order + 1) // 2)
    waves = np.where(order % 2 == 0, np.sin(turns), np.cos(turns))
    waves[:, 0] = 1.0
    parameters = waves @ coefficients
    parameters[:, _DIAGONAL] = np.exp(parameters[:, _DIAGONAL])
    factors = np.zeros((len(phases), RATES, RATES))
    factors[:, _LOWER[0], _LOWER[1]] = parameters
    return factors @ np.swapaxes(factors, 1, 2)


def even_phases(count: int = PHASES, starts: int = 1) -> tuple[float, ...]:
    """Evenly spread phases from 0, rad; with several starts over the part of a turn after which the tail is alike."""
    if starts > 1:
        count = min(count, _PHASES_OF_STARTS)
    return tuple(float(phase) for phase in 2.0 * np.pi / starts * np.arange(count) / count)


def mirrored(g: RobotGeometry, phases: tuple[float, ...]) -> tuple[RobotGeometry, tuple[float, ...]]:
    """Mirror image to the side of a robot and the phases of its tail."""
    return g._replace(hand=-g.hand), tuple((np.pi - phase) % (2.0 * np.pi) for phase in phases)


def mirror_image(matrices: Samples) -> Samples:
    """The 8x8 of the mirror image."""
    found: Samples = MIRROR[:, None] * matrices * MIRROR
    return found


def outer_resistance(matrices: Samples, film: Samples, t: float) -> Samples:
    """The outer part of resistances, (phases, 8, 8), of which the film's is (6, 6)."""
    rest = matrices.copy()
    rest[:, :6, :6] -= cut_of_film(t) * film
    return 0.5 * (rest + np.swapaxes(rest, 1, 2))


def is_positive_definite(matrices: Samples) -> bool:
    """Whether all of some symmetric matrices are, (n, 8, 8)."""
    return bool(np.linalg.eigvalsh(matrices).min() > 0.0)


def outer_coefficients(matrices: Samples, film: Samples, t: float, pose: TubePose, starts: int = 1) -> Samples:
    """Fourier coefficients of the factor of the outer resistance, (`PHASES`, 36)."""
    where = f"at an offset of {show(pose.offset, 'mm')} and a pitch of {show(pose.pitch, 'deg')}"
    return fourier(factor_of(outer_resistance(matrices, film, t), where), PHASES, starts)
