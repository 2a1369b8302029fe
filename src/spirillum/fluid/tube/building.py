"""Computation of tables: solve for the flow at all nodes, pack the outer resistance and the lubrication film.

Robots that differ in their tails have places in common: wall and body are solved for once for all of them.

A robot whose middle lies on the tube's axis: every tilt is a pitch, seen from another side.
A table needs lowered and yawed noses there too. All of them follow from raised ones by a rotation about the tube's
axis, and by one about the robot's own that brings the tail's phase along.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from threading import Thread
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.fluid.tube.film import FilmTable
from spirillum.fluid.tube.nodes import CHECKED_FROM, LARGEST_YAW, Places
from spirillum.fluid.tube.outer_resistance import (
    PHASES,
    NodeSolution,
    all_cached,
    even_phases,
    factor_of,
    fourier,
    is_positive_definite,
    matrices_at,
    mirror_image,
    mirrored,
    outer_coefficients,
    outer_resistance,
    solutions,
    solved_as_one,
)
from spirillum.fluid.tube.progress_messages import progress_message, saved_state_message
from spirillum.fluid.tube.stages import FINE, RESPONSES, Stage, response_errors
from spirillum.fluid.tube.table import TubeTable
from spirillum.fluid.tube.tube import check_solvable, finest_wire
from spirillum.fluid.wire.interaction import one_thread
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels import core
from spirillum.kernels import tube_table as kernel
from spirillum.kernels.core import MOTIONS, film_at
from spirillum.progress import Progress
from spirillum.robot.outline import Outline
from spirillum.robot.tube_pose import TubePose

_HALF_TURN = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True)
class OnAxis:
    """Resistance of a robot at offset 0 for any pitch and yaw."""

    pitches: Samples  #: Pitches of both signs, increasing, rad.
    values: Samples  #: Fourier coefficients of the factor there, (pitches, phases, 36).

    @classmethod
    def of(cls, pitches: Samples, values: Samples) -> OnAxis:
        """From raised noses: pitches from 0 and Fourier coefficients of the factor, (pitches, phases, 36)."""
        signs = (_HALF_TURN[:, None] * _HALF_TURN)[np.tril_indices(MOTIONS)]
        harmonic = (np.arange(values.shape[1]) + 1) // 2
        lowered = values[1:] * signs * ((-1.0) ** harmonic)[:, None]
        return cls(np.concatenate([-pitches[:0:-1], pitches]), np.concatenate([lowered[::-1], values]))

    def coefficients(self, pitch: float, yaw: float = 0.0) -> Samples:
        """Fourier coefficients of the factor at a pitch and yaw, (phases, 36)."""
        if yaw == 0.0:
            return self._at(pitch)
        axis = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
        side = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        tilt = float(np.arctan2(np.hypot(axis[1], axis[2]), axis[0]))
        level = np.array([0.0, axis[2], -axis[1]]) / np.hypot(axis[1], axis[2])  # y' of the frame without yaw
        turn = float(np.arctan2(level @ np.cross(axis, side), level @ side))
        count = self.values.shape[1]
        phases = np.array(even_phases(count))
        rotation = _about_x(turn)
        matrices = rotation @ matrices_at(self._at(tilt), phases - turn) @ rotation.T
        return fourier(factor_of(matrices, "on the tube's axis"))

    def _at(self, pitch: float) -> Samples:
        from scipy.interpolate import BarycentricInterpolator

        return np.asarray(BarycentricInterpolator(self.pitches, self.values, rng=0)(pitch))


def _about_x(angle: float) -> Samples:
    """From rates in a frame that is turned about x by an angle to those in the frame that is not, (8, 8)."""
    c, s = np.cos(angle), np.sin(angle)
    found = np.eye(MOTIONS)
    for first in (1, 4):
        found[first : first + 2, first : first + 2] = [[c, -s], [s, c]]
    return found


_SEED = 20121
_CHECKED_PHASES = 3  # Phases of the tail at a check pose: its solids are solved for once.
_NO_YAW = kernel.yaw_limit_of(np.zeros(1), np.zeros(1), np.zeros(1), 0.0)
"""Limit of the yaw of a table without yawed nodes."""


def built_tables(
    robots: Sequence[tuple[RobotGeometry, float]],
    *,
    stage: Stage = FINE,
    workers: int = 2,
    progress: Progress | None = None,
) -> list[TubeTable]:
    """Solve for the flow at every place of a stage, for every robot, and make their tables; refuse for memory first."""
    requests = [_Request.of(Places(geometry, radius, stage)) for geometry, radius in robots]
    wanted = [pose for request in requests for pose in request.poses]
    for request in requests:  # a level node stands for the tilted ones with its gap, and one with yaw for all of them
        yawed = [node for node in request.nodes if node.pose.yaw]  # that nearest to the glass first
        for node in (*(node for node in request.nodes if node.pose.level), *yawed[:1]):
            check_solvable(request.places.geometry, node.pose, node.fineness)
    if progress is not None:
        count, kept = _solved_before(wanted)
        progress(progress_message(count, workers, kept, stage.seconds, _further_tails(wanted)), 0, count)
    start = time.perf_counter()
    films = _start_films(requests, workers)
    try:
        found = iter(solutions(wanted, "poses of the table", progress, workers))
        films.join()
        solved = [_definite(one, [next(found) for _ in one.poses], progress, workers) for one in requests]
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(saved_state_message(*_solved_before(wanted))) from error
    tables = [_table(one, some) for one, some in zip(requests, solved, strict=True)]
    seconds = (time.perf_counter() - start) / len(tables)
    return [replace(table, seconds=seconds) for table in tables]


@dataclass(frozen=True)
class _Request:
    """All poses that are solved for to make one table."""

    places: Places
    straight: list[NodeSolution]
    yawed: list[NodeSolution]
    nodes: list[NodeSolution]

    @classmethod
    def of(cls, places: Places) -> _Request:
        """All poses of a robot."""
        yawed = _check_poses(places) if places.stage.yawed else []
        return cls(places, _check_poses(places, yawed=False), yawed, _nodes(places))

    @property
    def poses(self) -> list[NodeSolution]:
        """Check poses and nodes."""
        return [*self.straight, *self.yawed, *self.nodes]


def _solved_before(places: Sequence[NodeSolution]) -> tuple[int, int]:
    """Number of nodes that are solved for separately, and how many of them are cached."""
    shared = solved_as_one(places)
    return len(shared), sum(all_cached([places[number] for number in numbers]) for numbers in shared)


def _further_tails(places: Sequence[NodeSolution]) -> int:
    """Number of robots beyond the first at each node that is solved for."""
    shared = solved_as_one(places)
    return sum(len(numbers) - 1 for numbers in shared if not all_cached([places[number] for number in numbers]))


def _start_films(requests: Sequence[_Request], workers: int) -> Thread:
    """Tabulate the films beside the solutions where those leave this process idle; a refusal comes with the table."""

    def tabulate() -> None:
        with suppress(InputError), one_thread():
            for request in requests if workers > 1 else ():
                _film_of_table(request.places)

    thread = Thread(target=tabulate, daemon=True)  # an interrupt does not wait for it
    thread.start()
    return thread


def _table(request: _Request, found: Sequence[Sequence[Samples]]) -> TubeTable:
    """The table of a robot from the solutions at all poses of its request."""
    places, level, count = request.places, len(request.straight), len(request.poses) - len(request.nodes)
    packed = _packed(places, found[count:])
    without = _largest_errors(packed, request.straight, found[:level])
    error = _largest_errors(packed, request.yawed, found[level:count]) if request.yawed else without
    nodes, stage = len(request.nodes), places.stage.name
    wire = 0.0 if finest_wire(places.geometry) == "high" else None  # None: the largest error that was measured
    return TubeTable(places.geometry, places.radius, packed, error, without, nodes, 0.0, wire, stage)


def _definite(
    request: _Request, found: list[list[Samples]], progress: Progress | None, workers: int
) -> list[list[Samples]]:
    """Solutions at all poses; nodes whose outer resistance is not positive definite are solved for more finely."""
    places, first = request.places, len(request.poses) - len(request.nodes)
    film, nodes = _film_of_table(places), (*_level(places), *_yawed(places))
    weak = [n for n, node in enumerate(nodes) if not _is_definite(film, node, found[first + n])]
    if not weak:
        return found
    finer = [
        request.nodes[n]._replace(fineness=places.fineness(nodes[n].t, nodes[n].pose, stage=FINE, check=True))
        for n in weak
    ]
    again = solutions(finer, "poses that need a finer resolution", progress, workers)
    solved = dict(zip((first + n for n in weak), again, strict=True))
    return [solved.get(n, answers) for n, answers in enumerate(found)]


def _is_definite(film: Samples, node: _Place, answers: Sequence[Samples]) -> bool:
    """Whether the outer resistance is positive definite at a node, of the robot and, with yaw, of its mirror image."""
    pose = node.pose
    image = [(mirror_image(some), replace(pose, yaw=-pose.yaw)) for some in answers[1:]]
    return all(
        is_positive_definite(outer_resistance(some, _film_of(film, at), node.t))
        for some, at in [(answers[0], pose), *image]
    )


def _film_of_table(places: Places) -> Samples:
    """Packed film of a robot's body in its tube."""
    stage = places.stage
    return _tabulated_film(places.geometry.body, places.radius, stage.film_yaws, stage.film_intervals)


