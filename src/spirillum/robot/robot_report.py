"""Results of `robot show` and `robot check`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from spirillum.envelope import envelope, quantity
from spirillum.errors import InputError
from spirillum.robot.fields import field_values
from spirillum.robot.load import load, raw_table
from spirillum.robot.robot import Robot


def robot_answer(robot: Robot) -> dict[str, Any]:
    """Fields of a robot and what follows from them, as `spirillum robot show` prints them."""
    derived = {name: quantity(item.value, item.unit, meaning=item.meaning) for name, item in robot.derived().items()}
    fields = {
        path: value if unit is None else quantity(value, unit.replace("**", "^"))
        for path, value, unit in field_values(robot)
    }
    content = {"robot": robot.name, "fields": fields, "derived": derived}
    return envelope("robot", content, robot.warnings)


def checked(robot: str, overrides: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Problems and warnings of a robot file."""
    raw_table(robot)
    try:
        return (), load(robot, **overrides).warnings
    except InputError as error:
        return error.problems, ()


def check_answer(robot: str, problems: Sequence[str], warnings: Sequence[str]) -> dict[str, Any]:
    """Whether a robot file is valid, as `spirillum robot check` prints it."""
    return envelope("check", {"robot": robot, "valid": not problems, "problems": list(problems)}, warnings)
