"""Fields that somebody has set and a file of fitted values replaces: one of them would be lost without a word."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from spirillum.errors import InputError
from spirillum.fitted.fit import read_fit
from spirillum.robot.robot import Robot


def set_fields(overrides: Mapping[str, Any]) -> tuple[str, ...]:
    """Dotted names of the fields that overrides set, those of their tables one by one."""
    return tuple(_leaves(overrides, ""))


def _leaves(table: Mapping[str, Any], above: str) -> Iterator[str]:
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{above}{name}.")
        else:
            yield f"{above}{name}"


def check_not_replaced(
    fields: Iterable[str], robot: Robot, calibration: str | Path | None, posterior: str | Path | None
) -> None:
    """Refuse set fields of a robot whose values a calibration file or a posterior replaces.

    Args:
        fields: dotted names of the fields that were set.
        robot: the robot with them.
        calibration: calibration file; None without one.
        posterior: file of a posterior; None without one.
    """
    asked = tuple(fields)
    for paths in ((calibration, None), (None, posterior)):
        if asked and any(paths):
            check_kept(asked, robot, read_fit(*paths).central(robot), str(paths[0] or paths[1]))


def check_kept(fields: Iterable[str], before: Robot, after: Robot, source: str) -> None:
    """Refuse set fields that are not the same in a robot before and after fitted values have replaced its own."""
    asked = tuple(fields)
    if not asked or after is before:
        return
    own, fitted = before.model_dump(), after.model_dump()
    for field in asked:
        if _at(own, field) != _at(fitted, field):
            raise InputError(
                f"{field} is set or varied, and replaced by what {source} has fitted; allowed: one of them"
            )


def _at(table: Any, field: str) -> Any:
    """A value among nested tables; None where there is none."""
    for name in field.split("."):
        table = table.get(name) if isinstance(table, Mapping) else None
    return table
