"""How a robot sits in its tube: distances between its surfaces and the glass, pure geometry.

The tube's axis is horizontal. The robot's axis lies in the vertical plane through it, pitched nose up by alpha about
the y axis through the body's mid-length, which is e below the tube's axis. A point (x, y, z) of the robot's frame then
lies at height -e + x sin(alpha) + z cos(alpha) and at y to the side.

The points (x, rho cos(theta), rho sin(theta)) of a ring about the robot's axis have the squared distance

    rho^2 + d^2 + 2 d rho cos(alpha) s - rho^2 sin(alpha)^2 s^2,   d = -e + x sin(alpha), s = sin(theta)

from the tube's axis: a parabola in s, so that the farthest point of a ring is known in closed form, and with it the
farthest point of a tail over a whole turn. Lengths in m, angles in rad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.outline import Outline

__all__ = [
    "STEEPEST_PITCH",
    "TailClearance",
    "body_gap",
    "contact_pitch",
    "largest_gap",
    "offset_for_gap",
    "tail_clearance",
]

STEEPEST_PITCH = 0.25 * np.pi
"""Largest pitch of a placement, rad."""
_SAMPLES = 257
_ROUNDS = 4  # each narrows the place of the farthest ring by a factor of 128
_STEPS = 181  # pitches that are tried before the first contact is bracketed
_NARROWEST = 1e-10  # of the bracket around it, rad


@dataclass(frozen=True)
class TailClearance:
    """Where the wire comes closest to the glass."""

    clearance: float
    """Smallest distance between the wire's surface and the glass, m; negative where it cuts into it."""
    phase: float
    """Phase of the tail at which that happens, rad, 0 to 2 pi."""
    index: int
    """Number of the point of the centreline at which it happens."""


def _farthest(x: Samples, rho: Samples, e: float, pitch: float) -> tuple[Samples, Samples]:
    """Distance of the farthest point of each ring from the tube's axis, m, and the sine of its angle theta."""
    d = -e + x * np.sin(pitch)
    along, across = d * np.cos(pitch), rho * np.sin(pitch) ** 2
    inside = np.abs(along) < across  # else the ring's lowest or highest point is the farthest
    s = np.where(inside, along / np.where(inside, across, 1.0), np.where(along < 0, -1.0, 1.0))
    sideways = rho * np.sqrt(1.0 - s**2)
    return np.hypot(sideways, d + rho * np.cos(pitch) * s), s


def body_gap(outline: Outline, radius: float, e: float, pitch: float = 0.0) -> float:
    """Smallest distance between a solid of revolution and the glass, m; negative where it cuts into it.

    Args:
        outline: outline of body or coupling in the robot's frame.
        radius: radius R of the tube.
        e: distance of the body's mid-length below the tube's axis.
        pitch: nose-up pitch alpha.
    """
    reach = 0.0
    for piece in outline.pieces:
        low, high = 0.0, 1.0
        for _ in range(_ROUNDS):
            t = np.linspace(low, high, _SAMPLES)
            distance, _ = _farthest(*piece.points(t), e, pitch)
            at = int(np.argmax(distance))
            reach = max(reach, float(distance[at]))
            low, high = float(t[max(at - 1, 0)]), float(t[min(at + 1, _SAMPLES - 1)])
    return float(radius - reach)


def _largest_radius(outline: Outline) -> float:
    """Largest radius a of a solid of revolution, m; where it is reached does not matter in a level tube."""
    return -body_gap(outline, 0.0, 0.0)


def _centred(outline: Outline, radius: float, pitch: float) -> float:
    """Offset e at which the smallest distance to the glass is largest: it is concave in e, m."""
    if pitch == 0:
        return 0.0
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(
        lambda e: -body_gap(outline, radius, e, pitch), bounds=(-radius, radius), options={"xatol": 1e-9 * radius}
    )
    return float(found.x)


def largest_gap(outline: Outline, radius: float, pitch: float = 0.0) -> float:
    """Largest smallest distance to the glass that any offset leaves, m; negative where the body does not fit.

    Args:
        outline: outline of the body.
        radius: radius R of the tube.
        pitch: nose-up pitch alpha.
    """
    return body_gap(outline, radius, _centred(outline, radius, pitch), pitch)


