"""Light, rising and unbalanced robots: their runs end with a state, and forces and energies close on the way."""

from functools import cache

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.cli.tables import blocks_of
from spirillum.dynamics import return_map
from spirillum.dynamics.run_summary import run_answer
from spirillum.notes import notes_in
from spirillum.robot.links import links_of
from spirillum.robot.robot import STANDARD_GRAVITY


@cache
def run(mass: str, duration: str = "7 s") -> xr.Dataset:
    """The paper's robot with another mass in the wide tube, released with its motor on."""
    robot = sp.load("biorob2012-wide", **{"body.mass": mass})
    return sp.simulate(robot, model="tube", timing={"duration": duration}, in_tube={"wait": "0 s"})


@pytest.mark.slow
@pytest.mark.parametrize("mass", ["7.9 g", "7.75 g", "7.0 g"])
def test_a_light_robot_ends_with_a_state(mass: str) -> None:
    found = run(mass)
    assert float(found["time"][-1]) == 7.0
    assert found.attrs["state"] in ("changing", "orbit", "ceiling", "steady")


def test_the_tail_of_a_rising_robot_touches_the_wall() -> None:
    found = run("7.0 g", "4.6 s")
    assert float(found["time"][-1]) == 4.6
    assert float(found["tail_gap"].min()) < found.attrs["roughness"]
    spent = found["friction_energy"] + found["dissipated_energy"] + found["contact_energy"]
    left = found["drive_energy"] - spent - (found["potential_energy"] - found["potential_energy"][0])
    assert float(np.abs(left).max()) < 1e-6 * float(found["drive_energy"][-1])
    # It floats, which held motion leaves out and a run does not.
    assert "robot-floats" in {note.code for note in sp.load("biorob2012-wide", **{"body.mass": "7.0 g"}).warnings}
    assert "robot-floats" not in {note.code for note in notes_in(found.attrs)}
    assert "drive on: what a trial of `predict` gives, with its wait and duration" in blocks_of(run_answer(found))


@pytest.mark.parametrize("most", [20, 400])
def test_a_motion_that_cannot_be_followed_ends_with_a_state(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """In its first turn or later."""
    monkeypatch.setattr(return_map, "_MOST_STEPS", most)
    found = sp.settle(sp.load("biorob2012-wide", **{"body.mass": "7.9 g"}), placement={"gap": "0.2 mm"})
    assert found.to_dict()["state"] == "changing"
    assert "steps are too short to follow it on" in found.steady_state.ended
    assert np.isfinite(found.prediction.forward_velocity)


def test_the_center_of_mass_is_where_it_is_given() -> None:
    center = {"x": "2 mm", "radial": "1.2 mm", "angle": "90 deg"}
    robot = sp.load("biorob2012-wide", **{"body.center_of_mass": center})
    body, plain = links_of(robot).body, links_of(sp.load("biorob2012-wide")).body
    np.testing.assert_allclose(body.centre, [2e-3, 1.2e-3, 0.0], atol=1e-12)
    np.testing.assert_allclose(body.centroid, plain.centroid)
    assert body.mass == plain.mass
    assert 1e6 * body.mass * STANDARD_GRAVITY * 1.2e-3 == pytest.approx(122.0, abs=1.0)  # the motor's whole torque


def test_a_keel_balances_the_torque_on_the_body() -> None:
    timing, start = {"duration": "12 s"}, {"wait": "0 s"}
    robots = (sp.load("biorob2012-wide", **{"body.center_of_mass": {"radial": r}}) for r in ("0 mm", "2 mm"))
    even, keel = (sp.simulate(robot, model="tube", timing=timing, in_tube=start) for robot in robots)
    turned = [abs(float(found["body_angle"][-1])) for found in (even, keel)]
    late = [float(np.ptp(found["body_angle"].values[found["time"].values > 8.0])) for found in (even, keel)]
    assert turned[1] < 0.5 * np.pi  # the keel rises at most to the side
    assert late[1] < 0.25 * late[0]


@pytest.mark.parametrize(
    ("center", "words"),
    [
        ({"radial": "12 mm"}, "body.center_of_mass.radial = 12 mm lies outside the body; allowed: at most 9 mm"),
        ({"x": "-20 mm"}, "body.center_of_mass.x = 20 mm lies outside the body; allowed: at most 17.5 mm"),
    ],
)
def test_a_center_of_mass_outside_the_body_is_refused(center: dict[str, str], words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        sp.load("biorob2012-wide", **{"body.center_of_mass": center})
