"""Lubrication film (Reynolds' equation) between a body of revolution and the wall of a circular tube.

Lubrication with the body's true normal n and the true distance h between body and wall, the geometric mean of those
along the normals of either; lengths are those midway. The pressure p of a rigid motion v = U + Omega x r (viscosity 1,
wall at rest) obeys

    div(h^3/12 grad p) = div(h v_t/2) - v.n J,    p = 0 on the edges of the film,

with v_t the part of v along the body's surface and J the body's area over that midway. The resistance is the
dissipation of pressure and shear,

    R_ij = int h^3/12 grad p_i . grad p_j + g v_ti . v_tj/h dA,    g = 1/(1 + (h/0.2 a)^2),

which is symmetric and positive definite. Shear counts where the film is thin: with that of the whole half circle taken
away, the rest of a robot's resistance would not be positive definite. The edges of the film are fixed on the body: the
half circle that faces the wall, along the straight side and 0.7 rad of rounded ends; a spheroid's film is a patch about
its nearest point.

p is expanded in polynomials (Galerkin) of coordinates that stretch the bottom line, the shoulders and the nearest
point, so that films of any thickness cost the same.

Frame F: x' along the body's axis, y' level, z' = x' x y'. The body's middle lies at the offset e below the tube's axis;
the axis is (cos p cos psi, cos p sin psi, sin p) in (along the tube, to the side, towards the tube's axis).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Matrix6, Samples
from spirillum.errors import InputError
from spirillum.fluid.tube.film_surface import TOUCHES, Cuts, FilmBody, FilmSurface, Place, film_surface, frame
from spirillum.kernels import core
from spirillum.kernels import tube_table as table
from spirillum.robot.outline import Outline
from spirillum.units import show

_EXTRA = 3  # Gauss points of an element beyond its polynomials' degree.
_ROUNDING = 1e-13
"""What is added to the stiffness's diagonal, over it: where mobilities differ by 1e15 in one element, rounding leaves
it without a Cholesky factor."""
_SHEARED = 0.2
"""Thickness over the body's radius above which the shear of the gap is left out: it is no lubrication film."""
_THINNEST, _INTERVALS, _YAWS = 2e-5, 15, 5
"""Thinnest clearance of a table over the body's radius, intervals of its splines, polynomials in yaw."""
_LEAST_YAW = 0.03  # Coordinate of the smallest yaw at the nodes of a table.
_STEEPEST = 0.5  # Largest sine of pitch at the nodes of a table.
_LESS = 0.97  # Ratio of one inclination to the one before where the body touches.
_SHORTEST = 0.3  # Shortest straight side over the body's radius for which a table's coordinates serve.
_SPHEROID_PITCH = 0.6  # Largest pitch of a spheroid's table, rad.


class _Basis(NamedTuple):
    """Continuous piecewise polynomials on [-1, 1] at Gauss points."""

    nodes: Samples
    weights: Samples
    values: Samples  #: (points, functions).
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


class _Resolution(NamedTuple):
    """Degree of polynomials along and around the body; elements of equal length in the stretched coordinates."""

    along: int = 10
    around: int = 16
    rounded: int = 2
    side: int = 4


_STANDARD = _Resolution()


def film_resistance(
    outline: Outline, radius: float, e: float, p: float, psi: float, *, fineness: float = 1.0
) -> Matrix6:
    """R/mu of the lubrication film in frame F about the body's middle; p is off the wall, psi to +y."""
    return resistance_of(FilmBody.of(outline), radius, e, p, psi, fineness=fineness)


