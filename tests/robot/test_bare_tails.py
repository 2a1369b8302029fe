"""A tail without a body: what follows from it, and what is refused with a sentence."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.commands import run_command

from spirillum import compare_models, load, page, predict, prepare, resistance, simulate
from spirillum.designs.criteria import Variable
from spirillum.designs.learned import Corrected, solved_at
from spirillum.errors import InputError
from spirillum.fluid.wire.slender import Slender
from spirillum.robot.batch import RobotBatch
from spirillum.robot.mesh import robot_mesh
from spirillum.robot.robot import robot_text
from spirillum.swimming.balance import joined

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


def test_models_stand_side_by_side_without_effects_of_a_body() -> None:
    compared = compare_models(load(BARE, channel="none"), models=["sbt", "slender"])
    assert [(one.name, one.speed) for one in compared.effects] == [
        ("Lighthill's theory", compared.predictions["sbt"].forward_velocity),
        ("wire resolved", compared.predictions["slender"].forward_velocity),
    ]


def test_a_design_is_learned_as_that_of_a_robot() -> None:
    batch = RobotBatch.of(load(BARE)).with_values({"tail.wavelength": np.array([11e-3, 12e-3, 13e-3, 14e-3])})
    model = Corrected("slender", solved_at("slender", batch, (Variable("tail.wavelength", "m", 10e-3, 14e-3),)))
    assert np.allclose(joined(model.axial(batch)), joined(Slender().axial(batch)), rtol=1e-9, atol=1e-15)


def test_its_pose_is_on_the_axis_and_said_to_be() -> None:
    notes = {note.code: str(note) for note in predict(BARE, model="tube", motion="held").warnings}
    assert "on its channel's axis" in notes["no-weight"]


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
    with pytest.raises(InputError, match="the page takes a body"):
        page(load(BARE), browser=False)
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
