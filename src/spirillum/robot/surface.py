"""Closed surfaces of triangles: solids of revolution, round rods, and round wires along a curve."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from spirillum.arrays import Samples, Whole
from spirillum.errors import check_memory
from spirillum.robot.outline import Outline, Piece, Segment, Smooth

Faces: TypeAlias = Whole
"""Whole numbers, such as the three vertices of each triangle, counter-clockwise as seen from outside."""

_LEAST_AROUND = 3
_SHADED = 2100.0  # memory of a triangle while its normals are averaged with its neighbours', bytes


class Surface(NamedTuple):
    """A closed surface of triangles, outward oriented, made of consecutive bands."""

    vertices: Samples
    faces: Faces
    band: Faces  #: Index of each triangle's band, from the first pole to the last, (m,).
    sector: Faces  #: Index of each triangle's sector around the axis, (m,).


class OutlinePoints(NamedTuple):
    """Points of an outline from its front pole to its rear pole."""

    x: Samples  #: m, (k,).
    rho: Samples  #: Distance from the axis, m; zero at both poles, (k,).
    flat: tuple[bool, ...]  #: Whether each band, from a point to the next, is in a plane perpendicular to the axis.


def profile_of(outline: Outline, around: int, cuts: Sequence[float] = ()) -> OutlinePoints:
    """Points along an outline: on an arc in proportion to its angle, on a line only its ends."""
    x: list[Samples] = []
    rho: list[Samples] = []
    flat: list[bool] = []
    for piece in outline.pieces:
        count = 1
        if not isinstance(piece, Segment):
            count = max(2, len(piece.edges) - 1, int(np.ceil(around * piece.turn / (2.0 * np.pi))))
        t: Samples = np.linspace(0.0, 1.0, count + 1)
        for cut in cuts:
            t = _with_cut(t, _parameter(piece, cut))
        here_x, here_rho = piece.points(t)
        first = 1 if x else 0  # pieces share their ends
        x.append(here_x[first:])
        rho.append(here_rho[first:])
        flat += [isinstance(piece, Segment) and piece.start[0] == piece.end[0]] * (len(t) - 1)
    all_rho = np.concatenate(rho)
    all_rho[[0, -1]] = 0.0
    return OutlinePoints(np.concatenate(x), all_rho, tuple(flat))


def _parameter(piece: Piece, x: float) -> float:
    """Parameter (0 to 1) at which the piece passes x; NaN where it does not."""
    if isinstance(piece, Segment):
        run = piece.end[0] - piece.start[0]
        return (x - piece.start[0]) / run if run != 0 else float("nan")
    if isinstance(piece, Smooth):
        t, along, _ = piece.fine
        return float(np.interp(x, along[::-1], t[::-1], left=np.nan, right=np.nan))
    cosine = (x - piece.centre[0]) / piece.semi_axes[0]
    if abs(cosine) > 1.0:
        return float("nan")
    return float((np.arccos(cosine) - piece.angles[0]) / (piece.angles[1] - piece.angles[0]))


def _with_cut(t: Samples, cut: float) -> Samples:
    """The parameters with one more; it replaces an inner one nearby, so that no band is a sliver."""
    if not 1e-9 < cut < 1.0 - 1e-9:
        return t
    inner = t[1:-1]
    kept = inner[np.abs(inner - cut) > 0.3 / (len(t) - 1)]
    return np.sort(np.concatenate([t[:1], kept, t[-1:], np.full(1, cut)]))


def revolved(profile: OutlinePoints, around: int, start: float = 0.0) -> Surface:
    """The surface of a solid of revolution about the x axis."""
    around = max(around, _LEAST_AROUND)
    angle = start + 2.0 * np.pi * np.arange(around) / around
    x, rho = profile.x[1:-1, None], profile.rho[1:-1, None]
    rings = np.stack(np.broadcast_arrays(x, -rho * np.sin(angle), rho * np.cos(angle)), axis=-1)
    poles = np.zeros((2, 3))
    poles[:, 0] = profile.x[[0, -1]]
    return _closed(poles[0], rings, poles[1])


def rod(start: Samples, end: Samples, radius: float, around: int, *, round_start: bool, round_end: bool) -> Surface:
    """A round rod from one point to another, its ends flat, or balls about those points."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    ball = 0.5 * np.pi * (np.arange(1, max(2, around // 4)) / max(2, around // 4))
    x, rho = [np.array([length])], [np.array([radius])]
    if round_end:
        x.insert(0, length + radius * np.cos(ball))
        rho.insert(0, radius * np.sin(ball))
    x.append(np.zeros(1))
    rho.append(np.array([radius]))
    if round_start:
        x.append(-radius * np.cos(ball[::-1]))
        rho.append(radius * np.sin(ball[::-1]))
    tips = length + (radius if round_end else 0.0), -radius if round_start else 0.0
    profile = OutlinePoints(
        np.concatenate([[tips[0]], *x, [tips[1]]]), np.concatenate([[0.0], *rho, [0.0]]), (False,) * (len(x) + 1)
    )
    surface = revolved(profile, around)
    along = axis / length
    across = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    across /= np.linalg.norm(across)
    frame = np.stack([along, across, np.cross(along, across)])
    return surface._replace(vertices=start + surface.vertices @ frame)


