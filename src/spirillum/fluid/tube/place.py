"""Where a robot lies in its tube, and what a place has to fulfil so that the flow around it can be resolved."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from spirillum.answer import quantity
from spirillum.arrays import PerRobot
from spirillum.fluid.tube.wall import Seat
from spirillum.fluid.wire.pieces import PIECES, Geometry, solids_of_geometry, wire_of_geometry
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, all_hold, assembly_limits
from spirillum.robot.outline import Outline
from spirillum.robot.seat import body_gap, largest_gap, offset_for_gap, tail_clearance
from spirillum.units import show

__all__ = [
    "GAP_BAND",
    "GAP_SHARE",
    "WIRE_FILM",
    "Place",
    "number_of",
    "place_of",
    "placement_answer",
    "seat_limits",
    "seat_of",
]

GAP_SHARE = 1.0 / 18.0
"""Gap over the body's radius where none is given: 0.5 mm for the paper's robot."""
GAP_BAND = (1.0 / 90.0, 1.0 / 9.0)
"""The same for the band over unknown gaps: 0.1 to 1 mm for the paper's robot."""
WIRE_FILM = 0.75
"""Thinnest film between the wire's surface and the glass over the wire's radius: thinner ones are not resolved."""
_THINNEST_GAP = 1e-3
"""Thinnest film between a solid and the glass over the body's diameter: thinner ones are not resolved."""
_TIGHTEST = 1.05
"""Diameter of the tightest tube over the body's."""
_WIDEST = 1e3
"""Largest size of a channel, m: those without one are infinite."""


class Place(NamedTuple):
    """Where a robot is: tube, seat, and the surrogate's drop of the tail; m and rad."""

    radius: float
    offset: float
    pitch: float
    drop: float

    @property
    def seat(self) -> Seat:
        """The seat alone."""
        return Seat(self.radius, self.offset, self.pitch)


def number_of(column: PerRobot, index: int) -> float:
    """Value of a column for robot number `index`."""
    return float(column[index if column.size > 1 else 0])


def place_of(batch: RobotBatch, index: int) -> Place:
    """Place of robot number `index`; what the placement leaves open is level, and a gap of `GAP_SHARE`."""
    placement, body = batch.placement, _body(Geometry.of(batch, index))
    radius, pitch = 0.5 * number_of(batch.channel_diameter, index), placement.pitch or 0.0
    return Place(radius, _offset(body, radius, _gap(batch, index), pitch), pitch, placement.tail_drop)


def seat_of(batch: RobotBatch, index: int = 0) -> Seat:
    """Where in its tube robot number `index` lies."""
    return place_of(batch, index).seat


def _gap(batch: RobotBatch, index: int) -> float:
    """Gap in force; no larger than the robot's on the axis where none is given."""
    if batch.placement.gap is not None:
        return batch.placement.gap
    room = 0.5 * (number_of(batch.channel_diameter, index) - number_of(batch.body_diameter, index))
    if batch.placement.eccentricity is not None:
        return (1.0 - batch.placement.eccentricity) * room
    return min(GAP_SHARE * 0.5 * number_of(batch.body_diameter, index), room)


def _body(g: Geometry) -> Outline:
    return next(outline for name, outline, _ in solids_of_geometry(g) if name == "body")


@lru_cache(maxsize=256)
def _offset(body: Outline, radius: float, gap: float, pitch: float) -> float:
    return offset_for_gap(body, radius, gap, pitch)


@lru_cache(maxsize=4096)
def _largest(body: Outline, radius: float, pitch: float) -> float:
    return largest_gap(body, radius, pitch)


@lru_cache(maxsize=4096)
def _tail_clearance(g: Geometry, place: Place) -> tuple[float, str]:
    """Smallest clearance of the tail over a turn, m, and where it is, in words."""
    wire = wire_of_geometry(g, 1.0)
    found = tail_clearance(wire.points, wire.radius, *place)
    behind = show(-float(wire.points[found.index, 0]), "mm")
    return found.clearance, f" {behind} behind the body's middle at phase {show(found.phase, 'deg')}"


