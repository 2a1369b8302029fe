"""Apparent contour of a body: its silhouette and the front edge of its seal, projected onto the plane through its axis.

A line of sight tangent to the body is continued to the horizontal plane through the motor axis. In the body's frame,
the intersection depends on the position of the lens only, not on tilts, focal length or distortion. The contour is
therefore computed exactly for a grid of lens positions and interpolated by Chebyshev polynomials.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import chebyshev

from spirillum.arrays import Samples
from spirillum.kernels.core import edge_places, edge_points
from spirillum.robot.links import outlines_of
from spirillum.robot.outline import Outline, Segment
from spirillum.robot.robot import Robot
from spirillum.vision.camera.optics import BodyPose, Optics, placed
from spirillum.vision.video import opencv as cv2


@dataclass(frozen=True)
class ContourConstants:
    """Apparent edges of the body: which are used, and the least standard error of each, pixels."""

    front: float = 0.04  #: Error of the front end.
    rear: float = 0.06  #: Error of the rear end of a striped body.
    bare_rear: float = 0.5  #: Error of the rear end of a body without stripes.
    side: float = 0.04  #: Error of the sides.
    striped_side: float = 0.3  #: Error of the sides of the seal, where stripes pass.
    coupling: float = 0.15  #: Error of the coupling's edges.
    seal: float = 0.03  #: Error of the front edge of the seal.
    end_width: float = 0.9  #: Half width of the ends that is used, over the body's radius.
    seal_arc: float = 1.0  #: Angle from the top up to which the seal's edge is used, rad.


CONTOUR = ContourConstants()


GROUPS = ("front", "rear", "left", "right", "seal")
"""Groups of edges: front and rear end, the sides at +y and -y, and the front edge of the seal."""

EDGE_CUES = ("outline", "seal", "coupling")  #: What edges belong to, each a cue of its own to where the body is.

_ORDERS = 7, 4  # orders of the polynomials in the lens's x and y
_NODES = 8, 5  # interpolation nodes in x and y
_AROUND, _PER_TURN = 128, 144
"""Points around the axis, and along a full circle of a profile's arc, from which a silhouette is computed."""


@dataclass(frozen=True)
class Contour:
    """Apparent edge points of a body as functions of the lens's position in the body's frame."""

    group: np.ndarray = field(repr=False)  #: Index into `GROUPS` of each point, (n,).
    normals: Samples = field(repr=False)  #: Approximate outward normals in the plane, in the body's frame, (n, 2).
    floor: Samples = field(repr=False)
    """Least standard error of each point, pixels, (n,): edge profiles vary, most where stripes pass."""
    _factors: Samples = field(repr=False)
    """Chebyshev coefficients of the points with the upper and with the lower rims of flat ends, (a, b, 4, n)."""
    _reach: Samples = field(repr=False)  #: Largest distances of the lens along and across, m, (2,).
    cue: np.ndarray = field(repr=False)  #: Index into `EDGE_CUES` of each point, (n,).

    @property
    def seal(self) -> np.ndarray:
        """Mask of the points that bound the seal, (n,); none without stripes."""
        return np.asarray(self.cue == EDGE_CUES.index("seal"))

    def points(self, pose: BodyPose) -> Samples:
        """Edge points in the plane through the axis, in the body's frame, m, (n, 2)."""
        out = np.empty((len(self.group), 2))
        edge_points(np.array(pose, dtype=float), self._factors, self.normals, self._reach, out)
        return out

    def thinned(self, stride: int) -> Contour:
        """Every `stride`-th of the points."""
        return self.some(np.arange(len(self.group)) % stride == 0)

    def some(self, chosen: np.ndarray) -> Contour:
        """The points of a mask, (n,)."""
        factors = np.ascontiguousarray(self._factors[..., chosen])
        cue = self.cue[chosen]
        return Contour(self.group[chosen], self.normals[chosen], self.floor[chosen], factors, self._reach, cue)

    def places(self, pose: BodyPose, optics: Optics) -> tuple[Samples, Samples, Samples, Samples]:
        """Project the edges into the picture.

        Returns:
            Pixels (n, 2), unit normals in the picture (n, 2), pixels per m along them (n,), and the Jacobian of the
            displacement along each normal by (x, y, heading), pixels per m and per rad (n, 3).
        """
        count = len(self.group)
        found = np.empty((count, 2)), np.empty((count, 2)), np.empty(count), np.empty((count, 3))
        at = np.array(pose, dtype=float)
        edge_places(at, self._factors, self.normals, self._reach, optics.axis_height, optics.numbers, *found)
        return found


