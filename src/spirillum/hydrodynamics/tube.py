"""The robot in its tube: confinement computed from first principles, with no calibrated factor.

Body and coupling are as they are, the tail is a wire, the glass is a circular cylinder, and the flow between them all
is solved for (`confined`). The answer depends on where the robot lies and on the tail's phase. No net flux passes the
tube in that solution; open ends and an imposed flow follow from one scalar, the mean velocity U_m:

    8 pi mu L_eff U_m = load . V - drag U_m,    L_eff = L_ch + 1.09 R,

with the wrench `load` and the work `drag` of the flow of unit mean velocity past the robot at rest (reciprocal
theorem). The two losses at the ends of a free, thin-walled tube together are worth 1.09 R of its length, computed with
the tube's own wall meshed in an unbounded bath (`benchmarks/tube_reference.py`); a flange or a thick wall at both ends
makes 3 pi R/8 of it (Dagan, Weinbaum and Pfeffer, J. Fluid Mech. 115:505, 1982).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from spirillum.answer import quantity
from spirillum.arrays import Axial, AxialLoad, Flags, Matrix6, Matrix12, MeanFlow, PerRobot, Samples
from spirillum.errors import InputError
from spirillum.hydrodynamics.algebra import axis_rotation, joint_locked
from spirillum.hydrodynamics.confined import Held, held_in_tube
from spirillum.hydrodynamics.model import SwimmerModel
from spirillum.hydrodynamics.pieces import PIECES, Geometry, solids_of_geometry, wire_of_geometry
from spirillum.hydrodynamics.slender import Slender
from spirillum.hydrodynamics.tube_cache import kept_or_computed
from spirillum.hydrodynamics.tube_solids import MOTIONS, Fineness, Solids
from spirillum.hydrodynamics.tube_wall import Seat
from spirillum.hydrodynamics.wire import Wire
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, all_hold, assembly_limits
from spirillum.robot.options import ModelOptions
from spirillum.robot.outline import Outline
from spirillum.robot.seat import body_gap, largest_gap, offset_for_gap, tail_clearance
from spirillum.units import show

__all__ = ["END_LOSS", "GAP_BAND", "GAP_SHARE", "WIRE_FILM", "Tube", "held_robot", "seat_of"]

END_LOSS = 1.09
"""Length of tube over R that the losses at both open ends are worth."""
GAP_SHARE = 1.0 / 18.0
"""Gap over the body's radius where none is given: 0.5 mm for the paper's robot."""
GAP_BAND = (1.0 / 90.0, 1.0 / 9.0)
"""The same for the band over unknown gaps: 0.1 to 1 mm for the paper's robot."""
WIRE_FILM = 0.75
"""Thinnest film between the wire's surface and the glass over the wire's radius: thinner ones are not resolved."""
_CUT = 0.2
"""Tolerance of waves and modes over that of the speed: at gaps of 0.2 and 0.5 mm speeds are then good to a tenth."""
_COARSER = 10.0
"""The same of the resolution that gives the error estimate."""
_MOST_UNKNOWNS = 11_000
"""Of one parity: 2 GiB for the factors of both."""
_AXIAL = np.array([0, 3, 6, 9])


class _Place(NamedTuple):
    """Where a robot is: tube, seat, and the surrogate's drop of the tail; m and rad."""

    radius: float
    offset: float
    pitch: float
    drop: float

    @property
    def seat(self) -> Seat:
        """The seat alone."""
        return Seat(self.radius, self.offset, self.pitch)


def _number(column: PerRobot, index: int) -> float:
    return float(column[index if column.size > 1 else 0])


def _body(g: Geometry) -> Outline:
    return next(outline for name, outline, _ in solids_of_geometry(g) if name == "body")


def _place(batch: RobotBatch, index: int) -> _Place:
    """Place of robot number `index`; what the placement leaves open is level, and a gap of `GAP_SHARE`."""
    placement, g = batch.placement, Geometry.of(batch, index)
    radius, pitch = 0.5 * _number(batch.channel_diameter, index), placement.pitch or 0.0
    if placement.eccentricity is not None:
        offset = placement.eccentricity * (radius - 0.5 * g.body_diameter)
    else:
        offset = _offset(_body(g), radius, _gap(batch, index), pitch)
    return _Place(radius, offset, pitch, placement.tail_drop)


def _gap(batch: RobotBatch, index: int) -> float:
    """Gap in force; no larger than the robot's on the axis where none is given."""
    if batch.placement.gap is not None:
        return batch.placement.gap
    room = 0.5 * (_number(batch.channel_diameter, index) - _number(batch.body_diameter, index))
    return min(GAP_SHARE * 0.5 * _number(batch.body_diameter, index), room)


