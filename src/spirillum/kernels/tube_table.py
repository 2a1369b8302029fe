"""Packed tables of a robot in its tube: resistance, lubrication film, cavitation: csrc/table.c, film.c and others.

A pose is the offset e of the body's mid-length from the tube's axis, pitch p (nose up), yaw psi (nose to the side) and
phase phi of the tail. How the outer part of the resistance is interpolated between the nodes stands in csrc/table.c.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels import core

ORDER = (2, 4, 0, 1, 5, 3)
"""Order of the motions (U, Omega) in the factors: those that the film resists most come first, even ones before odd."""
_MOST_INTERVALS = 99  # intervals of a coordinate, and polynomials


def has_head(table: Samples, size: int, radius: float) -> bool:
    """Whether an array begins with that many finite numbers, the first of them the radius of a tube, m."""
    return table.size >= size and bool(np.isfinite(table[:size]).all()) and math.isclose(table[0], radius)


_COUNTS = [core.FILM_INTERVALS, core.FILM_SECOND_INTERVALS, core.FILM_YAWS]  # of a film: both coordinates, and yaws


def shape_of(film: Samples) -> tuple[int, int, int, int]:
    """Shape of the coefficients of a film from its head, or from all of it: both coordinates, yaws, entries."""
    first, second, yaws = (int(count) for count in film[_COUNTS])
    return first + 3, second + 3, yaws, core.FILM_ENTRIES


def is_complete_film(film: Samples, radius: float) -> bool:
    """Whether an array of any numbers is a packed film in a tube of this radius, m: the loops check no index."""
    if not has_head(film, core.FILM_SIZE, radius):
        return False
    counts, body = film[_COUNTS], film[core.FILM_BODY]
    if np.any(counts % 1.0) or counts.min() < 1 or counts.max() > _MOST_INTERVALS or not 0.0 < body < radius:
        return False
    values = film[core.FILM_SIZE :].view(np.float32)  # one more where their number is odd
    return values.size - math.prod(shape_of(film)) in (0, 1) and bool(np.isfinite(values).all())


MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
"""Sign of each of the `MOTIONS` (U and Omega of the body, omega_m of the rotor, mean flow) in a mirror to the side."""
PARAMETERS = core.MOTIONS * (core.MOTIONS + 1) // 2  #: Entries of a Cholesky factor.
STEEPEST = (math.radians(12.0), math.radians(8.0))
"""Largest pitch of a table nose up and nose down, rad: in a narrow tube the glass holds a robot long before."""
YAW_SLACK = 1.1  # of the largest yaw: the tail touches the glass a little beyond it
YAW_SHARES = (0.6, 0.8, 0.95)  #: Yaws of yawed nodes, to both sides, over the largest one at their place.
PHASES = 9
"""Phases that a mean is taken over: what they leave of a table's four harmonics is below 1e-6, five up to 5e-4."""
YAW_ORDERS = 2 * len(YAW_SHARES)  #: Powers of the stretched yaw, from the first.

# Header of a packed table: radius of the tube, rows, and the lengths of what follows.
_RADIUS, _RINGS, _GAPS, _UP, _DOWN, _PHASES, _YAW_GAPS, _YAW_PITCHES = 0, 1, 2, 3, 4, 5, 6, 7
_HEADER = 8
_MOST, _MOST_COEFFICIENTS = 12, 99  # nodes in one direction; rings, and Fourier coefficients
_YAW_LIMIT = 7  # numbers of `largest_yaw`


def packed(
    radius: float,  # R of the tube, m.
    rings: Samples,  # Of `contact_offset`, (n, 4).
    gaps: Samples,  # Nodes t, increasing, the last is 1.
    up: Samples,  # Nodes f nose up, the first is 0.
    down: Samples,  # Nodes f nose down, the first is 0.
    most: Samples,  # Largest pitches nose up and nose down (positive) at the nodes t, (gaps, 2), rad.
    rest: Samples,  # Parameters of the factor, see `Parts`; pitches as in `up`, then `down` without its first.
    yaw_gaps: Samples,  # Nodes t of the yawed places.
    yaw_pitches: Samples,  # Nodes of signed f of the yawed places, increasing, 0 one of them.
    yaw_limit: Samples,  # Of `yaw_limit_of`, (7,).
    yawed: Samples,  # Coefficients of the powers of the stretched yaw, see `Parts`.
    film: Samples,  # Packed film.
) -> Samples:
    """One array for `resistance_at`."""
    header = [radius, len(rings), gaps.size, up.size, down.size, rest.shape[2], yaw_gaps.size, yaw_pitches.size]
    nodes = (np.array(header, dtype=float), rings, gaps, up, down, most, yaw_gaps, yaw_pitches, yaw_limit)
    return np.concatenate([np.ravel(part) for part in (*nodes, rest, yawed, film)])


def is_whole(table: Samples, radius: float) -> bool:
    """Whether an array of any numbers is a packed table of a tube of this radius, m: the loops check no index."""
    if not has_head(table, _HEADER, radius):
        return False
    rings, gaps, up, down, phases, yaw_gaps, yaw_pitches = table[1:_HEADER]
    counts = np.array([rings, gaps, up, down, phases])
    turned = np.array([yaw_gaps, yaw_pitches])
    sizes = np.append(counts, turned)
    whole = not np.any(sizes % 1.0) and counts.min() >= 1
    if not whole or max(gaps, up, down, *turned) > _MOST or max(rings, phases) > _MOST_COEFFICIENTS:
        return False
    if phases % 2.0 == 0.0 or (turned.min() < 1 and turned.max() != 0):
        return False
    start = film_start(table)
    return start < table.size and bool(np.isfinite(table[:start]).all()) and is_complete_film(table[start:], radius)


