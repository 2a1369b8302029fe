"""Arguments of several fields: options (a frozen table, a mapping of its fields, or None) and overrides of a robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

from pydantic import AfterValidator, BeforeValidator
from pydantic_core import PydanticCustomError

from spirillum.errors import InputError, check_names, clipped
from spirillum.robot.fields import Section, field_values, problems_in, refused_table
from spirillum.scalars import is_number, is_whole
from spirillum.units import float_note


class Options(Section):
    """Options that belong together: frozen, closed to unknown fields, quantities in SI.

    In a file they are a table, in Python one argument, on the command line options of the same names.
    """

    argument: ClassVar[str] = "options"  #: Name of the argument that takes them; a keyword of the class.
    prefixed: ClassVar[bool] = False  #: Whether sentences name a field with its argument, as in `placement.gap`.

    def __init_subclass__(cls, *, argument: str = "", prefixed: bool = False, **others: Any) -> None:
        super().__init_subclass__(**others)
        if argument:
            cls.argument, cls.prefixed = argument, prefixed

    @classmethod
    def of(cls, value: Self | Mapping[str, Any] | None) -> Self:
        """Options from themselves, their fields by name (with units, or floats in SI), or None; None is left out."""
        if isinstance(value, cls):
            return value
        return cls._read(value, written=False)

    @classmethod
    def as_written(cls, value: Any) -> Self:
        """Options from a table of a file or from words of the command line, where every quantity has its unit."""
        return cls._read(value, written=True)

    @classmethod
    def _read(cls, value: Any, *, written: bool) -> Self:
        if not (value is None or isinstance(value, Mapping)):
            allowed = ", ".join(cls.model_fields)
            words = clipped(value) if isinstance(value, int) else repr(str(value)[:60])
            raise InputError(f"{cls.argument} = {words}; allowed: {allowed}, each by name")
        check_names(cls.argument, value or {}, cls.model_fields)
        units = {} if written else {item.path: item.unit for item in field_values(cls.model_construct())}
        given = {name: _with_unit(item, units.get(name)) for name, item in (value or {}).items() if item is not None}
        checked = problems_in(cls, given, cls.argument if cls.prefixed else "")
        if isinstance(checked, list):
            raise refused_table([_with_note(problem, units) for problem in checked])
        return checked


def _with_note(problem: str, units: Mapping[str, str | None]) -> str:
    """A problem; where a text has no unit, with what a float means in its field."""
    field = problem.partition(" ")[0].rpartition(".")[2]
    unit = units.get(field)
    return f"{problem}{float_note(unit)}" if unit is not None and " has no unit; " in problem else problem


def _with_unit(value: Any, unit: str | None) -> Any:
    """A number as text with its SI unit, where the field is a quantity."""
    if unit is None or not is_number(value):
        return value
    try:
        return f"{float(value)!r} {unit}"
    except OverflowError:
        return f"inf {unit}"


def refusal(sentence: str) -> PydanticCustomError:
    """The error of a value; the sentence follows the field's name."""
    return PydanticCustomError("quantity", "{sentence}", {"sentence": sentence})


def in_range(low: float, high: float, unit: str = "") -> Callable[[Any], float]:
    """A check of numbers from `low` to `high`; `unit` is for the sentence of an error."""

    def check(value: Any) -> float:
        if not (is_number(value) and low <= value <= high):
            raise refusal(f"= {clipped(value)}; allowed: {low:g} to {high:g}{unit}")
        return float(value)

    return check


def within(low: float, high: float, unit: str) -> AfterValidator:
    """A check of a quantity from `low` to `high`, SI; `unit` is for the sentence of an error."""

    def check(value: float) -> float:
        if not low <= value <= high:
            raise refusal(f"= {value:g} {unit}; allowed: {low:g} to {high:g} {unit}")
        return value

    return AfterValidator(check)


def whole(low: int, high: int) -> Callable[[Any], int]:
    """A check of whole numbers from `low` to `high`."""

    def check(value: Any) -> int:
        if not is_whole(value) or not low <= int(value) <= high:
            raise refusal(f"= {clipped(value)}; allowed: a whole number from {low} to {high}")
        return int(value)

    return check


def one_of(*allowed: str) -> Callable[[Any], Any]:
    """A check of words."""

    def check(value: Any) -> Any:
        if value not in allowed:
            raise refusal(f"= {str(value)[:40]!r}; allowed: {', '.join(allowed)}")
        return value

    return check


def file_path(what: str) -> BeforeValidator:
    """A check of the path of a file that is described in these words, or None."""

    def check(value: Any) -> Any:
        if not (value is None or isinstance(value, (str, Path))):
            raise refusal(f"= {str(value)[:40]}; allowed: {what}")
        return value

    return BeforeValidator(check)


_DEEPEST = 24  # nesting of tables up to which fields are distinguished: no robot file has more


def set_fields(overrides: Mapping[str, Any]) -> tuple[str, ...]:
    """Dotted names of the fields that overrides set, those of their tables one by one."""
    return tuple(_leaf_fields(overrides, ""))


def _leaf_fields(table: Mapping[str, Any], above: str) -> Iterator[str]:
    for name, value in table.items():
        if isinstance(value, Mapping) and above.count(".") < _DEEPEST:
            yield from _leaf_fields(value, f"{above}{name}.")
        else:
            yield f"{above}{name}"


def check_set_once(overrides: Mapping[str, Any]) -> None:
    """Refuse a field that overrides set twice, by itself and within a table, or a table that they also replace."""
    pairs = [(leaf, path) for path, value in overrides.items() for leaf in _leaf_fields({path: value}, "")]
    for leaf, path in pairs:
        for other, beside in pairs:
            if path != beside and f"{leaf}.".startswith(f"{other}."):
                first, again = sorted((path, beside), key=len)
                raise InputError(f"{other} is set by {first} and again by {again}; allowed: each field once")