def swept(points: Samples, tangents: Samples, radius: float, around: int) -> Surface:
    """The surface of a round wire along a curve, its ends cut square."""
    around = max(around, _LEAST_AROUND)
    least = np.argmin(np.abs(tangents), axis=1)
    some = np.cross(tangents, np.eye(3)[least])  # any vector perpendicular to the curve will do
    some = some / np.linalg.norm(some, axis=-1, keepdims=True)
    # The cross-sections follow a rotation-minimizing frame, computed by double reflection
    # (Wang, Juettler, Zheng and Liu, ACM Trans. Graph. 27:2, 2008).
    chord, own = np.diff(points, axis=0), some[:-1]
    carried, turned = _reflected(own, chord), _reflected(tangents[:-1], chord)
    carried = _reflected(carried, tangents[1:] - turned)
    other = np.cross(tangents[1:], some[1:])
    twist = np.arctan2(np.sum(carried * other, axis=1), np.sum(carried * some[1:], axis=1))
    angle = np.concatenate([np.zeros(1), np.cumsum(twist)])[:, None] - 2.0 * np.pi * np.arange(around) / around
    across = np.cos(angle)[..., None] * some[:, None]
    across = across + np.sin(angle)[..., None] * np.cross(tangents, some)[:, None]
    return _closed(points[0], points[:, None] + radius * across, points[-1])


def _reflected(vectors: Samples, normals: Samples) -> Samples:
    """Mirror images in the planes across `normals`; a zero normal leaves its vector."""
    square = np.sum(normals**2, axis=1)
    share = np.sum(vectors * normals, axis=1) / np.where(square > 0, square, 1.0)
    image: Samples = vectors - 2.0 * share[:, None] * normals
    return image


def _closed(first: Samples, rings: Samples, last: Samples) -> Surface:
    """Rings of vertices (k, n, 3), counter-clockwise seen from the first pole, joined to each other and the poles."""
    count, around = rings.shape[:2]
    vertices = np.concatenate([first[None], rings.reshape(-1, 3), last[None]])
    here, sector = np.arange(around), np.arange(around)
    beside = np.roll(here, -1)
    ring = 1 + around * np.arange(count)[:, None]
    a, b = ring[:-1] + here, ring[:-1] + beside
    d, c = ring[1:] + here, ring[1:] + beside
    front = np.stack([np.zeros_like(here), ring[0] + here, ring[0] + beside], axis=-1)
    rear = np.stack([ring[-1] + here, np.full_like(here, len(vertices) - 1), ring[-1] + beside], axis=-1)
    sides = np.stack([np.stack([a, d, b], axis=-1), np.stack([b, d, c], axis=-1)], axis=2).reshape(-1, 3)
    bands = np.repeat(np.arange(1, count), 2 * around)
    return Surface(
        vertices,
        np.concatenate([front, sides, rear]),
        np.concatenate([np.zeros(around, dtype=bands.dtype), bands, np.full(around, count)]),
        np.concatenate([sector, np.tile(np.repeat(sector, 2), count - 1), sector]),
    )


def mass_properties(vertices: Samples, faces: Faces) -> tuple[float, Samples, float]:
    """Volume (m^3), centroid of the volume (m, (3,)) and area (m^2) of a closed, outward oriented surface."""
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    a, b, c = np.moveaxis((vertices - middle)[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    six = np.sum(a * normal, axis=1)
    volume = float(np.sum(six)) / 6.0
    centroid = np.sum(six[:, None] * (a + b + c), axis=0) / (24.0 * volume)
    return volume, centroid + middle, 0.5 * float(np.sum(np.linalg.norm(normal, axis=1)))


def corner_normals(vertices: Samples, faces: Faces, crease: float) -> Samples:
    """Unit normals for smooth shading at the corners of each triangle, (m, 3, 3); sharp edges stay sharp."""
    # The mean over the triangles around a vertex, weighted by area, whose normals deviate from the corner's own by no
    # more than the crease angle.
    check_memory("smooth shading", len(faces), "triangles", _SHADED, "as with a smaller fineness")
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    area: Samples = np.cross(b - a, c - a)
    unit = _unit_or_zero(area)
    vertex = faces.ravel()
    order = np.argsort(vertex, kind="stable")
    owner = order // 3  # the triangles around each vertex, one vertex after the other
    count = np.bincount(vertex, minlength=len(vertices))
    first = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(count)[:-1]])
    around = count[vertex[order]]
    corner = np.repeat(np.arange(order.size), around)
    start = np.repeat(first[vertex[order]], around)
    step = np.arange(corner.size) - np.repeat(np.cumsum(around) - around, around)
    other = owner[start + step]
    near = np.sum(unit[owner[corner]] * unit[other], axis=1) >= np.cos(crease)
    total: Samples = np.stack(
        [np.bincount(corner, np.where(near, area[other, axis], 0.0), order.size) for axis in range(3)], axis=-1
    )
    found: Samples = np.empty_like(total)
    found[order] = _unit_or_zero(total)
    return found.reshape(-1, 3, 3)


def _unit_or_zero(vectors: Samples) -> Samples:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


def linear_light(colours: Samples) -> Samples:
    """Linear light of sRGB colours, both 0 to 1 (IEC 61966-2-1)."""
    colours = np.asarray(colours, dtype=float)
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
