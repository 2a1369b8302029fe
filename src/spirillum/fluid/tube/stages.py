"""Stages of a table: its nodes, the resolution of the flow there, and the errors of its matrices.

`straight` answers a robot without yaw, `yaw` adds yawed nodes, `fine` has all nodes at the finest resolution. Each
stage can be used on its own; its nodes are read from the cache where another stage has solved for them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError, did_you_mean
from spirillum.fluid.tube.solids import Fineness
from spirillum.fluid.tube.wall import SLACK
from spirillum.robot.tube_pose import TubePose

StageName = Literal["straight", "yaw", "fine"]
Tilt = Literal["level", "pitched", "yawed"]
Where = Literal["near", "far", "tight"]
"""Near the glass, far from it, or in a tube of less than twice the body's diameter."""

_NEAR = 0.12  # Gap over the body's radius below which a node is near the glass.
_TIGHT = 0.5
"""Radius of the body over the tube's from which on the fluid that it displaces along the tube multiplies errors."""


@dataclass(frozen=True)
class Stage:
    """Nodes and resolution of a table; see `spirillum.fluid.tube.nodes` for the coordinates t and f."""

    name: StageName
    up: tuple[float, ...]  #: Nodes f nose up.
    down: tuple[float, ...]  #: Nodes f nose down.
    upper: tuple[float, ...]  #: Nodes t far from the floor.
    phases: tuple[tuple[float, int], ...]
    """Phases of the tail from which clearance on, over the radius that it sweeps; near the glass it has more harmonics
    over a turn."""
    resolutions: dict[tuple[Where, Tilt], Fineness]  #: Resolution of the flow at nodes.
    seconds: tuple[float, float]
    held_out: int  #: Poses without yaw, and with it, from which the table's errors are stated.
    checks: dict[tuple[Where, Tilt], Fineness]  #: Resolution of the flow at these poses.
    hardest: tuple[tuple[float, float], ...] = ()
    """The first of these poses without yaw, where interpolation errs most: log t from half the first node (0) to the
    axis (1), and f."""
    hardest_yawed: tuple[tuple[float, float, float], ...] = ()
    """The first of those with yaw: as `hardest`, and the yaw over the largest one there."""
    growth: float = 2.0  #: About the ratio of one node t to the one before, near the floor.
    accuracy: float = 2.0  #: Largest relative error that it should have, over that of the finest stage.
    yawed: bool = True
    film_yaws: int = 5
    film_intervals: int = 15  #: Intervals of its splines: with 11 it is within 0.4 %.

    def fineness(self, level_gap: float, body_radius: float, pose: TubePose, *, check: bool = False) -> Fineness:
        """Return the resolution of a node, or of a check pose, whose level gap is given."""
        near: Where = "near" if level_gap < _NEAR * body_radius else "far"
        where: Where = "tight" if body_radius > _TIGHT * pose.radius else near
        tilt: Tilt = "level" if pose.level else "yawed" if pose.yaw else "pitched"
        return (self.checks if check else self.resolutions)[where, tilt]

    def phases_at(self, clearance: float) -> int:
        """Number of phases of a tail with that clearance over the radius that it sweeps."""
        return [count for least, count in self.phases if clearance >= least][-1]


_FINEST: dict[tuple[Where, Tilt], Fineness] = {
    (where, tilt): Fineness("standard", 0.002 if tilt == "level" else 0.01, 6)
    for where in get_args(Where)
    for tilt in get_args(Tilt)
}
"""With 8 Gauss nodes a panel no response changes by more than 0.1 %."""
_FINE_FAR = Fineness("standard", 0.03, 4)  # Far from the glass no response changes by more than 0.2 % to the finest.
_LOOSE = Fineness("standard", 0.03, 4, wires=4e-3, slack=2.0, crowd=1.25)
_FAR = replace(_LOOSE, wires=1e-3)
_FINER = replace(_LOOSE, tolerance=0.01, order=6, panel=3.5, slack=1.0)
_COARSE: dict[tuple[Where, Tilt], Fineness] = {
    ("near", "level"): replace(_LOOSE, tolerance=0.005, wires=1e-3, slack=SLACK),
    ("near", "pitched"): _FINER,
    ("near", "yawed"): _LOOSE,
    ("far", "level"): replace(_FAR, slack=SLACK),
    ("far", "pitched"): _FAR,
    ("far", "yawed"): _FAR,
    ("tight", "level"): Fineness("standard", 0.005, 6),
    ("tight", "pitched"): Fineness("standard", 0.03, 6),
    ("tight", "yawed"): Fineness("standard", 0.03, 6),
}
"""Near the glass within 0.3 % of the forward velocity, 1 % of forces, torques and normal resistance; within 0.2 % of
the velocity in a tight tube, where a tolerance of 0.1 errs by 5 %. Far from the glass 0.1 %, and 0.3 % of forces."""
_TIGHT_CHECKS = {place: fineness for place, fineness in _FINEST.items() if place[0] == "tight"}

