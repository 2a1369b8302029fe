"""Reynolds film between a body of revolution and the wall of a circular tube.

Lubrication with the true distance h from the body's surface to the wall and the body's true normal n: the pressure p
of a rigid motion v = U + Omega x r (viscosity 1, wall at rest) obeys on the body's surface

    div(h^3/12 grad p) = div(h v_t/2) - v.n,    p = 0 on the edges of the film,

with v_t the tangential part of v, and the resistance is the dissipation of pressure and shear,

    R_ij = int h^3/12 grad p_i . grad p_j + g v_ti . v_tj/h dA,    g = 1/(1 + (h/0.2 a)^2),

which is symmetric and positive definite. Shear counts where the film is thin: with all of the half circle's, the rest of
a robot's resistance without its film would not be positive definite. The edges of the film are fixed on the body: the half circle that faces the
wall, along the straight side and 0.7 rad of rounded ends; a spheroid's film is a patch about its nearest point.

p is expanded in polynomials (Galerkin) of coordinates that stretch the bottom line, the shoulders and the nearest
point, so that films of any thickness cost the same.

Frame F: x' along the body's axis, y' level, z' = x' x y'. The body's middle lies at the offset e below the tube's axis;
the axis is (cos p cos psi, cos p sin psi, sin p) in (along the tube, to the side, towards the tube's axis).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from spirillum.arrays import Matrix6, Samples
from spirillum.errors import InputError
from spirillum.robot.outline import Arc, Line, Outline

__all__ = ["ROUNDED", "FilmBody", "film_resistance", "frame"]

ROUNDED = 0.7
"""Angle of a rounded end that belongs to the film, rad."""
_HALF = 0.5 * np.pi
_EXTRA = 3
"""Gauss points of an element beyond its polynomials' degree."""
_TOUCHES = "the body touches the wall of the tube"
_SHEARED = 0.2
"""Thickness, over the body's radius, above which what shears in the tube is no film: its shear is left out there."""
_PATCH = 1.2
"""Half-width of a spheroid's film, rad of the unit sphere that the spheroid is stretched from."""


@dataclass(frozen=True)
class FilmBody:
    """What a film knows of a body of revolution about its mid-length; lengths in m."""

    radius: float
    """a."""
    half: float
    """Half-length of a spheroid along its axis; 0 for a body with a straight side."""
    rear: tuple[float, float]
    """Where the straight side ends behind, x, and the radius f of the rounded end there: 0 flat, a hemisphere."""
    front: tuple[float, float]
    """Where the straight side ends in front, x, and the radius f of the rounded end there."""

    @classmethod
    def of(cls, outline: Outline) -> FilmBody:
        """Read an outline.

        Raises:
            InputError: the outline is neither an ellipse nor a straight side between two ends.
        """
        sides = [k for k, p in enumerate(outline.pieces) if isinstance(p, Line) and p.start[1] == p.end[1] > 0]
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
        raise InputError("the film of a body without a straight side is known for spheres and spheroids only")


def frame(pitch: float, yaw: float) -> Samples:
    """Axes of F as columns, in (along the tube, to the side, towards the tube's axis)."""
    (c, s), (cy, sy) = (np.cos(pitch), np.sin(pitch)), (np.cos(yaw), np.sin(yaw))
    return np.array([[c * cy, -sy, -s * cy], [c * sy, cy, -s * sy], [s, 0.0, c]])


class _Surface(NamedTuple):
    """Part of a body's surface at a grid of coordinates (u, v), each (n_u, n_v, 3), in F about the body's middle."""

    points: Samples
    normals: Samples
    along: Samples
    """Derivative of the points by u."""
    across: Samples
    """Derivative of the points by v."""


class _Basis(NamedTuple):
    """Continuous piecewise polynomials on [-1, 1] at Gauss points."""

    nodes: Samples
    weights: Samples
    values: Samples
    """(points, functions)."""
    slopes: Samples
    pairs: Samples
    """Products of slopes with slopes, values with values, slopes with values, values with slopes:
    (4, points, functions^2)."""

    @classmethod
    def of(cls, nodes: Samples, weights: Samples, values: Samples, slopes: Samples) -> _Basis:
        """Complete it by the products."""
        kinds = ((slopes, slopes), (values, values), (slopes, values), (values, slopes))
        pairs = [(one[:, :, None] * other[:, None, :]).reshape(nodes.size, -1) for one, other in kinds]
        return cls(nodes, weights, values, slopes, np.stack(pairs))


