"""A tail without a body: what follows from it, and what is refused with a sentence."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.commands import run_command

from spirillum import load, predict, prepare, resistance, simulate
from spirillum.errors import InputError
from spirillum.robot.mesh import robot_mesh
from spirillum.robot.robot import robot_text

BARE: dict[str, Any] = {
    "name": "bare",
    "body": "none",
    "tail": {
        "wavelength": "12 mm",
        "amplitude": "3 mm",
        "length": "36 mm",
        "wire_diameter": "1 mm",
        "taper": "none",
        "density": "8000 kg/m^3",
    },
    "channel": {"diameter": "12 mm", "length": "200 mm"},
    "fluid": {"viscosity": "1 Pa s", "density": "970 kg/m^3"},
    "drive": {"kind": "rate", "joint": "fixed", "rate": "1 Hz"},
}


@pytest.mark.parametrize("model", ["sbt", "rft", "slender"])
def test_speed_is_that_of_a_tail_free_of_force(model: str) -> None:
    found = predict(BARE, model=model)
    matrix = resistance(BARE, model=model, part="tail").matrix
    pace = float(found.to_dict()["forward_velocity"]["value"])
    assert pace == pytest.approx(-matrix[0, 3] / matrix[0, 0] * 2.0 * np.pi, rel=1e-9)


def test_a_tail_on_the_axis_of_its_tube_is_held_more_than_without_walls() -> None:
    walled, free = (resistance(BARE, model=model).matrix for model in ("tube", "slender"))
    assert walled[0, 0] > 1.2 * free[0, 0]
    assert abs(walled[0, 1]) < 1e-3 * walled[0, 0]


def test_the_robot_is_its_wire(tmp_path: Path) -> None:
    robot = load(BARE)
    derived = robot.derived()
    assert derived["mass"].value == pytest.approx(8000.0 * derived["wire_volume"].value)
    assert {piece.name for piece in robot_mesh(robot)} == {"arm", "tail"}
    (tmp_path / "bare.toml").write_text(robot_text(robot))
    assert load(tmp_path / "bare.toml") == robot
    assert load(BARE, body={"shape": "none"}) == robot


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"drive.joint": "revolute"}, "against which nothing turns"),
        ({"seal.length": "3 mm"}, "seal is set with body = 'none'"),
        ({"body": {"shape": "none", "diameter": "3 mm"}}, "body.diameter"),
    ],
)
def test_what_takes_a_body_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as caught:
        load(BARE, **changes)
    assert any(said in problem for problem in caught.value.problems)


def test_requests_about_a_body_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="this robot has none"):
        resistance(BARE, part="body")
    with pytest.raises(InputError, match="has no table"):
        prepare(load(BARE))
    with pytest.raises(InputError, match="takes a body"):
        simulate(BARE, model="rft", timing={"duration": "1 s"})
    (tmp_path / "bare.toml").write_text(robot_text(load(BARE)))
    (tmp_path / "setup.toml").write_text('[robot]\nfile = "bare.toml"\n')
    (tmp_path / "video.mp4").write_bytes(b"")
    for words in (
        ["measure", "video.mp4", "--setup", "setup.toml"],
        ["render", "bare.toml", "-o", "video.mp4"],
        ["export", "bare.toml", "bare.urdf"],
    ):
        paths = [str(tmp_path / word) if "." in word else word for word in words]
        outcome = run_command(*paths)
        assert outcome.code == 2, outcome
