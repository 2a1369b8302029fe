"""A file of fitted parameters: drag factors for each channel, friction for each tail, and what they rest on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from spirillum.files import read_toml
from spirillum.fluid.registry import SWIMMER_MODELS
from spirillum.robot.fields import (
    AlsoReads,
    BackEmfConstant,
    Factor,
    Length,
    RotaryFriction,
    Section,
    Text,
    TorqueConstant,
    Viscosity,
    problems_in,
    refuse,
    refused_table,
)
from spirillum.robot.model_options import Calibration, known_model
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot, with_numbers

_WHAT = "a calibration file (TOML with [calibration.<model>] tables)"
_SAME = 1e-6  # relative difference up to which two geometries are the same

_Word = Annotated[Text, Field(max_length=500)]


def fitted_model(name: str) -> str:
    """The name of a model that may have been fitted, or none."""
    if name and name not in SWIMMER_MODELS:
        raise ValueError(f"a model that swims: {', '.join(SWIMMER_MODELS)}")
    return name


_Entries = Annotated[
    tuple[Calibration, ...],
    Field(min_length=1, max_length=1000),
    BeforeValidator(lambda value: [value] if isinstance(value, Mapping) else value),  # a single table, as of a robot
    AlsoReads(lambda many: many["items"]),
]


class FittedValues(Section):
    """Fitted fields of the robot itself; what is not given stays as the robot has it."""

    wire_diameter: Length | None = None  #: `tail.wire_diameter`.
    viscosity: Viscosity | None = None  #: `fluid.viscosity`.
    torque_constant: TorqueConstant | None = None  #: `motor.torque_constant`.
    back_emf_constant: BackEmfConstant | None = None  #: `motor.back_emf_constant`.
    normal_factor: Factor | None = None  #: `model.rft.normal_factor`.
    tangential_factor: Factor | None = None  #: `model.rft.tangential_factor`.
    friction: RotaryFriction | None = None  #: `friction.effective`, one for all tails.


class FittedFriction(Section):
    """B_eff of one tail in one channel."""

    channel_diameter: Length  #: Channel diameter.
    wavelength: Length  #: Wavelength of the tail.
    amplitude: Length  #: Amplitude of the tail.
    effective: RotaryFriction  #: `friction.effective`.


class FittedPlace(Section):
    """Pose of the robot in its channel, for a model that computes the walls."""

    channel_diameter: Length  #: Channel diameter.
    placement: Placement  #: The fitted fields of the placement.


class FittedContact(Section):
    """Pose and contact of the robot in its channel, for a model that computes the walls."""

    roughness: Length | None = None  #: Height of the asperities under the robot.
    friction_coefficient: Annotated[float | None, Field(strict=True, ge=0.0, le=10.0, allow_inf_nan=False)] = None
    """Coefficient of dry friction where they carry its weight."""


class Provenance(Section):
    """What the fitted values rest on."""

    observations: _Word = ""  #: Name of the observations file.
    sha256: _Word = ""  #: Hash of that file.
    rows: Annotated[int, Field(strict=True, ge=0)] = 0  #: Rows that were used.
    robots: Annotated[tuple[_Word, ...], Field(max_length=1000)] = ()  #: Robots that the rows belong to.
    model: Annotated[_Word, AfterValidator(fitted_model)] = ""  #: Hydrodynamic model that was fitted.
    method: _Word = ""  #: Method of the fit.
    free: Annotated[tuple[_Word, ...], Field(max_length=100)] = ()  #: Parameters that were free.
    answer: Literal["held", "trial"] = "held"  #: Motion that was fitted.
    friction_reading: Literal["", "rotor", "paper"] = ""  #: Reading of the friction under which B_eff was inferred.
    synthetic: Annotated[bool, Field(strict=True)] = False  #: Whether the observations state that they are synthetic.
    uncertainty: Annotated[tuple[_Word, ...], Field(max_length=1000)] = ()
    """Fitted values with their uncertainty, for people."""
    versions: _Word = ""  #: Versions of the programs.


class CalibrationFile(Section):
    """A file of fitted parameters; a table `[calibration.<model>]` is the same as in a robot file."""

    calibration: dict[Annotated[str, AfterValidator(known_model)], _Entries] = Field(default_factory=dict)
    """Factors for each model: one table, or a list of tables, one for each geometry that they were fitted to."""
    fitted: FittedValues = FittedValues()  #: Fitted fields of the robot itself.
    friction: Annotated[tuple[FittedFriction, ...], Field(max_length=100_000)] = ()  #: B_eff, tail by tail.
    placement: Annotated[tuple[FittedPlace, ...], Field(max_length=1000)] = ()
    """Pose of the robot, channel by channel."""
    contact: FittedContact = FittedContact()  #: Asperities and dry friction under the robot.
    provenance: Provenance = Provenance()  #: What the values rest on.

    @model_validator(mode="after")
    def _something(self) -> Self:
        values = self.fitted != FittedValues() or self.contact != FittedContact()
        if not (self.calibration or self.friction or self.placement or values):
            sentence = "nothing is calibrated; allowed: at least one [calibration.<model>] table"
            raise refuse(sentence)
        self._each_once()
        return self

    def _each_once(self) -> None:
        """Refuse two entries for the same thing: neither would be the right one."""
        listed: dict[str, list[tuple[Any, ...]]] = {
            f"calibration.{model}": [(entry.fitted_to,) for entry in entries]
            for model, entries in self.calibration.items()
        }
        listed["friction"] = [(item.channel_diameter, item.wavelength, item.amplitude) for item in self.friction]
        listed["placement"] = [(place.channel_diameter,) for place in self.placement]
        twice = [name for name, keys in listed.items() if len(set(keys)) < len(keys)]
        if twice:
            sentence = f"{twice[0]} holds two entries for the same geometry; allowed: one for each"
            raise refuse(sentence)


def read_calibration(path: str | Path) -> CalibrationFile:
    """Read and check a calibration file."""
    table = read_toml(Path(path), _WHAT)
    checked = problems_in(CalibrationFile, table)
    if not isinstance(checked, list):
        return checked
    tables = table.get("calibration")
    single = [name for name, entry in tables.items() if isinstance(entry, Mapping)] if isinstance(tables, dict) else []
    for name in single:  # the file has [calibration.sbt], not the first of a list
        checked = [problem.replace(f"calibration.{name}.0.", f"calibration.{name}.") for problem in checked]
    raise refused_table(checked, str(path))


def calibrated_robot(robot: Robot, file: CalibrationFile) -> Robot:
    """The robot with fitted factors, fields and friction; of several geometries the one nearest to it is taken."""
    # A file without factors leaves the robot its own; factors for some models take the place of all. A tail whose B_eff
    # was not fitted gets the middle of the fitted tails in its channel: they say more about it than the rotor's own
    # B_m, which is a lower bound.
    values = {path: getattr(file.fitted, name) for name, path in _FIELDS.items()}
    known = {path: value for path, value in values.items() if value is not None}
    if robot.motor is None:
        known = {path: value for path, value in known.items() if not path.startswith("motor.")}
    changed = with_numbers(robot, known)
    factors = {
        model: min(entries, key=lambda entry: _distance(robot, entry)) for model, entries in file.calibration.items()
    }
    friction = changed.friction
    fitted, others = friction_of_tails(robot, file.friction)
    if fitted is not None:
        friction = friction.model_copy(update={"effective": fitted})
    elif others:
        friction = friction.model_copy(update={"effective": float(np.median(others))})
    return changed.model_copy(update={"calibration": factors or robot.calibration, "friction": friction})


def friction_of_tails(robot: Robot, entries: Sequence[FittedFriction]) -> tuple[float | None, tuple[float, ...]]:
    """B_eff that was fitted to a robot's own tail, None where none was, and those of all tails in its channel."""
    if robot.channel is None or robot.motor is None or not entries:
        return None, ()
    diameter, tail = robot.channel.diameter, robot.tail
    near = [entry for entry in entries if _is_same_size(diameter, entry.channel_diameter)]
    waves = [entry for entry in near if _is_same_size(tail.wavelength, entry.wavelength)]
    own = [entry.effective for entry in waves if _is_same_size(tail.amplitude, entry.amplitude)]
    return own[0] if own else None, tuple(entry.effective for entry in near)