@lru_cache(maxsize=16)
def _tabulated_film(body: Outline, radius: float, yaws: int, intervals: int) -> Samples:
    """Packed film of a body in a tube, for all the places that tables have."""
    yaw, pitch = kernel.YAW_SLACK * LARGEST_YAW, 1.1 * max(kernel.STEEPEST)
    return FilmTable.of(body, radius, yaw=yaw, pitch=pitch, yaws=yaws, intervals=intervals).packed


def _nodes(places: Places) -> list[NodeSolution]:
    """Nodes without yaw, then those with yaw, of the robot and of its mirror image."""

    def tail(place: _Place) -> tuple[RobotGeometry, tuple[float, ...]]:
        return places.geometry, even_phases(place.phases, places.geometry.form.starts)

    level = [NodeSolution((tail(place),), place.pose, places.fineness(place.t, place.pose)) for place in _level(places)]
    yawed = [
        NodeSolution((tail(place), mirrored(*tail(place))), place.pose, places.fineness(place.t, place.pose))
        for place in _yawed(places)
    ]
    return level + yawed


class _Place(NamedTuple):
    """A node."""

    t: float
    f: float
    pose: TubePose
    phases: int  #: Of the tail, evenly spread.


def _phases_at(places: Places, pose: TubePose) -> int:
    """Number of phases of the tail at a node."""
    return places.stage.phases_at(places.tail_clearance(pose) / float(np.max(places.swept[:, 1])))


