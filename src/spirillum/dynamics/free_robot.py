"""A free robot as two rigid links, with the fluid films at the wall: ready for the compiled equations.

The gap of two smooth surfaces with relative curvatures 1/R_1 and 1/R_2 is h + x^2/2R_1 + y^2/2R_2. Reynolds' equation
for surfaces that near each other at speed U is solved exactly by p = 6 mu U/((1/R_1 + 1/R_2) h(x, y)^2), so that the
film resists with

    F/U = 12 pi mu (R_1 R_2)^(3/2)/((R_1 + R_2) h)          at a point
    F/U = 3 sqrt(2) pi mu (R_2/h)^(3/2) per length          along a line (R_1 infinite)

In a tube of radius R a body of radius a has R_2 = a R/(R - a). (O. Reynolds, Phil. Trans. R. Soc. 177:157, 1886; the
line against a plane: D. J. Jeffrey and Y. Onishi, Q. J. Mech. Appl. Math. 34:129, 1981.) Sliding along the wall is not
resisted by a film: what the walls add to it are the calibration factors, or the model `tube`. Films are counted from
the tips of the roughness; where one is thinner than the roughness is high, its tips are pressed together and carry.

The correct form of (15) with its motor: seven rates (U, Omega_b, omega_m) against weight, buoyancy, friction, the
torque of motor or field, and the fluid: here the films at the wall of a channel whose walls are otherwise left out, see
csrc/two_links.c; `tube_robot` has the walls.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar, TypeVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.tube.film_surface import FilmBody
from spirillum.kernels import core
from spirillum.robot.batch import RobotBatch
from spirillum.robot.links import links_of
from spirillum.robot.mesh import centreline_of
from spirillum.robot.outline import profile_outline
from spirillum.robot.robot import STANDARD_GRAVITY, Robot
from spirillum.robot.tables import FrictionModel
from spirillum.swimming.balance import friction_torques, packed_curve
from spirillum.swimming.motions import LINKS
from spirillum.swimming.prediction import Prediction
from spirillum.swimming.steady import calibrated_resistance

ROUGHNESS_SHARE = 1e-4
"""Roughness over the body's radius where none is given: 0.9 micrometres for the paper's robot. Assumed."""
_SIDE = ((-1.0, 1 / 20), (-math.sqrt(3 / 7), 49 / 180), (0.0, 16 / 45), (math.sqrt(3 / 7), 49 / 180), (1.0, 1 / 20))
"""Rings along a straight side and their shares of it: both ends, and points between them (Gauss-Lobatto)."""
_STIFFEST = 1e10  # Largest resistance of a film over that of the robot, so that numbers stay numbers.


def films_of(robot: Robot, roughness: float | None, drag: float, load: float) -> tuple[Samples, Samples]:
    """The channel's wall and the rings of a robot that may near it, as csrc/two_links.c reads them."""
    # The wall (4,): radius of the channel (infinite: none), roughness, largest resistance of a film, and the load that
    # halves a film as thick as the roughness. Rings (n, 6): x, radius, half-length along the axis, resistance, power,
    # reach. A film of thickness h resists with c ((reach/h)^power - 1): as lubrication has it where it is thin, and not
    # at all beyond its reach, where the resistance in open fluid is all there is.
    radius = 0.5 * robot.body.diameter
    height = ROUGHNESS_SHARE * radius if roughness is None else roughness
    if robot.channel is None:
        return np.array([np.inf, height, np.inf, load]), np.zeros((0, core.RING_SIZE))
    robot.check_body("motion beside the wall of a channel, with lubrication films,", ", or channel = 'none'")
    channel = 0.5 * robot.channel.diameter
    spots = np.array([*_body_rings(robot, channel), *_tail_rings(robot, channel)])
    spots[:, core.RING_RESISTANCE] /= spots[:, core.RING_REACH] ** spots[:, core.RING_POWER]
    return np.array([channel, height, _STIFFEST * drag, load]), spots


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
        ends = {end: radius if ball > 0.5 * radius else 0.0 for end, ball in rounds.items()}
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
    for side, share in _SIDE:
        reach = radius if ends.get(side, 0.0) >= radius else 0.0
        x = 0.5 * (front + rear) + 0.5 * length * side
        rings.append([x, radius, reach, line * share, 1.5, radius])
    return rings


