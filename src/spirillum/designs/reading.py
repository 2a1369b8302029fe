"""Ranges and conditions as people write them: numbers with the units of their quantities; nothing is evaluated."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, NamedTuple, cast

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError, did_you_mean
from spirillum.quantities import Quantity
from spirillum.swimming.steady_quantities import STEADY
from spirillum.units import Kind, display_unit, in_unit, parse_option

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
        found: Samples = (values - self.bound) / scale if self.relation == "<=" else (self.bound - values) / scale
        return found

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
    return Condition(
        quantity, cast("Literal['<=', '>=']", found[2]), _value(f"{option} {quantity.name}", found[3], quantity.unit)
    )


def range_of(name: str, given: str | Sequence[object], unit: str) -> tuple[float, float]:
    """The two ends of a range, SI."""
    ends: object = given.split(":") if isinstance(given, str) else given
    if isinstance(ends, bytes) or not isinstance(ends, Sequence) or len(ends) != 2:
        raise InputError(f"{name} = {str(given)[:60]!r}; allowed: LOW:HIGH, each with its unit")
    low, high = (_value(name, end, unit) for end in ends)
    return low, high


def _value(name: str, given: object, unit: str) -> float:
    if unit == "1":
        try:
            number = float(str(given))
        except ValueError:
            number = np.nan
        if isinstance(given, bool) or not np.isfinite(number):
            raise InputError(f"{name} = {str(given)[:60]!r}; allowed: a finite number without unit")
        return number
    return parse_option(name, given.strip() if isinstance(given, str) else cast("float", given), _kind(unit))


@lru_cache(maxsize=64)
def _kind(unit: str) -> Kind:
    """Any value of an SI unit; the limits of fields and model decide which are valid."""
    plain = unit.replace("^", "**")
    return Kind(f"quantity in {unit}", plain, f"1 {unit}", f"-1e12 {plain}", f"1e12 {plain}")
