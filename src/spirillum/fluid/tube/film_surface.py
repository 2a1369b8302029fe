"""Surface under the lubrication film of a body of revolution in a tube, in stretched coordinates.

Frame F: x' along the body's axis, y' level, z' = x' x y', origin at the body's middle, which lies at the offset e below
the tube's axis. The body's axis is (cos p cos psi, cos p sin psi, sin p) in (along the tube, to the side, towards the
tube's axis). Angles around the body count from -z'.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.robot.outline import Arc, Outline, Segment, Smooth

ROUNDED = 0.7  #: Angle of a rounded end that belongs to the lubrication film, rad.
PATCH = 1.2  #: Half-width of a spheroid's film, rad of the unit sphere that the spheroid is stretched from.
_LEAST = 1e-12  # Smallest film thickness over the tube's radius.
_FADE = 0.3
"""Depth of the body's axis below the tube's, over the room, at which no side is nearer to the wall any more."""
_TURNED = (0.62, 0.14)
"""Angle up to which coordinates follow the side that is nearest, and how much further they turn at most, rad: beyond
pi/4 they would fold."""
TOUCHES = "the body touches the wall of the tube"
_NO_FILM = "the lubrication film of body.profile is not known:"
_TILTED = float(np.radians(12.0))
"""Angle of its normal up to which an outline can near the wall: the largest pitch of a table, rad."""
_LEVEL = 2e-5  # How far a straight side may be off the largest radius, over it.
_SIDE = 0.3  # Shortest straight side, over the radius.
_EDGE = 1e-2  # Radius of an end, over that of the body, below which it is an edge.
_LEAST_HALF = 0.3  # Least half-length over the radius of a spheroid that stands for a body.
_INSIDE = 0.9  # Share of such a body, from its widest place to its nearer end, that belongs to the lubrication film.
_OFF = 5e-4  # How far an outline may be off the circles or the spheroid that stand for it, over its radius.
_SLENDER = 0.3  # Least angle of the film on a rounded end whose radius is larger than the body's, rad.
_HALF = 0.5 * np.pi
_AXIS = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class FilmBody:
    """Geometry of a body of revolution for its lubrication film, about its mid-length; lengths in m."""

    radius: float
    half: float  #: Half-length of a spheroid along its axis; 0 for a body with a straight side.
    rear: tuple[float, float]
    """Where the straight side ends behind, x, and the radius f of the rounded end there: 0 flat, a hemisphere, and more
    a slender end. Of a spheroid the x of its middle, and 0."""
    front: tuple[float, float]
    """Where the straight side ends in front, x, and the radius f of the rounded end there; of a spheroid as `rear`."""
    patch: float = PATCH  #: Half-width of a spheroid's film along it, rad of the unit sphere that it is stretched from.

    @property
    def rings(self) -> list[tuple[float, float, float, float]]:
        """What of it can touch a wall: ring of radius rho at x, half-length along the axis, and ball on it, m."""
        if self.half:
            return [(self.rear[0], self.radius, self.half, 0.0)]
        return [(x, self.radius - ball, 0.0, ball) for x, ball in (self.front, self.rear)]

    @classmethod
    def of(cls, outline: Outline) -> FilmBody:
        """Read an outline; of a profile what can near the wall, with circles for its ends or one spheroid."""
        straight = {k: piece for k, piece in enumerate(outline.pieces) if isinstance(piece, Segment)}
        slanted = any(p.start[0] != p.end[0] and p.start[1] != p.end[1] for p in straight.values())
        if slanted or any(isinstance(piece, Smooth) for piece in outline.pieces):
            return _of_profile(outline)
        sides = [k for k, p in straight.items() if p.start[1] == p.end[1] > 0]
        arcs = [piece for piece in outline.pieces if isinstance(piece, Arc)]
        if len(sides) == 1:
            side = outline.pieces[sides[0]]
            ends = [p.points(np.array([t]))[0][0] for p, t in ((side, 1.0), (side, 0.0))]
            rounded = [0.0, 0.0]
            for neighbour, place in ((sides[0] + 1, 0), (sides[0] - 1, 1)):
                piece = outline.pieces[neighbour]
                rounded[place] = piece.semi_axes[1] if isinstance(piece, Arc) else 0.0
            radius = float(side.points(np.zeros(1))[1][0])
            return cls(radius, 0.0, (float(ends[0]), rounded[0]), (float(ends[1]), rounded[1]))
        if arcs and len(arcs) == len(outline.pieces) and len({(p.centre, p.semi_axes[1]) for p in arcs}) == 1:
            return cls(arcs[0].semi_axes[1], abs(arcs[0].semi_axes[0]), (0.0, 0.0), (0.0, 0.0))
        return _of_profile(outline)


def _of_profile(outline: Outline) -> FilmBody:
    x, rho = outline.fine
    a = float(rho.max())
    wide = np.flatnonzero(rho >= a * (1.0 - _LEVEL))
    ends = float(x[wide[-1]]), float(x[wide[0]])
    if ends[1] - ends[0] < _SIDE * a:
        return _as_spheroid(x, rho, a)
    if np.any(rho[wide[0] : wide[-1]] < a * (1.0 - _LEVEL)):
        raise InputError(f"{_NO_FILM} its side has a waist; allowed: a straight side, or a round one")
    rear, front = (_rounded(outward * x, rho, a) for outward in (-1.0, 1.0))
    return FilmBody(a, 0.0, (-rear[0], rear[1]), front)


def _support(x: Samples, rho: Samples, angle: Samples) -> Samples:
    """How far an outline reaches at angles of its normal forwards, m."""
    return np.asarray(np.max(np.sin(angle)[:, None] * x + np.cos(angle)[:, None] * rho, axis=1))


def _rounded(x: Samples, rho: Samples, a: float) -> tuple[float, float]:
    """Where a straight side ends in front, and the radius of the circle that its end is near the side."""
    angle = np.linspace(0.0, _TILTED, 43)[1:]
    terms = np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    reach = _support(x, rho, angle) - a * np.cos(angle)
    joint, radius = np.linalg.lstsq(terms, reach, rcond=None)[0].tolist()
    if radius < _EDGE * a:
        joint, radius = float(np.mean(reach / terms[:, 0])), 0.0
    _check_near(terms @ [joint, radius] - reach, a)
    return joint, radius


def _as_spheroid(x: Samples, rho: Samples, a: float) -> FilmBody:
    """The spheroid that a body without a straight side is where it can near the wall."""
    from scipy.optimize import least_squares

    angle = np.linspace(-_TILTED, _TILTED, 85)
    reach = _support(x, rho, angle)

    def left(numbers: Samples) -> Samples:
        middle, half = numbers
        return np.asarray(middle * np.sin(angle) + np.hypot(half * np.sin(angle), a * np.cos(angle)) - reach)

    bent = (0.5 * float(reach[0] + reach[-1])) ** 2 - (a * np.cos(_TILTED)) ** 2
    start = float(x[np.argmax(rho)]), float(np.sqrt(max(bent, 0.0)) / np.sin(_TILTED))
    if start[1] < _LEAST_HALF * a:
        raise InputError(f"{_NO_FILM} it is an edge where it is widest; allowed: a straight side, or a round one")
    found = least_squares(left, start, bounds=([-np.inf, 1e-2 * a], [np.inf, 1e2 * a]), x_scale=a)
    middle, half = found.x.tolist()
    _check_near(found.fun, a)
    tangent = np.sin(_TILTED) * half**2 / np.hypot(half * np.sin(_TILTED), a * np.cos(_TILTED))
    near = np.abs(x - middle) < tangent
    _check_near(rho[near] - a * np.sqrt(1.0 - ((x[near] - middle) / half) ** 2), a)
    shorter = min(float(x.max()) - middle, middle - float(x.min())) / half
    patch = min(PATCH, _INSIDE * float(np.arcsin(min(shorter, 1.0))))
    return FilmBody(a, half, (middle, 0.0), (middle, 0.0), patch)


def _check_near(distance: Samples, a: float) -> None:
    """Refuse a film surface that is off the outline."""
    off = float(np.abs(distance).max(initial=0.0)) / a
    if off > _OFF:
        raise InputError(
            f"{_NO_FILM} where it can near the wall it is {100.0 * off:.2g} % of its radius off circles beside a "
            f"straight side, or off a spheroid without one; allowed: at most {100.0 * _OFF:g} %"
        )


def frame(pitch: float, yaw: float) -> Samples:
    """Axes of F as columns, in (along the tube, to the side, towards the tube's axis)."""
    (c, s), (cy, sy) = (np.cos(pitch), np.sin(pitch)), (np.cos(yaw), np.sin(yaw))
    return np.array([[c * cy, -sy, -s * cy], [c * sy, cy, -s * sy], [s, 0.0, c]])


class FilmSurface(NamedTuple):
    """Part of a body's surface at a grid of coordinates (u, v), each (n_u, n_v, 3), in F about the body's middle."""

    points: Samples
    normals: Samples
    along: Samples
    across: Samples
    turning_along: Samples
    turning_across: Samples


class Cuts(NamedTuple):
    """Points on [-1, 1] at which the surface is evaluated, and the number of equal elements that they fill."""

    side: Samples  #: Along the straight side.
    sides: int
    rounded: Samples  #: Along a rounded end, and along half of a spheroid.
    rounds: int
    patch: Samples  #: Along a spheroid.
    patches: int
    around: Samples  #: Around the body.


class _Stretched(NamedTuple):
    """A coordinate as a function of one on [-1, 1], and its derivative."""

    at: Samples
    slope: Samples


def _gathered(unit: Samples, low: float, high: float, where: float, scale: float) -> _Stretched:
    """Coordinate from `low` to `high` whose nodes gather at `where` over the length `scale`: it runs as sinh does."""
    first, last = np.arcsinh((np.array([low, high]) - where) / scale)
    rate = 0.5 * (last - first)
    at = first + rate * (1.0 + unit)
    return _Stretched(where + scale * np.sinh(at), rate * scale * np.cosh(at))


def _gathered_twice(unit: Samples, marks: tuple[tuple[float, float], tuple[float, float]]) -> _Stretched:
    """Coordinate whose nodes gather at both of its ends; `marks` are (where, over which length)."""
    # With a and b the distances from the marks over their lengths, asinh a + asinh b = y is a^2 + b^2 + 2 a b cosh y =
    # sinh(y)^2, a quadratic equation for the coordinate.
    (low, c), (high, d) = marks
    first, last = np.arcsinh((high - low) / d), np.arcsinh((high - low) / c)
    rate = 0.5 * (last + first)
    y = -first + rate * (1.0 + unit)
    mixed = np.cosh(y) / (c * d)
    square = 1.0 / c**2 + 1.0 / d**2 + 2.0 * mixed
    middle = (low / c**2 + high / d**2 + mixed * (low + high)) / square
    s = middle + np.sinh(y) * np.sqrt((1.0 + ((high - low) / (c * d)) ** 2 / square) / square)
    return _Stretched(s, rate / (1.0 / np.hypot(s - low, c) + 1.0 / np.hypot(s - high, d)))


@dataclass(frozen=True)
class Place:
    """Pose of a body in a tube."""

    body: FilmBody
    tube: float  #: R, m.
    offset: float
    axes: Samples  #: Axes of F as columns.

    def clearance(self, points: Samples) -> Samples:
        """H of points in F, m."""
        side = points @ self.axes[1]
        height = points @ self.axes[2] - self.offset
        return np.asarray(self.tube - np.hypot(side, height))

    def thickness(self, points: Samples, normals: Samples) -> Samples:
        """Thickness h of the film at points in F: geometric mean of the distances along both normals, m."""
        # With it, and lengths measured midway between the surfaces, what is left of the exact resistance hardly knows
        # the gap, for lines and for points of contact.
        side, height = points @ self.axes[1], points @ self.axes[2] - self.offset
        outward = side * (normals @ self.axes[1]) + height * (normals @ self.axes[2])
        distance = np.hypot(side, height)
        room = (self.tube - distance) * (self.tube + distance)
        # the smaller root, without cancellation where the film is thin
        root = np.sqrt(outward**2 + np.maximum(room, 0.0))
        along = np.where(outward > 0.0, room / (outward + root), root - outward)
        return np.asarray(np.sqrt(np.maximum((self.tube - distance) * along, 0.0)))

    def bottom(self, x: Samples, ring: float) -> tuple[Samples, Samples]:
        """Angle at which a ring about the body's axis is nearest to the wall, rad, and its derivative by its x."""
        # Thin films are narrow: an angle a hundredth off misses one of a ten-thousandth of the radius. It fades
        # to 0 towards the tube's axis, where no side is nearer, and is bounded: thin films are not that far around.
        along, lift, deepest = self.axes[1, 0], self.axes[2, 0], _FADE * (self.tube - self.body.radius)
        across, depth = x * along, np.maximum(self.offset - x * lift, _LEAST * self.tube)
        away = np.hypot(across, depth)
        # of a circle across the tube; derivatives by x behind
        sin, cos, turn = across / away, depth / away, (along * depth + lift * across) / away**2
        sin_x, cos_x = cos * turn, -sin * turn
        # one step of Newton's method for the ellipse that an inclined ring is across the tube
        to_side, up_to_side, to_depth = self.axes[1, 1], -self.axes[1, 2], self.axes[2, 2]
        side, deep = across + ring * (to_side * sin + up_to_side * cos), depth + ring * to_depth * cos
        side_x, deep_x = along + ring * (to_side * sin_x + up_to_side * cos_x), -lift + ring * to_depth * cos_x
        turned, turned_x = to_side * cos - up_to_side * sin, to_side * cos_x - up_to_side * sin_x
        error = side * turned - deep * to_depth * sin
        error_x = side_x * turned + side * turned_x - to_depth * (deep_x * sin + deep * sin_x)
        away_x = sin * along - cos * lift
        angle = np.arctan2(across, depth) + error / away
        slope = turn + (error_x - error * away_x / away) / away
        share = np.where(self.offset > x * lift, depth / deepest, 0.0)
        left = np.exp(-(share**2))
        angle, slope = angle * (1.0 - left), slope * (1.0 - left) - angle * left * 2.0 * share * lift / deepest
        beyond = np.tanh(np.maximum(np.abs(angle) - _TURNED[0], 0.0) / _TURNED[1])
        return np.clip(angle, -_TURNED[0], _TURNED[0]) + np.sign(angle) * _TURNED[1] * beyond, slope * (1.0 - beyond**2)

    def ends(self) -> Samples:
        """Gaps under the ends of the straight side, each a ring with a ball on it, or an edge; negative: it touches."""
        found = []
        for x, rounded in (self.body.rear, self.body.front):
            ring = self.body.radius - rounded
            angle = float(self.bottom(np.array([x]), ring)[0][0])
            point = np.array([x, ring * np.sin(angle), -ring * np.cos(angle)])
            away = float(np.hypot(point @ self.axes[1], point @ self.axes[2] - self.offset))
            found.append(min(self.tube - rounded - float(np.copysign(away, ring)), self.gap(x)[0]))
        return np.array(found)

    def gap(self, x: float) -> tuple[float, float]:
        """H of the straight side at x, and its derivative by x."""
        angle = float(self.bottom(np.array([x]), self.body.radius)[0][0])
        point = np.array([x, self.body.radius * np.sin(angle), -self.body.radius * np.cos(angle)])
        side, height = point @ self.axes[1], point @ self.axes[2] - self.offset
        slope = -(side * self.axes[1, 0] + height * self.axes[2, 0]) / np.hypot(side, height)
        return float(self.clearance(point)), float(slope)


def film_surface(place: Place, cuts: Cuts) -> FilmSurface:
    """Surface under the lubrication film, from rear to front; `along` is by a coordinate of -1 to 1 in an element."""
    return _spheroid(place, cuts) if place.body.half else _with_side(place, cuts)


def _with_side(place: Place, cuts: Cuts) -> FilmSurface:
    """Film surface of a body with a straight side, from the rear to the front."""
    body = place.body
    a = body.radius
    reduced = a * place.tube / (place.tube - a)
    shoulders = (body.rear, body.front)
    gaps, slopes = zip(*(place.gap(x) for x, _ in shoulders), strict=True)
    # of the rounded ends too, which may be turned to the wall
    nearest = place.ends()
    if not nearest.min() > _LEAST * place.tube:
        raise InputError(TOUCHES)
    thinnest = 1.0 / np.hypot(1.0 / nearest[0], 1.0 / nearest[1])
    width = float(np.sqrt(2.0 * thinnest * reduced) / a)
    around = _gathered(cuts.around, -_HALF, _HALF, 0.0, width)
    rear, front = (
        (x, float(1.0 / (1.0 / np.sqrt(2.0 * gap * reduced) + abs(slope) / gap)))
        for (x, _), gap, slope in zip(shoulders, gaps, slopes, strict=True)
    )
    x = _gathered_twice(cuts.side, (rear, front))
    zero, one = np.zeros_like(cuts.side), np.ones_like(cuts.side)
    parts = [_revolved(place, around, x.slope / cuts.sides, (x.at, a * one), (one, zero), (zero, one), (zero, zero))]
    for (joint, f), gap, slope, outward in zip(shoulders, nearest, slopes, (-1.0, 1.0), strict=True):
        if f == 0:
            continue
        most = min(ROUNDED, max(ROUNDED * a / f, _SLENDER))
        low, high = (0.0, most) if outward > 0 else (-most, 0.0)
        angle = _gathered(cuts.rounded, low, high, -float(np.arcsin(slope)), float(np.sqrt(2.0 * gap / f)))
        sin, cos = np.sin(angle.at), np.cos(angle.at)
        outline = (joint + f * sin, a - f + f * cos)
        end = _revolved(place, around, angle.slope / cuts.rounds, outline, (f * cos, -f * sin), (sin, cos), (cos, -sin))
        parts.insert(0 if outward < 0 else len(parts), end)
    return FilmSurface(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))


