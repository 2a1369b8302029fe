"""Forces on a robot that lies level in a round tube, and the way that it sinks and climbs under its weight.

The fluid's answer at a gap h is the same at every azimuth chi, for the tube is round: only gravity turns. Chi counts
about +x from the lowest place, so that a robot at chi > 0 lies on the +y side. In axes that turn with the line of
centres (y along the wall, z towards the tube's axis) the submerged weight is W (-sin chi, -cos chi), and a robot at the
distance e from the tube's axis, level and free to slide along the wall, follows

    S_y e dchi/dt = F_y(h) - W sin chi,    S_z dh/dt = F_z(h) - W cos chi

with the forces F of its own swimming at a held place and the resistances S of a robot that is free along the tube and
in its body's rotation. A body that turns is pushed along the wall the way that its lowest line moves, as a journal is
in its bearing (W. J. Harrison, Trans. Cambridge Philos. Soc. 22:39, 1913). Alone it is not lifted;
the tail's share of F_z is small.

In thin films S_z approaches 3 sqrt(2) pi mu L (a_e/h)^(3/2), 1/a_e = 1/a - 1/R, for a cylinder of length L and radius
a (the limit of Jeffrey and Onishi, Q. J. Mech. Appl. Math. 34:129, 1981), so that h falls as 1/time^2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.outline import Outline

__all__ = [
    "Descent",
    "Film",
    "contact_line",
    "descent_of",
    "film_of",
    "lubrication_resistance",
    "orbit_period",
    "settled_azimuth",
    "settling_time",
]

_X, _Y, _Z, _PITCH, _YAW, _SPIN = range(6)
_LONGEST = 100.0  # of a path, over h S_z/W at its start
_SAMPLES = 200


@dataclass(frozen=True)
class Film:
    """What the fluid does to a level robot on its course at one gap; SI, averaged over phases of the tail."""

    gap: float
    """Smallest distance of body and glass, m."""
    offset: float
    """Distance of the body's axis from the tube's, m."""
    body_rate: float
    """Rotation rate of the body, rad/s."""
    forces: Samples
    """Of the fluid at each phase, (phases, 4): along +y and +z, N; nose up and nose to +y, about mid-length, N m."""
    resistances: Samples
    """Along y, along z and nose up, 3x3: N s/m, N s, N m s; free along the tube and in the body's rotation."""

    @property
    def sideways_force(self) -> float:
        """F_y, N."""
        return float(self.forces[:, 0].mean())

    @property
    def normal_force(self) -> float:
        """F_z, N."""
        return float(self.forces[:, 1].mean())

    @property
    def pitching_torque(self) -> float:
        """Nose up, N m."""
        return float(self.forces[:, 2].mean())

    @property
    def sideways_resistance(self) -> float:
        """S_y, the robot held level and at its gap, N s/m."""
        return float(self.resistances[0, 0])

    @property
    def normal_resistance(self) -> float:
        """S_z, the robot held level and at its azimuth, N s/m."""
        return float(self.resistances[1, 1])

    def sinking(self, force: float, nose_up: float) -> tuple[float, float]:
        """Velocity along z, m/s, and nose-up rate, rad/s, free in both.

        Args:
            force: along z, N.
            nose_up: torque about mid-length, N m.
        """
        velocity, rate = np.linalg.solve(self.resistances[1:, 1:], np.array([force, nose_up]))
        return float(velocity), float(rate)


def film_of(
    matrices: Samples, motion: Samples, gap: float, offset: float, *, one_piece: bool, wall_friction: float = 0.0
) -> Film:
    """Forces and resistances of a robot on its course.

    Args:
        matrices: R at each phase of the tail, (phases, 12, 12), body axes about mid-length.
        motion: twists of body and rotor, (12,), m/s and rad/s.
        gap: of the body, m.
        offset: of the body's axis from the tube's, m.
        one_piece: whether body and tail turn together, at the given rate; else the tail's rate is given alone.
        wall_friction: torque on the body per rate, beside the fluid's, N m s.
    """
    moves = np.zeros((12, 6))
    for first in (0, 6):
        moves[first : first + 3, _X : _Z + 1] = np.eye(3)
        moves[first + 4, _PITCH], moves[first + 5, _YAW] = -1.0, 1.0
    moves[3, _SPIN] = 1.0
    forces = -(matrices @ motion) @ moves[:, [_Y, _Z, _PITCH, _YAW]]
    full = moves.T @ matrices.mean(axis=0) @ moves
    full[_SPIN, _SPIN] += wall_friction
    free, asked = [_X] if one_piece else [_X, _SPIN], [_Y, _Z, _PITCH]
    answered = np.linalg.solve(full[np.ix_(free, free)], full[np.ix_(free, asked)])
    reduced = full[np.ix_(asked, asked)] - full[np.ix_(asked, free)] @ answered
    return Film(gap, offset, float(motion[3]), forces, 0.5 * (reduced + reduced.T))


