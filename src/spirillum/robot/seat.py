"""Seat of a robot in its tube: where its axis runs, and the distances between its surfaces and the wall.

A `Placement` is what a user asks for; a `Seat` is the geometry that follows from it. The tube's axis is horizontal. The
robot's axis lies in the vertical plane through it, pitched nose up by alpha about the y axis through the body's
mid-length, which is e below the tube's axis. A point (x, y, z) of the robot's frame then lies at height
-e + x sin(alpha) + z cos(alpha) and at y to the side.

The points (x, rho cos(theta), rho sin(theta)) of a ring about the robot's axis have the squared distance

    rho^2 + d^2 + 2 d rho cos(alpha) s - rho^2 sin(alpha)^2 s^2,   d = -e + x sin(alpha), s = sin(theta)

from the tube's axis: a parabola in s, so that the farthest point of a ring is known in closed form, and with it the
farthest point of a tail over a whole turn. Lengths in m, angles in rad.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.outline import Outline
from spirillum.robot.placement import Placement

__all__ = ["GAP_BAND", "GAP_SHARE", "STEEPEST_PITCH", "Seat", "TailClearance", "contact_pitch", "gap_of", "largest_gap"]

GAP_SHARE = 1.0 / 18.0
"""Gap over the body's radius where a placement leaves it open: 0.5 mm for the paper's robot."""
GAP_BAND = (1.0 / 90.0, 1.0 / 9.0)
"""Least and largest gap over the body's radius of the band over unknown gaps: 0.1 to 1 mm for the paper's robot."""
STEEPEST_PITCH = 0.25 * np.pi
"""Largest pitch of a placement, rad."""
_SAMPLES = 257
_ROUNDS = 4  # each narrows the bracket of the farthest ring by a factor of 128
_STEPS = 181  # pitches that are tried before the first contact is bracketed
_NARROWEST = 1e-10  # of the bracket around it, rad


@dataclass(frozen=True)
class TailClearance:
    """Where the wire comes closest to the wall."""

    clearance: float
    """Smallest distance between the wire's surface and the wall, m; negative where it cuts into it."""
    phase: float
    """Phase of the tail at which that happens, rad, 0 to 2 pi."""
    index: int
    """Number of the point of the centreline at which it happens."""


@dataclass(frozen=True)
class Seat:
    """Where in a tube the robot's axis runs; m and rad.

    `rotation`, `placed` and `distances` use the axes in which the flow is solved: x along robot or tube, y up, z to
    the right.
    """

    radius: float
    """R of the tube."""
    offset: float
    """e, distance of the body's mid-length below the tube's axis; NaN where the body does not fit."""
    pitch: float = 0.0
    """alpha, nose up."""
    tail_drop: float = 0.0
    """Distance by which the tail's axis is lowered, across itself; the tail turns about the lowered axis."""

    @classmethod
    def of(cls, placement: Placement, body: Outline, body_diameter: float, radius: float) -> Seat:
        """The seat that follows from a placement; what it leaves open is level, and at the gap of `gap_of`.

        Args:
            placement: what is asked for.
            body: outline of the body.
            body_diameter: D_b.
            radius: R of the tube.
        """
        if placement.eccentricity is not None:
            return cls(radius, placement.eccentricity * (radius - 0.5 * body_diameter), 0.0, placement.tail_drop)
        gap = gap_of(placement, body_diameter, radius)
        return cls.at_gap(body, radius, gap, placement.pitch or 0.0, placement.tail_drop)

    @classmethod
    def at_gap(cls, body: Outline, radius: float, gap: float, pitch: float = 0.0, tail_drop: float = 0.0) -> Seat:
        """The seat at which the body's smallest distance to the wall is `gap`: of two such seats the lower one.

        For a level body of largest radius a, e = R - a - gap. The offset is NaN where the gap is larger than
        `largest_gap`, as it is once the nose comes nearer to the top.

        Args:
            body: outline of the body.
            radius: R of the tube.
            gap: smallest distance between body and wall.
            pitch: nose-up pitch alpha.
            tail_drop: distance by which the tail's axis is lowered.
        """
        return cls(radius, _offset(body, radius, gap, pitch), pitch, tail_drop)

    def clearance(self, outline: Outline) -> float:
        """Smallest distance between a solid of revolution and the wall, m; negative where it cuts into it.

        Args:
            outline: outline of body or coupling in the robot's frame.
        """
        reach = 0.0
        for piece in outline.pieces:
            low, high = 0.0, 1.0
            for _ in range(_ROUNDS):
                t = np.linspace(low, high, _SAMPLES)
                distance, _ = _farthest(*piece.points(t), self.offset, self.pitch)
                at = int(np.argmax(distance))
                reach = max(reach, float(distance[at]))
                low, high = float(t[max(at - 1, 0)]), float(t[min(at + 1, _SAMPLES - 1)])
        return float(self.radius - reach)

    def tail_clearance(self, points: Samples, wire_radius: float) -> TailClearance:
        """Smallest distance between the wire's surface and the wall over a whole turn of the tail.

        The wire is what a ball of its radius sweeps along the centreline, so that its ends are round.

        Args:
            points: (n, 3) centreline at phase 0 in the robot's frame, both ends included.
            wire_radius: radius of the wire.
        """
        x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        lowered = self.offset + self.tail_drop * np.cos(self.pitch)
        distance, s = _farthest(x, np.hypot(y, z), lowered, self.pitch)
        index = int(np.argmax(distance))
        phase = float(np.arcsin(s[index]) - np.arctan2(z, y)[index])
        return TailClearance(float(self.radius - wire_radius - distance[index]), phase % (2.0 * np.pi), index)

    @property
    def rotation(self) -> Samples:
        """From the robot's axes to the tube's, 3x3."""
        c, s = np.cos(self.pitch), np.sin(self.pitch)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def placed(self, points: Samples) -> Samples:
        """Points in the robot's axes as points about the tube's axis, (n, 3)."""
        moved: Samples = points @ self.rotation.T - np.array([0.0, self.offset, 0.0])
        return moved

    def distances(self, x: Samples, rho: Samples) -> Samples:
        """Smallest distances from the wall of rings about the robot's axis, sampled around each."""
        theta = np.linspace(0.0, np.pi, 181)
        height = x[..., None] * np.sin(self.pitch) + rho[..., None] * np.cos(theta) * np.cos(self.pitch) - self.offset
        farthest = np.max(np.hypot(height, rho[..., None] * np.sin(theta)), axis=-1)
        nearest: Samples = self.radius - farthest
        return nearest