def _level(places: Places) -> list[_Place]:
    """Nodes without yaw that are solved for: for each t those nose up, then, off the axis, those nose down."""
    return [
        _Place(float(t), float(f), pose, _phases_at(places, pose))
        for t in places.gaps
        for f in (*places.up, *(-places.down[1:] if t < 1.0 else ()))
        for pose in [places.pose(float(t), float(f))]
    ]


def _yawed(places: Places) -> list[_Place]:
    """Nodes with yaw that are solved for, those off the axis, one after the other for each share of the largest yaw."""
    if not places.stage.yawed:
        return []
    return [
        _Place(float(t), float(f), pose, _phases_at(places, pose))
        for t, row in zip(places.yaw_gaps, places.most_yaw, strict=True)
        if t < 1.0
        for f, most in zip(places.yaw_pitches, row, strict=True)
        for share in kernel.YAW_SHARES
        for pose in [places.pose(float(t), float(f), share * float(most))]
    ]


def _film_of(film: Samples, pose: TubePose) -> Samples:
    out = np.empty((6, 6))
    film_at(film, pose.offset, pose.pitch, pose.yaw, out)
    return out


def _packed(places: Places, found: Sequence[Sequence[Samples]]) -> Samples:
    """The packed table from the answers to `_nodes`: with yaw of the robot and of its mirror image."""
    starts, film, level = places.geometry.form.starts, _film_of_table(places), _level(places)
    rest = [
        outer_coefficients(own, _film_of(film, node.pose), node.t, node.pose, starts)
        for node, (own, *_) in zip(level, found[: len(level)], strict=True)
    ]
    most = places.most[-1]
    on_axis = OnAxis.of(places.up * most[0], np.stack(rest[-len(places.up) :]))
    rest += [on_axis.coefficients(float(-f * most[1])) for f in places.down[1:]]
    shape = len(places.gaps), len(places.up) + len(places.down) - 1, *rest[0].shape
    parts = (places.gaps, places.up, places.down, places.most, np.reshape(rest, shape))
    none = np.zeros(0)
    if not places.stage.yawed:
        return kernel.packed(places.radius, places.rings, *parts, none, none, _NO_YAW, none, film)
    straight = kernel.packed(places.radius, places.rings, *parts, none, none, places.yaw_limit, none, film)
    sides = []
    for (t, _, pose, _), (own, image) in zip(_yawed(places), found[len(level) :], strict=True):
        back = replace(pose, yaw=-pose.yaw)  # the nose to the other side
        left = outer_coefficients(own, _film_of(film, pose), t, pose, starts)
        sides.append((left, outer_coefficients(mirror_image(image), _film_of(film, back), t, back, starts)))
    for f, yaw in zip(places.yaw_pitches, places.most_yaw[-1], strict=True):
        pitch = float(f * (most[0] if f >= 0 else most[1]))
        for share in kernel.YAW_SHARES:
            here = share * float(yaw)
            sides.append((on_axis.coefficients(pitch, here), on_axis.coefficients(pitch, -here)))
    of_node = np.reshape(sides, (-1, len(kernel.YAW_SHARES), *np.shape(sides)[1:]))
    middles = [_interpolated(straight, pose, of_node.shape[-2]) for pose in places.yaw_poses]
    turned = np.stack([_powers(middle, node) for middle, node in zip(middles, of_node, strict=True)])
    yawed_nodes = places.yaw_gaps, places.yaw_pitches, places.yaw_limit
    return kernel.packed(places.radius, places.rings, *parts, *yawed_nodes, turned, film)