def settled_azimuth(force: float, weight: float) -> float:
    """Azimuth chi at which the weight holds a sideways force, sin(chi) = F/W, rad; NaN where F exceeds W."""
    return float(np.arcsin(force / weight)) if abs(force) <= weight else np.nan


def settling_time(film: Film, weight: float) -> float:
    """Time in which the distance from the settled azimuth falls by e, at a held gap, s; NaN if there is none."""
    left = weight**2 - film.sideways_force**2
    return film.offset * film.sideways_resistance / float(np.sqrt(left)) if left > 0 and film.offset > 0 else np.nan


def orbit_period(film: Film, weight: float) -> float:
    """Time of once around the tube, at a held gap, s; NaN where the weight holds the sideways force."""
    left = film.sideways_force**2 - weight**2
    if not (left > 0 and film.offset > 0):
        return np.nan
    return 2.0 * np.pi * film.offset * film.sideways_resistance / float(np.sqrt(left))


class Descent(NamedTuple):
    """The way from the lowest place at the largest gap."""

    time: Samples
    """s."""
    gap: Samples
    """m."""
    azimuth: Samples
    """Rad."""
    drained: bool
    """Whether it ends at the smallest gap; else the robot was carried up so far that the gap opened, or it stays."""


def descent_of(films: Sequence[Film], weight: float) -> Descent:
    """Gap and azimuth over time of a level robot that starts at the lowest place at the largest gap.

    Resistances are interpolated as powers of the gap, forces as cubics in its logarithm.

    Args:
        films: at two or more gaps, any order.
        weight: submerged weight, N.
    """
    from scipy.integrate import solve_ivp

    ordered = sorted(films, key=lambda film: film.gap)
    gaps = np.array([film.gap for film in ordered])
    axis = gaps[0] + ordered[0].offset  # gap of a robot on the tube's axis
    along, across = (_power(gaps, [getattr(f, name) for f in ordered]) for name in _RESISTANCES)
    sideways, normal = (_cubic(gaps, [getattr(f, name) for f in ordered]) for name in _FORCES)

    def rates(_: float, state: Samples) -> Samples:
        u, chi = state
        h = np.exp(u)
        turning = (sideways(u) - weight * np.sin(chi)) / (along(u) * (axis - h))
        return np.array([(normal(u) - weight * np.cos(chi)) / (across(u) * h), turning])

    def drained(_: float, state: Samples) -> float:
        return float(state[0] - np.log(gaps[0]))

    def opened(_: float, state: Samples) -> float:
        return float(state[0] - np.log(gaps[-1]) - 1e-6)

    for event in (drained, opened):
        event.terminal = True  # type: ignore[attr-defined]
    scale = gaps[-1] * ordered[-1].normal_resistance / weight
    start = np.array([np.log(gaps[-1]), 0.0])
    events, longest = (drained, opened), _LONGEST * scale
    found = solve_ivp(
        rates, (0.0, longest), start, method="LSODA", rtol=1e-10, atol=1e-11, dense_output=True, events=events
    )
    time = np.linspace(0.0, found.t[-1], _SAMPLES)
    u, azimuth = found.sol(time)
    return Descent(time, np.exp(u), azimuth, found.t_events[0].size > 0)


_RESISTANCES = ("sideways_resistance", "normal_resistance")
_FORCES = ("sideways_force", "normal_force")


def _cubic(gaps: Samples, values: Sequence[float]) -> Callable[[float], float]:
    """Cubic of the logarithm of the gap; constant beyond the last ones."""
    from scipy.interpolate import CubicSpline

    spline, low, high = CubicSpline(np.log(gaps), values), float(np.log(gaps[0])), float(np.log(gaps[-1]))
    return lambda u: float(spline(min(max(u, low), high)))


def _power(gaps: Samples, values: Sequence[float]) -> Callable[[float], float]:
    """Cubic of the logarithm of positive values in the logarithm of the gap; constant beyond the last ones."""
    logarithm = _cubic(gaps, np.log(values).tolist())
    return lambda u: float(np.exp(logarithm(u)))


def contact_line(body: Outline) -> tuple[float, float]:
    """From where to where (x, rear and front) a level body of revolution touches a floor, m."""
    x, rho = (np.concatenate(part) for part in zip(*(p.points(_SHARES) for p in body.pieces), strict=True))
    touching = x[rho > (1.0 - 1e-9) * rho.max()]
    return float(touching.min()), float(touching.max())


_SHARES = np.linspace(0.0, 1.0, 129)


def lubrication_resistance(viscosity: float, length: float, radius: float, tube_radius: float, gap: float) -> float:
    """S_z of a long cylinder in a thin film at the wall of a round tube, 3 sqrt(2) pi mu L (a_e/h)^(3/2), N s/m.

    Args:
        viscosity: Pa s.
        length: of the cylinder, m.
        radius: a of the cylinder, m.
        tube_radius: R, m.
        gap: h, m.
    """
    curvature = 1.0 / radius - 1.0 / tube_radius
    return float(3.0 * np.sqrt(2.0) * np.pi * viscosity * length * (curvature * gap) ** -1.5)
