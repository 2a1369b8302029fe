"""Drive, motor, battery and friction (Table II), and the complete robot file with its cross-field checks."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import pi
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import BeforeValidator, Field, PrivateAttr, model_validator

from spirillum.errors import InputError
from spirillum.kernels.core import MOST_POINTS
from spirillum.notes import Note
from spirillum.robot.fields import (
    NONE,
    UNSET,
    AlsoReads,
    BackEmfConstant,
    Charge,
    Inductance,
    InverseCurrent,
    Length,
    MagneticField,
    MagneticMoment,
    MomentAngle,
    Rate,
    Resistance,
    ResistancePerCurrent,
    RotaryFriction,
    Section,
    Text,
    Torque,
    TorqueConstant,
    Voltage,
    quantity_schema,
    refuse,
)
from spirillum.robot.geometry import Body, BodyOrNone, ChannelOrNone, Coupling, CouplingOrNone, Fluid, SealOrNone, Tail
from spirillum.robot.model_options import Calibrations, ModelOptions
from spirillum.robot.shape_input import source_of
from spirillum.units import KINDS, show

DriveKind = Literal["dc-motor", "rate", "torque", "torque-speed", "magnetic"]

FrictionModel = Literal["none", "rotor", "body", "paper"]


class TorqueCurve(NamedTuple):
    """Torque of a motor against its rate, straight between its points, in the motor's own sense; SI."""

    rates: tuple[float, ...]  #: Rates, rad/s: from 0, increasing.
    torques: tuple[float, ...]  #: Torques, N m: not increasing, down to 0.
    sense: float  #: 1 where the motor turns the tail as its hand swims forward, else -1.


class Drive(Section):
    """What turns the tail, and the joint between tail and body."""

    kind: DriveKind
    """`dc-motor` (motor and battery of the file), `torque-speed` (any other motor, by its torque against its rate),
    `rate` or `torque` (prescribed), `magnetic` (a rotating field)."""
    joint: Literal["revolute", "fixed"] = "revolute"
    """`revolute`: the tail turns against the body; `fixed`: one piece, driven from outside."""
    rate: Annotated[Rate | None, UNSET, NONE] = None  #: For `rate`: rotation rate of the tail about +x in the lab.
    torque: Annotated[Torque | None, UNSET, NONE] = None
    """For `torque`: torque at the joint before friction; with a fixed joint, external torque on the whole."""
    rates: Annotated[tuple[Rate, ...] | None, KINDS["rate"], UNSET, NONE] = None
    """For `torque-speed`: rates of the tail against the body, 2 to 12 that increase from 0; three give a knee."""
    torques: Annotated[tuple[Torque, ...] | None, KINDS["torque"], UNSET, NONE] = None
    """For `torque-speed`: torque at each of these rates, straight between them: from the stall torque down to 0."""
    polarity: Literal["forward", "reverse"] = "forward"
    """For `torque-speed`: `forward` turns the tail the way that its hand swims forward, `reverse` the other way."""
    duty: Annotated[float, Field(strict=True, ge=0.0, le=1.0, allow_inf_nan=False)] = 1.0
    """For `dc-motor`: pulse-width duty of the voltage controller; 1 is full throttle."""

    @property
    def curve(self) -> TorqueCurve | None:
        """Torque against rate; None for another drive."""
        if self.rates is None or self.torques is None:
            return None
        return TorqueCurve(self.rates, self.torques, 1.0 if self.polarity == "forward" else -1.0)

    def problems(self) -> list[str]:
        """A sentence for each rule between the fields that is broken."""
        kind, found = self.kind, []
        if (joint := _JOINTS.get(kind, self.joint)) != self.joint:
            found.append(f"drive.joint = '{self.joint}' with drive.kind = '{kind}'; allowed: '{joint}'")
        if self.duty != 1.0 and kind != "dc-motor":
            found.append(f"drive.duty = {self.duty:g} with drive.kind = '{kind}'; allowed: only for 'dc-motor'")
        if self.polarity != "forward" and kind != "torque-speed":
            found.append("drive.polarity = 'reverse'; allowed: only with drive.kind = 'torque-speed'")
        for name, owner in _OF_ONE_KIND.items():
            given = getattr(self, name) is not None
            if given != (kind == owner):
                found.append(
                    f"drive.{name} is {'set' if given else 'missing'} with drive.kind = '{kind}'; "
                    f"allowed: drive.{name} exactly when drive.kind = '{owner}'"
                )
        if kind != "torque-speed" or self.rates is None or self.torques is None:
            return found
        if len(self.rates) != len(self.torques) or not 2 <= len(self.rates) <= MOST_POINTS:
            return [
                *found,
                f"drive.rates has {len(self.rates)} and drive.torques has {len(self.torques)} values; allowed: as many "
                f"of both, from 2 to {MOST_POINTS}",
            ]
        if self.rates[0] != 0.0 or any(b <= a for a, b in pairwise(self.rates)):
            found.append("drive.rates must increase from 0; allowed: such as ['0 Hz', '170 Hz', '300 Hz']")
        if self.torques[0] <= 0.0 or self.torques[-1] != 0.0 or any(b > a for a, b in pairwise(self.torques)):
            found.append(
                "drive.torques must fall, or stay, from a positive stall torque to 0 at the last rate; "
                "allowed: such as ['0.3 mN m', '0.28 mN m', '0 N m']"
            )
        return found