def _powers(middle: Samples, sides: Samples) -> Samples:
    """Coefficients of the powers of the stretched yaw from values at `YAW_SHARES`, (orders, phases, 36)."""
    odd, even = 0.5 * (sides[:, 0] - sides[:, 1]), 0.5 * (sides[:, 0] + sides[:, 1]) - middle
    return np.tensordot(np.linalg.inv(kernel.yaw_parts_at_nodes()), np.concatenate([odd, even]), axes=1)


def _interpolated(straight: Samples, pose: TubePose, count: int) -> Samples:
    """Fourier coefficients of the factor of the outer resistance, interpolated from the table without yaw."""
    out = np.empty((count, kernel.PARAMETERS))
    core.outer_coefficients(straight, pose.offset, pose.pitch, out)
    return out


def _check_poses(places: Places, *, yawed: bool = True) -> list[NodeSolution]:
    """Check poses of a table between its nodes, the hardest first, then random ones, each with some phases."""
    draw, least = np.random.default_rng(_SEED), np.log(0.5 * places.gaps[0])
    hardest = iter(places.stage.hardest_yawed if yawed else [(*hard, 0.0) for hard in places.stage.hardest])
    chosen: list[NodeSolution] = []
    while len(chosen) < places.stage.held_out:
        rise, f, share = (float(draw.uniform(low, high)) for low, high in ((0.0, 1.0), (-0.8, 1.0), (-1.0, 1.0)))
        rise, f, share = next(hardest, (rise, f, share if yawed else 0.0))
        t = float(np.exp((1.0 - rise) * least))
        yaw = share * places.largest_yaw(t, f) if yawed else 0.0
        pose, first = places.pose_between(t, f, yaw), float(draw.uniform(0.0, 2.0 * np.pi))
        phases = tuple(first + phase for phase in even_phases(_CHECKED_PHASES))
        clear = places.tail_clearance(pose) > places.least_clearance
        if clear and pose.clearance(places.geometry.body) > CHECKED_FROM * places.thinnest:
            chosen.append(NodeSolution(((places.geometry, phases),), pose, places.fineness(t, pose, check=True)))
    return chosen


def _largest_errors(
    table: Samples, checks: Sequence[NodeSolution], solved: Sequence[Sequence[Samples]]
) -> dict[str, float]:
    """Largest error of `RESPONSES` at poses with their solutions, over their sizes in a turn of the tail."""
    errors = []
    for check, answers in zip(checks, solved, strict=True):
        (_, phases), pose = check.tails[0], check.pose
        found = np.empty((len(phases) + PHASES, core.MOTIONS, core.MOTIONS))
        for phase, out in zip((*phases, *even_phases()), found, strict=True):
            core.resistance_at(table, pose.offset, pose.pitch, pose.yaw, phase, out)
        turn = found[len(phases) :]
        errors += [response_errors(own, true, turn) for own, true in zip(found, answers[0], strict=False)]
    return dict(zip(RESPONSES, np.max(errors, axis=0).tolist(), strict=True))
