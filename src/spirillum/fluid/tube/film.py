"""Reynolds film between a body of revolution and the wall of a circular tube.

Lubrication with the true distance h from the body's surface to the wall and the body's true normal n: the pressure p
of a rigid motion v = U + Omega x r (viscosity 1, wall at rest) obeys on the body's surface

    div(h^3/12 grad p) = div(h v_t/2) - v.n,    p = 0 on the edges of the film,

with v_t the tangential part of v, and the resistance is the dissipation of pressure and shear,

    R_ij = int h^3/12 grad p_i . grad p_j + v_ti . v_tj/h dA,

which is symmetric and positive definite. The edges of the film are fixed on the body: the half circle that faces the
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
    """Polynomials on [-1, 1] at Gauss points, and their products in pairs."""

    nodes: Samples
    weights: Samples
    values: Samples
    """(points, functions): two that are 1 at one end, then bubbles; without the first two if both ends are 0."""
    slopes: Samples
    pairs: Samples
    """Products of slopes with slopes, values with values, slopes with values, values with slopes:
    (4, points, functions^2)."""


@lru_cache(maxsize=32)
def _basis(degree: int, *, bubbles: bool) -> _Basis:
    nodes, weights = np.polynomial.legendre.leggauss(degree + 4)
    legendre = np.polynomial.legendre.legvander(nodes, degree)
    k = np.arange(2, degree + 1)
    values = (legendre[:, 2:] - legendre[:, :-2]) / np.sqrt(4.0 * k - 2.0)
    slopes = legendre[:, 1:-1] * np.sqrt(k - 0.5)
    if not bubbles:
        values = np.column_stack([0.5 * (1.0 - nodes), 0.5 * (1.0 + nodes), values])
        slopes = np.column_stack([np.full_like(nodes, -0.5), np.full_like(nodes, 0.5), slopes])
    pairs = [
        (one[:, :, None] * other[:, None, :]).reshape(nodes.size, -1)
        for one, other in ((slopes, slopes), (values, values), (slopes, values), (values, slopes))
    ]
    return _Basis(nodes, weights, values, slopes, np.stack(pairs))


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
    """Polynomial degrees."""

    rounded: int = 12
    side: int = 16
    around: int = 22


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
    degrees = _Resolution(*(max(2, round(fineness * degree)) for degree in _STANDARD))
    surfaces = _spheroid(place, degrees) if body.half else _with_side(place, degrees)
    around = _basis(degrees.around, bubbles=True)
    columns, total = around.values.shape[1], sum(basis.values.shape[1] for basis, _ in surfaces) - len(surfaces) - 1
    matrix = np.zeros((total, columns, total, columns))
    loads = np.zeros((total, columns, 6))
    resistance = np.zeros((6, 6))
    start = -1  # of the function that is 1 at the rear edge, which the film has not
    for basis, surface in surfaces:
        inner = basis.values.shape[1] - 2
        rows = np.concatenate([[start, start + inner + 1], np.arange(start + 1, start + inner + 1)])
        kept = np.flatnonzero((rows >= 0) & (rows < total))
        stiffness, load, shear = _assembled(place, surface, basis, around)
        into = rows[kept]
        matrix[np.ix_(into, range(columns), into, range(columns))] += stiffness[
            np.ix_(kept, range(columns), kept, range(columns))
        ]
        loads[into] += load[kept]
        resistance += shear
        start += inner + 1
    size = total * columns
    factor = cholesky(matrix.reshape(size, size), lower=True, overwrite_a=True, check_finite=False)
    flow = solve_triangular(factor, loads.reshape(size, 6), lower=True, check_finite=False)
    return resistance + flow.T @ flow


def _assembled(place: _Place, surface: _Surface, basis: _Basis, around: _Basis) -> tuple[Samples, Samples, Samples]:
    """Stiffness (n_u, n_v, n_u, n_v), loads (n_u, n_v, 6) and resistance of shear of one part of the surface."""
    points, normals, along, across = surface
    h = place.clearance(points)
    if not h.min() > 0:
        raise InputError("the body touches the wall of the tube")
    area = np.einsum("abi,abi->ab", np.cross(along, across), normals)
    area = np.abs(area)
    to_u, to_v = np.cross(across, normals), np.cross(normals, along)  # gradients of u and v, times the area
    sign = np.sign(np.einsum("abi,abi->ab", to_u, along))[..., None]
    to_u, to_v = sign * to_u / area[..., None], sign * to_v / area[..., None]
    element = basis.weights[:, None] * around.weights * area
    mobility = element * h**3 / 12.0
    uu = mobility * np.einsum("abi,abi->ab", to_u, to_u)
    vv = mobility * np.einsum("abi,abi->ab", to_v, to_v)
    uv = mobility * np.einsum("abi,abi->ab", to_u, to_v)
    left = np.concatenate(basis.pairs)
    right = np.concatenate([uu @ around.pairs[1], vv @ around.pairs[0], uv @ around.pairs[3], uv @ around.pairs[2]])
    n_u, n_v = basis.values.shape[1], around.values.shape[1]
    stiffness = (left.T @ right).reshape(n_u, n_u, n_v, n_v).transpose(0, 2, 1, 3)
    unit = np.eye(3)
    motions = np.concatenate([np.broadcast_to(unit, (*h.shape, 3, 3)), np.cross(unit, points[:, :, None, :])], axis=2)
    through = motions @ normals[..., None]
    tangential = motions - through * normals[:, :, None, :]
    half = (0.5 * element * h)[..., None]
    by_u = half * (motions @ to_u[..., None])[..., 0]
    by_v = half * (motions @ to_v[..., None])[..., 0]
    squeeze = element[..., None] * through[..., 0]
    loads = (
        np.einsum("ai,bj,abm->ijm", basis.slopes, around.values, by_u, optimize=True)
        + np.einsum("ai,bj,abm->ijm", basis.values, around.slopes, by_v, optimize=True)
        + np.einsum("ai,bj,abm->ijm", basis.values, around.values, squeeze, optimize=True)
    )
    flat = (tangential * np.sqrt(element / h)[..., None, None]).transpose(2, 0, 1, 3).reshape(6, -1)
    return stiffness, loads, flat @ flat.T


def _with_side(place: _Place, degrees: _Resolution) -> list[tuple[_Basis, _Surface]]:
    """Parts of the film of a body with a straight side, from the rear to the front."""
    body = place.body
    a, tilt = body.radius, abs(place.axes[2, 0])
    reduced = a * place.tube / (place.tube - a)
    gaps = [place.gap(body.rear[0]), place.gap(body.front[0])]
    if min(gaps) <= 0:
        raise InputError("the body touches the wall of the tube")
    lowest = []
    for (_, f), gap, outward in ((body.rear, gaps[0], -1.0), (body.front, gaps[1], 1.0)):
        down = max(-outward * place.axes[2, 0], 0.0)
        lowest.append(gap - f * (1.0 - np.sqrt(1.0 - down**2)))
    thinnest = 1.0 / np.hypot(1.0 / lowest[0], 1.0 / lowest[1])
    if min(lowest) <= 0:
        raise InputError("the body touches the wall of the tube")
    widths = [np.sqrt(2.0 * gap * reduced) for gap in gaps]
    marks = tuple(
        (x, 1.0 / (1.0 / width + tilt / gap))
        for (x, _), width, gap in zip((body.rear, body.front), widths, gaps, strict=True)
    )
    around = _stretched(
        _basis(degrees.around, bubbles=True).nodes,
        -_HALF,
        _HALF,
        ((0.0, float(np.sqrt(2.0 * thinnest * reduced) / a)),),
    )
    parts = []
    basis = _basis(degrees.side, bubbles=False)
    x = _stretched(basis.nodes, body.rear[0], body.front[0], marks)
    flat = np.zeros_like(x.at)
    side = (basis, _revolved(place, around, x.at, x.slope, (x.at, flat + a), (flat + 1.0, flat), (flat, flat + 1.0)))
    for (joint, f), gap, outward in ((body.rear, lowest[0], -1.0), (body.front, lowest[1], 1.0)):
        if f == 0:
            continue
        basis = _basis(degrees.rounded, bubbles=False)
        # the nearest point, where the end is turned to the wall
        nearest = -np.arcsin(place.axes[2, 0])
        low, high = (0.0, ROUNDED) if outward > 0 else (-ROUNDED, 0.0)
        angle = _stretched(basis.nodes, low, high, ((float(nearest), float(np.sqrt(2.0 * gap / f))),))
        sin, cos = np.sin(angle.at), np.cos(angle.at)
        outline = (joint + f * sin, body.radius - f + f * cos)
        # the bottom line turns with the joint's, as far as the film reaches
        surface = _revolved(place, around, outline[0], angle.slope, outline, (f * cos, -f * sin), (sin, cos))
        parts.append((outward, (basis, surface)))
    behind = [part for outward, part in parts if outward < 0]
    before = [part for outward, part in parts if outward > 0]
    return [*behind, side, *before]


def _revolved(
    place: _Place,
    around: _Stretched,
    x: Samples,
    rate: Samples,
    outline: tuple[Samples, Samples],
    tangent: tuple[Samples, Samples],
    normal: tuple[Samples, Samples],
) -> _Surface:
    """Surface of revolution of an outline (x, rho) with its tangent by s and unit normal; `rate` is ds/du."""
    turn, turning = place.bottom(x)
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


def _spheroid(place: _Place, degrees: _Resolution) -> list[tuple[_Basis, _Surface]]:
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
        raise InputError("the body touches the wall of the tube")
    bends = [(h[0, 1] + h[2, 1] - 2 * h[1, 1]) / step**2, (h[1, 0] + h[1, 2] - 2 * h[1, 1]) / step**2]
    basis, around = _basis(degrees.side, bubbles=False), _basis(degrees.around, bubbles=True)
    beta, theta = (
        _stretched(nodes, -_PATCH, _PATCH, ((0.0, float(np.sqrt(2.0 * h[1, 1] / bend))),))
        for nodes, bend in zip((basis.nodes, around.nodes), bends, strict=True)
    )
    surface = patch(beta.at, theta.at)
    return [
        (
            basis,
            surface._replace(
                along=surface.along * beta.slope[:, None, None], across=surface.across * theta.slope[:, None]
            ),
        )
    ]