def gap_of(placement: Placement, body_diameter: float, radius: float) -> float:
    """Gap that a placement asks for, m; where it is open, `GAP_SHARE` of the body's radius, at most that on the axis.

    Args:
        placement: what is asked for.
        body_diameter: D_b, m.
        radius: R of the tube, m.
    """
    room = radius - 0.5 * body_diameter
    if placement.gap is not None:
        return placement.gap
    if placement.eccentricity is not None:
        return (1.0 - placement.eccentricity) * room
    return min(GAP_SHARE * 0.5 * body_diameter, room)


@lru_cache(maxsize=4096)
def largest_gap(outline: Outline, radius: float, pitch: float = 0.0) -> float:
    """Largest smallest distance to the wall that any offset leaves, m; negative where the body does not fit.

    Args:
        outline: outline of the body.
        radius: radius R of the tube.
        pitch: nose-up pitch alpha.
    """
    return Seat(radius, _centred(outline, radius, pitch), pitch).clearance(outline)


@lru_cache(maxsize=4096)
def _offset(outline: Outline, radius: float, gap: float, pitch: float) -> float:
    """Offset e of `Seat.at_gap`, m."""
    if pitch == 0:
        e = radius - _largest_radius(outline) - gap
        return float(e) if e >= -1e-12 * radius else np.nan
    from scipy.optimize import brentq

    def spare(e: float) -> float:
        return Seat(radius, e, pitch).clearance(outline) - gap

    centred = _centred(outline, radius, pitch)
    if spare(centred) < 0:
        return np.nan
    floor = radius + max(abs(float(x)) for p in outline.pieces for x in p.points(np.linspace(0.0, 1.0, 3))[0])
    return float(brentq(spare, centred, floor, xtol=1e-13 * radius, rtol=1e-14))


def _centred(outline: Outline, radius: float, pitch: float) -> float:
    """Offset e at which the smallest distance to the wall is largest: it is concave in e, m."""
    if pitch == 0:
        return 0.0
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(
        lambda e: -Seat(radius, e, pitch).clearance(outline),
        bounds=(-radius, radius),
        options={"xatol": 1e-9 * radius},
    )
    return float(found.x)


def _largest_radius(outline: Outline) -> float:
    """Largest radius a of a solid of revolution, m; where it is reached does not matter in a level tube."""
    return -Seat(0.0, 0.0).clearance(outline)


def _farthest(x: Samples, rho: Samples, e: float, pitch: float) -> tuple[Samples, Samples]:
    """Distance of the farthest point of each ring from the tube's axis, m, and the sine of its angle theta."""
    d = -e + x * np.sin(pitch)
    along, across = d * np.cos(pitch), rho * np.sin(pitch) ** 2
    inside = np.abs(along) < across  # else the ring's lowest or highest point is the farthest
    s = np.where(inside, along / np.where(inside, across, 1.0), np.where(along < 0, -1.0, 1.0))
    sideways = rho * np.sqrt(1.0 - s**2)
    return np.hypot(sideways, d + rho * np.cos(pitch) * s), s


def contact_pitch(
    body: Outline,
    points: Samples,
    wire_radius: float,
    radius: float,
    gap: float,
    *,
    coupling: Outline | None = None,
    tail_drop: float = 0.0,
    clearance: float = 0.0,
) -> float:
    """Largest nose-up pitch at which tail and coupling keep a clearance from the wall while the body keeps its gap.

    The robot is raised from level until the wire at any phase, or the coupling, comes to the clearance, or until the
    nose leaves the body no seat with that gap; at most `STEEPEST_PITCH`. Rad; NaN where a level robot does not fit.

    Args:
        body: outline of the body.
        points: (n, 3) centreline of the wire at phase 0 in the robot's frame.
        wire_radius: radius of the wire.
        radius: radius R of the tube.
        gap: smallest distance between body and wall.
        coupling: outline of the coupling's solid, where there is one; it stays on the robot's axis.
        tail_drop: distance by which the tail's axis is lowered.
        clearance: smallest distance allowed between the wire's surface, or the coupling, and the wall.
    """

    def spare(pitch: float) -> float:
        seat = Seat.at_gap(body, radius, gap, pitch, tail_drop)
        if np.isnan(seat.offset):
            return -radius
        tail = seat.tail_clearance(points, wire_radius).clearance
        solid = np.inf if coupling is None else seat.clearance(coupling)
        return min(tail, solid) - clearance

    if spare(0.0) < -1e-12 * radius:
        return np.nan
    tried = np.linspace(0.0, STEEPEST_PITCH, _STEPS)
    touching = next((step for step in range(1, _STEPS) if spare(float(tried[step])) < 0), None)
    if touching is None:
        return STEEPEST_PITCH
    low, high = float(tried[touching - 1]), float(tried[touching])
    while high - low > _NARROWEST:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if spare(middle) < 0 else (middle, high)
    return low
