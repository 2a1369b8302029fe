"""From preset, file or tables to one checked robot: layers, overrides, warnings."""

from pathlib import Path
from typing import Any

import pytest

from spirillum.errors import InputError
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load, parse_setting, preset_text


def test_dotted_and_nested_overrides_are_the_same() -> None:
    dotted = load("biorob2012-wide", **{"tail.wavelength": "20 mm", "motor.resistance.constant": "9 ohm"})
    nested = load("biorob2012-wide", tail={"wavelength": "20 mm"}, motor={"resistance": {"constant": "9 ohm"}})
    assert dotted == nested
    assert dotted.tail.wavelength == 0.020
    assert dotted.tail.amplitude == 0.0025  # its neighbours stay
    assert dotted.motor is not None
    assert dotted.motor.resistance.decay == 30.0


def test_a_preset_is_not_changed_by_a_load() -> None:
    load("biorob2012-wide", **{"tail.wavelength": "20 mm"})
    assert load("biorob2012-wide").tail.wavelength == 0.025


def test_a_mapping_is_not_changed_by_a_load() -> None:
    table: dict[str, Any] = {"extends": "biorob2012-wide", "tail": {"wavelength": "20 mm"}}
    load(table, **{"tail.amplitude": "3 mm", "channel": "none"})
    assert table == {"extends": "biorob2012-wide", "tail": {"wavelength": "20 mm"}}


def test_file_and_mapping_and_preset_text_agree(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(preset_text("biorob2012-wide"), encoding="utf-8")
    assert load(path) == load(str(path)) == load("biorob2012-wide")
    path.write_bytes(b"\xef\xbb\xbf" + preset_text("biorob2012-wide").encode())  # as Windows editors save it
    assert load(path) == load("biorob2012-wide")


def test_extends_lays_a_file_over_a_preset(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('extends = "biorob2012-narrow"\nname = "mine"\n[tail]\nwavelength = "20 mm"\n', encoding="utf-8")
    mine, narrow = load(path), load("biorob2012-narrow")
    assert mine.name == "mine"
    assert mine.tail == narrow.tail.model_copy(update={"wavelength": 0.020})
    assert (mine.body, mine.channel, mine.calibration) == (narrow.body, narrow.channel, narrow.calibration)


def test_no_channel() -> None:
    import numpy as np

    robot = load("biorob2012-wide", channel="none", **{"tail.amplitude": "30 mm", "tail.length": "500 mm"})
    assert robot.channel is None
    assert np.isinf(RobotBatch.of(robot).channel_diameter[0])
    back = load({"extends": "biorob2012-wide", "channel": "none"}, **{"channel.diameter": "25 mm"})
    assert back.channel is not None
    assert back.channel.diameter == 0.025
    assert back.channel.length is None


def test_a_value_taken_out() -> None:
    robot = load("biorob2012-wide", **{"body.mass": None, "channel.length": None, "tail.taper": "none"})
    assert robot.body.mass is None
    assert robot.channel is not None
    assert robot.channel.length is None
    assert robot.tail.taper is None
    assert load("biorob2012-wide", **{"tail.taper": robot.tail.taper}).tail.taper is None


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({"body.mass": "10.7 kg"}, "body.mass = 10.7 kg makes body and coupling 1.27e+06 kg/m^3 dense"),
        ({"friction.effective": "1e-9 N m s/rad"}, "is less than the rotor's own B_m = 7e-07 N m s/rad"),
    ],
)
def test_numbers_that_no_robot_has_are_doubted(overrides: dict[str, str], said: str) -> None:
    assert any(said in line for line in load("biorob2012-wide", **overrides).warnings)
    assert load("biorob2012-wide").warnings == ()


@pytest.mark.parametrize(
    ("hand", "polarity", "sign"),
    [("right", "forward", 1), ("left", "forward", -1), ("right", "reverse", -1), ("left", "reverse", 1)],
)
def test_polarity_follows_the_hand(hand: str, polarity: str, sign: int) -> None:
    batch = RobotBatch.of(load("biorob2012-wide", **{"tail.handedness": hand, "motor.polarity": polarity}))
    assert batch.electrics is not None
    assert batch.electrics.polarity[0] == sign
    assert batch.hand[0] == (1 if hand == "right" else -1)


