"""The robot as a whole: its file's tables, checked together, and what follows from them."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

from spirillum.robot.actuation import Battery, Drive, Friction, Magnetic, Motor
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import Section, Text
from spirillum.robot.limits import assembly_limits, broken
from spirillum.robot.links import links_of, robot_solids
from spirillum.robot.options import Calibrations, ModelOptions
from spirillum.robot.parts import Body, ChannelOrNone, Coupling, Fluid, SealOrNone, Tail

__all__ = ["STANDARD_GRAVITY", "Derived", "Robot"]

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of gravity, m/s^2 (3rd CGPM, 1901)."""


class Derived(NamedTuple):
    """A quantity that follows from the robot's fields."""

    value: float
    unit: str
    meaning: str


class Robot(Section):
    """A swimmer with one helical tail, its fluid, channel and drive; SI inside, frozen.

    Made by `spirillum.load` from a preset or a TOML file; the fields are the tables of that file.
    """

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

    _warnings: tuple[str, ...] = PrivateAttr(default=())

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was doubtful in the input, a sentence each."""
        return self._warnings

    @property
    def hand(self) -> float:
        """H of the wire's equation: +1 for a right-handed tail, -1 for a left-handed one."""
        return 1.0 if self.tail.handedness == "right" else -1.0

    @model_validator(mode="after")
    def _belongs_together(self) -> Self:
        problems = [*self._missing_or_idle_fields()]
        if not problems:
            problems = [limit.sentence() for limit in broken(assembly_limits(RobotBatch.of(self)))]
        if problems:
            raise PydanticCustomError("assembly", "{sentences}", {"sentences": "\n".join(problems)})
        return self

    def _missing_or_idle_fields(self) -> list[str]:
        """Fields that are needed or useless given the others."""
        return [*self._end_problems(), *self._drive_problems()]

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

    @model_validator(mode="after")
    def _one_motor_current(self) -> Self:
        """(17) has one steady root if R(I) I - V(I) rises with I and R(I) is positive, up to the stall current."""
        if self.motor is None or self.battery is None:
            return self
        r, b = self.motor.resistance, self.battery
        current = np.linspace(0.0, 1.1 * b.voltage / max(b.internal_resistance, 1e-3 * b.voltage), 4001)
        with np.errstate(over="ignore"):
            resistance = (
                r.constant
                + r.decay * np.exp(-r.decay_rate * current)
                + r.growth * np.exp(np.minimum(r.growth_rate * current, 600.0))
                + r.slope * current
            )
            drop = resistance * current + b.internal_resistance * current
        stall = int(np.searchsorted(np.maximum.accumulate(drop), b.voltage))
        upto = slice(0, min(stall + 2, current.size))
        if np.any(resistance[upto] <= 0) or np.any(np.diff(drop[upto]) <= 0):
            sentence = (
                "motor.resistance: R(I) falls so steeply with current that (17) has no single steady current; "
                "allowed: R(I) > 0 and R(I) I - V(I) rising up to the stall current"
            )
            raise PydanticCustomError("assembly", "{sentences}", {"sentences": sentence})
        return self

    def derived(self) -> dict[str, Derived]:
        """What follows from the fields: lengths, volumes, weight, centre of mass.

        Weight and centre of mass need `body.mass` and `tail.density`; without them they are left out. The
        centre of mass assumes that the measured mass is spread evenly over body and coupling.
        """
        batch, tail = RobotBatch.of(self), self.tail
        alpha, arc = float(batch.arc_fraction[0]), float(batch.arc_length[0])
        solids, links = robot_solids(self), links_of(self)
        coupling = solids["coupling"].volume if "coupling" in solids else 0.0
        volumes = np.array([link.volume for link in links])
        volume = float(np.sum(volumes))
        found = {
            "arc_fraction": Derived(alpha, "1", "alpha: axial over arc length of the tail"),
            "pitch_angle": Derived(float(np.arccos(alpha)), "rad", "angle between wire and tail axis"),
            "turns": Derived(tail.length / tail.wavelength, "1", "number of turns of the tail"),
            "arc_length": Derived(arc, "m", "arc length of the wire (plain helix)"),
            "robot_length": Derived(
                self.body.length + self.coupling.length + tail.length, "m", "body, coupling and tail together"
            ),
            "body_volume": Derived(solids["body"].volume, "m^3", "volume of the body"),
            "coupling_volume": Derived(coupling, "m^3", "volume of the coupling's solid"),
            "wire_volume": Derived(solids["tail"].volume, "m^3", "volume of the wire, its bend at the root included"),
            "displaced_volume": Derived(volume, "m^3", "volume of body, coupling and wire"),
        }
        if self.body.mass is None or tail.density is None:
            return found
        masses = np.array([link.mass for link in links])
        mass = float(np.sum(masses))
        centre = masses @ np.array([link.centre[0] for link in links]) / mass
        buoyancy = volumes @ np.array([link.centroid[0] for link in links]) / volume
        return found | {
            "tail_mass": Derived(tail.density * solids["tail"].volume, "kg", "mass of the wire"),
            "mass": Derived(mass, "kg", "mass of the robot"),
            "submerged_weight": Derived(
                (mass - self.fluid.density * volume) * STANDARD_GRAVITY, "N", "weight less buoyancy"
            ),
            "centre_of_mass": Derived(
                float(centre), "m", "x of the centre of mass (assumes body.mass spread evenly over body and coupling)"
            ),
            "centre_of_buoyancy": Derived(float(buoyancy), "m", "x of the centre of buoyancy"),
        }
