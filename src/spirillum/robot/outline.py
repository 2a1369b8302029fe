"""Outlines of solids of revolution about the motor axis: body and coupling, as lines and elliptic arcs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.geometry import End, ProfilePoints, Shape

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class Segment:
    """A straight segment from (x, rho) to (x, rho), m."""

    start: tuple[float, float]
    end: tuple[float, float]
    turn: ClassVar[float] = 0.0  #: Angle by which its tangent turns, rad.
    edges: ClassVar[tuple[float, ...]] = (0.0, 1.0)  #: Parameters between which it is analytic.

    def points(self, t: Samples) -> tuple[Samples, Samples]:
        """(x, rho) at t from 0 to 1."""
        (x_a, rho_a), (x_b, rho_b) = self.start, self.end
        return x_a + (x_b - x_a) * t, rho_a + (rho_b - rho_a) * t

    def slope(self, t: Samples) -> Samples:
        """dx/dt."""
        return np.full_like(t, self.end[0] - self.start[0])

    @property
    def length(self) -> float:
        """Length, m."""
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))

    def radius(self, x: Samples) -> Samples:
        """Radius at x; NaN off the piece and on a flat end."""
        (x_a, rho_a), (x_b, rho_b) = self.start, self.end
        if x_a == x_b:
            return np.full(np.shape(x), np.nan)
        t = (x - x_a) / (x_b - x_a)
        return np.where((t >= 0) & (t <= 1), rho_a + (rho_b - rho_a) * t, np.nan)


@dataclass(frozen=True)
class Arc:
    """A quarter or half of an ellipse: (x, rho) = centre + (A cos, B sin) between two angles, m and rad."""

    centre: tuple[float, float]
    semi_axes: tuple[float, float]
    angles: tuple[float, float]
    edges: ClassVar[tuple[float, ...]] = (0.0, 1.0)  #: Parameters between which it is analytic.

    def points(self, t: Samples) -> tuple[Samples, Samples]:
        """(x, rho) at t from 0 to 1."""
        angle = self.angles[0] + (self.angles[1] - self.angles[0]) * t
        return (
            self.centre[0] + self.semi_axes[0] * np.cos(angle),
            self.centre[1] + self.semi_axes[1] * np.abs(np.sin(angle)),
        )

    @property
    def turn(self) -> float:
        """Angle by which its tangent turns, rad."""
        return abs(self.angles[1] - self.angles[0])

    def slope(self, t: Samples) -> Samples:
        """dx/dt."""
        turn = self.angles[1] - self.angles[0]
        return -self.semi_axes[0] * np.sin(self.angles[0] + turn * t) * turn

    @property
    def length(self) -> float:
        """Length, m, by 64 chords; its accuracy suffices for subdividing the arc."""
        x, rho = self.points(np.linspace(0.0, 1.0, 65))
        return float(np.sum(np.hypot(np.diff(x), np.diff(rho))))

    def radius(self, x: Samples) -> Samples:
        """Radius at x; NaN off the piece."""
        ends = self.centre[0] + self.semi_axes[0] * np.cos(np.array(self.angles))
        slack = 1e-12 * abs(self.semi_axes[0])
        inside = (x >= ends.min() - slack) & (x <= ends.max() + slack)
        share = np.clip((x - self.centre[0]) / self.semi_axes[0], -1.0, 1.0)
        return np.where(inside, self.centre[1] + self.semi_axes[1] * np.sqrt(1.0 - share**2), np.nan)


@dataclass(frozen=True)
class Smooth:
    """A smooth line through points (x, rho), m: cubic splines over the length of chords."""

    knots: tuple[tuple[float, float], ...]  #: Points from front to rear.
    rounded: tuple[bool, bool]  #: Whether it meets the axis at a right angle at its start and at its end.

    @cached_property
    def _splines(self) -> tuple[Any, Any]:
        from scipy.interpolate import CubicSpline

        x, rho = np.array(self.knots).T
        chord = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(rho)))])
        kinds = ((1, 0.0), (2, 0.0))  # on the axis, x has no slope there and rho no curvature
        ends = [tuple(kind if pole else "not-a-knot" for pole in self.rounded) for kind in kinds]
        return CubicSpline(chord / chord[-1], x, bc_type=ends[0]), CubicSpline(chord / chord[-1], rho, bc_type=ends[1])

    @cached_property
    def fine(self) -> tuple[Samples, Samples, Samples]:
        """Parameters dense against its bends, and (x, rho) there."""
        knots = self._splines[0].x
        t = np.unique(np.linspace(knots[:-1], knots[1:], 33))
        return t, *self.points(t)

    @cached_property
    def turned(self) -> Samples:
        """Angle by which the tangent has turned up to the parameters of `fine`, rad."""
        t = self.fine[0]
        angle = np.unwrap(np.arctan2(self._splines[1](t, 1), self._splines[0](t, 1)))
        return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(angle)))])

    def points(self, t: Samples) -> tuple[Samples, Samples]:
        """(x, rho) at t from 0 to 1."""
        along, out = self._splines
        return along(t), np.maximum(out(t), 0.0)

    @property
    def turn(self) -> float:
        """Angle by which its tangent turns, rad."""
        return float(self.turned[-1])

    @property
    def edges(self) -> tuple[float, ...]:
        """Parameters between which it is analytic."""
        return tuple(self._splines[0].x.tolist())

    def slope(self, t: Samples) -> Samples:
        """dx/dt."""
        return np.asarray(self._splines[0](t, 1))

    @cached_property
    def length(self) -> float:
        """Length, m."""
        _, x, rho = self.fine
        return float(np.sum(np.hypot(np.diff(x), np.diff(rho))))

    def radius(self, x: Samples) -> Samples:
        """Radius at x, between samples linear; NaN off the piece."""
        _, along, out = self.fine
        return np.asarray(np.interp(x, along[::-1], out[::-1], left=np.nan, right=np.nan))


Piece = Segment | Arc | Smooth


@dataclass(frozen=True)
class Outline:
    """A closed solid of revolution: pieces from its front pole to its rear pole."""

    pieces: tuple[Piece, ...]
    corners: tuple[bool, ...]  #: Whether there is a sharp edge between each piece and the next.

    def line(self, t: Samples) -> tuple[Samples, Samples]:
        """(x, rho) of the pieces one after the other, each at t from 0 to 1."""
        x, rho = zip(*(piece.points(t) for piece in self.pieces), strict=True)
        return np.concatenate(x), np.concatenate(rho)

    @property
    def fine(self) -> tuple[Samples, Samples]:
        """Points (x, rho) dense against its bends, from front to rear, m."""
        every = np.linspace(0.0, 1.0, 257)
        parts = [piece.fine[1:] if isinstance(piece, Smooth) else piece.points(every) for piece in self.pieces]
        x, rho = zip(*parts, strict=True)
        return np.concatenate(x), np.concatenate(rho)

    def sections(self) -> tuple[Samples, Samples, Samples]:
        """x, rho^2 and the weighted -dx (it runs from front to rear) of Gauss quadrature along it, to rounding."""
        found = [(piece, low, high) for piece in self.pieces for low, high in pairwise(piece.edges)]
        parts = []
        for piece, low, high in found:
            t = low + 0.5 * (high - low) * (1.0 + _NODES)
            x, rho = piece.points(t)
            parts.append((x, rho**2, -piece.slope(t) * 0.5 * (high - low) * _WEIGHTS))
        x, square, dx = (np.concatenate(part) for part in zip(*parts, strict=True))
        return x, square, dx

    def contains(self, x: Samples, rho: Samples) -> np.ndarray:
        """Whether points are inside."""
        radius = np.fmax.reduce([piece.radius(x) for piece in self.pieces])
        tips = [float(piece.points(np.full(1, t))[0][0]) for piece in self.pieces for t in (0.0, 1.0)]
        with np.errstate(invalid="ignore"):
            return np.asarray((rho < radius) & (x < max(tips)) & (x > min(tips)))

    def distance(self, x: Samples, rho: Samples) -> Samples:
        """Distance of points from the surface, to a thousandth of a piece's length, m."""
        shape = np.broadcast_shapes(np.shape(x), np.shape(rho))
        points = np.stack(np.broadcast_arrays(x, rho), axis=-1).reshape(-1, 2)
        found, _ = _nearest(self).query(points)
        return np.asarray(found).reshape(shape)