@lru_cache(maxsize=256)
def _offset(body: Outline, radius: float, gap: float, pitch: float) -> float:
    return offset_for_gap(body, radius, gap, pitch)


def seat_of(batch: RobotBatch, index: int = 0) -> Seat:
    """Where in its tube robot number `index` lies."""
    return _place(batch, index).seat


def _near(g: Geometry) -> Samples:
    """Where any tail's root may be, behind the coupling: (x, rho, blob radius), the same for all tails of a robot."""
    widest = max(0.5 * g.coupling_diameter, 4.0 * g.wire_diameter)
    rho = np.linspace(0.0, widest, 9)
    blob = wire_of_geometry(g, 1.0).blob
    return np.stack([np.full(9, -0.5 * g.body_length - g.coupling_length), rho, np.full(9, blob)], axis=1)


class _SolidKey(NamedTuple):
    """All that decides the solids and the wall."""

    solids: tuple[tuple[Outline, int], ...]
    near: tuple[tuple[float, ...], ...]
    place: _Place
    fineness: Fineness


def _solid_key(g: Geometry, part: str, place: _Place, fineness: Fineness) -> _SolidKey:
    solids = tuple((outline, moves) for name, outline, moves in solids_of_geometry(g) if name in PIECES[part])
    near = tuple(map(tuple, _near(g).tolist())) if "tail" in PIECES[part] else ()
    return _SolidKey(solids, near, place._replace(drop=0.0), fineness)


@lru_cache(maxsize=1)
def _solids(key: _SolidKey) -> Solids:
    """The last one is kept: tails at one place come one after the other, and factors take memory."""
    return Solids(key.solids, key.place.seat, key.fineness, np.array(key.near).reshape(-1, 3))


@lru_cache(maxsize=4096)
def _size(key: _SolidKey) -> int:
    """Number of unknowns of one parity."""
    return Solids(key.solids, key.place.seat, key.fineness, np.array(key.near).reshape(-1, 3)).size


def _turned(wire: Wire, phase: float) -> Wire:
    turn = axis_rotation(np.array([phase]))[0]
    return Wire(wire.points @ turn.T, wire.tangents @ turn.T, wire.lengths, wire.radius)


class _Question(NamedTuple):
    """All that decides an answer, but for the viscosity and the ends."""

    geometry: Geometry
    part: str
    place: _Place
    fineness: Fineness
    phase: float


def _held(question: _Question) -> Held:
    g, part, place, fineness, phase = question
    wires = [(_turned(wire_of_geometry(g, 1.0), phase), 1)] if "tail" in PIECES[part] else []
    return held_in_tube(_solids(_solid_key(g, part, place, fineness)), wires, place.drop)


def _computed(question: _Question) -> Samples:
    """R, load and drag for viscosity 1, as one (13, 13)."""
    held = _held(question)
    found = np.empty((MOTIONS, MOTIONS))
    found[:-1, :-1], found[:-1, -1], found[-1, :-1], found[-1, -1] = held.matrix, held.load, held.load, held.drag
    return found


@lru_cache(maxsize=4096)
def _answer(question: _Question) -> Samples:
    found = kept_or_computed(question, _computed)
    found.flags.writeable = False
    return found


def held_robot(batch: RobotBatch, index: int = 0, phase: float = 0.0) -> Held:
    """All that the flow around robot number `index` exerts and is made by, viscosity 1, no net flux.

    Args:
        batch: robots inside the domain of the model.
        index: which.
        phase: of the tail, rad.
    """
    fineness = Tube().fineness(batch.options)
    return _held(_Question(Geometry.of(batch, index), "robot", _place(batch, index), fineness, phase))


