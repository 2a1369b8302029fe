"""Entries of answers as JSON, declared in `answers.csv`: its rows in order, by the name of the class.

The row of `schema` names the answer's kind. `entry` is the place in the JSON (`latency.median`), or several that are
alike; without it the entries of a mapping stand beside the others. `attribute` is where the value is found (`size.0`, a
method without arguments), what goes before the entry's name (`prediction.`), or text after `=`; without it, it is
called as the entry. `unit` is SI, `*` that of the registry, or that of an attribute in braces. An entry with `given` is
left out where that attribute is None, NaN, false or empty.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from spirillum.data_tables import records_of
from spirillum.envelope import envelope, finite, quantity
from spirillum.quantities import unit_of


class AnswerEntry(NamedTuple):
    """A row of `answers.csv`."""

    answer: str
    entry: str
    attribute: str
    unit: str
    given: str  #: Attribute without which the entry is left out.


def _declared() -> dict[str, list[AnswerEntry]]:
    found: dict[str, list[AnswerEntry]] = {}
    for row in records_of("answers.csv", AnswerEntry):
        for name in row.entry.split() or [""]:
            attribute = f"{row.attribute}{name}" if row.attribute.endswith(".") else row.attribute or name
            found.setdefault(row.answer, []).append(row._replace(entry=name, attribute=attribute))
    return found


ENTRIES = _declared()  #: An entry each, by the name of the class.


def answer_of(item: Any, **computed: Any) -> dict[str, Any]:
    """An answer as data, with its schema and its notes; `computed` values stand for attributes of these names."""
    content = content_of(item, **computed)
    return envelope(content.pop("schema"), content, getattr(item, "warnings", ()))


def content_of(item: Any, **computed: Any) -> dict[str, Any]:
    """The declared entries of an answer, or of a part of one."""
    found: dict[str, Any] = {}
    for row in ENTRIES[type(item).__name__]:
        if row.given and not _is_given(_value(item, row.given, computed)):
            continue
        *path, name = row.entry.split(".")
        table = found
        for part in path:
            table = table.setdefault(part, {})
        unit = str(_value(item, row.unit[1:-1], computed)) if row.unit.startswith("{") else row.unit
        value = _in_unit(_value(item, row.attribute, computed), unit, name)
        table.update({name: value} if name else value)
    return found


def _value(item: Any, path: str, computed: Mapping[str, Any]) -> Any:
    """The value at a path, such as `size.0`; a method is called."""
    if path.startswith("="):
        return path == "=true" or path[1:]
    first, *others = path.split(".")
    found = computed[first] if first in computed else getattr(item, first)
    for name in others:
        if isinstance(found, Mapping):
            found = found[name]
        else:
            found = found[int(name)] if name.lstrip("-").isdigit() else getattr(found, name)
    return found() if callable(found) else found


def _in_unit(value: Any, unit: str, name: str) -> Any:
    if not unit:
        return _plain(value)
    if isinstance(value, Mapping):
        return {key: _in_unit(one, unit, key) for key, one in value.items()}
    return quantity(value, unit_of(name) if unit == "*" else unit)


def _plain(value: Any) -> Any:
    """A value as JSON has it; of an object its own dictionary, or its declared entries."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if type(value).__name__ in ENTRIES:
        return content_of(value)
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    return str(value) if isinstance(value, Path) else finite(value)


def _is_given(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return bool(value) if isinstance(value, (str, int, tuple, Mapping)) else value is not None