def offset_for_gap(outline: Outline, radius: float, gap: float, pitch: float = 0.0) -> float:
    """Distance e of the body's mid-length below the tube's axis at which its smallest distance to the glass is `gap`.

    Of the two such places the lower one, m: e = R - a - gap for a level body of largest radius a. NaN where the gap is
    larger than `largest_gap`, as it is once the nose comes nearer to the top.

    Args:
        outline: outline of the body.
        radius: radius R of the tube.
        gap: smallest distance between body and glass.
        pitch: nose-up pitch alpha.
    """
    if pitch == 0:
        e = radius - _largest_radius(outline) - gap
        return float(e) if e >= -1e-12 * radius else np.nan
    from scipy.optimize import brentq

    centred = _centred(outline, radius, pitch)
    if body_gap(outline, radius, centred, pitch) < gap:
        return np.nan
    floor = radius + max(abs(float(x)) for p in outline.pieces for x in p.points(np.linspace(0.0, 1.0, 3))[0])
    return float(
        brentq(lambda e: body_gap(outline, radius, e, pitch) - gap, centred, floor, xtol=1e-13 * radius, rtol=1e-14)
    )


def tail_clearance(
    points: Samples,
    wire_radius: float,
    radius: float,
    e: float,
    pitch: float = 0.0,
    tail_drop: float = 0.0,
    phases: Samples | None = None,
) -> TailClearance:
    """Smallest distance between the wire's surface and the glass.

    The wire is what a ball of its radius sweeps along the centreline, so that its ends are round.

    Args:
        points: (n, 3) centreline at phase 0 in the robot's frame, both ends included.
        wire_radius: radius of the wire.
        radius: radius R of the tube.
        e: distance of the body's mid-length below the tube's axis.
        pitch: nose-up pitch alpha.
        tail_drop: distance by which the tail's axis is lowered, across itself; the tail turns about the lowered axis.
        phases: phases of the tail to look at, rad; None: the whole turn, in closed form.
    """
    x, y, z = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
    lowered = e + tail_drop * np.cos(pitch)
    rho, angle = np.hypot(y, z), np.arctan2(z, y)
    if phases is None:
        distance, s = _farthest(x, rho, lowered, pitch)
        index = int(np.argmax(distance))
        phase = float(np.arcsin(s[index]) - angle[index])
        return TailClearance(float(radius - wire_radius - distance[index]), phase % (2.0 * np.pi), index)
    turns = np.atleast_1d(np.asarray(phases, dtype=float))
    theta = angle + turns[:, None]
    height = -lowered + x * np.sin(pitch) + rho * np.sin(theta) * np.cos(pitch)
    distance = np.hypot(rho * np.cos(theta), height)
    turn, index = (int(i) for i in np.unravel_index(np.argmax(distance), distance.shape))
    clearance = float(radius - wire_radius - distance[turn, index])
    return TailClearance(clearance, float(turns[turn]) % (2.0 * np.pi), index)


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
    """Largest nose-up pitch at which tail and coupling keep a clearance from the glass while the body keeps its gap.

    The robot is raised from level until the wire at any phase, or the coupling, comes to the clearance, or until the
    nose leaves the body no place with that gap; at most `STEEPEST_PITCH`. Rad; NaN where a level robot does not fit.

    Args:
        body: outline of the body.
        points: (n, 3) centreline of the wire at phase 0 in the robot's frame.
        wire_radius: radius of the wire.
        radius: radius R of the tube.
        gap: smallest distance between body and glass.
        coupling: outline of the coupling's solid, where there is one; it stays on the robot's axis.
        tail_drop: distance by which the tail's axis is lowered.
        clearance: smallest distance allowed between the wire's surface, or the coupling, and the glass.
    """

    def spare(pitch: float) -> float:
        e = offset_for_gap(body, radius, gap, pitch)
        if np.isnan(e):
            return -radius
        tail = tail_clearance(points, wire_radius, radius, e, pitch, tail_drop).clearance
        solid = np.inf if coupling is None else body_gap(coupling, radius, e, pitch)
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
