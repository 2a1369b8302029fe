"""A drive of given torque: what it gives is one over the viscosity, and preset and answers say what that assumes."""

import pytest

import spirillum as sp

ASSUMED = "assumes the same torque at every rate"


def _cell(viscosity: float) -> sp.Robot:
    return sp.load("ecoli", **{"fluid.viscosity": f"{viscosity} mPa s"})


def test_speed_is_one_over_the_viscosity_and_the_answer_says_why() -> None:
    buffer, thick = (sp.predict(_cell(0.93 * factor), model="rft") for factor in (1, 4))
    assert thick.forward_velocity == pytest.approx(0.25 * buffer.forward_velocity, rel=1e-12)
    assert any(ASSUMED in said for said in thick.warnings)
    assert "constant torque is assumed" in sp.load("ecoli").description


def test_every_answer_of_its_drive_says_so_and_no_other() -> None:
    assert ASSUMED in sp.study({"robots": ["ecoli"], "models": ["rft"], "friction": ["none"]}).attrs["warnings"]
    assert ASSUMED in sp.simulate("ecoli", model="rft", timing={"turns": 0.1}).attrs["warnings"]
    found = sp.design("ecoli", {"tail.wavelength": "2 um:3 um"}, maximise="forward_velocity", model="rft")
    assert any(ASSUMED in said for said in found.warnings)
    at_a_rate = sp.predict("ecoli", model="rft", tail_rate="-100 Hz")
    assert not any(ASSUMED in said for said in (*at_a_rate.warnings, *sp.predict("magnetic-helix").warnings))