def placement_answer(batch: RobotBatch) -> dict[str, Any]:
    """Where the first robot of a batch lies, for answers."""
    place, body = place_of(batch, 0), _body(Geometry.of(batch, 0))
    room = place.radius - 0.5 * number_of(batch.body_diameter, 0)
    found: dict[str, Any] = {
        "kind": "in the channel",
        "gap": quantity(body_gap(body, place.radius, place.offset, place.pitch), "m"),
        "eccentricity": quantity(place.offset / room, "1"),
        "pitch": quantity(place.pitch, "rad"),
        "ends": batch.placement.ends_of(number_of(batch.channel_length, 0)),
    }
    if place.drop:
        found["tail_drop"] = quantity(place.drop, "m", note="a surrogate: no rigid tail on a revolute joint does it")
    if batch.placement.flow is not None:
        found["flow"] = quantity(batch.placement.flow, "m/s")
    return found


class _Films(NamedTuple):
    """Distances between the parts of robots and the glass, m; infinite for parts that do not matter."""

    asked: PerRobot
    """Gap asked for."""
    largest: PerRobot
    """Largest gap that there is room for."""
    coupling: PerRobot
    tail: PerRobot
    where: str
    """Where the last tail comes closest."""


def seat_limits(batch: RobotBatch, part: str) -> list[Limit]:
    """Requirements on the place in the tube for one of `PIECES`; robots that cannot be built are not asked."""
    films = _films(batch, part)
    open_ended = batch.placement.ends == "open"
    thinnest = _THINNEST_GAP * batch.body_diameter
    return [
        Limit.of(
            "there is no [channel]: channel.diameter",
            batch.channel_diameter,
            "at most",
            _WIDEST,
            "mm",
            "model 'tube' computes the walls of a channel",
            "no-channel",
        ),
        Limit.of(
            "the [channel] has no length: channel.length",
            batch.channel_length if open_ended else np.zeros(1),
            "at most",
            _WIDEST,
            "mm",
            "open ends matter by the length of tube between them (placement.ends = 'closed' needs none)",
            "no-channel-length",
        ),
        Limit.of(
            "channel.diameter",
            batch.channel_diameter,
            "at least",
            _TIGHTEST * batch.body_diameter,
            "mm",
            "a film all round the body is resolved down to a twentieth of its radius",
            "gap-too-thin",
        ),
        Limit.of(
            "placement.gap", films.asked, "at least", thinnest, "mm", "thinner films are not resolved", "gap-too-thin"
        ),
        Limit.of(
            "placement.gap",
            np.where(np.isinf(films.asked), 0.0, films.asked),
            "at most",
            films.largest,
            "mm",
            "there is no more room in the channel",
            "gap-too-wide",
        ),
        Limit.of(
            "clearance of coupling and glass",
            films.coupling,
            "at least",
            thinnest,
            "mm",
            "the coupling would touch the glass (placement.pitch, coupling.diameter)",
            "tail-in-wall",
        ),
        Limit.of(
            f"clearance of tail and glass{films.where}",
            films.tail,
            "at least",
            WIRE_FILM * 0.5 * batch.wire_diameter,
            "mm",
            f"the film under the wire is resolved down to {WIRE_FILM:g} of its radius, and below 0 the tail would "
            "pass through the wall (placement.pitch, placement.tail_drop, tail.amplitude)",
            "tail-in-wall",
        ),
    ]


def _films(batch: RobotBatch, part: str) -> _Films:
    asked, largest, coupling, tail = (np.full(batch.size, np.inf) for _ in range(4))
    where = ""
    for index in _seated(batch):
        g, radius = Geometry.of(batch, index), 0.5 * number_of(batch.channel_diameter, index)
        asked[index] = _gap(batch, index)
        largest[index] = _largest(_body(g), radius, batch.placement.pitch or 0.0)
        if not _THINNEST_GAP * g.body_diameter <= asked[index] <= largest[index]:
            continue
        place = place_of(batch, index)
        for name, outline, _ in solids_of_geometry(g):
            if name == "coupling" and name in PIECES[part]:
                coupling[index] = body_gap(outline, radius, place.offset, place.pitch)
        if "tail" in PIECES[part]:
            tail[index], where = _tail_clearance(g, place)
    return _Films(asked, largest, coupling, tail, where if batch.size == 1 else "")


def _seated(batch: RobotBatch) -> Iterator[int]:
    """Robots that can be built and have a channel around them."""
    there = batch.known & all_hold(assembly_limits(batch)) & np.isfinite(batch.channel_diameter)
    yield from np.flatnonzero(np.broadcast_to(there, (batch.size,))).tolist()
