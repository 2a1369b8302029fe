"""Resistance of the lubrication film between a body of revolution and its tube: csrc/film.c, and its packed form."""

from __future__ import annotations

import math

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.native import Array, Float64, native

# Columns of the head of a packed table.
TUBE, BODY, HALF = 0, 1, 2  # R, a and a spheroid's half-length (0: a straight side), m
REAR, REAR_ROUND, FRONT, FRONT_ROUND = (
    3,
    4,
    5,
    6,
)  # ends of the straight side, x (a spheroid's middle), and the radii of the ends, m
FIRST, LAST, INTERVALS = 7, 8, 9  # of the first coordinate's knots
SECOND_FIRST, SECOND_LAST, SECOND_INTERVALS = 10, 11, 12  # of the second's
YAW, YAWS = 13, 14  # largest yaw, rad; polynomials in yaw
HEAD = 15

ORDER = (2, 4, 0, 1, 5, 3)
"""Order of the motions (U, Omega) in the factors: those that the film resists most come first, even ones before odd."""
ENTRIES = 21
_MANY = 99  # intervals of a coordinate, and polynomials


def has_head(table: Samples, size: int, radius: float) -> bool:
    """Whether an array begins with that many finite numbers, the first of them the radius of a tube, m."""
    return table.size >= size and bool(np.isfinite(table[:size]).all()) and math.isclose(table[0], radius)


def shape_of(film: Samples) -> tuple[int, int, int, int]:
    """Shape of the coefficients of a film from its head, or from all of it: both coordinates, yaws, entries."""
    return int(film[INTERVALS]) + 3, int(film[SECOND_INTERVALS]) + 3, int(film[YAWS]), ENTRIES


def film_is_whole(film: Samples, radius: float) -> bool:
    """Whether an array is a packed film in a tube of this radius: the loops below check no index.

    Args:
        film: of any numbers.
        radius: R of the tube, m.
    """
    if not has_head(film, HEAD, radius):
        return False
    counts = film[[INTERVALS, SECOND_INTERVALS, YAWS]]
    if np.any(counts % 1.0) or counts.min() < 1 or counts.max() > _MANY or not 0.0 < film[BODY] < radius:
        return False
    values = film[HEAD:].view(np.float32)  # one more where their number is odd
    return values.size - math.prod(shape_of(film)) in (0, 1) and bool(np.isfinite(values).all())


@native()
def clearance(
    head: Float64[Array, "..."],
    x: float,
    half: float,
    ring: float,
    rounded: float,
    e: float,
    lift: float,
    side: float,
) -> float:
    """Depth by which a ring, or a spheroid, may sink until it touches the wall, m.

    Args:
        head: head of a packed table.
        x: place on the body's axis.
        half: half-length of the spheroid, 0 for a ring.
        ring: radius of the ring or spheroid.
        rounded: radius of the ball that runs around on the ring.
        e: offset of the body's middle.
        lift: component of the body's axis towards the tube's axis.
        side: component of the body's axis to the side.
    """


@native()
def smallest_gap(head: Float64[Array, "..."], e: float, p: float, psi: float) -> float:
    """Smallest distance between a body and the wall, m; `head` may be a packed table."""


@native()
def stretched(v: float, radius: float) -> float:
    """Coordinate of a clearance: its logarithm where it is small against the radius, and finer about the radius."""


@native()
def yaw_scale(head: Float64[Array, "..."], rear: float, front: float) -> float:
    """Sine of the yaw at which the wall's curvature under the straight side counts, from the clearances of its ends."""


@native("out")
def film_coordinates(head: Float64[Array, "..."], e: float, p: float, psi: float, out: Float64[Array, "5"]) -> None:
    """Write what the interpolation of a film goes by at a place; `head` may be a packed table.

    Three coordinates; the part of log D of the first motion that is known in closed form; and the angle from z' to
    the normal of the wall, where a rounded end is nearest.
    """


@native("out")
def spline_weights(at: float, first: float, last: float, intervals: int, out: Float64[Array, "4"]) -> int:
    """Weights of the four cubic B-splines at a place, and the number of their first; a straight line outside."""


@native("out")
def film_at(packed: Float64[Array, "..."], e: float, p: float, psi: float, out: Float64[Array, "6 6"]) -> float:
    """Write the film's resistance (6x6, per viscosity, in F about the body's middle); the body's smallest gap, m.

    Outside of the table the film goes on: as power laws below its thinnest clearances, unchanged beyond its largest
    yaw. Where the body touches the wall, the clearances are 1e-12 of its radius, and the gap is negative.

    Args:
        packed: a film's table, packed.
        e: offset of the body's middle from the tube's axis, m, at least 0.
        p: pitch, rad, positive where the nose points away from the wall.
        psi: yaw, rad.
        out: (6, 6), the result.
    """
