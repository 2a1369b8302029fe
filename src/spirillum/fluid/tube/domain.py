"""Pose of a robot in its tube and its limits, within which the flow can be resolved."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import PerRobot
from spirillum.envelope import quantity
from spirillum.fluid.wire.robot_geometry import PIECES, RobotGeometry, number_of
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, within
from spirillum.robot.tube_pose import TubePose, gap_of, largest_gap
from spirillum.units import show

WIRE_FILM = 0.75  #: Smallest resolved clearance between the wire's surface and the wall, over the wire's radius.
_THINNEST_GAP = 1e-3  # Smallest resolved clearance between a solid and the wall, over the body's diameter.
_TIGHTEST = 1.05  # Diameter of the tightest tube over the body's.
_WIDEST = 1e3  # Largest size of a channel, m: those without one are infinite.


def in_tube(batch: RobotBatch, index: int = 0) -> tuple[RobotGeometry, float]:
    """Geometry of robot number `index` and R of its tube, m: what decides its table."""
    return RobotGeometry.of(batch, index), 0.5 * number_of(batch.channel_diameter, index)


def seated(batch: RobotBatch, index: int = 0) -> tuple[RobotGeometry, TubePose]:
    """Geometry of robot number `index` and its pose in its tube; by default level, at a gap of `GAP_SHARE`."""
    g, radius = in_tube(batch, index)
    return g, TubePose.of(batch.pose, g.body, g.width, radius)


def pose_of(batch: RobotBatch, index: int = 0) -> TubePose:
    """Pose of robot number `index` in its tube."""
    return seated(batch, index)[1]


@lru_cache(maxsize=4096)
def _tail_clearance(g: RobotGeometry, pose: TubePose) -> tuple[float, str]:
    """Smallest clearance of the tail over a turn, m, and its position in words."""
    wire = g.wire()
    found = pose.tail_clearance(wire.points, wire.radius)
    behind = show(-float(wire.points[found.index, 0]), "mm")
    return found.clearance, f" {behind} behind the body's middle at phase {show(found.phase, 'deg')}"


def placement_answer(batch: RobotBatch) -> dict[str, Any]:
    """Pose of the first robot of a batch, for results."""
    g, pose = seated(batch)
    room = pose.radius - 0.5 * g.width
    found: dict[str, Any] = {
        "kind": "in the channel",
        "gap": quantity(pose.clearance(g.body), "m"),
        "eccentricity": quantity(pose.offset / room, "1"),
        "pitch": quantity(pose.pitch, "rad"),
        "ends": batch.placement.ends_of(number_of(batch.channel_length, 0)),
    }
    if pose.yaw:
        found["yaw"] = quantity(pose.yaw, "rad")
    if pose.tail_drop:
        note = "a surrogate: no rigid tail on a revolute joint does it"
        found["tail_drop"] = quantity(pose.tail_drop, "m", note=note)
    if batch.placement.flow is not None:
        found["flow"] = quantity(batch.placement.flow, "m/s")
    return found


class _Films(NamedTuple):
    """Distances between the parts of robots and the wall, m; infinite for parts that do not matter."""

    asked: PerRobot  #: Requested gap.
    largest: PerRobot  #: Largest gap that there is room for.
    coupling: PerRobot
    tail: PerRobot
    where: str  #: Position of the smallest clearance of the last tail.


def pose_limits(
    batch: RobotBatch,
    part: str,
    kept: Sequence[Limit],
    *,
    thinnest_gap: float = _THINNEST_GAP,
    wire_film: float = WIRE_FILM,
) -> list[Limit]:
    """Requirements on the pose in the tube for one of `PIECES`, after those that do not depend on it."""
    # No clearance is computed for robots that cannot be built or break one of the former: their wires may be too fine
    # for the memory. The least gap is over the body's diameter, the least film at the wire over the wire's radius.
    resolved = f"the clearance of the wire is resolved down to {wire_film:g} of its radius, and below 0 "
    films = _films(batch, part, kept, thinnest_gap)
    angles = {"pitch": batch.placement.pitch, "yaw": batch.placement.yaw}
    said = [f"placement.{name} = {show(angle, 'deg')}" for name, angle in angles.items() if angle]
    turned = f" ({', '.join(said)})" if said else ""
    share = batch.pose.eccentricity
    gap = "placement.gap" if share is None else f"placement.eccentricity = {share:g}: gap"
    length = batch.channel_length if batch.placement.ends == "open" else np.zeros(1)
    thinnest, wire = thinnest_gap * batch.body_diameter, wire_film * 0.5 * batch.wire_diameter
    asked = np.where(np.isinf(films.asked), 0.0, films.asked)
    return [
        *kept,
        Limit.named("channel", batch.channel_diameter, _WIDEST),
        Limit.named("open-channel", length, _WIDEST),
        Limit.named("annulus", batch.channel_diameter, _TIGHTEST * batch.body_diameter),
        Limit.named("room", films.largest, 0.0, turned=turned),
        Limit.named("least-gap", films.asked, thinnest, gap=gap),
        Limit.named("largest-gap", asked, films.largest, gap=gap, turned=turned),
        Limit.named("coupling-off-wall", films.coupling, thinnest),
        Limit.named("tail-off-wall", films.tail, wire, where=films.where, resolved=resolved if wire_film else ""),
    ]


def _films(batch: RobotBatch, part: str, kept: Sequence[Limit], thinnest_gap: float) -> _Films:
    asked, largest, coupling, tail = (np.full(batch.size, np.inf) for _ in range(4))
    where = ""
    for index in within(batch, kept):
        g, radius = in_tube(batch, index)
        if not np.isfinite(radius):
            continue
        outlines = g.outlines
        asked[index] = gap_of(batch.pose, g.width, radius)
        largest[index] = largest_gap(g.body, radius, batch.placement.pitch or 0.0, batch.placement.yaw)
        if not thinnest_gap * g.body_diameter <= asked[index] <= largest[index]:
            continue
        pose = TubePose.of(batch.pose, g.body, g.width, radius)
        if "coupling" in outlines and "coupling" in PIECES[part]:
            coupling[index] = pose.clearance(outlines["coupling"])
        if "tail" in PIECES[part]:
            tail[index], where = _tail_clearance(g, pose)
    return _Films(asked, largest, coupling, tail, where if batch.size == 1 else "")