def contour_of(robot: Robot, optics: Optics) -> Contour:
    """Compute the apparent contour of a robot's body."""
    robot.check_body("the tracker, which follows the body's outline,")
    outlines = {name: outline for name, outline in outlines_of(robot).items() if name in ("body", "coupling")}
    outline, radius = outlines["body"], 0.5 * robot.body.diameter
    spacing = 1.2 * optics.length_per_pixel
    reach = _reach(robot, optics)
    upright = Optics(optics.size, 1.0, optics.height, optics.axis_height, optics.surface, optics.index)

    def on_plane(points: Samples, x: float, y: float) -> Samples:
        moved = placed(points, BodyPose(-x, -y, 0.0), optics.axis_height)
        found = upright.points(upright.pixels(moved), optics.axis_height)[:, :2]
        return np.asarray(found + np.array([x, y]))

    seal = _seal(robot, radius, max(spacing, 1.8 * radius / 80))
    striped = len(seal) > 0
    wide = np.arange(-CONTOUR.end_width * radius, CONTOUR.end_width * radius, max(spacing, 1.8 * radius / 80))
    behind = wide[np.abs(wide) > 0.5 * robot.coupling.diameter + 1e-3]
    sides = _sides(robot, outlines, spacing)
    kinds = [("front", "outline", wide.size), ("rear", "seal" if striped else "outline", behind.size)]
    cues = {"striped_side": "seal", "coupling": "coupling"}
    for flank in ("left", "right"):
        kinds += [(flank, cues.get(kind, "outline"), stations.size) for _, kind, stations in sides]
    kinds.append(("seal", "seal", len(seal)))
    sizes = [size for _, _, size in kinds]
    count = sum(sizes)
    nodes = [np.cos(np.pi * (np.arange(count) + 0.5) / count) for count in _NODES]
    surfaces = {name: _surface(outline) for name, outline in outlines.items()}
    flats = [(_flat(outline, 0), wide, 1.0), (_flat(outline, -1), behind, -1.0)]

    def edges_at(a: float, b: float) -> Samples:
        """Edge points seen from a place of the lens, with the upper and with the lower rims of flat ends."""
        hulls = {name: _hull(on_plane(surface, a, b)) for name, surface in surfaces.items()}
        lengthwise = {name: _walks(hull, 0) for name, hull in hulls.items()}
        crosswise = _walks(hulls["body"], 1)
        ends: list[list[Samples]] = [[], []]
        for flat, stations, outward in flats:
            if flat is None:
                round_end = np.stack([_outermost(crosswise, stations, outward, 1), stations], axis=1)
            for level, sign in zip(ends, (1.0, -1.0), strict=True):
                # Stripes end at the upper rim, also when the flat end is in view.
                upper = 1.0 if striped and outward < 0.0 else sign
                level.append(round_end if flat is None else _rim(flat, stations, upper, on_plane, a, b))
        common = [
            np.stack([stations, _outermost(lengthwise[part], stations, outward, 0)], axis=1)
            for outward in (1.0, -1.0)
            for part, _, stations in sides
        ]
        common.append(on_plane(seal, a, b))
        return np.stack([np.concatenate(level + common) for level in ends])

    found = np.array([[edges_at(a, b) for b in nodes[1] * reach[1]] for a in nodes[0] * reach[0]])
    basis = np.einsum(
        "ia,jb->ijab", chebyshev.chebvander(nodes[0], _ORDERS[0]), chebyshev.chebvander(nodes[1], _ORDERS[1])
    ).reshape(_NODES[0] * _NODES[1], -1)
    found = np.moveaxis(found, -1, -2)
    factors = np.linalg.lstsq(basis, found.reshape(len(basis), -1), rcond=None)[0]
    factors = np.ascontiguousarray(factors).reshape(*(order + 1 for order in _ORDERS), 4, count)
    group = np.repeat([GROUPS.index(name) for name, _, _ in kinds], sizes)
    # The near and the far rim of a flat end without stripes are easily confused, and move differently.
    rear = "rear" if striped or _flat(outline, -1) is None else "bare_rear"
    trusted = [getattr(CONTOUR, name) for name in ("front", rear, *[kind for _, kind, _ in sides] * 2, "seal")]
    floor = np.repeat(trusted, sizes)
    middle = found[_NODES[0] // 2, _NODES[1] // 2, 0].T
    cue = np.repeat([EDGE_CUES.index(name) for _, name, _ in kinds], sizes)
    return Contour(group, _normals(middle, group), floor, factors, np.array(reach), cue)


def _reach(robot: Robot, optics: Optics) -> tuple[float, float]:
    """Largest distance of the lens from the body, along and across, m."""
    width, height = optics.size
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
    view = np.nanmax(np.abs(optics.points(corners, optics.axis_height)[:, :2]), axis=0)
    far = float(np.hypot(*view)) * 0.3
    return float(view[0] + robot.body.length + far), float(view[1] + 0.5 * robot.body.length + far)


def _surface(outline: Outline) -> Samples:
    """Points on the surface of a solid of revolution, m, (k, 3)."""
    counts = (2 + int(_PER_TURN * piece.turn / (2.0 * np.pi)) for piece in outline.pieces)
    pieces = [piece.points(np.linspace(0.0, 1.0, count)) for piece, count in zip(outline.pieces, counts, strict=True)]
    x, rho = (np.concatenate(part) for part in zip(*pieces, strict=True))
    around = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)[:, None]
    rings = np.broadcast_arrays(x[None, :], rho * np.cos(around), rho * np.sin(around))
    return np.stack(rings, axis=-1).reshape(-1, 3)