@lru_cache(maxsize=32)
def _element(degree: int) -> _Basis:
    """Polynomials of one element: bubbles that are 0 at both ends, then those that are 1 at its start and its end."""
    nodes, weights = np.polynomial.legendre.leggauss(degree + _EXTRA)
    legendre = np.polynomial.legendre.legvander(nodes, degree)
    k = np.arange(2, degree + 1)
    bubbles = (legendre[:, 2:] - legendre[:, :-2]) / np.sqrt(4.0 * k - 2.0)
    values = np.column_stack([bubbles, 0.5 * (1.0 - nodes), 0.5 * (1.0 + nodes)])
    half = np.full_like(nodes, 0.5)
    return _Basis.of(nodes, weights, values, np.column_stack([legendre[:, 1:-1] * np.sqrt(k - 0.5), -half, half]))


def _cut(element: _Basis, pieces: int) -> tuple[Samples, Samples]:
    """Gauss points and weights of [-1, 1] in equal elements."""
    starts = np.arange(pieces)[:, None] * 2.0 / pieces - 1.0
    return (starts + (1.0 + element.nodes) / pieces).ravel(), np.tile(element.weights / pieces, pieces)


@lru_cache(maxsize=32)
def _halves(degree: int) -> _Basis:
    """Polynomials on both halves of [-1, 1] that meet in the middle and are 0 at the ends."""
    element = _element(degree)
    nodes, weights = _cut(element, 2)
    grids = []
    for one, scale in ((element.values, 1.0), (element.slopes, 2.0)):
        bubbles, zero = scale * one[:, :-2], np.zeros_like(one[:, :-2])
        middle = scale * np.concatenate([one[:, -1], one[:, -2]])[:, None]
        grids.append(np.hstack([np.vstack([bubbles, zero]), np.vstack([zero, bubbles]), middle]))
    return _Basis.of(nodes, weights, *grids)


class _Stretched(NamedTuple):
    """A coordinate as a function of one on [-1, 1], and its derivative."""

    at: Samples
    slope: Samples


def _stretched(unit: Samples, low: float, high: float, marks: tuple[tuple[float, float], ...]) -> _Stretched:
    """Coordinate from `low` to `high` whose nodes gather at marks (where, over which length)."""

    def progress(s: Samples) -> Samples:
        return np.sum([np.arcsinh((s - where) / scale) for where, scale in marks], axis=0)

    def rate(s: Samples) -> Samples:
        return np.sum([1.0 / np.hypot(s - where, scale) for where, scale in marks], axis=0)

    first, last = progress(np.array([low, high]))
    wanted = first + 0.5 * (last - first) * (1.0 + unit)
    below, above = np.full_like(unit, low), np.full_like(unit, high)
    s = 0.5 * (below + above)
    for _ in range(100):
        error = progress(s) - wanted
        below, above = np.where(error < 0, s, below), np.where(error > 0, s, above)
        step = s - error / rate(s)
        step = np.where((step > below) & (step < above), step, 0.5 * (below + above))
        if np.max(np.abs(step - s)) < 1e-13 * (high - low):
            break
        s = step
    return _Stretched(s, 0.5 * (last - first) / rate(s))


@dataclass(frozen=True)
class _Place:
    """A body at a place in a tube."""

    body: FilmBody
    tube: float
    """R, m."""
    offset: float
    axes: Samples
    """Axes of F as columns."""

    def clearance(self, points: Samples) -> Samples:
        """H of points in F, m."""
        side = points @ self.axes[1]
        height = points @ self.axes[2] - self.offset
        return self.tube - np.hypot(side, height)

    def bottom(self, x: Samples) -> tuple[Samples, Samples]:
        """Angle at which the straight side faces the wall at x, rad, and its derivative by x.

        It is 0 near the tube's axis, where no side does.
        """
        side, height = x * self.axes[1, 0], self.offset - x * self.axes[2, 0]
        size = side**2 + height**2 + (0.1 * self.body.radius) ** 2
        angle = side * height / size
        d_size = 2.0 * (side * self.axes[1, 0] - height * self.axes[2, 0])
        slope = (self.axes[1, 0] * height - side * self.axes[2, 0] - angle * d_size) / size
        return angle, slope

    def gap(self, x: float) -> float:
        """H of the straight side at x."""
        angle = float(self.bottom(np.array([x]))[0][0])
        point = np.array([x, self.body.radius * np.sin(angle), -self.body.radius * np.cos(angle)])
        return float(self.clearance(point))


