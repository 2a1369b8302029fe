"""A robot as the text of a robot file: every field that is set, with its unit."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from spirillum.files import MARK
from spirillum.robot.fields import default_of, field_values
from spirillum.robot.robot import Robot
from spirillum.units import USUAL, Kind, for_people, parse_quantity, shown_in


def robot_text(robot: Robot, comment: str = "") -> str:
    """The text of a file from which `spirillum.load` gives the same robot."""
    sections: dict[str, list[str]] = {"": []}
    for path, text in _fields(robot):
        section, _, name = path.rpartition(".")
        sections.setdefault(section, []).append(f"{name} = {text}")
    head = [*comment.splitlines(), f"Every field that is set, {MARK}."]
    lines = [f"# {line}" for line in head] + sections.pop("")
    for section, entries in sections.items():
        lines += ["", f"[{section}]", *entries]
    return "\n".join(lines) + "\n"


def with_numbers(robot: Robot, values: dict[str, float]) -> Robot:
    """The robot with numbers of its tables replaced; the whole is not checked anew."""
    for path, value in values.items():
        robot = _replaced(robot, path.split("."), value)
    return robot


def _replaced(table: Any, names: list[str], value: float) -> Any:
    first, *rest = names
    inner = _replaced(getattr(table, first), rest, value) if rest else value
    return table.model_copy(update={first: inner})


def _fields(robot: Robot) -> Iterator[tuple[str, str]]:
    for path, value, unit in field_values(robot):
        if value is None:
            if default_of(robot, path) is not None:
                yield path, '"none"'
        elif unit is None:
            yield path, json.dumps(list(value) if isinstance(value, (tuple, list)) else value, ensure_ascii=False)
        elif isinstance(value, tuple):
            yield path, json.dumps([_with_unit(item, unit) for item in value], ensure_ascii=False)
        else:
            yield path, f'"{_with_unit(float(value), unit)}"'


def _with_unit(value: float, unit: str) -> str:
    """In the unit that people read where that is exactly the same number, else in SI."""
    shown = for_people(unit)
    if shown in USUAL.get(unit, ()):
        text = f"{shown_in(value, shown):.12g} {shown}"
        if parse_quantity(text, Kind("quantity", unit, f"1 {unit}", f"-1e30 {unit}", f"1e30 {unit}")) == value:
            return text
    return f"{value!r} {unit}"