_JOINTS = {"dc-motor": "revolute", "torque-speed": "revolute", "magnetic": "fixed"}
"""The joint of drives that have only one."""
_OF_ONE_KIND = {"rates": "torque-speed", "torques": "torque-speed", "rate": "rate", "torque": "torque"}
"""Fields that one kind of drive needs and no other has."""


class MotorResistance(Section):
    """Table II: R(I) = constant + decay exp(-decay_rate I) + growth exp(growth_rate I) + slope I."""

    constant: Resistance  #: Constant term.
    decay: Resistance = 0.0  #: Amplitude of the term that decays with current.
    decay_rate: InverseCurrent = 0.0  #: Rate of that decay.
    growth: Resistance = 0.0  #: Amplitude of the term that grows with current.
    growth_rate: InverseCurrent = 0.0  #: Rate of that growth.
    slope: ResistancePerCurrent = 0.0  #: Slope of the linear term (with its sign).


def _plain_resistance(value: Any) -> Any:
    """A single value, which does not depend on the current, as the constant term."""
    return value if isinstance(value, (Mapping, MotorResistance)) else {"constant": value}


_PLAIN_RESISTANCE = AlsoReads(lambda _: quantity_schema(KINDS["resistance"]))


class Motor(Section):
    """The DC-motor of eqs (17) and (18)."""

    torque_constant: TorqueConstant  #: Torque constant K_m (Table II).
    back_emf_constant: BackEmfConstant  #: Back-emf constant K_b (Table II).
    inductance: Inductance  #: Inductance L (Table II).
    rotor_friction: RotaryFriction  #: Friction B_m of the rotor alone, on the motor's shaft (Table II).
    resistance: Annotated[MotorResistance, BeforeValidator(_plain_resistance), _PLAIN_RESISTANCE]
    """Equivalent resistance R(I) of motor and driver (Table II): its terms, or one value such as `"10.4 ohm"`."""
    gear_ratio: Annotated[float, Field(strict=True, ge=1e-3, le=1e4, allow_inf_nan=False)] = 1.0
    """Turns of the motor's shaft for one of the joint, G, of a gear without losses of its own; 1: driven directly."""
    polarity: Literal["forward", "reverse"] = "forward"
    """`forward` turns the tail the way that its hand swims forward, `reverse` the other way."""
    shaft_diameter: Length | None = None
    """Diameter of the shaft (Table I's rotor), for pictures and exports only; unset: the wire's."""

    @property
    def joint_rotor_friction(self) -> float:
        """B_m G^2: friction of the rotor referred to the joint, N m s/rad."""
        return self.rotor_friction * self.gear_ratio**2


class Battery(Section):
    """Table II: V(I) = voltage - internal_resistance I at the terminals."""

    voltage: Voltage  #: Open-circuit voltage.
    internal_resistance: Resistance  #: Voltage lost per current.
    capacity: Charge | None = None  #: Rated charge.


class Magnetic(Section):
    """A magnet fixed in the robot, and the uniform field that turns it about the lab's x axis."""

    moment: MagneticMoment  #: Magnetic moment m of the robot, fixed in it.
    moment_angle: MomentAngle = 0.5 * pi
    """Angle between the moment and the motor axis, towards +z at rest; 90 deg (the default) is across the axis."""
    field: MagneticField  #: Flux density B of the field, which is at right angles to its axis of rotation.
    rotation_rate: Rate  #: Rotation rate of the field about +x in the lab.
    axis: Literal["x"] = "x"
    """Axis about which the field turns: `x`, the lab's and the channel's; no other is computed."""


class Friction(Section):
    """The effective rotary friction of eqs (18) and (19), and how it is read."""

    effective: RotaryFriction | None = None
    """B_eff in the joint, which contains B_m G^2; unset: that alone. For the `body` reading: B of the wall."""
    reading: FrictionModel = "rotor"
    """Where friction acts: `none`, `rotor` (inside the joint), `body` (on the wall), `paper` (as (19) is printed)."""


