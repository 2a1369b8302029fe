"""Interface of the hydrodynamic models.

A model maps the twists of the two rigid parts, body and rotor, to the wrenches that the fluid exerts:
(F_body, F_rotor) = -R (V_body, V_rotor), twists about the origin in body axes, R symmetric positive
definite. Where the fluid is made to flow past the robot, it adds a wrench on the robot at rest:
(F_body, F_rotor) = -R (V_body, V_rotor) + L. A new model is one new file with one class.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np

from spirillum.arrays import Axial, AxialLoad, Matrix6, Matrix12, MeanFlow, PerRobot
from spirillum.errors import InputError
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, assembly_limits
from spirillum.robot.model_options import ModelOptions

PARTS = ("body", "coupling", "tail", "rotor", "robot")
"""Parts of a robot: body, coupling, the bare wire, coupling and wire together, and the whole with its joint locked."""


class ResistanceModel(ABC):
    """A model that knows the resistance of some parts of a robot."""

    name: str  #: Name on the command line.
    title: ClassVar[str]
    references: ClassVar[tuple[str, ...]]  #: Keys of its references, see `spirillum.citation`.
    known_error: ClassVar[str]  #: Neglected effects and their cost.
    parts: ClassVar[tuple[str, ...]]  #: Parts whose matrix it can give.
    closed_form: ClassVar[bool] = True
    """False for a model that solves for the flow, which takes a tenth of a second for each robot."""
    axial_only: ClassVar[bool] = False
    """True if the model gives only the entries along and about the motor axis; the others are NaN."""
    form: ClassVar[str | None] = None  #: Solution method, for a model that has more than one.
    error_against: str | None = None  #: Basis of the error estimate, if that is not another resolution.
    placed: ClassVar[bool] = False  #: Whether the result depends on the pose in the channel, `batch.placement`.

    def stated_error(self, options: ModelOptions) -> str:
        """Neglected effects with these options, and their cost."""
        return self.known_error

    def error_statement(self, batch: RobotBatch, fitted_by: str = "") -> str:
        """Neglected effects for a robot, and their cost."""
        return self.stated_error(batch.options)

    @abstractmethod
    def domain(self, batch: RobotBatch) -> list[Limit]:
        """Requirements of the theory: if violated, the result is NaN in a batch and an `InputError` for one robot."""

    def requirements(self, batch: RobotBatch) -> list[Limit]:
        """Requirements without which this model has no answer: the robot can be built, and is inside the domain."""
        return assembly_limits(batch) + self.domain(batch)

    def part_domain(self, batch: RobotBatch, part: str) -> list[Limit]:
        """Requirements on one part alone: those of the tail do not matter to body and coupling."""
        return [] if part in ("body", "coupling") else self.domain(batch)

    def check_part(self, batch: RobotBatch, part: str) -> None:
        """Refuse a part that the model does not know or the robot does not have."""
        if part not in self.parts:
            raise InputError(f"part = {part!r} with model '{self.name}'; allowed: {', '.join(self.parts)}")
        if part == "coupling" and np.any((batch.coupling_length == 0) | (batch.coupling_diameter == 0)):
            raise InputError("part = 'coupling': this robot has none (coupling.length or coupling.diameter is 0)")

    def cautions(self, batch: RobotBatch) -> list[Limit]:
        """Requirements of the theory's accuracy: if violated, the result carries a warning."""
        return []

    def placement_of(self, batch: RobotBatch) -> dict[str, Any]:
        """Assumed pose of robots like the first of the batch: `kind` in words, and quantities."""
        return {"kind": "unbounded fluid"}

    @abstractmethod
    def part_matrix(self, batch: RobotBatch, part: str, phase: PerRobot) -> Matrix6:
        """Resistance of one of `parts` alone in the same fluid, about the origin, never calibrated."""


class AxialFlow(NamedTuple):
    """Loads of the fluid on a robot that moves along and about its axis, averaged over a turn of the tail."""

    resistance: Axial
    load: AxialLoad  #: L of an imposed flow on the robot at rest, N and N m; zero where none is imposed.
    mean_flow: MeanFlow | None
    """Mean velocity of the fluid through the channel, per unit (U_x, Omega_x) of body and of rotor, and at rest:
    1, m/rad, 1, m/rad, m/s; None for a model without a channel."""


class SwimmerModel(ResistanceModel):
    """A model of body and rotor together, from which the motion follows."""

    known_speed_error: ClassVar[float | None] = None
    """Relative error of the speed of a reference robot, see `docs/accuracy.md`; None if there is no reference."""

    def checked_by(self, batch: RobotBatch) -> tuple[SwimmerModel, ...]:
        """This model at other resolutions, each of which differs from the one before in one respect.

        The error estimate is the sum of the relative differences of the forward velocities from this model's on, and of
        `unchecked_error`. None for a model in closed form, which has a known error only, and for tables.
        """
        return ()

    def unchecked_error(self, batch: RobotBatch) -> float:
        """Relative error of the forward velocity that the models of `checked_by` share, where it is estimated."""
        return 0.0

    def stated_speed_error(self, batch: RobotBatch) -> float:
        """Relative error of the forward velocity at these poses: the sum of the estimates; NaN without a check."""
        return float("nan")

    @abstractmethod
    def axial(self, batch: RobotBatch) -> Axial:
        """R between (U_x, Omega_x) of body and rotor, 4x4: all that motion along the channel needs.

        Asked for directly, never cut from a 12x12, so that a million robots fit into memory. Where it depends
        on the tail's phase it is the average over a turn.
        """

    def axial_flow(self, batch: RobotBatch) -> AxialFlow:
        """`axial` with what a channel adds, in one evaluation; a model with walls overrides it."""
        return AxialFlow(self.axial(batch), np.zeros((1, 4)), None)

    @abstractmethod
    def resistance(self, batch: RobotBatch, phase: PerRobot) -> Matrix12:
        """The full R, 12x12, at a phase of the tail; NaN where the model does not know an entry."""
