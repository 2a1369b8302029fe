"""The real tail and body: a wire of its own shape, solids of revolution, and the flow between them.

The tail is a line of regularised Stokeslets (`wire`), body and coupling are single layers (`revolution`), coupled in
unbounded fluid (`interaction`). The 12x12 is constant in the tail's frame: it is computed once for a geometry and
turned with the tail.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from spirillum.arrays import Axial, Matrix6, Matrix12, PerRobot, Samples
from spirillum.fluid.algebra import axial_entries, axis_rotation, joint_locked, rotated
from spirillum.fluid.closed.sbt import EXACT_EPS_CONSTANT, thin_wire_cautions
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.reference_errors import CHECKED, STATED, validation_note, wall_clause
from spirillum.fluid.wire.interaction import Discretisation, UnitTwistSolution, solve
from spirillum.fluid.wire.robot_geometry import PIECES, RobotGeometry, number_of
from spirillum.fluid.wire.stokeslets import Accuracy, closest_approach, station_count
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, within
from spirillum.robot.model_options import ModelOptions
from spirillum.robot.tail_form import ROOT_SHARE, closest_strands, coil_spacing

FINEST_WIRE_ERROR = 0.004
"""Relative error of speeds with `high` wires: the largest of drag, thrust, torque and speed against resolved wires."""

MOST_STATIONS: dict[Accuracy, int] = {"standard": 1500, "high": 800}  #: Stations along a tail, by the form of the wire.
_SMALLEST_CLEARANCE = 0.01  # relative to the coupling's diameter
_SMALLEST_GAP = 0.01  # of the tail from the body, relative to the amplitude
_SLIMMEST = 1e-3  # thickness of a solid over its length, or length over thickness

_RESOLUTIONS = {
    "standard": Discretisation("standard", order=8, tolerance=1e-4),
    "high": Discretisation("high", order=12, tolerance=1e-6),
}
_CHECKS = {  # what differs most from each: the form of the wire, and the spacing of its stations
    "standard": Discretisation("high", order=8, tolerance=1e-4),
    "high": Discretisation("high", order=8, tolerance=1e-4, spacing=1.25),
}


def robot_solution(batch: RobotBatch) -> UnitTwistSolution:
    """Tractions on the first robot of a batch for all unit twists, at phase 0."""
    return _solved(RobotGeometry.of(batch), "robot", _RESOLUTIONS[batch.options.slender.accuracy])


def _solved(g: RobotGeometry, part: str, resolution: Discretisation) -> UnitTwistSolution:
    wires = [(wire, 1) for wire in g.wires(resolution.spacing)] if "tail" in PIECES[part] else []
    return solve(g.solids(part), wires, resolution)


def _slimness(batch: RobotBatch) -> list[Limit]:
    """Body and coupling neither needles nor foils: their outlines are resolved against their own thickness."""
    solid = batch.coupling_length - 2.0 * batch.coupling_clearance
    coupled = (batch.coupling_length > 0) & (batch.coupling_diameter > 0)
    rows = (
        ("body.diameter", batch.body_diameter, _SLIMMEST * batch.body_length),
        ("body.length", batch.body_length, _SLIMMEST * batch.body_diameter),
        ("coupling.diameter", np.where(coupled, batch.coupling_diameter, np.inf), _SLIMMEST * solid),
        ("coupling.length less clearance", np.where(coupled, solid, np.inf), _SLIMMEST * batch.coupling_diameter),
    )
    return [Limit.named("solid-thickness", value, bound, name=name) for name, value, bound in rows]


@lru_cache(maxsize=4096)
def _closest(g: RobotGeometry) -> float:
    wires = g.wires()
    if len(wires) == 1:
        return closest_approach(wires[0])
    behind = wires[0].points[0, 0] - wires[0].points[:, 0]
    joined = ROOT_SHARE * g.tail_length if g.form.curve else min(3.0 / g.taper, 4.0 * ROOT_SHARE) * g.tail_length
    clear = behind > joined
    along = np.cumsum(wires[0].lengths) - 0.5 * wires[0].lengths
    return closest_strands([wire.points[clear] for wire in wires], along[clear], wires[0].radius)


@lru_cache(maxsize=4096)
def _matrix(g: RobotGeometry, part: str, resolution: Discretisation) -> Samples:
    """12x12 of a part at phase 0 and viscosity 1."""
    matrix = _solved(g, part, resolution).matrix
    matrix.flags.writeable = False
    return matrix


class Slender(SwimmerModel):
    """The tail as a line of regularised Stokeslets, body and coupling as they are, and the flow between them."""

    name = "slender"
    title = "resolved"
    references = ("cortez2001", "cortez2012", "pozrikidis1992", "biorob2012")
    known_error = STATED["slender standard"]
    known_speed_error = 0.005
    parts = ("body", "coupling", "tail", "rotor", "robot")
    closed_form = False

    def __init__(self, resolution: Discretisation | None = None) -> None:
        """Resolve the flow by each robot's `model.slender.accuracy`, or with one resolution for all."""
        self._resolution = resolution

    def stated_error(self, options: ModelOptions) -> str:
        """See `ResistanceModel.stated_error`."""
        return STATED[f"slender {options.slender.accuracy}"]

    def error_statement(self, batch: RobotBatch, fitted_by: str = "") -> str:
        """See `ResistanceModel.error_statement`."""
        coupled = bool(batch.coupling_length[0] > 0 and batch.coupling_diameter[0] > 0)
        found = (
            validation_note(batch, CHECKED["slender"])
            if batch.options.slender.accuracy == "standard"
            else "against resolved wires and a robot, drag, thrust and torque of the tail and speed agree to 0.4 %"
        )
        clearance = "; the coupling's torque is as good as its clearance" if coupled else ""
        return f"{found}{clearance}{wall_clause(batch)}"

    def checked_by(self, batch: RobotBatch) -> tuple[SwimmerModel, ...]:
        """See `SwimmerModel.checked_by`."""
        return (Slender(_CHECKS[batch.options.slender.accuracy]),)

    def unchecked_error(self, batch: RobotBatch) -> float:
        """See `SwimmerModel.unchecked_error`."""
        return FINEST_WIRE_ERROR

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """Solids apart from each other, and a wire that the line of Stokeslets can follow."""
        coupled = (batch.coupling_length > 0) & (batch.coupling_diameter > 0)
        resolution = self._resolution or _RESOLUTIONS[batch.options.slender.accuracy]
        behind = batch.coupling_length if batch.shape != "none" else np.full(1, np.inf)
        wire_length = batch.arc_length + np.where(np.isfinite(batch.taper), batch.amplitude, 0.0)
        clearance = np.where(coupled & (batch.shape != "none"), batch.coupling_clearance, np.inf)
        stations = batch.form.starts * station_count(wire_length, 0.5 * batch.wire_diameter)
        limits = [
            Limit.named("root-off-body", behind, 0.5 * batch.wire_diameter),
            Limit.named("tail-off-body", behind, _SMALLEST_GAP * batch.amplitude),
            Limit.named("coupling-off-body", clearance, _SMALLEST_CLEARANCE * batch.coupling_diameter),
            Limit.named("wire-length", batch.wire_diameter, 0.5 * batch.arc_length),
            Limit.named("stations", stations, float(MOST_STATIONS[resolution.wire])),
            *_slimness(batch),
        ]
        nearest = np.full(batch.size, np.inf)
        for index in within(batch, limits):
            nearest[index] = _closest(RobotGeometry.of(batch, index))
        return [*limits, Limit.named("wire-off-itself", batch.wire_diameter, nearest)]

    def part_domain(self, batch: RobotBatch, part: str) -> list[Limit]:
        """See `ResistanceModel.part_domain`."""
        return _slimness(batch) if part in ("body", "coupling") else self.domain(batch)

    def cautions(self, batch: RobotBatch) -> list[Limit]:
        """A wire thin against its wave, its turns apart, and long enough for its ends not to matter much."""
        return [
            thin_wire_cautions(batch, EXACT_EPS_CONSTANT)[0],
            Limit.named("turns-apart", batch.wire_diameter, coil_spacing(batch.wavelength, batch.amplitude) / 3.0),
            Limit.named("wire-ends", batch.wire_diameter, 0.2 * batch.arc_length),
        ]

    def axial(self, batch: RobotBatch) -> Axial:
        """See `SwimmerModel.axial`; NaN for robots outside the domain."""
        zero = np.zeros(1)
        return axial_entries(self.resistance(batch, zero))

    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Matrix12:
        """See `SwimmerModel.resistance`; NaN for robots outside the domain."""
        matrices = self._matrices(batch, "robot")
        turn = np.zeros((*np.shape(phase), 12, 12))
        for first in range(0, 12, 3):
            turn[..., first : first + 3, first : first + 3] = axis_rotation(phase)
        return turn @ matrices @ np.swapaxes(turn, -1, -2)

    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Matrix6:
        """See `ResistanceModel.part_matrix`; the rotor is coupling and tail."""
        self.check_part(batch, part)
        return rotated(joint_locked(self._matrices(batch, part)), axis_rotation(phase))

    def _matrices(self, batch: RobotBatch, part: str) -> Samples:
        """12x12 of a part at phase 0; the other entries are zero, all are NaN outside the domain."""
        resolution = self._resolution or _RESOLUTIONS[batch.options.slender.accuracy]
        found = np.full((batch.size, 12, 12), np.nan)
        for index in within(batch, self.part_domain(batch, part)):
            viscosity = number_of(batch.viscosity, index)
            found[index] = viscosity * _matrix(RobotGeometry.of(batch, index), part, resolution)
        return found
