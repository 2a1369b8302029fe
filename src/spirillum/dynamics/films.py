"""Where a robot may near the wall of its channel, and what resists there: films of fluid between them.

The gap of two smooth surfaces with relative curvatures 1/R_1 and 1/R_2 is h + x^2/2R_1 + y^2/2R_2. Reynolds' equation
for surfaces that near each other at speed U is solved exactly by p = 6 mu U/((1/R_1 + 1/R_2) h(x, y)^2), so that the
film resists with

    F/U = 12 pi mu (R_1 R_2)^(3/2)/((R_1 + R_2) h)          at a point
    F/U = 3 sqrt(2) pi mu (R_2/h)^(3/2) per length          along a line (R_1 infinite)

In a tube of radius R a body of radius a has R_2 = a R/(R - a). (O. Reynolds, Phil. Trans. R. Soc. 177:157, 1886; the
line against a plane: D. J. Jeffrey and Y. Onishi, Q. J. Mech. Appl. Math. 34:129, 1981.) Sliding along the wall is not
resisted by a film: what the walls add to it are the calibration factors, or the model `tube`. Films are counted from
the tips of the roughness; where one is thinner than the roughness is high, its tips are pressed together and carry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.film_surface import FilmBody
from spirillum.kernels import two_links as kernel
from spirillum.robot.mesh import centreline_of
from spirillum.robot.outline import profile_outline
from spirillum.robot.robot import Robot

ROUGHNESS_SHARE = 1e-4
"""Roughness over the body's radius where none is given: 0.9 micrometres for the paper's robot. Assumed."""
_SIDE = ((-1.0, 1 / 20), (-math.sqrt(3 / 7), 49 / 180), (0.0, 16 / 45), (math.sqrt(3 / 7), 49 / 180), (1.0, 1 / 20))
"""Rings along a straight side and their shares of it: both ends, and points between them (Gauss-Lobatto)."""
_STIFFEST = 1e10
"""Largest resistance of a film over that of the robot, so that numbers stay numbers."""


@dataclass(frozen=True)
class WallFilms:
    """Rings of a robot that may near the wall, as `kernels.two_links` reads them."""

    wall: Samples
    """Radius of the channel (infinite: none), roughness, largest resistance of a film, load: `kernel.WALL` columns."""
    spots: Samples
    """Rings (n, 6), `kernel.RING` columns: x, radius, half-length along the axis, resistance, power, reach.

    A film of thickness h resists with c ((reach/h)^power - 1): as lubrication has it where it is thin, and not at all
    beyond its reach, where the resistance in open fluid is all there is.
    """


def films_of(robot: Robot, roughness: float | None, drag: float, load: float) -> WallFilms:
    """The films between a robot and its channel.

    Args:
        robot: the robot; without a channel it has none.
        roughness: height of what keeps the surfaces apart, m; None: `ROUGHNESS_SHARE` of the body's radius.
        drag: resistance of the robot to sideways motion, N s/m.
        load: force of the order that presses the robot to the wall, N: it halves a film as thick as the roughness.
    """
    radius = 0.5 * robot.body.diameter
    height = ROUGHNESS_SHARE * radius if roughness is None else roughness
    if robot.channel is None:
        return WallFilms(np.array([np.inf, height, np.inf, load]), np.zeros((0, kernel.RING)))
    robot.check_body("motion beside the wall of a channel, with lubrication films,")
    channel = 0.5 * robot.channel.diameter
    rows = [*_body_rings(robot, channel), *_tail_rings(robot, channel)]
    spots = np.array(rows)
    spots[:, kernel.FILM_RESISTANCE] /= spots[:, kernel.FILM_REACH] ** spots[:, kernel.FILM_POWER]
    return WallFilms(np.array([channel, height, _STIFFEST * drag, load]), spots)


def _across(radius: float, channel: float) -> float:
    """R_2 of a body of that radius in the channel."""
    return radius * channel / (channel - radius)


def _point(along: float, across: float, viscosity: float) -> float:
    """Coefficient of 1/h at a point."""
    return float(12.0 * np.pi * viscosity * (along * across) ** 1.5 / (along + across))


def _body_rings(robot: Robot, channel: float) -> list[list[float]]:
    body, viscosity = robot.body, robot.fluid.viscosity
    radius, half = 0.5 * body.diameter, 0.5 * body.length
    across = _across(radius, channel)
    if body.shape == "profile":
        shape = FilmBody.of(profile_outline(body.points))
        middle, half, front, rear = shape.rear[0], shape.half, shape.front[0], shape.rear[0]
        rounds = {-1.0: shape.rear[1], 1.0: shape.front[1]}
        ends = {place: radius if ball > 0.5 * radius else 0.0 for place, ball in rounds.items()}
    else:
        ends = {-1.0: body.rounding(body.rear_end), 1.0: body.rounding(body.front_end)}
        middle, half = 0.0, half if body.shape in ("sphere", "spheroid") else 0.0
        front, rear = 0.5 * body.length - ends[1.0], -0.5 * body.length + ends[-1.0]
    if half:
        return [[middle, radius, half, _point(half**2 / radius, across, viscosity), 1.0, radius]]
    length = front - rear
    if length < 1e-6 * radius:
        return [[front, radius, radius, _point(radius, across, viscosity), 1.0, radius]]
    line = 3.0 * np.sqrt(2.0) * np.pi * viscosity * across**1.5 * length
    rings = []
    for place, share in _SIDE:
        reach = radius if ends.get(place, 0.0) >= radius else 0.0
        x = 0.5 * (front + rear) + 0.5 * length * place
        rings.append([x, radius, reach, line * share, 1.5, radius])
    return rings


def _tail_rings(robot: Robot, channel: float) -> list[list[float]]:
    """The circles on which the wire turns: where it has its full radius, of a helix behind its root, and at its tip.

    The wire touches with its own small radius: its film stops it, and resists little before.
    """
    tail = robot.tail
    wire, root = 0.5 * tail.wire_diameter, 0.5 * robot.body.length + robot.coupling.length
    coefficient = _point(wire, _across(wire, channel), robot.fluid.viscosity)
    settled = 0.0 if tail.taper is None else min(3.0 / tail.taper, 0.5) * tail.length
    places = [(-root - settled, tail.amplitude), (-root - tail.length, tail.amplitude)]
    if not tail.form.is_helix:
        points = centreline_of(robot, np.linspace(0.0, tail.length, 2001)).position
        reach = np.hypot(points[:, 1], points[:, 2])
        places = [(float(points[n, 0]), float(reach[n])) for n in dict.fromkeys((int(np.argmax(reach)), 2000))]
    return [[x, reach + wire, 0.0, coefficient, 1.0, reach + wire] for x, reach in places]
