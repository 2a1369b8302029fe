"""Pose of a robot in its tube: its axis, and the clearances between its surfaces and the wall.

A `Placement` is what a user asks for; a `TubePose` is the geometry that follows from it. The tube's axis is
horizontal. The body's mid-length is e below it. There the robot is pitched nose up by alpha and then yawed by psi
about the vertical, nose to +y: its axis is (cos(alpha) cos(psi), cos(alpha) sin(psi), sin(alpha)). A point (x, y, z)
of the robot's frame lies at the height -e + x sin(alpha) + z cos(alpha), and to the side at (x cos(alpha) - z
sin(alpha)) sin(psi) + y cos(psi).

Without yaw the points (x, rho cos(theta), rho sin(theta)) of a ring about the robot's axis have the squared distance

    rho^2 + d^2 + 2 d rho cos(alpha) s - rho^2 sin(alpha)^2 s^2,   d = -e + x sin(alpha), s = sin(theta)

from the tube's axis: a parabola in s, so that the farthest point of a ring is known in closed form, and with it the
farthest point of a tail over a whole turn. With yaw it is found by Newton's method. Lengths in m, angles in rad.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.outline import Outline, Piece, Segment
from spirillum.robot.placement import Placement

GAP_SHARE = 1.0 / 18.0  #: Gap over the body's radius where a placement leaves it open: 0.5 mm for the paper's robot.
GAP_BAND = (1.0 / 90.0, 1.0 / 9.0)
"""Least and largest gap over the body's radius of the band over unknown gaps: 0.1 to 1 mm for the paper's robot."""
STEEPEST_PITCH = 0.25 * np.pi  #: Largest pitch of a placement, nose up or down, rad.
_SAMPLES = np.linspace(0.0, 1.0, 257)  # rings of a curved piece
_ROUNDS = 3  # each samples between the neighbours of the farthest ring so far; the distance is then exact
_STEPS = 181  # pitches that are tried before the first contact is bracketed
_NARROWEST = 1e-10  # of the bracket around it, rad
_AROUND = 64  # points of a yawed ring among which Newton's method begins
_NEWTON_STEPS = 6
_STILL = 1e-9  # step at which it ends, rad: the distance is then exact


@dataclass(frozen=True)
class TailClearance:
    """Smallest clearance of the wire from the wall."""

    clearance: float  #: Smallest distance between the wire's surface and the wall, m; negative where it cuts into it.
    phase: float  #: Phase of the tail at which that happens, rad, 0 to 2 pi.
    index: int  #: Number of the point of the centreline at which it happens.


@dataclass(frozen=True)
class TubePose:
    """Where in a tube the robot's axis runs; m and rad.

    `rotation`, `placed` and `distances` use the axes in which the flow is solved: x along robot or tube, y up, z to
    the right.
    """

    radius: float  #: R of the tube.
    offset: float  #: e, distance of the body's mid-length below the tube's axis; NaN where the body does not fit.
    pitch: float = 0.0  #: alpha, nose up.
    tail_drop: float = 0.0
    """Distance by which the tail's axis is lowered, across itself; the tail turns about the lowered axis."""
    yaw: float = 0.0  #: psi, nose to +y (to the left, seen along the tube).

    @classmethod
    def of(cls, placement: Placement, body: Outline, body_diameter: float, radius: float) -> TubePose:
        """Return the pose of a placement; by default level, at the gap of `gap_of`."""
        if placement.eccentricity is not None:
            return cls(radius, placement.eccentricity * (radius - 0.5 * body_diameter), 0.0, placement.tail_drop)
        gap = gap_of(placement, body_diameter, radius)
        return cls.at_gap(body, radius, gap, placement.pitch or 0.0, placement.tail_drop, placement.yaw)

    @classmethod
    def at_gap(
        cls, body: Outline, radius: float, gap: float, pitch: float = 0.0, tail_drop: float = 0.0, yaw: float = 0.0
    ) -> TubePose:
        """The pose at which the body's least distance to the wall is `gap`: the lower one of two, NaN without one."""
        # For a level body of largest radius a, e = R - a - gap.
        return cls(radius, _offset(body, radius, gap, pitch, yaw), pitch, tail_drop, yaw)

    @property
    def level(self) -> bool:
        """Whether the robot's axis is parallel to the tube's."""
        return self.pitch == 0 and self.yaw == 0

    def clearance(self, outline: Outline) -> float:
        """Smallest distance between a solid of revolution and the wall, m; negative where it cuts into it."""
        ends, arcs = _rings(outline)
        reach = float(self._farthest(*ends)[0].max(initial=0.0))
        sampled = [(self._farthest(*whole)[0], arc, step) for arc, whole, step in arcs]
        for whole, arc, step in sorted(sampled, key=lambda item: -item[0].max()):
            if whole.max() + step < reach:
                continue
            distance, low, width = whole, 0.0, 1.0
            for _ in range(_ROUNDS - 1):
                at = int(distance.argmax())
                reach = max(reach, float(distance[at]))
                first, last = max(at - 1, 0), min(at + 1, _SAMPLES.size - 1)
                low, width = low + width * float(_SAMPLES[first]), width * float(_SAMPLES[last] - _SAMPLES[first])
                distance, _ = self._farthest(*arc.points(low + width * _SAMPLES))
            reach = max(reach, float(distance.max()))
        return float(self.radius - reach)

    def tail_clearance(self, points: Samples, wire_radius: float) -> TailClearance:
        """Smallest distance between wire and wall over a turn; the wire is what a ball sweeps: its ends are round."""
        x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
        distance, theta = self._farthest(x, np.hypot(y, z), self.tail_drop)
        index = int(np.argmax(distance))
        phase = float((theta - np.arctan2(z, y))[index])
        return TailClearance(float(self.radius - wire_radius - distance[index]), phase % (2.0 * np.pi), index)

    @property
    def rotation(self) -> Samples:
        """From the robot's axes to the tube's, 3x3."""
        c, s = np.cos(self.pitch), np.sin(self.pitch)
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[cos * c, -cos * s, sin], [s, c, 0.0], [-sin * c, sin * s, cos]])

    @property
    def forward(self) -> Samples:
        """The tube's axis in body axes (x along the robot, y to the left, z up), (3,)."""
        along, up, right = self.rotation[0]
        return np.array([along, -right, up])

    @property
    def across(self) -> Samples:
        """Up and right about the tube's axis in body axes, (2, 3): a body point p is at `across @ p`, less e up."""
        along, up, right = self.rotation[1:].T
        return np.stack([along, -right, up], axis=1)

    def placed(self, points: Samples) -> Samples:
        """Points in the robot's axes as points about the tube's axis, (n, 3)."""
        moved: Samples = points @ self.rotation.T - np.array([0.0, self.offset, 0.0])
        return moved

    def distances(self, x: Samples, rho: Samples) -> Samples:
        """Smallest distances from the wall of rings about the robot's axis, sampled around each."""
        theta = np.linspace(0.0, np.pi, 181) if self.yaw == 0 else np.linspace(0.0, 2.0 * np.pi, 361)
        up, right = rho[..., None] * np.cos(theta), rho[..., None] * np.sin(theta)
        height = x[..., None] * np.sin(self.pitch) + up * np.cos(self.pitch) - self.offset
        if self.yaw:
            along = x[..., None] * np.cos(self.pitch) - up * np.sin(self.pitch)
            right = right * np.cos(self.yaw) - along * np.sin(self.yaw)
        nearest: Samples = self.radius - np.max(np.hypot(height, right), axis=-1)
        return nearest

    def _farthest(self, x: Samples, rho: Samples, drop: float = 0.0) -> tuple[Samples, Samples]:
        """Distance of the farthest point of each ring from the tube's axis, m, and its angle theta."""
        pitch = self.pitch
        d = -(self.offset + drop * np.cos(pitch)) + x * np.sin(pitch)
        if self.yaw:
            sideways = (x * np.cos(pitch) + drop * np.sin(pitch)) * np.sin(self.yaw)
            return _farthest_of_ellipses(
                (d, rho * np.cos(pitch)), (sideways, -rho * np.sin(pitch) * np.sin(self.yaw), rho * np.cos(self.yaw))
            )
        along, across = d * np.cos(pitch), rho * np.sin(pitch) ** 2
        inside = np.abs(along) < across  # else the ring's lowest or highest point is the farthest
        s = np.where(inside, along / np.where(inside, across, 1.0), np.where(along < 0, -1.0, 1.0))
        sideways = rho * np.sqrt(1.0 - s**2)
        return np.hypot(sideways, d + rho * np.cos(pitch) * s), np.arcsin(s)