@lru_cache(maxsize=256)
def _nearest(outline: Outline) -> Any:
    """Tree of points along an outline."""
    from scipy.spatial import cKDTree

    return cKDTree(np.stack(outline.line(np.linspace(0.0, 1.0, 1001)), axis=-1))


def _end(end: End | None, x_tip: float, outward: float, radius: float, fillet: float) -> list[Segment | Arc]:
    """Pieces of an end from the axis to where the straight side begins."""
    inner = x_tip - outward * (radius if end == "hemisphere" else fillet)
    if end == "hemisphere":
        return [Arc((inner, 0.0), (outward * radius, radius), (0.0, 0.5 * np.pi))]
    if end == "fillet":
        core = radius - fillet
        arc = Arc((inner, core), (outward * fillet, fillet), (0.0, 0.5 * np.pi))
        return [Segment((x_tip, 0.0), (x_tip, core)), arc] if core > 0 else [arc]
    return [Segment((x_tip, 0.0), (x_tip, radius))]


def body_outline(
    shape: Shape,
    diameter: float,
    length: float,
    fillet: float,
    front: End | None,
    rear: End | None,
    profile: ProfilePoints = (),
) -> Outline:
    """Outline of a body about its mid-length; lengths in m, points of a profile in mm."""
    if shape == "profile":
        return profile_outline(profile)
    radius, half = 0.5 * diameter, 0.5 * length
    if shape in ("sphere", "spheroid"):
        return Outline((Arc((0.0, 0.0), (half, radius), (0.0, np.pi)),), ())
    nose = _end(front, half, 1.0, radius, fillet)
    tail: list[Segment | Arc] = [
        Segment(piece.end, piece.start)
        if isinstance(piece, Segment)
        else Arc(piece.centre, piece.semi_axes, (piece.angles[1], piece.angles[0]))
        for piece in reversed(_end(rear, -half, -1.0, radius, fillet))
    ]
    x_front, x_rear = nose[-1].points(np.ones(1))[0][0], tail[0].points(np.zeros(1))[0][0]
    side: list[Segment | Arc] = [Segment((float(x_front), radius), (float(x_rear), radius))]
    if x_front - x_rear < 1e-9 * length:
        side = []
    joints = [front == "flat"] if side else [front == "flat" or rear == "flat"]
    corners = [False] * (len(nose) - 1) + joints
    corners += ([rear == "flat"] if side else []) + [False] * (len(tail) - 1)
    return Outline((*nose, *side, *tail), tuple(corners))


