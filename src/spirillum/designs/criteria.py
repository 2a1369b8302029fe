"""What a design may choose and has to keep: fields with ranges, objectives, constraints, manufacturability."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Annotated, Literal, NamedTuple, cast

import numpy as np
from pydantic import Field

from spirillum.arrays import Samples
from spirillum.errors import InputError, did_you_mean
from spirillum.quantities import Quantity
from spirillum.robot.arguments import Options
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import LengthOrZero, field_values, kind_of
from spirillum.robot.limits import Limit
from spirillum.robot.robot import Robot
from spirillum.robot.tail_form import coil_curvature
from spirillum.swimming.motions import STEADY
from spirillum.units import Kind, as_given, display_unit, in_unit, parse_option, show


class Judged(Options, argument="judged"):
    """Statistics of designs under uncertainty."""

    statistic: Literal["mean", "quantile"] = "mean"
    """Of the objective over the draws: its mean, or the quantile of its worse end."""
    level: Annotated[float, Field(gt=0.0, lt=0.5)] = 0.1  #: Of the quantile: the share of the draws that are worse.
    confidence: Annotated[float, Field(gt=0.0, le=1.0)] = 0.95  #: Share of the draws that must satisfy a condition.
    draws: Annotated[int, Field(strict=True, ge=8, le=16384)] = 256
    """Draws used by the search; the stated statistics use four times as many new ones."""
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**31)] = 1  #: Seed of draws and search.
    confirm: Annotated[bool, Field(strict=True)] = False
    """Make the tables that trials of the best three designs lack: 2 to 5 minutes of two cores each."""

    def check_read(self, *, known: bool, conditions: bool) -> None:
        """Refuse what was given and nothing reads; a seed serves the search in any case."""
        given = [
            name
            for name in type(self).model_fields
            if name in self.model_fields_set and name not in ("seed", "confirm")
        ]
        if given and known:
            raise InputError(
                f"{', '.join(given)} where nothing is unknown; allowed: with a field that is not known (unknown) or a "
                "posterior"
            )
        if "level" in given and self.statistic != "quantile":
            raise InputError(
                f"level = {self.level:g} with statistic '{self.statistic}', which has none; allowed: with quantile"
            )
        if "confidence" in given and not conditions:
            raise InputError(
                f"confidence = {self.confidence:g} without a condition (subject_to) that would have to hold; allowed: "
                "with one"
            )


_CONDITION = re.compile(r"\s*([A-Za-z_]+)\s*(<=|>=)\s*(\S.*)", re.S)
_LONGEST = 200


class Condition(NamedTuple):
    """What a quantity has to keep, as `motor_current <= 0.4 A`; SI."""

    quantity: Quantity
    relation: Literal["<=", ">="]
    bound: float

    def excess(self, values: Samples) -> Samples:
        """By how much values break it, relative to the bound (to 1 where that is 0); 0 or less where they keep it."""
        scale = abs(self.bound) or 1.0
        return (values - self.bound) / scale if self.relation == "<=" else (self.bound - values) / scale

    @property
    def words(self) -> str:
        """The condition as text."""
        return f"{self.quantity.name} {self.relation} {with_unit(self.bound, self.quantity.unit)}"


def with_unit(value: float, unit: str) -> str:
    """An SI value as people read it, with its unit."""
    shown = display_unit(value, unit)
    return in_unit(value, unit, shown) + ("" if shown == "1" else f" {shown}")


def quantity_of(name: str, option: str) -> Quantity:
    """A quantity of steady swimming by name."""
    for item in STEADY:
        if item.name == name:
            return item
    names = [item.name for item in STEADY]
    raise InputError(f"{option} = {name[:60]!r} is no quantity{did_you_mean(name, names)}; allowed: {', '.join(names)}")


def condition_of(text: str, option: str = "subject_to") -> Condition:
    """A condition from text such as `motor_current <= 0.4 A`."""
    given: object = text
    found = _CONDITION.fullmatch(given) if isinstance(given, str) and len(given) <= _LONGEST else None
    if found is None:
        raise InputError(
            f"{option} = {str(text)[:60]!r}; allowed: NAME <= VALUE UNIT or NAME >= VALUE UNIT, as "
            "'motor_current <= 0.4 A'"
        )
    quantity = quantity_of(found[1], option)
    kind = None if quantity.unit == "1" else _kind(quantity.unit)
    return Condition(
        quantity, cast("Literal['<=', '>=']", found[2]), _value(f"{option} {quantity.name}", found[3], kind)
    )


def range_of(name: str, given: str | Sequence[object], kind: Kind | None) -> tuple[float, float]:
    """The two ends of a range, SI; None: of numbers without unit."""
    ends: object = given.split(":") if isinstance(given, str) else given
    if isinstance(ends, bytes) or not isinstance(ends, Sequence) or len(ends) != 2:
        raise InputError(f"{name} = {str(given)[:60]!r}; allowed: LOW:HIGH, each with its unit")
    low, high = (_value(name, end, kind) for end in ends)
    return low, high


def _as_typed(given: str | Sequence[object], unit: str) -> str:
    """A range as a caller gave it, numbers with their SI unit."""
    return given[:60] if isinstance(given, str) else ":".join(as_given(end, unit) for end in given)


def _value(name: str, given: object, kind: Kind | None) -> float:
    if kind is None:
        try:
            number = float(str(given))
        except ValueError:
            number = np.nan
        if isinstance(given, bool) or not np.isfinite(number):
            raise InputError(f"{name} = {str(given)[:60]!r}; allowed: a finite number without unit")
        return number
    return parse_option(name, given.strip() if isinstance(given, str) else cast("float", given), kind)


@lru_cache(maxsize=64)
def _kind(unit: str) -> Kind:
    """Any value of an SI unit; the limits of fields and model decide which are valid."""
    plain = unit.replace("^", "**")
    return Kind(f"quantity in {unit}", plain, f"1 {unit}", f"-1e12 {plain}", f"1e12 {plain}")


class Manufacturability(Options, argument="bench", prefixed=True):
    """How tightly a wire is wound, and how far the tail stays off the glass."""

    mandrel: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    """Least bending diameter of the wire, in wire diameters (IEC 60851-3, mandrel winding)."""
    clearance: LengthOrZero | None = None
    """Least distance between the tail on the tube's axis and the glass; None: one wire diameter."""

    def check(self, designs: RobotBatch) -> None:
        """Refuse a clearance that no design leaves, before any of them is evaluated."""
        room = 0.5 * float(designs.channel_diameter.max() - designs.wire_diameter.min())
        amplitude = float(designs.amplitude.min())
        most = room - amplitude
        if self.clearance is not None and 0.0 <= most < self.clearance:
            raise InputError(
                f"bench.clearance = {show(self.clearance, 'mm')}; allowed: at most {show(most, 'mm')}, which the tube "
                f"leaves beside a tail of {show(amplitude, 'mm')} amplitude"
            )

    def limits(self, batch: RobotBatch) -> list[Limit]:
        """The conditions, for every robot of a batch."""
        wire = batch.wire_diameter
        curvature = coil_curvature(batch.wavelength, batch.amplitude)
        clearance = wire if self.clearance is None else np.full(1, self.clearance)
        return [
            Limit.named("tail-off-glass", batch.amplitude, 0.5 * (batch.channel_diameter - wire) - clearance),
            Limit.named("mandrel", 1.0 / curvature, 0.5 * (1.0 + self.mandrel) * wire),
        ]


