"""From options as they are typed to what the functions take."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spirillum.robot.robot import Robot

__all__ = ["loaded_robot", "overrides_from", "placement_from"]


def overrides_from(settings: list[str] | None) -> dict[str, Any]:
    """Fields of the robot by `--set`."""
    from spirillum.robot.load import parse_setting

    return dict(parse_setting(text) for text in settings or [])


def loaded_robot(robot: str, settings: list[str] | None) -> Robot:
    """The robot with its fields set.

    Raises:
        InputError: if it or a field is wrong.
    """
    from spirillum.robot.load import load

    return load(robot, **overrides_from(settings))


def placement_from(
    gap: str | None,
    eccentricity: float | None,
    pitch: str | None,
    tail_drop: str | None,
    ends: str | None,
    flow: str | None,
) -> dict[str, str | float]:
    """Those fields of the placement that were given."""
    fields = {
        "gap": gap,
        "eccentricity": eccentricity,
        "pitch": pitch,
        "tail_drop": tail_drop,
        "ends": ends,
        "flow": flow,
    }
    return {name: value for name, value in fields.items() if value is not None}
