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

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Axial, Matrix6, Matrix12, PerRobot, Samples
from spirillum.errors import MOST_MEMORY, InputError
from spirillum.fluid.algebra import axis_rotation, joint_locked
from spirillum.fluid.model import AxialFlow, SwimmerModel
from spirillum.fluid.reference_errors import CHECKED, STATED, fit_clause, validation_note
from spirillum.fluid.tube.cache import cached_or_computed, is_cached
from spirillum.fluid.tube.confined import UnitMotions, share_basis, solve_unit_motions
from spirillum.fluid.tube.domain import placement_answer, pose_limits, seated
from spirillum.fluid.tube.solids import MOTIONS, Fineness, Solids, check_fits
from spirillum.fluid.tube.stages import LARGEST_WIRE_ERROR
from spirillum.fluid.wire.robot_geometry import PIECES, RobotGeometry, number_of
from spirillum.fluid.wire.slender import FINEST_WIRE_ERROR, Slender
from spirillum.fluid.wire.stokeslets import Accuracy, Wire
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, all_hold, within
from spirillum.robot.outline import Outline
from spirillum.robot.tube_pose import TubePose

END_LOSS = 1.09  #: Length of tube over R that the losses at both open ends are worth.
_CUT = 0.2
"""Tolerance of waves and modes over that of the speed: at gaps of 0.2 and 0.5 mm speeds are then good to a tenth."""
_COARSER = 10.0  # Tolerance of the resolution that gives the error estimate, over that of the result.
_COARSEST = 0.05  # Coarsest tolerance of Fourier modes.
_ORDERS = ((5e-3, 4), (5e-4, 6), (0.0, 8))
"""Gauss nodes of a panel from which tolerance on: they change the speed by less than the tolerance does."""
_MOST_FINE_STATIONS = 300  # Along a tail with `high` wires, whose equations then cost as much as the solids'.
_MOST_WAVES = 1_000_000  # Orders and wave numbers together: minutes.
_MOST_UNKNOWNS = 11_000  # Of one parity: 2 GiB for the factors of both.


def _near(g: RobotGeometry) -> Samples:
    """Where any tail's root may be, behind the coupling: (x, rho, blob radius), the same for all tails of a robot."""
    widest = max(0.5 * g.coupling_diameter, 4.0 * g.wire_diameter)
    rho = np.linspace(0.0, widest, 9)
    blob = g.wire().blob
    return np.stack([np.full(9, -0.5 * g.body_length - g.coupling_length), rho, np.full(9, blob)], axis=1)


class _SolidKey(NamedTuple):
    """All that decides the solids and the wall."""

    solids: tuple[tuple[Outline, int], ...]
    near: tuple[tuple[float, ...], ...]
    pose: TubePose
    fineness: Fineness

    def made(self) -> Solids:
        """The solids, not solved for yet."""
        return Solids(self.solids, self.pose, self.fineness, np.array(self.near).reshape(-1, 3))


def _solid_key(g: RobotGeometry, part: str, pose: TubePose, fineness: Fineness) -> _SolidKey:
    near = tuple(map(tuple, _near(g).tolist())) if "tail" in PIECES[part] else ()
    return _SolidKey(tuple(g.solids(part)), near, replace(pose, tail_drop=0.0), fineness)


@lru_cache(maxsize=1)
def _solids(key: _SolidKey) -> Solids:
    """Solids of a pose; the last one is cached, for consecutive tails share a pose and factorizations are large."""
    return key.made()


@lru_cache(maxsize=4096)
def _size(key: _SolidKey) -> tuple[int, int]:
    """Number of unknowns of one parity, and of waves between solids and wall; of these 0 with too many unknowns."""
    solids = key.made()
    few = not solids.none and solids.size <= _MOST_UNKNOWNS
    return solids.size, sum(solids.waves(solids.gap).orders) if few else 0


@lru_cache(maxsize=4096)
def _memory(key: _SolidKey) -> float:
    """See `Solids.memory`."""
    return key.made().memory