STALE = "was measured before"


@pytest.mark.parametrize(
    "overrides",
    [
        {"body.diameter": "17 mm"},
        {"body.length": "36 mm"},
        {"body.rear": "hemisphere"},
        {"coupling.length": "11 mm"},
        {"coupling": {"diameter": "5 mm"}},
        {"coupling.clearance": "0.4 mm"},
    ],
    ids=str,
)
def test_a_mass_older_than_the_geometry_warns(overrides: dict[str, Any]) -> None:
    (warning,) = load("biorob2012-wide", **overrides).warnings
    field = next(iter(overrides))
    assert warning.startswith("body.mass = 10.7 g")
    assert STALE in warning
    assert field in warning
    # A new mass, or none, settles it.
    assert load("biorob2012-wide", **overrides, **{"body.mass": "11 g"}).warnings == ()
    assert load("biorob2012-wide", **overrides, **{"body.mass": None}).warnings == ()


@pytest.mark.parametrize(
    "overrides", [{"tail.wavelength": "20 mm"}, {"channel.diameter": "50 mm"}, {"name": "x"}], ids=str
)
def test_a_mass_does_not_weigh_the_tail(overrides: dict[str, Any]) -> None:
    """Table I's 10.7 g is body and coupling together."""
    assert load("biorob2012-wide", **overrides).warnings == ()


def test_a_coupling_of_another_body_that_no_longer_fits_warns(tmp_path: Path) -> None:
    """Wider than the body, or longer; one that is set with or after the body is the user's own."""
    small = {"body.diameter": "5 mm", "body.length": "12 mm"}

    def said(robot: str | Path, **fields: str) -> list[str]:
        return [note for note in load(robot, **fields).warnings if note.startswith("coupling.")]

    words = "coupling.diameter = 6 mm is that of another body and wider than body.diameter = 5 mm; set it anew"
    assert said("biorob2012-wide", **small) == [words]
    assert said("biorob2012-wide", **{"body.length": "9 mm"})[0].startswith("coupling.length = 10 mm is that of")
    assert not said("biorob2012-wide", **{"body.diameter": "6 mm"})
    path = tmp_path / "small.toml"
    path.write_text('extends = "biorob2012-wide"\nbody.diameter = "5 mm"\n')
    assert said(path) == [words]
    assert not said(path, **{"coupling.diameter": "5.5 mm"})


def test_layers_of_a_stale_mass(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    text = 'extends = "biorob2012-wide"\n[body]\ndiameter = "17 mm"\n'
    path.write_text(text, encoding="utf-8")
    assert STALE in load(path).warnings[0]
    path.write_text(text + 'mass = "9 g"\n', encoding="utf-8")
    assert load(path).warnings == ()
    # An override changes the geometry after the file weighed it.
    assert STALE in load(path, **{"body.length": "40 mm"}).warnings[0]
    # A file on its own has no older layer: its mass belongs to its geometry.
    path.write_text(preset_text("biorob2012-wide"), encoding="utf-8")
    assert load(path).warnings == ()


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("tail.wavelength=20mm", "tail.wavelength", "20mm"),
        ("tail.wavelength = 20 mm", "tail.wavelength", "20 mm"),
        ('tail.wavelength="20 mm"', "tail.wavelength", "20 mm"),
        ("tail.taper=50", "tail.taper", 50),
        ("tail.taper=none", "tail.taper", "none"),
        ("model.rft.spin=true", "model.rft.spin", True),
        ("drive.rate=-1.5 Hz", "drive.rate", "-1.5 Hz"),
        ('drive={kind="rate", rate="1 Hz"}', "drive", {"kind": "rate", "rate": "1 Hz"}),
        ("name=a=b", "name", "a=b"),
    ],
)
def test_settings_are_toml_or_text(text: str, path: str, value: Any) -> None:
    assert parse_setting(text) == (path, value)


@pytest.mark.parametrize("text", ["tail.wavelength", "=20mm", "tail.wavelength=", "", "="])
def test_settings_need_path_and_value(text: str) -> None:
    with pytest.raises(InputError, match=r"is not PATH=VALUE; for example --set tail\.wavelength=20mm"):
        parse_setting(text)