def _revolved(
    place: Place,
    around: _Stretched,
    rate: Samples,
    outline: tuple[Samples, Samples],
    tangent: tuple[Samples, Samples],
    normal: tuple[Samples, Samples],
    turning: tuple[Samples, Samples],
) -> FilmSurface:
    """Surface of revolution of an outline (x, rho): tangent by s, unit normal, its derivative by s; `rate` is ds/du."""
    turn, turn_rate = place.bottom(outline[0], place.body.radius)
    fade = 1.0 - (around.at / _HALF) ** 2  # the edges stay where they are
    theta = around.at + turn[:, None] * fade
    by_v = around.slope * (1.0 - turn[:, None] * 2.0 * around.at / _HALF**2)
    by_u = ((turn_rate * tangent[0])[:, None] * fade) * rate[:, None]
    sin, cos = np.sin(theta), np.cos(theta)
    rho = outline[1][:, None]
    zero = np.zeros_like(sin)
    radial = np.stack([zero, sin, -cos], axis=-1)
    hoop = np.stack([zero, cos, sin], axis=-1)
    to_points, to_normals, to_tangents, to_turning = (
        x[:, None, None] * _AXIS + r[:, None, None] * radial for x, r in (outline, normal, tangent, turning)
    )
    steep = normal[1][:, None]
    return FilmSurface(
        to_points,
        to_normals,
        to_tangents * rate[:, None, None] + (rho * by_u)[..., None] * hoop,
        (rho * by_v)[..., None] * hoop,
        to_turning * rate[:, None, None] + (steep * by_u)[..., None] * hoop,
        (steep * by_v)[..., None] * hoop,
    )