@lru_cache(maxsize=256)
def _rings(outline: Outline) -> tuple[tuple[Samples, Samples], list[tuple[Piece, tuple[Samples, Samples], float]]]:
    """(x, rho) of the rings at the ends of straight pieces, along which the distance is convex, and of each arc's."""
    # An arc comes with the largest distance between its rings: by no more does one between them reach farther.
    ends = [end for piece in outline.pieces if isinstance(piece, Segment) for end in (piece.start, piece.end)]
    x, rho = np.array(ends, dtype=float).reshape(-1, 2).T
    arcs = [(piece, piece.points(_SAMPLES)) for piece in outline.pieces if not isinstance(piece, Segment)]
    return (x, rho), [(arc, rings, float(np.hypot(*np.diff(rings)).max())) for arc, rings in arcs]


def _farthest_of_ellipses(
    height: tuple[Samples, Samples], side: tuple[Samples, Samples, Samples]
) -> tuple[Samples, Samples]:
    """Largest distance from the origin on each ellipse of the cross-section, and the angle at which it is."""
    # Heights are a mean and a coefficient of sin(theta), distances to the side a mean and those of sin and cos.
    (h_0, h_s), (w_0, w_s, w_c) = height, side
    theta = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    s, c = np.sin(theta), np.cos(theta)
    # The squared distance is a quadratic form of sine and cosine; what is constant does not move its maximum.
    terms = (2.0 * (h_0 * h_s + w_0 * w_s), 2.0 * w_0 * w_c, h_s**2 + w_s**2, w_c**2, 2.0 * w_s * w_c)
    angle = theta[np.argmax(np.stack(terms, axis=1) @ np.stack([s, c, s**2, c**2, s * c]), axis=1)]
    best, found = np.zeros_like(angle), angle
    for _ in range(_NEWTON_STEPS + 1):
        s, c = np.sin(angle), np.cos(angle)
        up, aside = h_0 + h_s * s, w_0 + w_s * s + w_c * c
        distance = np.hypot(up, aside)
        found, best = np.where(distance > best, angle, found), np.maximum(distance, best)
        up_1, aside_1 = h_s * c, w_s * c - w_c * s
        slope = up * up_1 + aside * aside_1
        bend = up_1**2 + aside_1**2 - up * h_s * s - aside * (w_s * s + w_c * c)
        step = np.where(bend < 0, -slope / np.where(bend < 0, bend, 1.0), 0.0)
        if np.abs(step).max(initial=0.0) < _STILL:
            break
        angle = angle + np.clip(step, -2.0 * np.pi / _AROUND, 2.0 * np.pi / _AROUND)
    return best, found