class Tube(SwimmerModel):
    """Body, coupling and tail in their tube, and all the flow between them and the wall."""

    name = "tube"
    title = "tube"
    references = ("happel1983", "cortez2001", "pozrikidis1992", "dagan1982", "biorob2012")
    known_error = (
        "no calibrated factor: the walls are computed; what the paper does not tell, the gap under the body and its "
        "pitch, decides much of the answer"
    )
    parts = ("body", "coupling", "tail", "rotor", "robot")
    closed_form = False
    placed = True

    def __init__(self, coarser: float = 1.0) -> None:
        """Resolve the flow to each robot's `model.tube.tolerance`, or more coarsely by a factor."""
        self._coarser = coarser

    def fineness(self, options: ModelOptions) -> Fineness:
        """How finely the flow is resolved with these options."""
        return Fineness(options.slender.accuracy, min(_CUT * self._coarser * options.tube.tolerance, 0.1))

    def checked_by(self, options: ModelOptions) -> SwimmerModel:
        """See `SwimmerModel.checked_by`."""
        return Tube(_COARSER)

    def placement_of(self, batch: RobotBatch) -> dict[str, Any]:
        """See `ResistanceModel.placement_of`."""
        if not np.all(all_hold(self.domain(batch))):
            return {"kind": "in the channel"}
        place, body = _place(batch, 0), _body(Geometry.of(batch, 0))
        room = place.radius - 0.5 * _number(batch.body_diameter, 0)
        found: dict[str, Any] = {
            "kind": "in the channel",
            "gap": quantity(body_gap(body, place.radius, place.offset, place.pitch), "m"),
            "eccentricity": quantity(place.offset / room, "1"),
            "pitch": quantity(place.pitch, "rad"),
            "ends": batch.placement.ends_of(_number(batch.channel_length, 0)),
        }
        if place.drop:
            found["tail_drop"] = quantity(
                place.drop, "m", note="a surrogate: no rigid tail on a revolute joint does it"
            )
        if batch.placement.flow is not None:
            found["flow"] = quantity(batch.placement.flow, "m/s")
        return found

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """What `slender` asks for, and a robot that lies in a tube without touching it."""
        return [*Slender().domain(batch), *self._seated(batch, "robot")]

    def part_domain(self, batch: RobotBatch, part: str) -> list[Limit]:
        """See `ResistanceModel.part_domain`."""
        return [*Slender().part_domain(batch, part), *self._seated(batch, part)]

    def _seated(self, batch: RobotBatch, part: str) -> list[Limit]:
        """Requirements on the place in the tube."""
        size = (batch.size,)
        fit = np.broadcast_to(batch.known & all_hold(assembly_limits(batch)), size)
        placed, fine = np.full(size, np.inf), np.full(size, 0.0)
        there = np.isfinite(np.broadcast_to(batch.channel_diameter, size))
        asked = np.zeros(size)
        clear, where = np.full(size, np.inf), ""
        for index in np.flatnonzero(fit & there):
            g, radius = Geometry.of(batch, int(index)), 0.5 * _number(batch.channel_diameter, int(index))
            asked[index] = _gap(batch, int(index))
            placed[index] = _largest(_body(g), radius, batch.placement.pitch or 0.0)
            place = _place(batch, int(index)) if asked[index] <= placed[index] else None
            if place is None:
                continue
            if "tail" in PIECES[part]:
                clear[index], where = _clearance(g, place)
            if clear[index] > 0:
                fine[index] = _size(_solid_key(g, part, place, self.fineness(batch.options)))
        ends = batch.placement.ends_of(np.inf) == "closed" and batch.placement.ends == "open"
        return [
            Limit.of(
                "channel.diameter",
                np.where(there, 0.0, np.inf),
                "less than",
                np.inf,
                "mm",
                "model 'tube' computes the walls of a channel",
                "no-channel",
            ),
            Limit.of(
                "channel.length",
                np.where(ends, batch.channel_length, 0.0),
                "less than",
                np.inf,
                "mm",
                "open ends matter by the length of tube between them (placement.ends = 'closed' needs none)",
                "no-channel-length",
            ),
            Limit.of(
                "placement.gap", asked, "at most", placed, "mm", "the body would rise above the axis", "gap-too-wide"
            ),
            Limit.of(
                f"clearance of tail and glass{where}",
                clear,
                "at least",
                WIRE_FILM * 0.5 * batch.wire_diameter,
                "mm",
                f"the film under the wire is resolved down to {WIRE_FILM:g} of its radius, and below 0 the tail would "
                "pass through the wall (placement.pitch, placement.tail_drop, tail.amplitude)",
                "tail-in-wall",
            ),
            Limit.of(
                "unknowns that gap and tolerance ask for",
                fine,
                "at most",
                float(_MOST_UNKNOWNS),
                "1",
                "they would fill the memory: a wider placement.gap or a larger model.tube.tolerance",
                "gap-too-thin",
            ),
        ]

    def axial(self, batch: RobotBatch) -> Axial:
        """See `SwimmerModel.axial`: the average over `model.tube.phases` phases, ends condensed."""
        answers, _ = self._axial(batch)
        return answers[:, :4, :4]

    def axial_load(self, batch: RobotBatch) -> AxialLoad:
        """See `SwimmerModel.axial_load`."""
        answers, _ = self._axial(batch)
        return (batch.placement.flow or 0.0) * answers[:, :4, 4]

    def mean_flow(self, batch: RobotBatch) -> MeanFlow:
        """See `SwimmerModel.mean_flow`."""
        return self._axial(batch)[1]

    def _axial(self, batch: RobotBatch) -> tuple[Samples, Samples]:
        """R and load along the tube and about the motor axis, (n, 5, 5), and the mean flow, (n, 5)."""
        phases = 2.0 * np.pi * np.arange(batch.options.tube.phases) / batch.options.tube.phases
        along = np.zeros((5, MOTIONS))
        along[[1, 3, 4], [3, 9, 12]] = 1.0
        pitch = batch.placement.pitch or 0.0
        for row, first in ((0, 0), (2, 6)):
            along[row, first], along[row, first + 2] = np.cos(pitch), -np.sin(pitch)
        answers, flows = np.zeros((batch.size, 5, 5)), np.zeros((batch.size, 5))
        for phase in phases:
            full = along @ self._full(batch, "robot", np.array([phase])) @ along.T
            condensed, flow = self._with_ends(batch, full)
            answers += condensed / len(phases)
            flows += flow / len(phases)
        return answers, flows

    def _with_ends(self, batch: RobotBatch, full: Samples) -> tuple[Samples, Samples]:
        """Ends condensed: (n, k, k) with the flow as last row and column, and the mean flow that goes with motions."""
        length, radius = (
            np.broadcast_to(v, (batch.size,)) for v in (batch.channel_length, 0.5 * batch.channel_diameter)
        )
        flow = np.zeros(full.shape[:2])
        opened = np.array([batch.placement.ends_of(float(value)) == "open" for value in length])
        if batch.placement.flow is not None:
            flow[:, -1] = batch.placement.flow
        if np.any(opened):
            viscosity = np.broadcast_to(batch.viscosity, (batch.size,))
            against = 8.0 * np.pi * viscosity * (length + END_LOSS * radius) + full[:, -1, -1]
            flow[:, :-1] = np.where(opened[:, None], full[:, :-1, -1] / against[:, None], 0.0)
            full = full.copy()
            full[:, :-1, :-1] -= flow[:, :-1, None] * full[:, None, :-1, -1]
        return full, flow

    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Matrix12:
        """See `SwimmerModel.resistance`; about the origin in body axes, ends condensed."""
        return self._with_ends(batch, self._full(batch, "robot", phase))[0][:, :-1, :-1]

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Matrix6:
        """See `ResistanceModel.part_matrix`; that part alone in the channel, where the robot lies."""
        if part not in self.parts:
            raise InputError(f"part = {part!r} with model 'tube'; allowed: {', '.join(self.parts)}")
        if part == "coupling" and np.any((batch.coupling_length == 0) | (batch.coupling_diameter == 0)):
            raise InputError("part = 'coupling': this robot has none (coupling.length or coupling.diameter is 0)")
        return joint_locked(self._with_ends(batch, self._full(batch, part, phase))[0][:, :-1, :-1])

    def _full(self, batch: RobotBatch, part: str, phase: PerRobot) -> Samples:
        """R, load and drag of a part, (n, 13, 13), no net flux; NaN outside the domain."""
        found = np.full((batch.size, MOTIONS, MOTIONS), np.nan)
        limits = assembly_limits(batch) + self.part_domain(batch, part)
        answerable: Flags = np.broadcast_to(batch.known & all_hold(limits), (batch.size,))
        fineness = self.fineness(batch.options)
        turns = np.broadcast_to(phase, (batch.size,))
        for index in np.flatnonzero(answerable):
            g, place = Geometry.of(batch, int(index)), _place(batch, int(index))
            turn = float(turns[index]) if "tail" in PIECES[part] else 0.0
            question = _Question(g, part, place, fineness, turn)
            found[index] = _number(batch.viscosity, int(index)) * _answer(question)
        return found


@lru_cache(maxsize=4096)
def _largest(body: Outline, radius: float, pitch: float) -> float:
    return largest_gap(body, radius, pitch)


@lru_cache(maxsize=4096)
def _clearance(g: Geometry, place: _Place) -> tuple[float, str]:
    """Smallest clearance of the tail over a turn, m, and where it is, in words."""
    wire = wire_of_geometry(g, 1.0)
    found = tail_clearance(wire.points, wire.radius, *place)
    behind = show(-float(wire.points[found.index, 0]), "mm")
    return found.clearance, f" {behind} behind the body's middle at phase {show(found.phase, 'deg')}"