def _spheroid(place: Place, cuts: Cuts) -> FilmSurface:
    """Film surface of a spheroid: a patch of the stretched unit sphere about its nearest point."""
    body = place.body
    stretch = np.array([body.half, body.radius, body.radius])
    facing = -place.axes[2]
    nearest = stretch * facing
    turn = np.arctan2(nearest[0], -nearest[2])

    def patch(beta: Samples, theta: Samples) -> FilmSurface:
        (sb, cb), (st, ct) = (np.sin(beta)[:, None], np.cos(beta)[:, None]), (np.sin(theta), np.cos(theta))
        zero = np.zeros(np.broadcast_shapes(sb.shape, st.shape))
        c, s = np.cos(turn), np.sin(turn)

        def turned(x: Samples, y: Samples, z: Samples) -> Samples:
            return np.stack([zero + c * x - s * z, zero + y, zero + s * x + c * z], axis=-1)

        sphere = turned(sb, cb * st, -cb * ct)
        normals = sphere / stretch
        size = np.linalg.norm(normals, axis=-1, keepdims=True)
        normals /= size
        slopes = turned(cb, -sb * st, sb * ct), turned(0.0 * sb, cb * ct, cb * st)
        along, across = (stretch * slope for slope in slopes)
        turning = [slope / (stretch * size) for slope in slopes]
        first, second = (by - normals * np.sum(normals * by, axis=-1, keepdims=True) for by in turning)
        return FilmSurface(stretch * sphere + body.rear[0] * _AXIS, normals, along, across, first, second)

    step = 0.05
    probe = np.array([-step, 0.0, step])
    h = place.clearance(patch(probe, probe).points)
    if not h[1, 1] > _LEAST * place.tube:
        raise InputError(TOUCHES)
    bends = [(h[0, 1] + h[2, 1] - 2 * h[1, 1]) / step**2, (h[1, 0] + h[1, 2] - 2 * h[1, 1]) / step**2]
    beta, theta = (
        _gathered(unit, -width, width, 0.0, float(np.sqrt(2.0 * h[1, 1] / (max(bend, 0.0) + h[1, 1]))))
        for unit, width, bend in zip((cuts.patch, cuts.around), (body.patch, PATCH), bends, strict=True)
    )
    surface = patch(beta.at, theta.at)
    by_u, by_v = beta.slope[:, None, None] / cuts.patches, theta.slope[:, None]
    return surface._replace(
        along=surface.along * by_u,
        across=surface.across * by_v,
        turning_along=surface.turning_along * by_u,
        turning_across=surface.turning_across * by_v,
    )
