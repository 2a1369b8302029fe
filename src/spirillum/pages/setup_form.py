"""The form of a setup: its fields in their order, and what each of them means."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from spirillum.data_tables import rows_of
from spirillum.errors import InputError, clipped

_LONGEST = 200  # characters of a field


@dataclass(frozen=True)
class Entry:
    """One field of the setup file."""

    field: str
    label: str
    group: str
    example: str  #: Placeholder of an empty field: its meaning, or an example.
    note: str
    choices: tuple[str, ...] = ()
    number: bool = False  #: Whether it is a bare number, without a unit.
    uncertain: bool = False  #: Whether it has a standard uncertainty in a field of its own.


def _entries() -> Iterator[Entry]:
    """The rows of `setup_form.csv`."""
    for row in rows_of("pages/setup_form.csv"):
        words: Any = {name: row[name] for name in ("field", "label", "group", "example", "note")}
        yield Entry(
            **words, choices=tuple(row["choices"].split()), number=row["number"] != "", uncertain=row["uncertain"] != ""
        )


FORM = tuple(_entries())  #: Fields of the form, without the robot's file.

_NUMBERS = {entry.field for entry in FORM if entry.number} | {"tank.index_uncertainty"}
_KNOWN = {entry.field for entry in FORM} | {f"{entry.field}_uncertainty" for entry in FORM if entry.uncertain}


def form_fields(given: Mapping[str, Any], robots: tuple[str, ...]) -> dict[str, Any]:
    """Fields of a setup from a form or a file, without empty ones."""
    found: dict[str, Any] = {}
    for name, value in given.items():
        if name != "robot.file" and name not in _KNOWN:
            raise InputError(f"{str(name)[:60]} is no field of this form; allowed: {', '.join(sorted(_KNOWN))}")
        if isinstance(value, list) and name == "robot.stripes":
            value = ", ".join(map(str, value))  # noqa: PLW2901
        known = isinstance(value, (str, int, float)) and not isinstance(value, bool)
        text = str(value).strip() if known else clipped(value)
        if not known or len(text) > _LONGEST or not text.isprintable():
            raise InputError(f"{name} = {text[:60]!r}; allowed: a text of at most {_LONGEST} printable characters")
        if name == "robot.file" and text not in robots:
            raise InputError(f"robot.file = {text[:60]!r}; allowed: {', '.join(robots)}")
        if text:
            found[name] = _typed(name, text)
    return found


def _typed(name: str, text: str) -> Any:
    if name == "robot.stripes":
        return [part.strip() for part in text.split(",") if part.strip()]
    if name in _NUMBERS:
        with suppress(ValueError):
            number = float(text.replace(",", "."))
            if math.isfinite(number):  # JSON has no others; as text its field refuses it
                return number
    return text