TURNS = "tail.turns"  #: Whole turns of the tail: its length over its wavelength, a field of designs only.
_MOST_TURNS = 100
_MOST_VARIABLES = 8
_MAY_BE_UNSET = "friction.effective"


class Variable(NamedTuple):
    """A field with the range from which a design chooses it; SI."""

    path: str  #: Dotted field of the robot file, or `tail.turns`.
    unit: str  #: SI unit.
    low: float
    high: float

    @property
    def is_whole(self) -> bool:
        """Whether it is a whole number."""
        return self.path == TURNS

    def at(self, share: Samples) -> Samples:
        """Values at shares of the range, 0 to 1; whole numbers are equally likely."""
        if self.is_whole:
            count = self.high - self.low + 1.0
            return self.low + np.minimum(np.floor(share * count), count - 1.0)
        return self.low + share * (self.high - self.low)

    def share(self, value: float) -> float:
        """Position of a value in its range; of a whole number the middle of its interval."""
        if self.is_whole:
            return (value - self.low + 0.5) / (self.high - self.low + 1.0)
        return (value - self.low) / (self.high - self.low)


@dataclass(frozen=True)
class Space:
    """All designs of a robot: a box of shares, (variables,), each 0 to 1."""

    robot: Robot
    variables: tuple[Variable, ...]

    @cached_property
    def size(self) -> int:
        """Number of variables."""
        return len(self.variables)

    def values(self, shares: Samples) -> Samples:
        """Values of the variables, (designs, variables), from shares of their ranges."""
        return np.stack([variable.at(shares[:, n]) for n, variable in enumerate(self.variables)], axis=-1)

    def named(self, shares: Samples) -> dict[str, float]:
        """Values of the variables of one design, (variables,), by their fields."""
        return dict(zip((item.path for item in self.variables), self.values(shares[None])[0].tolist(), strict=True))

    def settled(self, shares: Samples) -> Samples:
        """Normalised values, of which those of one whole number coincide."""
        values = self.values(shares)
        found = shares.copy()
        for n, variable in enumerate(self.variables):
            if variable.is_whole:
                found[:, n] = [variable.share(value) for value in values[:, n]]
        return found

    def columns(self, shares: Samples) -> dict[str, Samples]:
        """Fields of a batch, (designs,), from shares; turns become the tail's length."""
        found = {variable.path: column for variable, column in zip(self.variables, self.values(shares).T, strict=True)}
        turns = found.pop(TURNS, None)
        if turns is not None:
            found["tail.length"] = turns * found.get("tail.wavelength", self.robot.tail.wavelength)
        return found

    def batch(self, shares: Samples) -> RobotBatch:
        """The robots of some designs, with what is not varied as the robot has it."""
        return RobotBatch.of(self.robot).with_values(self.columns(shares))

    @cached_property
    def today(self) -> dict[str, float]:
        """Values of the variables of the robot as it is; NaN where one is unset."""
        tail = self.robot.tail
        known = {item.path: item.value for item in field_values(self.robot)} | {TURNS: tail.length / tail.wavelength}
        return {item.path: float(np.nan if known[item.path] is None else known[item.path]) for item in self.variables}