def resistance_of(body: FilmBody, radius: float, e: float, p: float, psi: float, *, fineness: float = 1.0) -> Matrix6:
    """Resistance of the lubrication film of a preprocessed body; arguments and result of `film_resistance`."""
    from scipy.linalg import cholesky, solve_triangular

    place = Place(body, radius, e, frame(p, psi))
    grid = _STANDARD._replace(along=round(fineness * _STANDARD.along), around=round(fineness * _STANDARD.around))
    along, around = _element(grid.along), _halves(grid.around)
    pieces = (grid.side, grid.rounded, 2 * grid.rounded)
    points = [_cut(along, count)[0] for count in pieces]
    cuts = Cuts(points[0], pieces[0], points[1], pieces[1], points[2], pieces[2], around.nodes)
    stiffness, loads, resistance = _assembled(place, film_surface(place, cuts), along, around)
    elements, rows, columns = loads.shape[:3]
    inner = (rows - 2) * columns  # unknowns that no other element has
    size = rows * columns
    stiffness, loads = stiffness.reshape(elements, size, size), loads.reshape(elements, size, 6)
    stiffness[:, np.arange(size), np.arange(size)] *= 1.0 + _ROUNDING
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


def _assembled(place: Place, surface: FilmSurface, along: _Basis, around: _Basis) -> tuple[Samples, Samples, Samples]:
    """Stiffness (elements, n_u, n_v, n_u, n_v), loads (elements, n_u, n_v, 6) and the shear's resistance."""
    points, normals, by_u, by_v, *turning = surface
    h = place.thickness(points, normals)
    if not h.min() > 0:
        raise InputError(TOUCHES)
    displaced = np.linalg.norm(np.cross(by_u, by_v), axis=-1)
    by_u, by_v = (by + 0.5 * h[..., None] * turn for by, turn in zip((by_u, by_v), turning, strict=True))
    normal = np.cross(by_u, by_v)
    squared = np.einsum("abi,abi->ab", normal, normal)
    to_u, to_v = np.cross(by_v, normal), np.cross(normal, by_u)  # gradients of u and v
    to_u, to_v = to_u / squared[..., None], to_v / squared[..., None]
    weights = np.resize(along.weights, h.shape[0])
    weights = weights[:, None] * around.weights
    element = weights * np.sqrt(squared)
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
    loads = (
        _tested(half * (motions @ to_u[..., None])[..., 0], along.slopes, around.values)
        + _tested(half * (motions @ to_v[..., None])[..., 0], along.values, around.slopes)
        + _tested((weights * displaced)[..., None] * through[..., 0], along.values, around.values)
    )
    thin = 1.0 / (1.0 + (h / (_SHEARED * place.body.radius)) ** 2)
    sheared = (tangential * np.sqrt(element * thin / h)[..., None, None]).swapaxes(0, 2).reshape(6, -1)
    return stiffness, loads, sheared @ sheared.T


def _tested(density: Samples, one: Samples, other: Samples) -> Samples:
    """Integrals (elements, n_u, n_v, 6) of densities, at all Gauss points, times functions along and around."""
    n_q = one.shape[0]
    rings = np.tensordot(other, density, axes=(0, 1)).reshape(other.shape[1], -1, n_q, 6)
    return np.asarray(np.tensordot(one, rings, axes=(0, 2)).transpose(2, 0, 1, 3))