def _tail_rings(robot: Robot, channel: float) -> list[list[float]]:
    """The circles on which the wire turns: where it has its full radius, of a helix behind its root, and at its tip."""
    tail = robot.tail
    wire, root = 0.5 * tail.wire_diameter, 0.5 * robot.body.length + robot.coupling.length
    # The wire touches with its own small radius: its film stops it, and resists little before.
    coefficient = _point(wire, _across(wire, channel), robot.fluid.viscosity)
    settled = 0.0 if tail.taper is None else min(3.0 / tail.taper, 0.5) * tail.length
    rings = [(-root - settled, tail.amplitude), (-root - tail.length, tail.amplitude)]
    if not tail.form.is_helix:
        points = centreline_of(robot, np.linspace(0.0, tail.length, 2001)).position
        reach = np.hypot(points[:, 1], points[:, 2])
        rings = [(float(points[n, 0]), float(reach[n])) for n in dict.fromkeys((int(np.argmax(reach)), 2000))]
    return [[x, reach + wire, 0.0, coefficient, 1.0, reach + wire] for x, reach in rings]


_KINDS = {
    "dc-motor": core.MOTOR,
    "torque": core.TORQUE,
    "rate": core.RATE,
    "magnetic": core.MAGNETIC,
    "torque-speed": core.CURVE,
}
_Robot = TypeVar("_Robot", bound="FreeRobot")
"""Instead of `Self`, which checks of shapes take in classes as a whole only."""


@dataclass(frozen=True, kw_only=True)
class FreeRobot(ABC):
    """What the compiled equations need of a free robot, SI, about the origin in body axes."""

    tolerance: float = 1e-8  #: Error of a step over the sizes of the state's components.
    observed: ClassVar[int]  #: Number of what is observed in a state.

    friction: Samples  #: Friction of joint and wall against the seven rates (7, 7).
    weight: Samples  #: Submerged weight of body and rotor, N, and first moments about the origin at phase 0, N m (8,).
    drive: Samples  #: `Drive` of csrc/links.h, (48,).
    table: Samples = field(default_factory=lambda: np.zeros(0))
    """The robot's table in its tube, see `spirillum.kernels.tube_table`; empty without walls."""
    length: float  #: A length of the robot's order, m.
    torque: float  #: A torque of the order of those that act, N m.
    turn: float  #: Time of the order of a turn of the tail, s.

    @property
    @abstractmethod
    def data(self) -> Samples:
        """All but the table in one array, for the compiled equations."""

    @property
    @abstractmethod
    def gap_count(self) -> int:
        """Number of the gaps that are watched."""

    @property
    @abstractmethod
    def roughness(self) -> float:
        """Height of the asperities, m."""

    @abstractmethod
    def contact_event(self, site: int, *, touches: bool) -> str:
        """What happens where a gap becomes as thin as the roughness, or opens again."""

    @classmethod
    def integrator(cls) -> str:
        """Method and tolerance of its integration."""
        return f"Rodas5P, tolerance {cls.tolerance:g}"

    @property
    def bends(self) -> Samples:
        """Times at which an imposed flow has a corner, s."""
        return np.zeros(0)

    def observe(self, time: Samples, states: Samples) -> Samples:
        """What is observed in states, (n, 19), at times, s: (n, 13), or (n, 31) in a tube."""
        out = np.empty((time.size, self.observed))
        core.observe(time, states, self.data, self.table, out)
        return out

    def observe_state(self, state: Samples) -> Samples:
        """Observed quantities of one state: (13,), or (31,) in a tube."""
        return np.asarray(self.observe(np.zeros(1), state[None])[0])

    def gaps(self, state: Samples) -> Samples:
        """Gaps that are watched in a state, (19,), m: at every site, and last the smallest of the wire, in a tube."""
        found = np.empty(self.gap_count)
        core.gaps_of(state, self.data, self.table, found)
        return found

    def at_duty(self: _Robot, duty: float) -> _Robot:
        """The robot at the duty of the remote; a field or a prescribed rate is on at any duty but 0."""
        drive = self.drive.copy()
        drive[core.DRIVE_DUTY] = duty
        return replace(self, drive=drive)

    def between(self: _Robot, start: float, stop: float) -> _Robot:  # noqa: ARG002 - of a tube
        """The robot with what of an imposed flow matters from one time to another, s."""
        return self

    def range_message(self, state: Samples, time: float) -> str:
        """A sentence on the range of the table that was left."""
        raise NotImplementedError  # no table, no range

    def step_sizes(self) -> Samples:
        """Sizes of the state that matter, a small time (0: nothing depends on it), and the time of a turn; (21,)."""
        resistance = self.drive[core.DRIVE_CONSTANT]
        current = self.drive[core.DRIVE_VOLTAGE] / resistance if resistance > 0 else 1.0
        found = np.ones(core.STATE_SIZE + 2)
        found[core.STATE_POSITION : core.STATE_POSITION + 3] = self.length
        found[core.STATE_CURRENT] = found[core.STATE_CHARGE] = current
        found[core.STATE_ELECTRICAL : core.STATE_CHARGE] = max(self.drive[core.DRIVE_VOLTAGE] * current, self.torque)
        found[core.STATE_DRIVEN : core.STATE_SIZE] = self.torque
        changing = self.drive[core.DRIVE_KIND] == core.MAGNETIC or self.bends.size > 1
        found[core.STATE_SIZE :] = 1e-6 * self.turn if changing else 0.0, self.turn
        return found


