"""A robot in its tube: table, walls, contacts, ends and flow, ready for the compiled equations.

Sites at which body and coupling can touch the wall are the rings at the ends of their straight sides, with the ball of
a hemisphere or fillet; a spheroid has one. The wire can touch at any of its crests and at its tip.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.free_robot import (
    ROUGHNESS_SHARE,
    FreeRobot,
    drive_of,
    friction_of,
    packed,
    torque_scale,
    weight_of,
)
from spirillum.dynamics.integration import RANGE_LEFT
from spirillum.errors import InputError
from spirillum.fluid.tube.film_surface import FilmBody
from spirillum.kernels import core
from spirillum.robot.mesh import centreline_of
from spirillum.robot.outline import profile_outline
from spirillum.robot.robot import Robot
from spirillum.swimming.prediction import Prediction

FRICTION_COEFFICIENT = 0.1
"""Coefficient of dry friction mu_c where none is given. Assumed: with a lubricant between asperities it is 0.05 to 0.15
(F. P. Bowden, D. Tabor, The Friction and Lubrication of Solids, Oxford, 1950); a range to try is 0 to 0.3."""
_SLIDING_SHARE = 1e-4
"""Sliding speed below which dry friction is made smooth, over that of a body turning as fast as the tail."""
_STATIONS_PER_TURN = 24
_LINE_STATIONS_PER_TURN = 64  # Where the wire is a cubic between them: off by less than a millionth of the amplitude.


@dataclass(frozen=True)
class Surroundings:
    """What surrounds a robot in its tube."""

    ends: int = core.CLOSED  #: `CLOSED`, `OPEN` or `IMPOSED`.
    length: float = np.inf  #: L_eff of open ends, m.
    flow: Samples = field(default_factory=lambda: np.zeros((1, 2)))
    """Imposed mean flow: times, s, and velocities, m/s, (k, 2); straight between them, constant beyond."""
    roughness: float | None = None  #: Height of the asperities, m; None: `ROUGHNESS_SHARE` of the body's radius.
    coefficient: float = FRICTION_COEFFICIENT  #: Coefficient of dry friction, 1.


@dataclass(frozen=True, kw_only=True)
class TubeRobot(FreeRobot):
    """A robot in its tube: see csrc/tube_motion.c."""

    tolerance: float = 1e-7
    """Trajectory and pose of a minute in contact are then accurate to some parts in 1e7, energies to 1e-6; a tenth of
    it takes two and a half times as long.
    """
    observed: ClassVar[int] = core.SEEN_SIZE

    tube: Samples  #: The tube, `Tube` of csrc/motion.h, (9,) up to the numbers of sites and stations.
    wire: Samples  #: The wire, `Wire` of csrc/contacts.h, (6,).
    sites: Samples  #: Sites of body and coupling that can touch, `Site`, (n, 5).
    stations: Samples  #: Stations along the wires, `Station`, (m, 8).
    flow: Samples  #: Imposed mean flow: times, s, and velocities, m/s, (k, 2).
    names: tuple[str, ...]  #: Names of the sites, and of the tail.

    @property
    def data(self) -> Samples:
        """All but the table in one array, for the compiled equations."""
        numbers = np.array([len(self.sites), len(self.stations)], dtype=float)
        own = (self.tube, numbers, self.wire, self.sites, self.stations, self.flow)
        return packed(self.friction, self.weight, self.drive, *own)

    @property
    def gap_count(self) -> int:
        """Sites of body and coupling, and the wire."""
        return len(self.names)

    @property
    def bends(self) -> Samples:
        """Times of the imposed flow's rows, s."""
        return np.asarray(self.flow[:, 0])

    @property
    def roughness(self) -> float:
        """Height of the asperities, m."""
        return float(self.tube[core.TUBE_ROUGHNESS])

    def between(self, start: float, stop: float) -> TubeRobot:
        """The robot with what of the imposed flow matters from one time to another: few rows are copied."""
        first = max(int(np.searchsorted(self.bends, start, "right")) - 1, 0)
        return replace(self, flow=self.flow[first : int(np.searchsorted(self.bends, stop, "left")) + 1])

    def contact_event(self, site: int, *, touches: bool) -> str:
        """Which part of the robot touches the wall, or leaves it."""
        return f"{self.names[site]} {'touches' if touches else 'leaves'} the wall"

    def range_message(self, state: Samples, time: float) -> str:
        """A sentence on the range of the table that was left."""
        seen = self.observe(np.array([time]), state[None])[0]
        name = _RANGES.get(int(seen[core.SEEN_OUTSIDE]), "place")
        offset, pitch, yaw = seen[[core.SEEN_OFFSET, core.SEEN_PITCH, core.SEEN_YAW]]
        return (
            f"{RANGE_LEFT} in {name} is left, at an offset of {1e3 * offset:.4g} mm, a pitch of "
            f"{np.degrees(pitch):.3g} deg and a yaw of {np.degrees(yaw):.3g} deg against the wall"
        )


_RANGES = {core.TOO_FAR_PITCHED: "pitch", core.TOO_FAR_YAWED: "yaw"}
"""How `resistance_at` reports that a pose is outside the table."""