@dataclass(frozen=True)
class FilmTable:
    """Resistance of a body's lubrication film in a tube, tabulated over offset, pitch and yaw."""

    packed: Samples
    """Packed form for `kernels.tube_table.film_at`: a head, then the spline coefficients in single precision."""

    @classmethod
    def of(
        cls,
        outline: Outline,
        radius: float,
        *,
        yaw: float = 0.12,
        pitch: float = 0.2,
        intervals: int = _INTERVALS,
        yaws: int = _YAWS,
        step: Callable[[float], None] | None = None,
    ) -> FilmTable:
        """Tabulate the lubrication film of a body up to a yaw and a pitch, rad, in half a minute of one core."""
        body = FilmBody.of(outline)
        head = _head(body, radius, yaw, pitch, intervals)
        head[core.FILM_YAWS] = yaws
        places = np.concatenate([[0.0, 1 / 3], np.arange(1, intervals), [intervals - 1 / 3, intervals]])
        grids = [low + (high - low) * places / intervals for low, high in (head[7:9], head[10:12])]
        etas = np.cos((np.arange(yaws) + 0.5) * 0.5 * np.pi / (yaws - 0.5))  # clustered at 0: most robots are level
        etas[-1] = _LEAST_YAW
        nodes = np.empty((places.size, places.size, yaws, core.FILM_ENTRIES))
        for i, first in enumerate(grids[0]):
            for j, second in enumerate(grids[1]):
                for k, eta in enumerate(etas):
                    e, p, psi = _off_the_wall(body, radius, *_place_of(head, first, second, eta))
                    found = np.empty(5)
                    core.film_coordinates(head, e, p, psi, found)
                    nodes[i, j, k] = _factors(resistance_of(body, radius, e, p, psi), body.radius, found[4])
                    nodes[i, j, k, 0] -= found[3]
            if step is not None:
                step((i + 1) / places.size)
        odd = np.array([False] * 6 + [n < 3 <= m for m in range(6) for n in range(m)])
        nodes[..., odd] /= etas[:, None]
        powers = np.linalg.inv(np.vander(etas**2, increasing=True))
        splines = [
            np.linalg.inv(_collocated(grid, low, high))
            for grid, low, high in zip(grids, head[[7, 10]], head[[8, 11]], strict=True)
        ]
        found = np.einsum("ai,bj,mk,ijkn->abmn", *splines, powers, nodes, optimize=True).astype(np.float32).ravel()
        return cls(np.concatenate([head, np.pad(found, (0, found.size % 2)).view(np.float64)]))

    def at(self, e: float, p: float, psi: float) -> tuple[Matrix6, float]:
        """Resistance at a pose, as of `film_resistance`, and the body's smallest gap, m."""
        out = np.empty((6, 6))
        return out, float(core.film_at(self.packed, e, p, psi, out))


def _head(body: FilmBody, radius: float, yaw: float, pitch: float, intervals: int) -> Samples:
    """Head of a table."""
    a, reach = body.radius, max(-body.rear[0], body.front[0])
    length = body.front[0] - body.rear[0]
    if not radius > a:
        sizes = f"body.diameter = {show(2.0 * a, 'mm')} and channel.diameter = {show(2.0 * radius, 'mm')}"
        raise InputError(f"{sizes}: the body does not fit into the tube; allowed: a wider channel")
    if not body.half and length < _SHORTEST * a:
        raise InputError(
            f"the body's straight side of {show(length, 'mm')} is too short for a table of its lubrication film; "
            f"allowed: at least {_SHORTEST:g} of its radius (body.length, body.profile), or single poses"
        )
    head = np.zeros(core.FILM_SIZE)
    head[:7] = radius, a, body.half, *body.rear, *body.front
    widest = min(2.0 * (radius - a), radius - a + np.sin(pitch) * reach)
    head[core.FILM_FIRST] = core.stretched(_THINNEST * a, a)
    head[core.FILM_LAST] = core.stretched(widest, a)
    head[core.FILM_INTERVALS] = head[core.FILM_SECOND_INTERVALS] = intervals
    head[10:12] = (-_SPHEROID_PITCH, _SPHEROID_PITCH) if body.half else head[7:9]
    room = 1.0 if reach == 0 else min(0.6 * (radius - a) / reach, 1.0)
    head[core.FILM_YAW] = min(yaw, float(np.arcsin(room)))
    return head


def _clearance_of(at: float, radius: float) -> float:
    """Inverse of `stretched`."""
    v = 1e-4 * radius
    for _ in range(100):
        error = core.stretched(v, radius) - at
        if abs(error) < 1e-13:
            break
        v *= np.exp(-error / (1.0 + 2.0 * v / (radius + v)))
    return float(v)