def _center_problems(body: Body) -> list[str]:
    """Problems of the body's centre of mass: it needs a mass, and lies inside the body."""
    center = body.center_of_mass
    if center is None:
        return []
    problems = [] if body.mass is not None else ["body.center_of_mass requires body.mass; set both, or neither"]
    for name, value, most in (("x", abs(center.x or 0.0), body.length), ("radial", center.radial, body.diameter)):
        if value > 0.5 * most:
            size = "length" if name == "x" else "diameter"
            problems.append(
                f"body.center_of_mass.{name} = {show(value, 'mm')} lies outside the body; allowed: at most "
                f"{show(0.5 * most, 'mm')}, half of body.{size}"
            )
    return problems


class RobotTables(Section):
    """The tables of a robot file; SI inside, frozen. `Robot` adds what its geometry has to fulfil."""

    name: Text = Field(default="robot", min_length=1, max_length=200)  #: Name of the robot, for tables and figures.
    description: Text = Field(default="", max_length=2000)  #: What it is, in a sentence.
    reference: Text = Field(default="", max_length=2000)  #: Where its numbers come from.
    body: BodyOrNone  #: The body, or `none` for a bare tail.
    seal: SealOrNone = None
    """The striped seal at the body's rear, or `none` (here None) for a plain body; pictures and exports show it."""
    coupling: CouplingOrNone = Coupling()  #: The coupling between motor and tail, or `none`.
    tail: Tail  #: The helical tail.
    channel: ChannelOrNone = None  #: The channel, or `none` (here None).
    fluid: Fluid  #: The fluid.
    drive: Drive | None = None  #: What turns the tail; without a drive an answer needs `--tail-rate`.
    motor: Motor | None = None  #: The motor of a `dc-motor` drive.
    battery: Battery | None = None  #: The battery of a `dc-motor` drive.
    magnetic: Magnetic | None = None  #: The magnet and the rotating field of a `magnetic` drive.
    friction: Friction = Friction()  #: Rotary friction.
    model: ModelOptions = ModelOptions()  #: Options of the hydrodynamic models.
    calibration: Calibrations = Field(default_factory=dict)  #: Calibration factors for each model.

    _warnings: tuple[Note, ...] = PrivateAttr(default=())

    def __eq__(self, other: object) -> bool:
        """Whether all fields are equal; what was doubtful when one of them was loaded does not count."""
        names = type(self).model_fields
        return type(other) is type(self) and all(getattr(self, name) == getattr(other, name) for name in names)

    __hash__ = None  # type: ignore[assignment]  # one of its fields is a dict

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
    def _no_field_missing_or_unused(self) -> Self:
        problems = [*self._end_problems(), *self._drive_problems(), *self._problems_without_body()]
        if problems:
            raise refuse(*problems)
        return self

    def source_of(self, field: str) -> str | None:
        """Field with the points from which a field follows; None for one of its own."""
        return source_of(field, curve=bool(self.tail.curve), profile=bool(self.body.points))

    @property
    def has_body(self) -> bool:
        """Whether there is a body, against which a joint can turn."""
        return self.body.shape != "none"

    def check_body(self, what: str, instead: str = "") -> None:
        """Refuse a bare tail for what takes a body; a sentence ends with what may be done instead."""
        if not self.has_body:
            allowed = f"a robot with a body{instead}"
            raise InputError(f"{what} takes a body, and {self.name} has body = 'none'; allowed: {allowed}")

    def _problems_without_body(self) -> list[str]:
        if self.has_body:
            return []
        problems = []
        if self.seal is not None:
            problems.append("seal is set with body = 'none'; allowed: seal = 'none'")
        if self.drive is not None and self.drive.joint == "revolute":
            problems.append(
                "drive.joint = 'revolute' with body = 'none', against which nothing turns; allowed: 'fixed'"
            )
        return problems

    def _end_problems(self) -> list[str]:
        body, rft = self.body, self.model.rft
        problems = _center_problems(body)
        if body.shape in ("sphere", "spheroid", "profile"):
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
        problems = drive.problems()
        if drive.kind == "dc-motor":
            absent = [table for table in ("motor", "battery") if getattr(self, table) is None]
            problems += [f"{table} is missing; drive.kind = 'dc-motor' needs a [{table}] table" for table in absent]
        if (drive.kind == "magnetic") != (self.magnetic is not None):
            problems.append(
                f"magnetic is {'set' if self.magnetic else 'missing'} with drive.kind = '{drive.kind}'; "
                "allowed: a [magnetic] table exactly when drive.kind = 'magnetic'"
            )
        return problems