def _flat(outline: Outline, end: int) -> tuple[float, float] | None:
    """Axial position and radius of a flat end's sharp rim, m; None if the end is round."""
    piece = outline.pieces[end]
    if isinstance(piece, Segment) and piece.start[0] == piece.end[0] and outline.corners and outline.corners[end]:
        return piece.start[0], max(piece.start[1], piece.end[1])
    return None


def _rim(flat: tuple[float, float], stations: Samples, sign: float, on_plane, a: float, b: float) -> Samples:  # type: ignore[no-untyped-def]
    """The half of a sharp rim above (sign 1) or below (-1) the axis, projected, m, (n, 2)."""
    height = np.sqrt(flat[1] ** 2 - stations**2)
    return np.asarray(on_plane(np.stack([np.full(stations.size, flat[0]), stations, sign * height], axis=1), a, b))


def _sides(robot: Robot, outlines: dict[str, Outline], spacing: float) -> list[tuple[str, str, Samples]]:
    """Part, kind and x of the edge points along the sides of body and coupling."""
    found = []
    half, seal = 0.5 * robot.body.length, robot.seal
    low, high = _straight(outlines["body"])
    if seal is not None and seal.stripes and low < seal.length - half:
        middle, gap = seal.length - half, 0.05 * robot.body.length
        found.append(("body", "striped_side", _stations(low + 0.5 * gap, middle - 0.5 * gap, spacing)))
        low = middle + gap
    found.append(("body", "side", _stations(low, max(high - 0.03 * robot.body.length, low), spacing)))
    if "coupling" in outlines and robot.coupling.diameter > 0.15 * robot.body.diameter:
        low, high = _straight(outlines["coupling"])
        inset = 0.15 * (high - low)
        found.append(("coupling", "coupling", _stations(low + inset, high - inset, spacing)))
    return found


def _stations(low: float, high: float, spacing: float) -> Samples:
    """At most about sixty positions from `low` to `high`, at least `spacing` apart."""
    if high <= low:
        return np.empty(0)
    return np.arange(low, high, max(spacing, (high - low) / 60))


def _straight(outline: Outline) -> tuple[float, float]:
    """Range of x in which the sides of a solid are straight; without such, its middle half."""
    widest = (
        max(max(piece.start[1], piece.end[1]) for piece in outline.pieces if isinstance(piece, Segment))
        if any(isinstance(piece, Segment) for piece in outline.pieces)
        else 0.0
    )
    for piece in outline.pieces:
        if isinstance(piece, Segment) and piece.start[1] == piece.end[1] == widest and piece.start[0] != piece.end[0]:
            return min(piece.start[0], piece.end[0]), max(piece.start[0], piece.end[0])
    tips = [float(piece.points(np.full(1, t))[0][0]) for piece in outline.pieces for t in (0.0, 1.0)]
    return 0.5 * min(tips), 0.5 * max(tips)


def _seal(robot: Robot, radius: float, spacing: float) -> Samples:
    """The visible front edge of the seal, m, (k, 3)."""
    if robot.seal is None or not robot.seal.stripes:
        return np.empty((0, 3))
    place = np.arange(-CONTOUR.seal_arc, CONTOUR.seal_arc, spacing / radius)
    front = np.full(place.size, robot.seal.length - 0.5 * robot.body.length)
    return np.stack([front, radius * np.sin(place), radius * np.cos(place)], axis=1)


def _hull(points: Samples) -> Samples:
    """Vertices of the convex hull in their order; chosen in single precision, which is fast, and exact themselves."""
    chosen = cv2.convexHull(points.astype(np.float32), returnPoints=False)
    return np.asarray(points[chosen[:, 0]])


def _walks(hull: Samples, along: int) -> list[Samples]:
    """Both ways along a convex polygon from end to end, in the order of one coordinate (0 for x, 1 for y)."""
    ends = int(np.argmin(hull[:, along])), int(np.argmax(hull[:, along]))
    walks = []
    for first, last in (ends, ends[::-1]):
        count = (last - first) % len(hull)
        walk = hull[(first + np.arange(count + 1)) % len(hull)]
        walks.append(walk[np.argsort(walk[:, along], kind="stable")])
    return walks


def _outermost(walks: list[Samples], stations: Samples, outward: float, along: int) -> Samples:
    """Outermost coordinate of a convex polygon at stations of the other one, along which its `walks` are ordered."""
    values = [np.interp(stations, walk[:, along], walk[:, 1 - along]) for walk in walks]
    return np.asarray(np.maximum(*values) if outward > 0 else np.minimum(*values))


def _normals(points: Samples, group: np.ndarray) -> Samples:
    """Outward normals of the edges; forward for the seal."""
    normals = np.zeros_like(points)
    for index, outward in enumerate(((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 0.0))):
        inside = group == index
        if GROUPS[index] in ("rear", "seal", "left", "right") or inside.sum() < 3:
            normals[inside] = outward
            continue
        along = np.gradient(points[inside], axis=0)
        turned = np.stack([along[:, 1], -along[:, 0]], axis=1)
        turned *= np.sign(turned @ np.array(outward))[:, None]
        normals[inside] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return normals
