"""Units at the edge: text such as ``"18 mm"`` to SI floats and back.

Inside the package every number is SI with rates in rad/s. pint reads the units, in a registry of our
own (`units.txt`) where angle is a dimension, because 1 Hz of a rotating part is 2 pi rad/s.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import as_file, files
from typing import TYPE_CHECKING, Any

from spirillum.data_tables import rows_of
from spirillum.errors import InputError
from spirillum.scalars import is_number, plain_minus
from spirillum.unit_spelling import other_spellings, plain_unit, spelled_names

if TYPE_CHECKING:
    import pint

_QUANTITY = re.compile(
    r"\s*(?P<number>[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?|nan|inf|infinity))"
    r"\s*(?P<unit>[^0-9].*)?",
    re.I | re.S,
)
# Letters, products, quotients and one-digit powers: nothing that could be expensive to read.
_UNIT = re.compile(r"(?:[^\W\d]|[ */().°]|\*\*-?\d(?!\d)|\^-?\d(?!\d)|(?<![\w.])1(?=\s*/))+")
_POWER_OF_A_POWER = re.compile(r"\d\s*(?:\*\*|\^)")
_LONGEST_UNIT = 40
_PREFIX = re.compile(r"([^\W\d]+)-(?=\s)")

Hz = 2 * math.pi  #: One turn per second in rad/s.

_SI: dict[str, float] = {
    **dict.fromkeys(("1", "m", "m/s", "rad/s", "kg", "N", "N m", "N m s/rad", "W", "A", "V", "s"), 1.0),
    **dict.fromkeys(("m/rad", "kg/m^3"), 1.0),
    **dict.fromkeys(("mm", "mm/s", "g", "mN", "mN m", "mW", "mA", "mT", "mPa s", "mV"), 1e-3),
    **dict.fromkeys(("um", "um/s", "mg", "uN", "uN m", "uW", "ml"), 1e-6),
    **dict.fromkeys(("nm", "nm/s", "ug", "nN", "nN m", "nW", "ul"), 1e-9),
    **dict.fromkeys(("pg", "fN", "fW"), 1e-15),
    **dict.fromkeys(("pN", "pN m", "pW"), 1e-12),
    **dict.fromkeys(("pN um", "aW", "um^3"), 1e-18),
    "pN nm": 1e-21,
    **dict.fromkeys(("Hz", "turn"), Hz),
    "deg": math.pi / 180,
    "mm/turn": 1e-3 / (2 * math.pi),
    "um/turn": 1e-6 / (2 * math.pi),
    "nm/turn": 1e-9 / (2 * math.pi),
    "min": 60.0,
    **dict.fromkeys(("%", "cm"), 1e-2),
    "mA h": 3.6,
}
"""SI values of the units that are shown, and of those that files mostly state."""


_UNITS = rows_of("shown_units.csv")
USUAL = {row["unit"]: tuple(row["read"].split("; ")) for row in _UNITS if row["read"]}
"""Units of a kind's own unit that files mostly state: they are read without pint, which takes a while to load."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of quantity: what it is called, its SI unit, an example, and the range that makes sense."""

    # The range is generous (micro-swimmers to metre-long models); it stops typing errors and overflow, not unusual
    # robots.

    name: str
    unit: str
    example: str
    low: str
    high: str
    also: str | None = None

    @property
    def allowed(self) -> str:
        """The allowed range in words."""
        return f"{self.low} to {self.high}"


KINDS = {
    row["kind"]: Kind(row["name"], row["unit"], row["example"], row["low"], row["high"], row["also"] or None)
    for row in rows_of("kinds.csv")
}


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    with as_file(files("spirillum") / "units.txt") as path:
        return pint.UnitRegistry(filename=str(path), cache_folder=None)


@lru_cache(maxsize=512)
def _factor(unit: str, kind: Kind) -> float:
    """SI value of one `unit` as a quantity of `kind`."""
    if unit == kind.unit:
        return 1.0
    return _SI[unit] if unit in USUAL.get(kind.unit, ()) else _factor_by_pint(unit, kind)


