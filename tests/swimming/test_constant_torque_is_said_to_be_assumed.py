"""A drive of given torque: what it gives is one over the viscosity, and preset and answers say what that assumes."""

import tomllib
from pathlib import Path

import pytest

import spirillum as sp
from spirillum.robot.load import preset_text
from spirillum.robot.robot import robot_text

ASSUMED = "assumes the same torque at every rate"


def _cell(viscosity: float) -> sp.Robot:
    return sp.load(_of_torque(), **{"fluid.viscosity": f"{viscosity} mPa s"})


def _of_torque() -> dict[str, object]:
    """The cell with a constant torque in place of its curve."""
    tables = tomllib.loads(preset_text("ecoli"))
    return tables | {"name": "cell", "drive": {"kind": "torque", "torque": "-6.5e-19 N m"}}


def test_speed_is_one_over_the_viscosity_and_the_answer_says_why() -> None:
    buffer, thick = (sp.predict(_cell(0.93 * factor), model="rft") for factor in (1, 4))
    assert thick.forward_velocity == pytest.approx(0.25 * buffer.forward_velocity, rel=1e-12)
    assert any(ASSUMED in said for said in thick.warnings)


def test_every_answer_of_its_drive_says_so_and_no_other(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(robot_text(sp.load(_of_torque())))
    study = {"robots": [str(tmp_path / "cell.toml")], "models": ["rft"], "friction": ["none"]}
    assert ASSUMED in sp.study(study).attrs["warnings"]
    assert ASSUMED in sp.simulate(_of_torque(), model="rft", timing={"turns": 0.1}).attrs["warnings"]
    found = sp.design(_of_torque(), {"tail.wavelength": "2 um:3 um"}, maximise="forward_velocity", model="rft")
    assert any(ASSUMED in said for said in found.warnings)
    at_a_rate = sp.predict(_of_torque(), model="rft", tail_rate="-100 Hz")
    others = (*sp.predict("magnetic-helix").warnings, *sp.predict("ecoli").warnings)
    assert not any(ASSUMED in said for said in (*at_a_rate.warnings, *others))