class Range(NamedTuple):
    """Where a table holds."""

    gaps: Samples  #: Gaps of a level robot at which the next three are stated, (n,), m.
    up: Samples  #: Largest pitch nose up, (n,), rad.
    down: Samples  #: Largest pitch nose down, positive, (n,), rad.
    yaw: Samples  #: Largest yaw of a level robot to either side, (n,), rad.


def range_of(table: Samples) -> Range:
    """Where a packed table holds."""
    at_gaps = _HEADER + 4 * int(table[_RINGS])
    gaps = int(table[_GAPS])
    at_most = at_gaps + gaps + int(table[_UP] + table[_DOWN])
    most = table[at_most : at_most + 2 * gaps].reshape(gaps, 2)
    room = core.contact_offset_of(table, 0.0)
    levels = table[at_gaps : at_gaps + gaps] * room
    return Range(levels, most[:, 0], most[:, 1], np.array([core.largest_yaw(table, room - gap, 0.0) for gap in levels]))


class Parts(NamedTuple):
    """What a packed table is made of."""

    nodes: Samples  #: Head, rings and nodes.
    rest: Samples  #: Fourier coefficients 1, cos, sin, cos 2, ... of the factor, (gaps, up + down - 1, phases, 36).
    yawed: Samples  #: (yaw gaps, yaw pitches, `YAW_ORDERS`, phases, 36).
    film: Samples  #: Packed film.

    def packed(self) -> Samples:
        """All in one array again."""
        return np.concatenate([self.nodes, self.rest.ravel(), self.yawed.ravel(), self.film])


def shapes_of(table: Samples) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Shapes of `rest` and `yawed` of a packed table, or of its nodes."""
    gaps, pitches = int(table[_GAPS]), int(table[_UP] + table[_DOWN]) - 1
    yaw_gaps, yaw_pitches, phases = int(table[_YAW_GAPS]), int(table[_YAW_PITCHES]), int(table[_PHASES])
    return (gaps, pitches, phases, PARAMETERS), (yaw_gaps, yaw_pitches, YAW_ORDERS, phases, PARAMETERS)


def parts_of(table: Samples) -> Parts:
    """The parts of a packed table."""
    shapes, film = shapes_of(table), film_start(table)
    yawed = film - int(np.prod(shapes[1]))
    rest = yawed - int(np.prod(shapes[0]))
    return Parts(table[:rest], table[rest:yawed].reshape(shapes[0]), table[yawed:film].reshape(shapes[1]), table[film:])


def mirror_image(table: Samples) -> Samples:
    """The packed table of the mirror image to the side."""
    # Motions to the side and turns out of it change their signs, a yaw is one to the other side, and a tail at the
    # phase phi is one at pi - phi.
    parts = parts_of(table)
    row, column = np.tril_indices(core.MOTIONS)
    order = np.arange(parts.rest.shape[2])
    harmonic = (order + 1) // 2
    phases = np.where(order % 2 == 0, -1.0, 1.0) * (-1.0) ** harmonic  # of sin, of cos
    phases[0] = 1.0
    signs = phases[:, None] * (MIRROR[row] * MIRROR[column])
    yaws = ((-1.0) ** np.arange(1, YAW_ORDERS + 1))[:, None, None]
    return parts._replace(rest=parts.rest * signs, yawed=parts.yawed * signs * yaws).packed()


def yaw_limit_of(
    x: Samples,  # Offsets of the body's mid-length over R, (n,).
    pitches: Samples,  # Nose up, (n,), rad.
    yaws: Samples,  # At which the tail is near the glass, (n,), rad.
    most: float,  # Largest yaw anywhere, rad.
) -> Samples:
    """The numbers of `limited_yaw`, (7,), from largest yaws at some places."""
    p = np.sin(pitches)
    terms = np.stack([np.ones_like(x), p, p**2, x, x * p, x**2], axis=1)
    return np.append(np.linalg.lstsq(terms, np.sin(yaws) ** 2, rcond=None)[0], most)


def yaw_parts_at_nodes() -> Samples:
    """Odd and then even part of what a yaw adds at its nodes, from the coefficients of its powers, (orders, orders)."""
    # The parts have the size of what is added; coefficients of so high powers cancel each other, and need more digits.
    s = np.array([core.stretched_yaw(share) for share in YAW_SHARES])[:, None]
    order = np.arange(1, YAW_ORDERS + 1)
    odd = order % 2 == 1
    found: Samples = np.concatenate([np.where(odd, s**order, 0.0), np.where(odd, 0.0, s**order)])
    return found


def film_start(table: Samples) -> int:
    """Where in a packed table the film begins."""
    own = 4 * table[_RINGS] + 3 * table[_GAPS] + table[_UP] + table[_DOWN] + table[_YAW_GAPS] + table[_YAW_PITCHES]
    outer, yawed = shapes_of(table)
    return _HEADER + int(own) + _YAW_LIMIT + math.prod(outer) + math.prod(yawed)