def _factor_by_pint(unit: str, kind: Kind) -> float:
    """SI value of one `unit` as a quantity of `kind`, by parsing it with pint."""
    hint = f'allowed: a unit of {kind.name}, as in "{kind.example}" (SI: {kind.unit.replace("**", "^")})'
    plain = plain_unit(unit)
    if len(plain) > _LONGEST_UNIT or not _UNIT.fullmatch(plain) or _POWER_OF_A_POWER.search(plain):
        comma = ", and a decimal point in the number" if unit.startswith(",") else ""
        raise InputError(f'"{_clip(unit)}" is not a unit; {hint}{comma}')
    found = _in_si(plain, kind)
    if found is not None:
        return found
    others: list[str] = []
    for loose in (False, True):
        others += other_spellings(plain, _names(), loose=loose)
        values = {text: value for text in others if (value := _in_si(text, kind)) is not None}
        distinct = {f"{value:.12g}": text for text, value in reversed(values.items())}
        if len(distinct) == 1:
            return next(iter(values.values()))
        if distinct:
            raise InputError(f'"{unit}" may mean {" or ".join(sorted(distinct.values()))}; {hint}')
    raise InputError(_refusal(unit, [plain, *others], kind, hint))


def _in_si(unit: str, kind: Kind) -> float | None:
    """SI value of one `unit` as a quantity of `kind`; None where it is unknown or measures something else."""
    one = _quantity_of(unit)
    for accepted in (kind.unit, kind.also):
        if one is not None and accepted is not None and one.is_compatible_with(accepted):
            return float(one.to(accepted).magnitude)
    return None


def _quantity_of(unit: str) -> Any:
    """One `unit` as pint reads it; None where it is unknown."""
    registry = _registry()
    try:
        return registry.Quantity(1.0, registry.parse_units(unit))
    except Exception:  # pint raises its own kinds and those of Python's tokenizer
        return None


@lru_cache(maxsize=1)
def _names() -> Mapping[str, frozenset[str]]:
    prefixes = _PREFIX.findall((files("spirillum") / "units.txt").read_text(encoding="utf-8"))
    return spelled_names(list(_registry()), prefixes)


_OTHER_MEASURES = [tuple(row.values()) for row in rows_of("other_measures.csv")]
"""SI unit of a kind, that of a common mistake, and the end of the sentence."""


def _refusal(unit: str, spellings: Sequence[str], kind: Kind, hint: str) -> str:
    """The sentence on a unit that is unknown, or measures something else in all its spellings."""
    known = [one for one in map(_quantity_of, spellings) if one is not None]
    for own, other, words in _OTHER_MEASURES:
        if kind.unit == own and any(one.is_compatible_with(other) for one in known):
            return f'"{unit}" {words}'
    return f'"{unit}" is not a unit of {kind.name}; {hint}' if known else f'"{unit}" is not a known unit; {hint}'


def _clip(text: str, longest: int = 60) -> str:
    return text if len(text) <= longest else f"{text[:longest]}…"


class _NoUnitError(InputError):
    """A number without its unit."""


def parse_quantity(value: object, kind: Kind) -> float:
    """Read a quantity such as ``"18 mm"`` or a pint quantity into an SI float."""
    if hasattr(value, "magnitude") and hasattr(value, "units"):
        value = f"{value.magnitude} {value.units}"
    needed = f'allowed: a number with its unit, for example "{kind.example}"'
    wrong = f"is not {'an' if kind.name[0] in 'aeiou' else 'a'} {kind.name}; {needed}"
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        shown = "a table or list" if isinstance(value, (dict, list)) else _clip(str(value))
        raise InputError(f"= {shown} {wrong}")
    if not isinstance(value, str):
        number, unit = value if isinstance(value, float) else float(max(-(10**300), min(value, 10**300))), ""
        shown = f"{value:.6g}" if isinstance(value, float) else _clip(f"{value:d}" if abs(value) < 10**30 else "(huge)")
    else:
        found = _QUANTITY.fullmatch(plain_minus(value))
        shown = f'"{_clip(value)}"'
        if found is None or len(value) > 200:
            raise InputError(f"= {shown} {wrong}")
        number, unit = float(found["number"]), (found["unit"] or "").strip()
        unit = f"1{unit}" if unit.startswith("/") else unit
    if not math.isfinite(number):
        raise InputError(f"= {shown} is not finite; allowed: {kind.allowed}")
    if not unit:
        raise _NoUnitError(f"= {shown} has no unit; {needed}")
    try:
        si = _scaled(number, _factor(unit, kind))
    except InputError as error:
        raise InputError(f"= {shown}: {error}") from error
    if not _bound(kind.low, kind) <= si <= _bound(kind.high, kind):
        raise InputError(f"= {shown} is out of range; allowed: {kind.allowed}")
    return si


def parse_option(name: str, value: str | float, kind: Kind) -> float:
    """Read an option of a function or command: text with its unit, or a float in SI."""
    if is_number(value):
        try:
            value = f"{float(value)!r} {kind.unit}"
        except OverflowError:
            value = f"inf {kind.unit}"
    try:
        return parse_quantity(value, kind)
    except _NoUnitError as error:
        raise InputError(f"{name} {error}{float_note(kind.unit)}") from error
    except InputError as error:
        raise InputError(f"{name} {error}") from error