def _place_of(head: Samples, first: float, second: float, eta: float) -> tuple[float, float, float]:
    """Offset, pitch and yaw of coordinates in a table; pitches are cut off at `_STEEPEST`."""
    tube, a, half, rear, _, front, _ = head[:7]
    if half:
        psi = float(np.arcsin(np.sinh(eta * np.arcsinh(np.sin(head[core.FILM_YAW])))))
        e, wanted = 0.0, _clearance_of(first, a)
        for _ in range(4):
            e += core.clearance(head, rear, half, a, 0.0, e, np.sin(second), np.cos(second) * np.sin(psi)) - wanted
        return e, float(second), psi
    length = front - rear
    v = np.array([_clearance_of(first, a), _clearance_of(second, a)])
    scale = core.yaw_scale(head, *v)
    sine = scale * np.sinh(eta * np.arcsinh(np.sin(head[core.FILM_YAW]) / scale))
    v = np.minimum(v, v.min() + _STEEPEST * length)

    lift = (v[1] - v[0]) / length
    e = tube - a - v[0] + rear * lift
    step = 1e-6
    for _ in range(50):
        error = _clearances(head, e, lift, sine) - v
        if np.max(np.abs(error) / v) < 1e-10:
            break
        ahead, behind = (_clearances(head, e + change, lift, sine) for change in (step * a, -step * a))
        by_e = (ahead - behind) / (2.0 * step * a)
        up, down = (_clearances(head, e, lift + change, sine) for change in (step, -step))
        by_lift = (up - down) / (2.0 * step)
        change = np.linalg.solve(np.column_stack([by_e, by_lift]), error)
        e, lift = e - change[0], float(np.clip(lift - change[1], -0.9, 0.9))
    return float(e), float(np.arcsin(lift)), float(np.arcsin(sine))


def _off_the_wall(body: FilmBody, radius: float, e: float, p: float, psi: float) -> tuple[float, float, float]:
    """Node of a table, less inclined where the body would touch the wall: only the splines know it, no robot."""
    least = _THINNEST * body.radius
    most = radius - body.radius - least  # on either side: in a narrow tube nodes reach the wall above the body
    while not body.half and Place(body, radius, e, frame(p, psi)).ends().min() < 0.5 * least:
        e, p, psi = float(np.clip(e, -most, most)), _LESS * p, _LESS * psi
    return e, p, psi


def _clearances(head: Samples, e: float, lift: float, sine: float) -> Samples:
    """Clearances of both shoulders at an offset, with the sines of pitch and yaw."""
    _, a, _, rear, rear_round, front, front_round = head[:7]
    side = float(np.sqrt(1.0 - lift**2) * sine)
    ends = ((rear, rear_round), (front, front_round))
    return np.array([core.clearance(head, x, 0.0, a - f, f, e, lift, side) for x, f in ends])


def _factors(resistance: Matrix6, a: float, angle: float) -> Samples:
    """Logarithms of D and the entries of M of R = M D M', R over powers of a and turned so that z' is the normal."""
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.eye(6)
    turn[0, 0], turn[0, 2], turn[2, 0], turn[2, 2] = cos, -sin, sin, cos
    sizes = np.array([1.0, 1.0, 1.0, a, a, a]) * np.sqrt(a)
    scaled = (turn @ resistance @ turn.T) / np.outer(sizes, sizes)
    factor = np.linalg.cholesky(scaled[np.ix_(table.ORDER, table.ORDER)])
    roots = np.diag(factor)
    return np.concatenate([2.0 * np.log(roots), (factor / roots)[np.tril_indices(6, -1)]])


def _collocated(places: Samples, low: float, high: float) -> Samples:
    """B-splines (columns) at nodes (rows)."""
    count = places.size
    matrix, weights = np.zeros((count, count)), np.empty(4)
    for row, place in enumerate(places):
        start = core.spline_weights(place, low, high, count - 3, weights)
        matrix[row, start : start + 4] = weights
    return matrix
