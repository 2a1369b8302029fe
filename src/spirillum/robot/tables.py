"""The tables of a robot file, each field checked and the fields checked against each other."""

from __future__ import annotations

from typing import Self

from pydantic import Field, PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

from spirillum.notes import Note
from spirillum.robot.actuation import Battery, Drive, Friction, Magnetic, Motor
from spirillum.robot.fields import Section, Text
from spirillum.robot.model_options import Calibrations, ModelOptions
from spirillum.robot.parts import Body, ChannelOrNone, Coupling, Fluid, SealOrNone, Tail


class RobotTables(Section):
    """The tables of a robot file; SI inside, frozen. `Robot` adds what its geometry has to fulfil."""

    name: Text = Field(default="robot", min_length=1, max_length=200)
    """Name of the robot, for tables and figures."""
    description: Text = Field(default="", max_length=2000)
    """What it is, in a sentence."""
    reference: Text = Field(default="", max_length=2000)
    """Where its numbers come from."""
    body: Body
    """The body."""
    seal: SealOrNone = None
    """The striped seal at the body's rear, or `none` (here None) for a plain body; pictures and exports show it."""
    coupling: Coupling = Coupling()
    """The coupling between motor and tail."""
    tail: Tail
    """The helical tail."""
    channel: ChannelOrNone = None
    """The channel, or `none` (here None)."""
    fluid: Fluid
    """The fluid."""
    drive: Drive | None = None
    """What turns the tail; without a drive an answer needs `--tail-rate`."""
    motor: Motor | None = None
    """The motor of a `dc-motor` drive."""
    battery: Battery | None = None
    """The battery of a `dc-motor` drive."""
    magnetic: Magnetic | None = None
    """The magnet and the rotating field of a `magnetic` drive."""
    friction: Friction = Friction()
    """Rotary friction."""
    model: ModelOptions = ModelOptions()
    """Options of the hydrodynamic models."""
    calibration: Calibrations = Field(default_factory=dict)
    """Calibration factors for each model."""

    _warnings: tuple[Note, ...] = PrivateAttr(default=())

    @property
    def warnings(self) -> tuple[Note, ...]:
        """What was doubtful in the input."""
        return self._warnings

    @property
    def notes(self) -> tuple[Note, ...]:
        """What was doubtful in the input, as notes with codes."""
        return self._warnings

    @property
    def hand(self) -> float:
        """H of the wire's equation: +1 for a right-handed tail, -1 for a left-handed one."""
        return 1.0 if self.tail.handedness == "right" else -1.0

    @model_validator(mode="after")
    def _no_field_missing_or_idle(self) -> Self:
        problems = [*self._end_problems(), *self._drive_problems()]
        if problems:
            raise PydanticCustomError("assembly", "{sentences}", {"sentences": "\n".join(problems)})
        return self

    def _end_problems(self) -> list[str]:
        body, rft = self.body, self.model.rft
        problems = []
        if body.shape in ("sphere", "spheroid"):
            idle = [name for name in ("front", "rear", "fillet") if getattr(body, name) is not None]
            problems += [
                f"body.{name} is set, but a {body.shape} has no ends; allowed: leave it out, or 'none'" for name in idle
            ]
        elif (body.fillet is not None) != ("fillet" in (body.front_end, body.rear_end)):
            wanted = "needs body.fillet, the edge radius" if body.fillet is None else "is not used by either end"
            problems.append(f"body.fillet: an end 'fillet' {wanted}; allowed: both or neither")
        if rft.axis_height is not None and rft.coefficients != "brennen-winet":
            problems.append(
                f"model.rft.axis_height is set, but coefficients are '{rft.coefficients}'; "
                "allowed: only with model.rft.coefficients = 'brennen-winet'"
            )
        return problems

    def _drive_problems(self) -> list[str]:
        drive = self.drive
        if drive is None:
            return []
        problems = []
        if drive.kind == "dc-motor":
            if drive.joint == "fixed":
                problems.append("drive.joint = 'fixed' with drive.kind = 'dc-motor'; allowed: 'revolute'")
            absent = [table for table in ("motor", "battery") if getattr(self, table) is None]
            problems += [f"{table} is missing; drive.kind = 'dc-motor' needs a [{table}] table" for table in absent]
        elif drive.duty != 1.0:
            problems.append(
                f"drive.duty = {drive.duty:g} with drive.kind = '{drive.kind}'; allowed: only for 'dc-motor'"
            )
        magnetic = drive.kind == "magnetic"
        if magnetic and drive.joint == "revolute":
            problems.append("drive.joint = 'revolute' with drive.kind = 'magnetic'; allowed: 'fixed'")
        if magnetic != (self.magnetic is not None):
            problems.append(
                f"magnetic is {'missing' if magnetic else 'set'} with drive.kind = '{drive.kind}'; "
                "allowed: a [magnetic] table exactly when drive.kind = 'magnetic'"
            )
        for kind in ("rate", "torque"):
            given = getattr(drive, kind) is not None
            if given != (drive.kind == kind):
                problems.append(
                    f"drive.{kind} is {'set' if given else 'missing'} with drive.kind = '{drive.kind}'; "
                    f"allowed: drive.{kind} exactly when drive.kind = '{kind}'"
                )
        return problems