def float_note(unit: str) -> str:
    """Return the end of a refusal of a text without unit: what a float means there."""
    return f"; in Python a float is in {unit}"


def _scaled(number: float, factor: float) -> float:
    """Number times factor; by division where 1/factor is whole, so that 18 mm is 0.018 and not its neighbour."""
    whole = round(1.0 / factor)
    if factor < 1.0 and math.isclose(whole * factor, 1.0, rel_tol=1e-14):
        return number / whole
    return number * factor


@lru_cache(maxsize=128)
def _bound(text: str, kind: Kind) -> float:
    number, unit = text.split(" ", 1)
    return float(number) * _factor(unit, kind)


def shown_in(value: float, unit: str) -> float:
    """The SI `value` expressed in a display `unit` (``mm``, ``Hz``, ``mm/s``...)."""
    return float(value) / _SI[unit]


def show(value: float, unit: str) -> str:
    """Text of an SI `value` in a display `unit`, four significant digits."""
    number = f"{shown_in(value, unit):.4g}"
    return number if unit == "1" else f"{number} {unit}"


def show_height(value: float) -> str:
    """Text of a gap or of the height of asperities, m: in mm from 0.1 mm on, else in um."""
    return show(value, "mm" if value >= 1e-4 else "um")


def as_given(value: object, unit: str) -> str:
    """Text of a quantity as a caller gave it: words as they are, clipped, and a number with its SI unit."""
    if not is_number(value):
        return _clip(str(value), 40)
    try:
        return f"{float(value):g} {unit}"
    except OverflowError:
        return f"(huge) {unit}"


def show_apart(one: float, other: float, unit: str, least: int = 4) -> tuple[str, str]:
    """Texts of two SI values in a display `unit`, with as many digits as distinguish them, and at least some."""
    for digits in range(least, 18):
        texts = tuple(f"{shown_in(value, unit):.{digits}g}" for value in (one, other))
        if texts[0] != texts[1] or one == other:
            break
    first, second = (text if unit == "1" else f"{text} {unit}" for text in texts)
    return first, second


_FOR_PEOPLE = {row["unit"]: row["shown"] for row in _UNITS if row["shown"]}


def _sizes(column: str) -> dict[str, list[tuple[float, str]]]:
    """SI unit to sizes, least first, and the unit in which values are read from or below them."""
    found = {row["unit"]: row[column].split("; ") for row in _UNITS if row[column]}
    pairs = {unit: [part.partition(" ") for part in parts] for unit, parts in found.items()}
    return {unit: [(float(size), shown) for size, _, shown in parts] for unit, parts in pairs.items()}


_LARGE = {unit: sizes[0] for unit, sizes in _sizes("from").items()}
_SMALL = _sizes("below")


def for_people(unit: str) -> str:
    """The unit in which people read values of an SI `unit` that are neither very small nor very large."""
    return _FOR_PEOPLE.get(unit, unit)


def display_unit(value: float | None, unit: str) -> str:
    """The unit in which people read an SI `value` of that size; None counts as neither small nor large."""
    if value is not None and unit in _LARGE and abs(value) >= _LARGE[unit][0]:
        return _LARGE[unit][1]
    if value:
        for below, shown in _SMALL.get(unit, ()):
            if abs(value) < below:
                return shown
    return for_people(unit)


def speed_unit(speed: float | None, rate: float | None) -> str:
    """The unit in which people read a speed beside the tail's rate: one for the slow and the fast runs of a robot."""
    if speed and rate and abs(speed) * Hz >= _ROBOTS_ADVANCE * abs(rate):
        return "mm/s"
    return display_unit(speed, "m/s")


_ROBOTS_ADVANCE = 5e-6  # advance in a turn of the tail from which a robot is one of millimetres and more, m


def among(value: float | None, unit: str, others: Iterable[float | None]) -> str:
    """The unit in which people read an SI `value` beside `others` of the same unit: a zero takes that of the least."""
    if value != 0:
        return display_unit(value, unit)
    sizes = [abs(other) for other in others if other]
    return display_unit(min(sizes, default=0.0), unit)


def in_unit(value: float | None, unit: str, shown: str, digits: int = 4) -> str:
    """Text of an SI `value` of that `unit` in the unit `shown`, with significant digits; ``-`` for None."""
    return "-" if value is None else f"{value if shown == unit else shown_in(value, shown):.{digits}g}"