def _turned(wire: Wire, phase: float) -> Wire:
    turn = axis_rotation(np.array([phase]))[0]
    return Wire(wire.points @ turn.T, wire.tangents @ turn.T, wire.lengths, wire.radius)


class _SolveRequest(NamedTuple):
    """Request of a solution: all parameters but the viscosity and the ends."""

    geometry: RobotGeometry
    part: str
    pose: TubePose
    fineness: Fineness
    phase: float


def _unit_motions(question: _SolveRequest) -> UnitMotions:
    g, part, pose, fineness, phase = question
    wires = [(_turned(wire, phase), 1) for wire in g.wires()] if "tail" in PIECES[part] else []
    return solve_unit_motions(_solids(_solid_key(g, part, pose, fineness)), wires, pose.tail_drop)


def _computed(question: _SolveRequest) -> Samples:
    """R, load and drag for viscosity 1, as one (13, 13)."""
    held = _unit_motions(question)
    if np.min(np.diag(held.matrix)) < 0:
        raise InputError(
            "the flow in the tube is not resolved at this placement.gap; allowed: a wider gap or a finer tolerance"
        )
    found = np.empty((MOTIONS, MOTIONS))
    found[:-1, :-1], found[:-1, -1], found[-1, :-1], found[-1, -1] = held.matrix, held.load, held.load, held.drag
    return found


@lru_cache(maxsize=4096)
def _answer(question: _SolveRequest) -> Samples:
    found = cached_or_computed(question, _computed)
    found.flags.writeable = False
    return found


def solved(geometry: RobotGeometry, pose: TubePose, fineness: Fineness, phase: float) -> Samples:
    """R, load and drag of a whole robot, (13, 13): viscosity 1, no net flux, twists about the origin in body axes."""
    return _answer(_SolveRequest(geometry, "robot", pose, fineness, phase))


def is_solved(geometry: RobotGeometry, pose: TubePose, fineness: Fineness, phase: float) -> bool:
    """Whether the result of `solved` is cached."""
    return is_cached(_SolveRequest(geometry, "robot", pose, fineness, phase), _computed)


def solved_together(
    tails: Sequence[tuple[RobotGeometry, tuple[float, ...]]], pose: TubePose, fineness: Fineness
) -> list[Samples]:
    """As `solved`, (phases, 13, 13) for each of some robots that differ in their tails: wall and body are shared."""
    keys = {_solid_key(g, "robot", pose, fineness) for g, _ in tails}
    if len(keys) != 1:
        raise ValueError("robots that differ in more than their tails")
    solids = _solids(keys.pop())
    share_basis(solids, [g.wires() for g, _ in tails])
    found = [np.stack([solved(g, pose, fineness, phase) for phase in phases]) for g, phases in tails]
    share_basis(solids, [])
    return found


def check_solvable(geometry: RobotGeometry, pose: TubePose, fineness: Fineness) -> None:
    """Refuse a pose at which the flow around a whole robot does not fit into memory."""
    check_fits(_memory(_solid_key(geometry, "robot", pose, fineness)))


def unit_motions(batch: RobotBatch, index: int = 0, phase: float = 0.0) -> UnitMotions:
    """All that the flow around robot number `index` exerts and is made by, viscosity 1, no net flux."""
    fineness = Tube().fineness(batch, index)
    g, pose = seated(batch, index)
    return _unit_motions(_SolveRequest(g, "robot", pose, fineness, phase))


def finest_wire(g: RobotGeometry) -> Accuracy:
    """Form of the wire that the model takes: `high`, but for tails of more stations than are quickly solved for."""
    return "high" if g.stations <= _MOST_FINE_STATIONS else "standard"