def space_of(robot: Robot, vary: Mapping[str, str | Sequence[object]]) -> Space:
    """The space of designs that some ranges span."""
    if not vary:
        raise InputError("vary holds no field; allowed: one to 8 numeric fields, as tail.wavelength=5mm:40mm")
    if len(vary) > _MOST_VARIABLES:
        raise InputError(f"vary holds {len(vary)} fields; allowed: at most {_MOST_VARIABLES}")
    if TURNS in vary and "tail.length" in vary:
        raise InputError("vary holds tail.turns and tail.length; allowed: one of them, for turns set the length")
    return Space(robot, tuple(variable_of(robot, path, given) for path, given in vary.items()))


def variable_of(robot: Robot, path: str, given: str | Sequence[object], option: str = "vary") -> Variable:
    """One field with its range."""
    if path == TURNS:
        low, high = range_of(f"{option} {path}", given, None)
        if low != round(low) or high != round(high) or not 1 <= low <= high <= _MOST_TURNS:
            raise InputError(f"{option} {path} = {low:g}:{high:g}; allowed: whole numbers from 1 to {_MOST_TURNS}")
        return Variable(path, "1", low, high)
    # A field that is unset belongs to another drive or shape; friction alone may be unset and still act.
    units = {
        item.path: item.unit for item in field_values(robot) if item.value is not None or item.path == _MAY_BE_UNSET
    }
    known = sorted(set(units) & set(RobotBatch.numbers()))
    if path not in known:
        hint = did_you_mean(path, [*known, TURNS])
        raise InputError(f"{option} {path[:60]} is no number of this robot{hint}; allowed: {', '.join(known)}, {TURNS}")
    if (source := robot.source_of(path)) is not None:
        raise InputError(f"{option} {path} follows from {source}; allowed: fields that it leaves open")
    unit = units[path] or "1"
    low, high = range_of(f"{option} {path}", given, kind_of(robot, path))
    if not low < high:
        raise InputError(f"{option} {path} = {_as_typed(given, unit)}; allowed: LOW:HIGH with LOW below HIGH")
    try:
        RobotBatch.of(robot).with_values({path: [low, high]})
    except InputError as error:
        raise InputError(
            f"{option} {path} = {_as_typed(given, unit)}; allowed: numbers that the field of a robot file may have"
        ) from error
    return Variable(path, unit, low, high)