_CORNER = np.radians(20.0)  # angle from one chord to the next above which a profile has a sharp edge there
_SQUARE = np.radians(30.0)  # angle of a chord from the axis's normal below which the pole where it ends is rounded
_STRAIGHT = 3.0  # length of a chord over those of its neighbours above which it is a straight piece


@lru_cache(maxsize=64)
def profile_outline(points: tuple[tuple[float, float], ...]) -> Outline:
    """Outline through points (x, rho) from pole to pole, mm, about its mid-length: smooth but at corners."""
    # Chords between corners, those much longer than what they join without one, and flat ends are straight.
    x, rho = 1e-3 * np.array(points).T
    x = x - 0.5 * (x.max() + x.min())
    if x[0] < x[-1]:
        x, rho = x[::-1], rho[::-1]
    length = np.hypot(np.diff(x), np.diff(rho))
    angle = np.arctan2(np.diff(rho), np.diff(x))
    turn = np.abs((np.diff(angle) + np.pi) % (2.0 * np.pi) - np.pi)
    sharp = [False, *(bool(some > _CORNER) for some in turn), False]
    straight = [bool(a == b) for a, b in pairwise(x)]
    for i, own in enumerate(length):
        joined = [k for k, edge in ((i - 1, i), (i + 1, i + 1)) if 0 <= k < length.size and not sharp[edge]]
        straight[i] |= bool(own > _STRAIGHT * max((length[k] for k in joined), default=0.0))
    cuts = [i for i in range(1, length.size) if sharp[i] or straight[i - 1] or straight[i]]
    pieces: list[Piece] = []
    for first, last in pairwise([0, *cuts, length.size]):
        knots = tuple(zip(x[first : last + 1].tolist(), rho[first : last + 1].tolist(), strict=True))
        if len(knots) == 2:
            pieces.append(Segment(*knots))
        else:
            poles = (first == 0 and _meets_squarely(angle[0]), last == length.size and _meets_squarely(angle[-1]))
            pieces.append(Smooth(knots, poles))
    return Outline(tuple(pieces), tuple(sharp[i] for i in cuts))


def _meets_squarely(angle: float) -> bool:
    """Whether a chord from or to the axis is so nearly at right angles to it that the pole is rounded."""
    return bool(abs(abs(angle) - 0.5 * np.pi) < _SQUARE)


def cylinder_outline(diameter: float, front: float, rear: float) -> Outline:
    """Outline of a flat-ended cylinder from x = front to x = rear < front; lengths in m."""
    radius = 0.5 * diameter
    pieces = (
        Segment((front, 0.0), (front, radius)),
        Segment((front, radius), (rear, radius)),
        Segment((rear, radius), (rear, 0.0)),
    )
    return Outline(pieces, (True, True))


def solid_outlines(
    body: Outline | None, body_length: float, coupling_diameter: float, coupling_length: float, clearance: float
) -> dict[str, Outline]:
    """Outlines by part: the body, and the coupling behind it where there is one; lengths in m."""
    outlines = {} if body is None else {"body": body}
    if coupling_diameter > 0 and coupling_length > 2.0 * clearance:
        rear = -0.5 * body_length
        outlines["coupling"] = cylinder_outline(coupling_diameter, rear - clearance, rear - coupling_length + clearance)
    return outlines