def packed(*parts: Samples) -> Samples:
    """One array for csrc/stiff_steps.c; it begins with what is observed, and serves one caller at a time."""
    return np.concatenate([np.ravel(part) for part in (np.zeros(core.SEEN_SIZE), *parts)])


def friction_of(batch: RobotBatch, reading: FrictionModel, effective: float) -> Samples:
    """The readings of (18) and (19) as torques against Omega_b about x (on the whole) and omega_m (in the joint)."""
    rotor = batch.electrics.joint_rotor_friction if batch.electrics else np.zeros(1)
    t = friction_torques(reading, np.array([effective]), rotor)
    bb, br, rb, rr = (float(entry[0]) for entry in (t.bb, t.br, t.rb, t.rr))
    found = np.zeros((7, 7))
    roll, joint = core.SPIN, core.JOINT
    found[roll, roll], found[roll, joint] = (bb + br) + (rb + rr), br + rr
    found[joint, roll], found[joint, joint] = rb + rr, rr
    return found


def weight_of(robot: Robot) -> Samples:
    """Weight less buoyancy of both links; zero where the masses are not known."""
    links = links_of(robot)
    if not np.isfinite([link.mass for link in links]).all():
        return np.zeros(core.WEIGHT_SIZE)
    density = robot.fluid.density
    sizes = [link.mass - density * link.volume for link in links]
    moments = [link.mass * link.centre - density * link.volume * link.centroid for link in links]
    return STANDARD_GRAVITY * np.concatenate([sizes, *moments])


def drive_of(batch: RobotBatch) -> Samples:
    """Drive and motor of a batch of one at full duty (48,)."""
    drive = np.zeros(core.DRIVE_SIZE)
    drive[core.DRIVE_KIND], drive[core.DRIVE_FIXED] = _KINDS[str(batch.drive)], float(batch.joint == "fixed")
    drive[core.DRIVE_DUTY] = 1.0
    if batch.drive == "torque":
        drive[core.DRIVE_GIVEN] = batch.drive_torque[0]
    elif batch.drive == "rate":
        drive[core.DRIVE_GIVEN] = batch.drive_rate[0]
    elif batch.drive == "magnetic":
        moment, angle = float(batch.magnetic_moment[0]), float(batch.moment_angle[0])
        drive[core.DRIVE_MOMENT : core.DRIVE_FIELD] = moment * np.cos(angle), 0.0, moment * np.sin(angle)
        drive[core.DRIVE_FIELD], drive[core.DRIVE_FIELD_RATE] = batch.magnetic_field[0], batch.field_rate[0]
    elif batch.curve is not None:
        drive[core.DRIVE_POLARITY] = batch.curve.sense * batch.hand[0]
        drive[core.DRIVE_POINTS :] = packed_curve(batch.curve)
    elif batch.electrics is not None:
        drive[core.DRIVE_TORQUE_CONSTANT : core.DRIVE_AXIS_Y] = [column[0] for column in batch.electrics.columns]
        drive[core.DRIVE_DUTY] = batch.electrics.duty[0]
    return drive


