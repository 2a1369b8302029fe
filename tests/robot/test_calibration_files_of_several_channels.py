"""Calibration files: a robot takes the table of its own channel, its own tail's friction, and fitted fields."""

from pathlib import Path

import pytest

import spirillum as sp
from spirillum import InputError
from spirillum.fitted.fit import read_fit
from spirillum.robot.load import load

TABLES = """
[[calibration.sbt]]
body_drag = 2.5
body_rotation = 0.7
source = "made up"
[calibration.sbt.fitted_to]
channel_diameter = "40 mm"
body_diameter = "18 mm"
body_length = "35 mm"

[[calibration.sbt]]
body_drag = 4.5
source = "made up"
[calibration.sbt.fitted_to]
channel_diameter = "30 mm"
body_diameter = "18 mm"
body_length = "35 mm"

[fitted]
wire_diameter = "1.1 mm"
torque_constant = "0.0005 N m/A"
normal_factor = 1.2

[[friction]]
channel_diameter = "30 mm"
wavelength = "25 mm"
amplitude = "2.5 mm"
effective = "9e-6 N m s/rad"
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "calibration.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_each_channel_takes_its_own(tmp_path: Path) -> None:
    path = written(tmp_path, TABLES)
    wide = read_fit(path).central(load("biorob2012-wide"))
    narrow = read_fit(path).central(load("biorob2012-narrow"))
    assert (wide.calibration["sbt"].body_drag, narrow.calibration["sbt"].body_drag) == (2.5, 4.5)
    assert (wide.friction.effective, narrow.friction.effective) == (None, 9e-6)
    assert set(wide.calibration) == {"sbt"}
    assert wide.tail.wire_diameter == 1.1e-3
    assert wide.motor is not None
    assert wide.motor.torque_constant == 5e-4
    assert wide.model.rft.normal_factor == 1.2
    other = read_fit(path).central(load("biorob2012-wide", **{"channel.diameter": "33 mm"}))
    assert other.calibration["sbt"].body_drag == 4.5
    answer = sp.predict(load("biorob2012-wide", **{"channel.diameter": "33 mm"}), calibration=path)
    assert any("outside its geometry" in warning for warning in answer.warnings)


def test_a_file_without_factors_leaves_the_robot_its_own(tmp_path: Path) -> None:
    path = written(tmp_path, '[fitted]\nviscosity = "3 Pa s"\n')
    robot = read_fit(path).central(load("biorob2012-wide"))
    assert robot.fluid.viscosity == 3.0
    assert robot.calibration["sbt"].body_drag == 1.95


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[provenance]\nrows = 3\n", "nothing is calibrated"),
        ('[calibration.sbt]\nbody_drag = 2.0\nsource = "x"\n', "calibration.sbt.fitted_to is missing"),
        ("[calibration.tube]\n", "calibration.tube"),
        ('[fitted]\nwire = "1 mm"\n', "fitted.wire is not a known field"),
        ('[fitted]\nviscosity = "3 mm"\n', '"mm" is not a unit of viscosity'),
        ("[calibration]\nsbt = 3\n", "calibration.sbt"),
        (TABLES + '[provenance]\nfriction_reading = "foo"\n', "friction_reading"),
        (
            TABLES + '[provenance]\nmodel = "xyz"\n',
            "provenance.model = 'xyz' is not allowed; allowed: a model that swims",
        ),
        (TABLES.partition("[fitted]")[0] * 2, "calibration.sbt holds two entries for the same geometry"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        read_fit(written(tmp_path, text)).central(load("biorob2012-wide"))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