def placement_in(file: CalibrationFile, robot: Robot) -> Placement | None:
    """Pose of a robot in its channel by a calibration; None where the file has none for that channel."""
    diameter = robot.channel.diameter if robot.channel else float("inf")
    own = [place.placement for place in file.placement if _is_same_size(diameter, place.channel_diameter)]
    return own[0] if own else None


def _is_same_size(value: float, fitted: float) -> bool:
    return abs(value - fitted) <= _SAME * fitted


_OPEN = 1e3  # diameter that represents an unbounded fluid, m: the widest channel is the nearest to it


def nearest_channel(robot: Robot, channels: Sequence[float]) -> int:
    """Index of the channel that is nearest to a robot's own; an open robot is nearest to the widest."""
    own = robot.channel.diameter if robot.channel else _OPEN
    return int(np.argmin([abs(np.log(own / diameter)) for diameter in channels]))


def _distance(robot: Robot, entry: Calibration) -> float:
    """How far a robot is from the geometry that factors were fitted to."""
    fitted = entry.fitted_to
    channel = robot.channel.diameter if robot.channel else _OPEN
    pairs = (
        (channel, fitted.channel_diameter),
        (robot.body.diameter, fitted.body_diameter),
        (robot.body.length, fitted.body_length),
    )
    return float(sum(abs(np.log(value / fit)) for value, fit in pairs))


_FIELDS = {
    "wire_diameter": "tail.wire_diameter",
    "viscosity": "fluid.viscosity",
    "torque_constant": "motor.torque_constant",
    "back_emf_constant": "motor.back_emf_constant",
    "normal_factor": "model.rft.normal_factor",
    "tangential_factor": "model.rft.tangential_factor",
    "friction": "friction.effective",
}
"""Field of `FittedValues` to the field of a robot."""