def torque_scale(drag: Samples, weight: Samples, drive: Samples) -> float:
    """The largest of the torques of stall, field, prescribed drive or rate, and weight, N m."""
    kind = drive[core.DRIVE_KIND]
    field = float(np.linalg.norm(drive[core.DRIVE_MOMENT : core.DRIVE_FIELD])) * drive[core.DRIVE_FIELD]
    given = abs(drive[core.DRIVE_GIVEN]) * (float(drag[core.JOINT, core.JOINT]) if kind == core.RATE else 1.0)
    heavy = float(np.abs(weight[: core.WEIGHT_MOMENT_BODY]).sum()) * float(np.sqrt(drag[4, 4] / drag[1, 1]))
    resistance = drive[core.DRIVE_CONSTANT]
    stall = drive[core.DRIVE_TORQUE_CONSTANT] * drive[core.DRIVE_VOLTAGE] / resistance if resistance > 0 else 0.0
    stall = max(stall, drive[core.DRIVE_AT + 1])
    return float(max(stall, field, given if kind in (core.TORQUE, core.RATE) else 0.0, heavy, 1e-300))


@dataclass(frozen=True, kw_only=True)
class TwoLinks(FreeRobot):
    """A robot in unbounded fluid, with films between it and a channel's wall: see csrc/two_links.c."""

    observed: ClassVar[int] = core.SEEN_CONTACT_FORCE

    drag: Samples  #: Resistance of both links against the seven rates at phase 0 of the tail (7, 7).
    wall: Samples  #: The channel's wall (4,), see `films_of`.
    spots: Samples  #: Rings that may near the wall (n, 6), see `films_of`.

    @property
    def data(self) -> Samples:
        """All of them in one array."""
        return packed(self.friction, self.weight, self.drive, self.drag, self.wall, self.spots)

    @property
    def gap_count(self) -> int:
        """The thinnest film."""
        return 1

    @property
    def roughness(self) -> float:
        """Height of the wall's asperities, m."""
        return float(self.wall[core.WALL_ROUGHNESS])

    @property
    def is_walled(self) -> bool:
        """Whether there are films at a wall."""
        return bool(np.isfinite(self.wall[core.WALL_RADIUS]))

    def contact_event(self, site: int, *, touches: bool) -> str:  # noqa: ARG002 - of a tube
        """The roughness carries, or no longer does."""
        return "film as thin as the roughness"


def two_links(steady: Prediction, roughness: float | None, *, weight: bool) -> TwoLinks:
    """Everything that a robot's rates in unbounded fluid follow from, with films between it and a channel's wall."""
    robot, batch, effective = steady.robot, steady.batch, steady.effective_friction
    resistance = calibrated_resistance(batch, steady.model, calibrated=steady.calibrated)[0]
    drag = np.ascontiguousarray(LINKS.T @ resistance @ LINKS)
    heavy, drive = weight_of(robot) if weight else np.zeros(core.WEIGHT_SIZE), drive_of(batch)
    length, torque = float(np.sqrt(drag[4, 4] / drag[1, 1])), torque_scale(drag, heavy, drive)
    wall, spots = films_of(robot, roughness, float(drag[1, 1]), torque / length)
    return TwoLinks(
        drag=drag,
        friction=friction_of(batch, steady.friction, 0.0 if np.isnan(effective) else effective),
        weight=heavy,
        wall=wall,
        spots=spots,
        drive=drive,
        length=length,
        torque=torque,
        turn=2.0 * np.pi * float(drag[core.SPIN, core.SPIN]) / torque,
    )