YAW = Stage(
    "yaw",
    up=(0.0, 0.5, 0.85, 1.0),
    down=(0.0, 0.35, 0.85, 1.0),
    upper=(0.45, 0.75, 1.0),
    phases=((0.0, 7), (0.5, 5), (3.0, 3)),
    resolutions=_COARSE,
    seconds=(2.7, 7.0),
    held_out=3,
    checks=_COARSE | _TIGHT_CHECKS | {("near", "yawed"): _FINER},
    hardest=((0.08, -0.7), (0.92, 0.97), (0.15, 0.97), (0.98, 0.3)),
    hardest_yawed=((0.01, -0.65, 0.4), (0.98, 0.05, 0.97), (0.13, 0.89, -0.97)),
    growth=3.0,
    film_intervals=11,
)
STRAIGHT = replace(YAW, name="straight", seconds=(1.4, 3.5), held_out=4, yawed=False, film_yaws=1)
FINE = Stage(
    "fine",
    up=(0.0, 0.33, 0.66, 0.88, 1.0),
    down=(0.0, 0.33, 0.66, 0.88, 1.0),
    upper=(0.55, 0.78, 1.0),
    phases=((0.0, 9), (1.0, 5)),
    resolutions=_FINEST | {("far", "pitched"): _FINE_FAR, ("far", "yawed"): _FINE_FAR},
    seconds=(5.0, 12.0),
    held_out=4,
    checks=_FINEST | {("near", tilt): replace(_FINEST["near", tilt], order=8) for tilt in ("pitched", "yawed")},
    hardest=((0.82, 0.2), (0.97, -0.9)),
    hardest_yawed=((0.88, 0.16, 0.68), (0.79, -0.52, 0.98)),
    accuracy=1.0,
)
STAGES: dict[StageName, Stage] = {stage.name: stage for stage in (STRAIGHT, YAW, FINE)}
"""From the coarsest to the finest: each answers what those before it answer."""


def stage_of(name: str) -> StageName:
    """Return the name of a stage that a user gives."""
    if name not in STAGES:
        raise InputError(f"stage = {name[:40]!r}{did_you_mean(name[:40], STAGES)}; allowed: {', '.join(STAGES)}")
    return name


RESPONSES = {
    "forward_velocity": 0.01,
    "body_rotation_rate": 0.01,
    "sideways_force": 0.02,
    "pitching_torque": 0.03,
    "yawing_torque": 0.03,
    "normal_resistance": 0.05,
}
"""Quantities by which a table is judged, and the largest relative error that each should have."""


def response_of(matrix: Samples) -> Samples:
    """Response `RESPONSES` to a tail turning at 1 rad/s, held laterally and in tilt, closed ends, viscosity 1, (7,)."""
    free = [0, 3]
    tail = matrix[:, 6]  # the rotor's lab rate is Omega + omega_m = 1
    a = matrix[np.ix_(free, free)] - np.outer(tail[free], [0.0, 1.0])
    speed, roll = np.linalg.solve(a, -tail[free])
    rates = np.zeros(len(matrix))
    rates[[0, 3, 6]] = speed, roll, 1.0 - roll
    force = -matrix @ rates
    return np.array([speed, roll, force[1], force[2], force[4], force[5], matrix[2, 2]])


def response_errors(matrix: Samples, true: Samples, turn: Samples | None = None) -> Samples:
    """Errors of `RESPONSES`, over the size of what acts on the robot, sideways force and torques over those in all."""
    a, b = response_of(matrix), response_of(true)
    # With matrices over a turn of the tail sizes are root mean squares over them, for a force that nearly vanishes at
    # one phase moves nothing.
    sizes = np.stack([response_of(some) for some in (true[None] if turn is None else turn)])
    force, torque = (np.hypot(sizes[:, first], sizes[:, first + 1]) for first in (2, 4))
    of_each = np.stack([sizes[:, 0], sizes[:, 1], force, torque, torque, sizes[:, 6]])
    found: Samples = np.abs(a - b)[[0, 1, 2, 4, 5, 6]] / np.sqrt(np.mean(of_each**2, axis=1))
    return found


SOLIDS_ERROR = 2e-4
"""Relative error of the drag of a body in a tube at the coarsest tolerance of a table; see `docs/accuracy.md`."""
LARGEST_WIRE_ERROR = 0.0267
"""Of the forward velocity with `standard` wires against `high` ones: the largest of `benchmarks/tube_wires.py`, 2.42 %,
and a tenth more for other poses."""
