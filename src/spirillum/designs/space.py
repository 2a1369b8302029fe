"""The fields that a design may choose, and their ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.designs.reading import range_of
from spirillum.errors import InputError, did_you_mean
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import field_values
from spirillum.robot.robot import Robot

TURNS = "tail.turns"
"""Whole turns of the tail: its length over its wavelength, a field of designs only."""
_MOST_TURNS = 100
_MOST_VARIABLES = 8
_MAY_BE_UNSET = "friction.effective"


class Variable(NamedTuple):
    """A field with the range from which a design chooses it; SI."""

    path: str
    """Dotted field of the robot file, or `tail.turns`."""
    unit: str
    """SI unit."""
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
        found: Samples = self.low + share * (self.high - self.low)
        return found

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
        low, high = range_of(f"{option} {path}", given, "1")
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
    low, high = range_of(f"{option} {path}", given, unit)
    if not low < high:
        raise InputError(f"{option} {path} = {low:g}:{high:g} {unit}; allowed: LOW:HIGH with LOW below HIGH")
    try:
        RobotBatch.of(robot).with_values({path: [low, high]})
    except InputError as error:
        raise InputError(
            f"{option} {path} = {low:g}:{high:g} {unit}; allowed: numbers that the field of a robot file may have"
        ) from error
    return Variable(path, unit, low, high)
