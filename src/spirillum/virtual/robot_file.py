"""A checked robot written as a robot file, so that a setup can name it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from spirillum.files import MARK
from spirillum.robot.fields import Section, field_values
from spirillum.robot.load import load, preset_names
from spirillum.robot.robot import Robot

__all__ = ["is_preset", "robot_text"]


def is_preset(robot: Robot) -> bool:
    """Whether a robot is an unchanged preset."""
    return robot.name in preset_names() and load(robot.name) == robot


def robot_text(robot: Robot) -> str:
    """A robot file (TOML) of all fields of a robot, SI units.

    Args:
        robot: a checked robot.
    """
    units = {item.path: item.unit for item in field_values(robot) if item.unit is not None}
    return "\n".join([f"# every field of a checked robot, {MARK}", *_lines(robot, "", units)]) + "\n"


def _lines(section: Section, path: str, units: dict[str, str]) -> Iterator[str]:
    for name, info in type(section).model_fields.items():
        value, where = getattr(section, name), f"{path}{name}"
        if value is None:
            if info.default is not None:
                yield f'{where} = "none"'
        elif isinstance(value, Section):
            yield from _lines(value, f"{where}.", units)
        elif isinstance(value, dict):
            for key, item in value.items():
                yield from _lines(item, f"{where}.{key}.", units)
        else:
            yield f"{where} = {_value(value, units.get(where))}"


def _value(value: Any, unit: str | None) -> str:
    if unit is not None:
        return f'"{float(value)!r} {unit}"'
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(item, None) for item in value)}]"
    return json.dumps(value, ensure_ascii=False)