def gap_of(placement: Placement, body_diameter: float, radius: float) -> float:
    """Gap of a placement, m; by default `GAP_SHARE` of the body's radius, at most that on the axis."""
    room = radius - 0.5 * body_diameter
    if placement.gap is not None:
        return placement.gap
    if placement.eccentricity is not None:
        return (1.0 - placement.eccentricity) * room
    return min(GAP_SHARE * 0.5 * body_diameter, room)


@lru_cache(maxsize=4096)
def largest_gap(outline: Outline, radius: float, pitch: float = 0.0, yaw: float = 0.0) -> float:
    """Largest smallest distance to the wall that any offset leaves, m; negative where the body does not fit."""
    return TubePose(radius, _centred(outline, radius, pitch, yaw), pitch, yaw=yaw).clearance(outline)


@lru_cache(maxsize=4096)
def _offset(outline: Outline, radius: float, gap: float, pitch: float, yaw: float) -> float:
    """Offset e of `TubePose.at_gap`, m."""
    if pitch == 0 and yaw == 0:
        e = radius + TubePose(0.0, 0.0).clearance(outline) - gap  # in a tube without radius less the largest one
        return float(e) if e >= -1e-12 * radius else np.nan
    from scipy.optimize import brentq

    def spare(e: float) -> float:
        return TubePose(radius, e, pitch, yaw=yaw).clearance(outline) - gap

    # Between the two offsets with that gap there is more of it. Mostly the tube's axis lies between them, which saves
    # the search for the middle.
    between = 0.0 if spare(0.0) >= 0 else _centred(outline, radius, pitch, yaw)
    if spare(between) < 0:
        return np.nan
    floor = radius + max(abs(float(x)) for p in outline.pieces for x in p.points(np.linspace(0.0, 1.0, 3))[0])
    return float(brentq(spare, between, floor, xtol=1e-13 * radius, rtol=1e-14))


def _centred(outline: Outline, radius: float, pitch: float, yaw: float) -> float:
    """Offset e at which the smallest distance to the wall is largest: it is concave in e, m."""
    if pitch == 0:  # yaw leaves the mirror image above and below
        return 0.0
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(
        lambda e: -TubePose(radius, e, pitch, yaw=yaw).clearance(outline),
        bounds=(-radius, radius),
        options={"xatol": 1e-9 * radius},
    )
    return float(found.x)


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
    yaw: float = 0.0,
) -> float:
    """Largest pitch at which tail and coupling have a clearance at a body's gap, rad; NaN: no level robot fits."""
    # The nose is raised from level until the wire at any phase, or the coupling, comes to the clearance, or until the
    # nose leaves the body no pose with that gap; at most `STEEPEST_PITCH`.

    def spare(pitch: float) -> float:
        pose = TubePose.at_gap(body, radius, gap, pitch, tail_drop, yaw)
        if np.isnan(pose.offset):
            return -radius
        tail = pose.tail_clearance(points, wire_radius).clearance
        solid = np.inf if coupling is None else pose.clearance(coupling)
        return min(tail, solid) - clearance

    if spare(0.0) < -1e-12 * radius:
        return np.nan
    return last_clear(spare, STEEPEST_PITCH, _STEPS, _NARROWEST)


def last_clear(spare: Callable[[float], float], most: float, steps: int, narrowest: float) -> float:
    """Largest angle up to which nothing touches the wall, rad: the first contact among `steps`, bracketed further."""
    tried = np.linspace(0.0, most, steps)
    touching = next((step for step in range(1, steps) if spare(float(tried[step])) < 0), None)
    if touching is None:
        return float(most)
    low, high = float(tried[touching - 1]), float(tried[touching])
    while high - low > narrowest:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if spare(middle) < 0 else (middle, high)
    return low