class _Resolution(NamedTuple):
    """Degree of polynomials along and around the body; elements of equal length in the stretched coordinates."""

    along: int = 8
    around: int = 13
    rounded: int = 2
    side: int = 4


_STANDARD = _Resolution()


def film_resistance(
    outline: Outline, radius: float, e: float, p: float, psi: float, *, fineness: float = 1.0
) -> Matrix6:
    """Resistance of the film between a body and the wall of a tube, per unit of viscosity, m, m^2 and m^3.

    Args:
        outline: outline of the body.
        radius: R of the tube, m.
        e: offset of the body's middle from the tube's axis, m, at least 0.
        p: pitch, rad, positive where the nose points away from the wall.
        psi: yaw, rad, positive where the nose points to +y.
        fineness: factor of the polynomial degrees, to show their convergence.

    Returns:
        R in frame F about the body's middle: force and torque on the body are -mu R (U, Omega).

    Raises:
        InputError: the body touches the wall, or its outline is of no known kind.
    """
    return resistance_of(FilmBody.of(outline), radius, e, p, psi, fineness=fineness)


def resistance_of(body: FilmBody, radius: float, e: float, p: float, psi: float, *, fineness: float = 1.0) -> Matrix6:
    """Resistance of the film of a body that was read already; arguments and answer of `film_resistance`."""
    place = _Place(body, radius, e, frame(p, psi))
    grid = _STANDARD._replace(along=round(fineness * _STANDARD.along), around=round(fineness * _STANDARD.around))
    surface = _spheroid(place, grid) if body.half else _with_side(place, grid)
    stiffness, loads, resistance = _assembled(place, surface, _element(grid.along), _halves(grid.around))
    elements, rows, columns = loads.shape[:3]
    inner = (rows - 2) * columns  # unknowns that no other element has
    size = rows * columns
    stiffness, loads = stiffness.reshape(elements, size, size), loads.reshape(elements, size, 6)
    # What the ends of the elements are left with when their insides are eliminated; 0 at both edges.
    ends = np.zeros((elements + 1, columns, elements + 1, columns))
    push = np.zeros((elements + 1, columns, 6))
    for k in range(elements):
        factor = cholesky(stiffness[k, :inner, :inner], lower=True, check_finite=False)
        coupled = np.hstack([stiffness[k, :inner, inner:], loads[k, :inner]])
        solved = solve_triangular(factor, coupled, lower=True, check_finite=False)
        link, flow = solved[:, :-6], solved[:, -6:]
        resistance += flow.T @ flow
        left = (stiffness[k, inner:, inner:] - link.T @ link).reshape(2, columns, 2, columns)
        ends[k : k + 2, :, k : k + 2] += left
        push[k : k + 2] += (loads[k, inner:] - link.T @ flow).reshape(2, columns, 6)
    size = (elements - 1) * columns
    factor = cholesky(ends[1:-1, :, 1:-1].reshape(size, size), lower=True, check_finite=False)
    flow = solve_triangular(factor, push[1:-1].reshape(size, 6), lower=True, check_finite=False)
    return np.asarray(resistance + flow.T @ flow)