def tube_robot(steady: Prediction, table: Samples, around: Surroundings, *, turn: float, weight: bool) -> TubeRobot:
    """Everything that a robot's rates in its tube follow from."""
    robot, effective = steady.robot, steady.effective_friction
    if robot.channel is None:
        raise InputError("the robot has no channel; allowed: a robot with a [channel]")
    heavy, drive = weight_of(robot) if weight else np.zeros(core.WEIGHT_SIZE), drive_of(steady.batch)
    friction = friction_of(steady.batch, steady.friction, 0.0 if np.isnan(effective) else effective)
    a, half = 0.5 * robot.body.diameter, 0.5 * robot.body.length
    drag = 6.0 * np.pi * robot.fluid.viscosity * a * np.diag([1.0, 1.0, 1.0, a**2, half**2, half**2, a**2])
    torque = torque_scale(drag, heavy, drive)
    tube = np.zeros(core.TUBE_SIZE - 2)
    tube[core.TUBE_RADIUS] = 0.5 * robot.channel.diameter
    tube[core.TUBE_ROUGHNESS] = ROUGHNESS_SHARE * a if around.roughness is None else around.roughness
    tube[core.TUBE_LOAD] = torque / half  # its weight, or what its drive presses a lighter one with
    tube[core.TUBE_COEFFICIENT], tube[core.TUBE_SLIDING] = around.coefficient, _SLIDING_SHARE * a * 2.0 * np.pi / turn
    tube[core.TUBE_VISCOSITY] = robot.fluid.viscosity
    tube[core.TUBE_ENDS], tube[core.TUBE_LENGTH] = around.ends, around.length
    bound = robot.fluid.cavitation_pressure
    tube[core.TUBE_CAVITATION] = np.inf if bound is None else bound
    names, sites = _sites(robot)
    form = robot.tail.form
    xi = _station_positions(robot)
    line = centreline_of(robot, xi)
    parts = (line.position, line.tangent * line.stretch[:, None])
    rows = [
        np.column_stack([xi, *(part @ turned.T for part in parts), np.full(xi.size, turn)])
        for turn, turned in zip(form.turns, form.rotations, strict=True)
    ]
    tail = robot.tail
    found = np.zeros(core.WIRE_SIZE)
    found[core.WIRE_RADIUS], found[core.WIRE_AMPLITUDE] = 0.5 * tail.wire_diameter, tail.amplitude
    found[core.WIRE_TAPER] = 0.0 if tail.taper is None else tail.taper / tail.length
    found[core.WIRE_HAND_K] = robot.hand * 2.0 * np.pi / tail.wavelength if tail.form.is_helix else 0.0
    found[core.WIRE_ROOT], found[core.WIRE_LENGTH] = -0.5 * robot.body.length - robot.coupling.length, tail.length
    return TubeRobot(
        friction=friction,
        weight=heavy,
        drive=drive,
        table=np.ascontiguousarray(table),
        tube=tube,
        wire=found,
        sites=sites,
        stations=np.ascontiguousarray(np.concatenate(rows)),
        flow=np.ascontiguousarray(around.flow, dtype=float),
        names=(*names, "tail"),
        length=half,
        torque=torque,
        turn=turn,
    )


def _sites(robot: Robot) -> tuple[list[str], Samples]:
    """Names and rows of the sites."""
    body, coupling = robot.body, robot.coupling
    a, half = 0.5 * body.diameter, 0.5 * body.length
    rows: list[Sequence[float]] = []
    names = []
    if body.shape == "profile":
        rows = [(*ring, 0.0) for ring in FilmBody.of(profile_outline(body.points)).rings]
        names = ["body"] if len(rows) == 1 else ["body front", "body rear"]
    elif body.shape in ("sphere", "spheroid"):
        names, rows = ["body"], [(0.0, a, half, 0.0, 0.0)]
    else:
        for name, end, sign in (("body front", body.front_end, 1.0), ("body rear", body.rear_end, -1.0)):
            ball = body.rounding(end)
            names.append(name)
            rows.append((sign * (half - ball), a - ball, 0.0, ball, 0.0))
    solid = coupling.length - 2.0 * coupling.clearance
    if coupling.length > 0 and solid > 0:
        front = -half - coupling.clearance
        names += ["coupling front", "coupling rear"]
        rows += [(x, 0.5 * coupling.diameter, 0.0, 0.0, 1.0) for x in (front, front - solid)]
    return names, np.array(rows)


def _station_positions(robot: Robot) -> Samples:
    """Distances of the stations from the root, m."""
    tail = robot.tail
    if tail.form.is_helix:
        count = _STATIONS_PER_TURN * tail.length / tail.wavelength
        return np.linspace(0.0, tail.length, 1 + int(np.ceil(count)))
    if tail.form.curve:
        return tail.length * tail.form.centre.shares(_LINE_STATIONS_PER_TURN * tail.form.centre.turns)
    _, shortest = tail.form.widths(np.array(tail.amplitude), np.array(tail.wavelength))
    count = _LINE_STATIONS_PER_TURN * tail.length / float(np.min(shortest))
    return np.linspace(0.0, tail.length, 1 + int(np.ceil(count)))
