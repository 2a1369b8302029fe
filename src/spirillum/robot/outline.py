"""Outlines of solids of revolution about the motor axis: body and coupling, as lines and elliptic arcs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.geometry import End, Shape


@dataclass(frozen=True)
class Segment:
    """A straight segment from (x, rho) to (x, rho), m."""

    start: tuple[float, float]
    end: tuple[float, float]

    def points(self, t: Samples) -> tuple[Samples, Samples]:
        """(x, rho) at t from 0 to 1."""
        (x_a, rho_a), (x_b, rho_b) = self.start, self.end
        return x_a + (x_b - x_a) * t, rho_a + (rho_b - rho_a) * t

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

    def points(self, t: Samples) -> tuple[Samples, Samples]:
        """(x, rho) at t from 0 to 1."""
        angle = self.angles[0] + (self.angles[1] - self.angles[0]) * t
        return (
            self.centre[0] + self.semi_axes[0] * np.cos(angle),
            self.centre[1] + self.semi_axes[1] * np.abs(np.sin(angle)),
        )

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
class Outline:
    """A closed solid of revolution: pieces from its front pole to its rear pole."""

    pieces: tuple[Segment | Arc, ...]
    corners: tuple[bool, ...]
    """Whether there is a sharp edge between each piece and the next."""

    def line(self, t: Samples) -> tuple[Samples, Samples]:
        """(x, rho) of the pieces one after the other, each at t from 0 to 1."""
        x, rho = zip(*(piece.points(t) for piece in self.pieces), strict=True)
        return np.concatenate(x), np.concatenate(rho)

    def contains(self, x: Samples, rho: Samples) -> np.ndarray:
        """Whether points are inside."""
        radius = np.fmax.reduce([piece.radius(x) for piece in self.pieces])
        tips = [float(piece.points(np.full(1, t))[0][0]) for piece in self.pieces for t in (0.0, 1.0)]
        with np.errstate(invalid="ignore"):
            return np.asarray((rho < radius) & (x < max(tips)) & (x > min(tips)))

    def distance(self, x: Samples, rho: Samples) -> Samples:
        """Distance of points from the surface, to a thousandth of a piece's length, m."""
        from scipy.spatial import cKDTree

        shape = np.broadcast_shapes(np.shape(x), np.shape(rho))
        points = np.stack(np.broadcast_arrays(x, rho), axis=-1).reshape(-1, 2)
        found, _ = cKDTree(np.stack(self.line(np.linspace(0.0, 1.0, 1001)), axis=-1)).query(points)
        return np.asarray(found).reshape(shape)


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


def _reversed(pieces: list[Segment | Arc]) -> list[Segment | Arc]:
    turned: list[Segment | Arc] = []
    for piece in reversed(pieces):
        if isinstance(piece, Segment):
            turned.append(Segment(piece.end, piece.start))
        else:
            turned.append(Arc(piece.centre, piece.semi_axes, (piece.angles[1], piece.angles[0])))
    return turned


def body_outline(
    shape: Shape, diameter: float, length: float, fillet: float, front: End | None, rear: End | None
) -> Outline:
    """Outline of a body about its mid-length; lengths in m."""
    radius, half = 0.5 * diameter, 0.5 * length
    if shape in ("sphere", "spheroid"):
        return Outline((Arc((0.0, 0.0), (half, radius), (0.0, np.pi)),), ())
    nose = _end(front, half, 1.0, radius, fillet)
    tail = _reversed(_end(rear, -half, -1.0, radius, fillet))
    x_front, x_rear = nose[-1].points(np.ones(1))[0][0], tail[0].points(np.zeros(1))[0][0]
    side: list[Segment | Arc] = [Segment((float(x_front), radius), (float(x_rear), radius))]
    if x_front - x_rear < 1e-9 * length:
        side = []
    joints = [front == "flat"] if side else [front == "flat" or rear == "flat"]
    corners = [False] * (len(nose) - 1) + joints
    corners += ([rear == "flat"] if side else []) + [False] * (len(tail) - 1)
    return Outline((*nose, *side, *tail), tuple(corners))


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
    """Outlines by part: the body, and the coupling behind it where there is one; lengths in m.

    Args:
        body: outline of the body; None for a bare tail.
        body_length: L_b.
        coupling_diameter: D_c, 0 for a bare gap.
        coupling_length: L_c, 0 for none.
        clearance: axial clearance on both sides of the coupling's solid.
    """
    outlines = {} if body is None else {"body": body}
    if coupling_diameter > 0 and coupling_length > 2.0 * clearance:
        rear = -0.5 * body_length
        outlines["coupling"] = cylinder_outline(coupling_diameter, rear - clearance, rear - coupling_length + clearance)
    return outlines