class Tube(SwimmerModel):
    """Body, coupling and tail in their tube, and all the flow between them and the wall."""

    name = "tube"
    title = "tube"
    references = ("happel1983", "cortez2001", "pozrikidis1992", "dagan1982", "biorob2012")
    known_error = STATED["tube"]
    parts = ("body", "coupling", "tail", "rotor", "robot")
    closed_form = False
    form = "direct"
    placed = True

    def __init__(self, coarser: float = 1.0, *, between: bool = False, wire: Accuracy | None = None) -> None:
        """Resolve the flow to each robot's `model.tube.tolerance`, or more coarsely, at evenly spread phases.

        Args:
            coarser: factor of the tolerance.
            between: average over the phases halfway between those that start at 0.
            wire: form of the wire; None: `high` by each robot's `model.slender.accuracy`, or where its tail allows it.
        """
        self._coarser, self._first, self._wire = coarser, 0.5 if between else 0.0, wire

    def error_statement(self, batch: RobotBatch, fitted_by: str = "") -> str:
        """See `ResistanceModel.error_statement`: numerical errors are estimated; what remains is an assumed pose."""
        placement = batch.placement
        unknown = ["the gap under the body"] if placement.gap is None and placement.eccentricity is None else []
        unknown += ["the body's pitch"] if placement.pitch is None else []
        if unknown:
            decide = "decides" if len(unknown) == 1 else "decide"
            place = f"{' and '.join(unknown)}, not given here, {decide} much of the answer"
        else:
            place = "gap and pitch are taken as given: their own uncertainty comes on top"
        standard = any(self._wire_of(batch, index) == "standard" for index in range(batch.size))
        wire = f"; without walls, {validation_note(batch, CHECKED['slender'])}" if standard else ""
        return f"walls are computed, {fit_clause(fitted_by)}; {place}{wire}"

    def fineness(self, batch: RobotBatch, index: int = 0) -> Fineness:
        """Resolution of the flow around robot number `index`."""
        tolerance = min(_CUT * self._coarser * batch.options.tube.tolerance, _COARSEST)
        order = next(order for coarsest, order in _ORDERS if tolerance >= coarsest)
        return Fineness(self._wire_of(batch, index), tolerance, order)

    def _wire_of(self, batch: RobotBatch, index: int) -> Accuracy:
        stated = batch.options.slender.accuracy
        return self._wire or (stated if stated == "high" else finest_wire(RobotGeometry.of(batch, index)))

    def checked_by(self, batch: RobotBatch) -> tuple[SwimmerModel, ...]:
        """See `SwimmerModel.checked_by`: other phases give the error of the mean over a turn, too."""
        return (Tube(_COARSER, between=True),)

    def unchecked_error(self, batch: RobotBatch) -> float:
        """See `SwimmerModel.unchecked_error`; of `standard` wires what the finest form changes at most."""
        return FINEST_WIRE_ERROR + (LARGEST_WIRE_ERROR if self._wire_of(batch, 0) == "standard" else 0.0)

    def placement_of(self, batch: RobotBatch) -> dict[str, Any]:
        """See `ResistanceModel.placement_of`."""
        if not np.all(all_hold(self.domain(batch))):
            return {"kind": "in the channel"}
        return placement_answer(batch)

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """Requirements of `slender`, and a pose in a tube at which the flow can be resolved."""
        return self.part_domain(batch, "robot")

    def part_domain(self, batch: RobotBatch, part: str) -> list[Limit]:
        """See `ResistanceModel.part_domain`."""
        limits = pose_limits(batch, part, Slender().part_domain(batch, part))
        unknowns, waves, memory = np.zeros((3, batch.size))
        for index in within(batch, limits):
            g, pose = seated(batch, index)
            key = _solid_key(g, part, pose, self.fineness(batch, index))
            unknowns[index], waves[index] = _size(key)
            if unknowns[index] <= _MOST_UNKNOWNS and waves[index] <= _MOST_WAVES:
                memory[index] = _memory(key) / 2**30
        gibibytes = "GiB of memory", memory, MOST_MEMORY / 2**30
        asked = (("unknowns", unknowns, _MOST_UNKNOWNS), ("waves", waves, _MOST_WAVES), gibibytes)
        return limits + [Limit.named("solvable", count, float(most), what=what) for what, count, most in asked]

    def axial(self, batch: RobotBatch) -> Axial:
        """See `SwimmerModel.axial`: the average over `model.tube.phases` phases, ends condensed."""
        return self.axial_flow(batch).resistance

    def axial_flow(self, batch: RobotBatch) -> AxialFlow:
        """See `SwimmerModel.axial_flow`."""
        answers, mean_flow = self._axial(batch)
        return AxialFlow(answers[:, :4, :4], (batch.placement.flow or 0.0) * answers[:, :4, 4], mean_flow)

    def _axial(self, batch: RobotBatch) -> tuple[Samples, Samples]:
        """R and load along the tube and about the motor axis, (n, 5, 5), and the mean flow, (n, 5)."""
        count = batch.options.tube.phases
        phases = 2.0 * np.pi / batch.form.starts * (np.arange(count) + self._first) / count
        along = np.zeros((5, MOTIONS))
        along[[1, 3, 4], [3, 9, 12]] = 1.0
        tilt = TubePose(0.0, 0.0, batch.placement.pitch or 0.0, yaw=batch.placement.yaw)
        for row, first in ((0, 0), (2, 6)):
            along[row, first : first + 3] = tilt.forward
        answers, flows = np.zeros((batch.size, 5, 5)), np.zeros((batch.size, 5))
        for phase in phases:
            full = along @ self._full(batch, "robot", np.array([phase])) @ along.T
            condensed, flow = self._with_ends(batch, full)
            answers += condensed / len(phases)
            flows += flow / len(phases)
        return answers, flows

    def _with_ends(self, batch: RobotBatch, full: Samples) -> tuple[Samples, Samples]:
        """Condense the ends: (n, k, k) with the flow as last row and column, and the mean flow due to motions."""
        flow = np.zeros(full.shape[:2])
        if batch.placement.flow is not None:
            flow[:, -1] = batch.placement.flow
        against = np.broadcast_to(batch.viscosity, (batch.size,)) * self.against(batch)
        if np.any(np.isfinite(against)):
            flow[:, :-1] = full[:, :-1, -1] / (against + full[:, -1, -1])[:, None]
            full = full.copy()
            full[:, :-1, :-1] -= flow[:, :-1, None] * full[:, None, :-1, -1]
        return full, flow

    def against(self, batch: RobotBatch) -> PerRobot:
        """8 pi L_eff, m: what drives the mean flow through each tube, over viscosity and flow; infinite if closed."""
        length, radius = (
            np.broadcast_to(v, (batch.size,)) for v in (batch.channel_length, 0.5 * batch.channel_diameter)
        )
        opened = np.array([batch.placement.ends_of(float(value)) == "open" for value in length])
        return np.where(opened, 8.0 * np.pi * (length + END_LOSS * radius), np.inf)

    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Matrix12:
        """See `SwimmerModel.resistance`; about the origin in body axes, ends condensed."""
        return self._with_ends(batch, self._full(batch, "robot", phase))[0][:, :-1, :-1]

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Matrix6:
        """See `ResistanceModel.part_matrix`; that part alone in the channel, at the robot's pose."""
        self.check_part(batch, part)
        return joint_locked(self._with_ends(batch, self._full(batch, part, phase))[0][:, :-1, :-1])

    def _full(self, batch: RobotBatch, part: str, phase: PerRobot) -> Samples:
        """R, load and drag of a part, (n, 13, 13), no net flux; NaN outside the domain."""
        found = np.full((batch.size, MOTIONS, MOTIONS), np.nan)
        turns = np.broadcast_to(phase, (batch.size,))
        for index in within(batch, self.part_domain(batch, part)):
            g, pose = seated(batch, index)
            turn = float(turns[index]) if "tail" in PIECES[part] else 0.0
            question = _SolveRequest(g, part, pose, self.fineness(batch, index), turn)
            found[index] = number_of(batch.viscosity, index) * _answer(question)
        return found
