"""The text of a robot is a robot file of the same robot, and one of this program's."""

from pathlib import Path
from typing import Any

import pytest

from spirillum.files import written_by_us
from spirillum.robot.load import is_preset, load, preset_names
from spirillum.robot.robot import robot_text

CHANGES: list[dict[str, Any]] = [
    {},
    {"tail.taper": "none"},  # its default is a number
    {"tail.wavelength": "17.123456789 mm", "fluid.viscosity": "1.1 Pa s"},
]


@pytest.mark.parametrize("changes", CHANGES, ids=["as it is", "no taper", "odd numbers"])
@pytest.mark.parametrize("name", preset_names())
def test_a_robot_file_holds_every_field(name: str, changes: dict[str, Any], tmp_path: Path) -> None:
    robot = load(name, **changes)
    path = tmp_path / "robot.toml"
    path.write_text(robot_text(robot, "A robot.\nOf two lines."), encoding="utf-8")
    assert load(path) == robot
    assert written_by_us(path)
    assert is_preset(robot) == (not changes)


def test_a_robot_without_its_channel_has_none(tmp_path: Path) -> None:
    robot = load("biorob2012-wide", channel="none", seal="none")
    path = tmp_path / "robot.toml"
    path.write_text(robot_text(robot), encoding="utf-8")
    assert load(path) == robot