def _assembled(place: _Place, surface: _Surface, along: _Basis, around: _Basis) -> tuple[Samples, Samples, Samples]:
    """Stiffness (elements, n_u, n_v, n_u, n_v), loads (elements, n_u, n_v, 6) and the shear's resistance."""
    points, normals, by_u, by_v = surface
    h = place.clearance(points)
    if not h.min() > 0:
        raise InputError(_TOUCHES)
    normal = np.cross(by_u, by_v)
    squared = np.einsum("abi,abi->ab", normal, normal)
    to_u, to_v = np.cross(by_v, normal), np.cross(normal, by_u)  # gradients of u and v
    to_u, to_v = to_u / squared[..., None], to_v / squared[..., None]
    weights = np.resize(along.weights, h.shape[0])
    element = weights[:, None] * around.weights * np.sqrt(squared)
    mobility = element * h**3 / 12.0
    uu, vv, uv = (
        mobility * np.einsum("abi,abi->ab", one, other) for one, other in ((to_u, to_u), (to_v, to_v), (to_u, to_v))
    )
    n_u, n_v, n_q = along.values.shape[1], around.values.shape[1], along.nodes.size
    count = h.shape[0] // n_q
    slopes, values, mixed, swapped = around.pairs
    right = np.stack([part @ pairs for part, pairs in ((uu, values), (vv, slopes), (uv, swapped), (uv, mixed))])
    right = right.reshape(4, count, n_q, -1).swapaxes(0, 1).reshape(count, 4 * n_q, -1)
    stiffness = along.pairs.reshape(4 * n_q, -1).T @ right
    stiffness = stiffness.reshape(count, n_u, n_u, n_v, n_v).transpose(0, 1, 3, 2, 4)
    unit = np.eye(3)
    motions = np.concatenate([np.broadcast_to(unit, (*h.shape, 3, 3)), np.cross(unit, points[:, :, None, :])], axis=2)
    through = motions @ normals[..., None]
    tangential = motions - through * normals[:, :, None, :]
    half = (0.5 * element * h)[..., None]

    def tested(density: Samples, one: Samples, other: Samples) -> Samples:
        rings = np.tensordot(other, density, axes=(0, 1)).reshape(n_v, count, n_q, 6)
        return np.tensordot(one, rings, axes=(0, 2)).transpose(2, 0, 1, 3)

    loads = (
        tested(half * (motions @ to_u[..., None])[..., 0], along.slopes, around.values)
        + tested(half * (motions @ to_v[..., None])[..., 0], along.values, around.slopes)
        + tested(element[..., None] * through[..., 0], along.values, around.values)
    )
    thin = 1.0 / (1.0 + (h / (_SHEARED * place.body.radius)) ** 2)
    sheared = (tangential * np.sqrt(element * thin / h)[..., None, None]).swapaxes(0, 2).reshape(6, -1)
    return stiffness, loads, sheared @ sheared.T


def _with_side(place: _Place, grid: _Resolution) -> _Surface:
    """The film of a body with a straight side, from the rear to the front."""
    body = place.body
    a, lift = body.radius, place.axes[2, 0]
    reduced = a * place.tube / (place.tube - a)
    shoulders = (body.rear, body.front)
    gaps = [place.gap(x) for x, _ in shoulders]
    # of the rounded ends too, which may be turned to the wall
    nearest = [
        gap - f * (1.0 - np.sqrt(1.0 - min(outward * lift, 0.0) ** 2))
        for (_, f), gap, outward in zip(shoulders, gaps, (-1.0, 1.0), strict=True)
    ]
    if not min(*gaps, *nearest) > 0:
        raise InputError(_TOUCHES)
    thinnest = 1.0 / np.hypot(1.0 / nearest[0], 1.0 / nearest[1])
    width = float(np.sqrt(2.0 * thinnest * reduced) / a)
    around = _stretched(_halves(grid.around).nodes, -_HALF, _HALF, ((0.0, width),))
    element = _element(grid.along)
    marks = tuple(
        (x, float(1.0 / (1.0 / np.sqrt(2.0 * gap * reduced) + abs(lift) / gap)))
        for (x, _), gap in zip(shoulders, gaps, strict=True)
    )
    nodes = _cut(element, grid.side)[0]
    x = _stretched(nodes, body.rear[0], body.front[0], marks)
    zero, one = np.zeros_like(nodes), np.ones_like(nodes)
    parts = [_revolved(place, around, x.slope / grid.side, (x.at, a * one), (one, zero), (zero, one))]
    for (joint, f), gap, outward in zip(shoulders, nearest, (-1.0, 1.0), strict=True):
        if f == 0:
            continue
        low, high = (0.0, ROUNDED) if outward > 0 else (-ROUNDED, 0.0)
        mark = (-float(np.arcsin(lift)), float(np.sqrt(2.0 * gap / f)))
        angle = _stretched(_cut(element, grid.rounded)[0], low, high, (mark,))
        sin, cos = np.sin(angle.at), np.cos(angle.at)
        outline = (joint + f * sin, a - f + f * cos)
        end = _revolved(place, around, angle.slope / grid.rounded, outline, (f * cos, -f * sin), (sin, cos))
        parts.insert(0 if outward < 0 else len(parts), end)
    return _Surface(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))


