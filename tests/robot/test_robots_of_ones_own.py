"""Robots of one's own: files over files, plain resistances, left-over values, studies of any field."""

from pathlib import Path

import pytest
from tests.support.commands import run_command

import spirillum as sp
from spirillum.robot.batch import RobotBatch

BASE = 'extends = "biorob2012-wide"\nname = "base"\n[body]\ndiameter = "16 mm"\nmass = "9 g"\n'


def test_a_changed_robot_does_not_describe_itself_as_its_preset() -> None:
    changed = sp.load({"extends": "biorob2012-wide", "channel": {"diameter": "30 mm"}})
    assert changed.description == "biorob2012-wide with other channel.diameter"
    assert sp.load({"extends": "biorob2012-wide", "name": "same"}).description == sp.load("biorob2012-wide").description
    assert (
        sp.load({"extends": "biorob2012-wide", "channel": "none"}).description == "biorob2012-wide with other channel"
    )
    own = sp.load({"extends": "biorob2012-wide", "description": "mine", "channel": {"diameter": "30 mm"}})
    assert own.description == "mine"


def test_a_file_extends_a_file_beside_it(tmp_path: Path) -> None:
    (tmp_path / "base.toml").write_text(BASE, encoding="utf-8")
    (tmp_path / "mine").mkdir()
    path = tmp_path / "mine" / "long.toml"
    path.write_text('extends = "../base.toml"\nname = "long"\n[tail]\nlength = "70 mm"\n', encoding="utf-8")
    robot = sp.load(path)
    assert (robot.name, robot.body.diameter, robot.tail.length, robot.tail.wavelength) == ("long", 0.016, 0.07, 0.025)
    assert robot.warnings == ()
    path.write_text('extends = "../base.toml"\n[body]\nlength = "36 mm"\n', encoding="utf-8")
    (warning,) = sp.load(path).warnings
    assert warning == "body.mass = 9 g was measured before body.length changed; set it anew"


def test_a_new_file_hears_what_it_took_from_its_base(tmp_path: Path) -> None:
    """Fields that decide the motion and that neither it nor an option sets; none of a preset or a whole file."""
    path = tmp_path / "mine.toml"
    path.write_text('extends = "biorob2012-wide"\n[body]\ndiameter = "16 mm"\nmass = "9 g"\n', encoding="utf-8")
    for command in ("check", "show"):
        said = " ".join(run_command("robot", command, str(path), "--set", "tail.length=50mm").out.split())
        taken = said.partition("taken from biorob2012-wide, to be set where yours differs: ")[2].partition("A ")[0]
        assert taken.startswith("body.length 35 mm, coupling.diameter 6 mm, coupling.length 10 mm, tail.wire_diameter")
        assert "tail.length" not in taken
        assert "body.mass" not in taken
        assert "taken from" not in run_command("robot", command, "biorob2012-narrow").out
    assert run_command("robot", "new", str(tmp_path / "whole.toml")).code == 0
    assert "taken from" not in run_command("robot", "check", str(tmp_path / "whole.toml")).out


def test_chains_that_do_not_end_are_refused(tmp_path: Path) -> None:
    one, two = tmp_path / "one.toml", tmp_path / "two.toml"
    one.write_text('extends = "two.toml"\n', encoding="utf-8")
    two.write_text('extends = "one.toml"\n', encoding="utf-8")
    with pytest.raises(sp.InputError, match="leads back to itself"):
        sp.load(one)
    two.write_text('extends = "none.toml"\n', encoding="utf-8")
    with pytest.raises(sp.InputError, match=r"one\.toml: extends: .*two\.toml: extends: .*none\.toml does not exist"):
        sp.load(one)
    two.write_text('extends = "biorob2012-wide"\nbody.profile = "none.csv"\n', encoding="utf-8")
    with pytest.raises(sp.InputError, match=r"one\.toml: extends: .*two\.toml: .*none\.csv does not exist"):
        sp.load(one)
    two.write_text('extends = "a\\u0000b.toml"\n', encoding="utf-8")
    with pytest.raises(sp.InputError, match="is no name of a file"):
        sp.load(one)
    two.write_text('extends = "biorob2012-wise"\n', encoding="utf-8")
    with pytest.raises(sp.InputError, match=r"did you mean biorob2012-wide\?\); allowed: .* or a robot file"):
        sp.load(one)