def _revolved(
    place: _Place,
    around: _Stretched,
    rate: Samples,
    outline: tuple[Samples, Samples],
    tangent: tuple[Samples, Samples],
    normal: tuple[Samples, Samples],
) -> _Surface:
    """Surface of revolution of an outline (x, rho) with its tangent by s and unit normal; `rate` is ds/du."""
    turn, turning = place.bottom(outline[0])
    fade = 1.0 - (around.at / _HALF) ** 2  # the edges stay where they are
    theta = around.at + turn[:, None] * fade
    by_v = around.slope * (1.0 - turn[:, None] * 2.0 * around.at / _HALF**2)
    by_u = ((turning * tangent[0])[:, None] * fade) * rate[:, None]
    sin, cos = np.sin(theta), np.cos(theta)
    rho = outline[1][:, None]
    zero = np.zeros_like(sin)
    radial = np.stack([zero, sin, -cos], axis=-1)
    hoop = np.stack([zero, cos, sin], axis=-1)
    axis = np.array([1.0, 0.0, 0.0])

    def meridian(pair: tuple[Samples, Samples]) -> Samples:
        return pair[0][:, None, None] * axis + pair[1][:, None, None] * radial

    return _Surface(
        meridian(outline),
        meridian(normal),
        meridian(tangent) * rate[:, None, None] + (rho * by_u)[..., None] * hoop,
        (rho * by_v)[..., None] * hoop,
    )


def _spheroid(place: _Place, grid: _Resolution) -> _Surface:
    """The film of a spheroid: a patch of the stretched unit sphere about its nearest point."""
    body = place.body
    stretch = np.array([body.half, body.radius, body.radius])
    facing = -place.axes[2]
    nearest = stretch * facing
    turn = np.arctan2(nearest[0], -nearest[2])

    def patch(beta: Samples, theta: Samples) -> _Surface:
        (sb, cb), (st, ct) = (np.sin(beta)[:, None], np.cos(beta)[:, None]), (np.sin(theta), np.cos(theta))
        zero = np.zeros(np.broadcast_shapes(sb.shape, st.shape))
        c, s = np.cos(turn), np.sin(turn)

        def turned(x: Samples, y: Samples, z: Samples) -> Samples:
            return np.stack([zero + c * x - s * z, zero + y, zero + s * x + c * z], axis=-1)

        sphere = turned(sb, cb * st, -cb * ct)
        normals = sphere / stretch
        normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
        along, across = turned(cb, -sb * st, sb * ct), turned(0.0 * sb, cb * ct, cb * st)
        return _Surface(stretch * sphere, normals, stretch * along, stretch * across)

    step = 0.05
    probe = np.array([-step, 0.0, step])
    h = place.clearance(patch(probe, probe).points)
    if h[1, 1] <= 0:
        raise InputError(_TOUCHES)
    bends = [(h[0, 1] + h[2, 1] - 2 * h[1, 1]) / step**2, (h[1, 0] + h[1, 2] - 2 * h[1, 1]) / step**2]
    pieces = 2 * grid.rounded
    nodes = (_cut(_element(grid.along), pieces)[0], _halves(grid.around).nodes)
    beta, theta = (
        _stretched(unit, -_PATCH, _PATCH, ((0.0, float(np.sqrt(2.0 * h[1, 1] / bend))),))
        for unit, bend in zip(nodes, bends, strict=True)
    )
    surface = patch(beta.at, theta.at)
    return surface._replace(
        along=surface.along * beta.slope[:, None, None] / pieces, across=surface.across * theta.slope[:, None]
    )