def test_plain_resistance_is_the_constant_term() -> None:
    plain = sp.load("biorob2012-wide", **{"motor.resistance": "10.4 ohm"})
    electrics = RobotBatch.of(plain).electrics
    assert electrics is not None
    assert (electrics.constant[0], electrics.decay[0], electrics.slope[0]) == (10.4, 0.0, 0.0)
    with pytest.raises(sp.InputError, match=r"motor\.resistance\.constant = .*resistance"):
        sp.load("biorob2012-wide", **{"motor.resistance": "10.4 V"})


def test_what_a_scaled_robot_has_left_over_is_named() -> None:
    scaled = sp.load("magnetic-helix", **{"body.diameter": "3.9 mm"}).warnings
    (warning,) = [sentence for sentence in scaled if sentence.startswith("magnetic.moment = ")]
    assert "body.diameter changed" in warning
    settled = sp.load("magnetic-helix", **{"body.diameter": "3.9 mm", "magnetic.moment": "1e-4 A m^2"}).warnings
    assert not any("magnetic.moment" in sentence for sentence in settled)


def test_far_outside_stokes_flow_is_refused_unless_asked_for() -> None:
    water = {"fluid.viscosity": "1 mPa s", "fluid.density": "1000 kg/m^3"}
    robot = sp.load("biorob2012-wide", **water)
    with pytest.raises(sp.InputError, match=r"Reynolds number .* allowed: at most 10"):
        sp.predict(robot, model="sbt", tail_rate="3 Hz")
    answer = sp.predict(robot, model="sbt", tail_rate="3 Hz", beyond_stokes=True)
    assert answer.tail_reynolds_number > 10
    assert any("inertia is neglected" in warning for warning in answer.warnings)


def test_a_study_varies_any_field() -> None:
    vary = {"tail.length": ["40 mm", "60 mm"], "fluid.viscosity": ["1 Pa s", "3 Pa s"]}
    table = {"models": ["sbt"], "friction": ["rotor"], "robots": ["biorob2012-wide"], "vary": vary}
    found = sp.study(table)
    names = ["length 40 mm, viscosity 1 Pa s", "length 40 mm, viscosity 3 Pa s"]
    assert [str(name) for name in found["robot"].values[:2]] == names
    own = sp.load("biorob2012-wide", **{"tail.length": "60 mm", "fluid.viscosity": "1 Pa s"})
    alone = sp.predict(own, model="sbt", friction="rotor").forward_velocity
    assert float(found["forward_velocity"][2, 0, 0]) == pytest.approx(alone, rel=1e-12)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"vary": {"tail.length": ["40 mm"]}, "grid": {"wavelengths": ["20 mm"]}}, "grid"),
        ({"vary": {"tail.lenght": ["40 mm"]}, "robots": ["biorob2012-wide"]}, "did you mean length?"),
        ({"vary": {"tail.length": ["40 mm", "40 mm"]}, "robots": ["biorob2012-wide"]}, "holds a value twice"),
        ({"vary": {"a." * 1000: ["x"]}, "robots": ["biorob2012-wide"]}, "allowed: "),
        (
            {"vary": {f"tail.{k}": list(range(100)) for k in range(3)}, "robots": ["biorob2012-wide"]},
            "vary makes 1000000 robots; allowed: at most 100000",
        ),
        ({"vary": {"tail.length": []}, "robots": ["biorob2012-wide"]}, "at least one entry"),
        ({"vary": {"tail.turns": [3]}, "robots": ["biorob2012-wide"]}, "tail.turns is not a known field"),
    ],
)
def test_wrong_variations_are_refused(table: dict[str, object], words: str) -> None:
    with pytest.raises(sp.InputError) as caught:
        sp.study({"models": ["sbt"], **table})
    assert words in str(caught.value)
