"""Means while the drive is on and while the motion is steady, against closed forms of a linear circuit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp

LINEAR = {
    "motor": {"resistance": {"constant": "10 ohm", "decay": "0 ohm", "growth": "0 ohm", "slope": "0 ohm/A"}},
    "friction": {"effective": "1.1e-5 N m s/rad"},
}


def robot(**changes: Any) -> Any:
    return sp.load("biorob2012-wide", **LINEAR, **changes)


def held(**timing: Any) -> Any:
    return sp.simulate(robot(), motion="held", timing=timing, model="rft")


@pytest.fixture(scope="module")
def decay() -> float:
    """L over the circuit's resistance with the motor on, s."""
    steady = sp.predict(robot(), model="rft")
    return 0.082 / (10.8 + 0.004 * steady.motor_rotation_rate / steady.motor_current)


@pytest.mark.parametrize("samples", [10, 100, 999])
def test_means_of_an_exponential_start(decay: float, samples: int) -> None:
    """U = U_0 (1 - exp(-t/tau)): its mean while on, and the time log(100) tau from which on it is steady."""
    speed = sp.predict(robot(), model="rft").forward_velocity
    run = held(duration=3.0, on=[(0.0, 0.77)], samples_per_turn=samples)
    expected = speed * (1.0 - decay / 0.77 * (1.0 - np.exp(-0.77 / decay)))
    assert float(run["mean_forward_velocity_on"]) == pytest.approx(expected, rel=1e-6)
    assert float(run["time_on"]) == pytest.approx(0.77, abs=1e-15)
    spacing = float(run["time"][1])
    assert np.log(100) * decay - spacing < 0.77 - float(run["time_steady"]) < np.log(100) * decay + spacing
    assert float(run["mean_forward_velocity_steady"]) == pytest.approx(speed, rel=2e-3)
    assert float(run["mean_forward_velocity"]) < 0.01 * speed  # the remote is off for most of the last two thirds


@pytest.mark.parametrize("samples", [1, 100, 320])
def test_the_last_two_thirds_of_a_short_run_hang_on_no_sample(decay: float, samples: int) -> None:
    """The mean of U_0 (1 - exp(-t/tau)) over them, from the ends of a run that starts, however few its samples."""
    speed, end = sp.predict(robot(), model="rft").forward_velocity, 0.01
    run = held(duration=end, samples_per_turn=samples)
    left = decay * (np.exp(-end / 3.0 / decay) - np.exp(-end / decay))
    expected = speed * (1.0 - left / (end - end / 3.0))
    assert float(run["mean_forward_velocity"]) == pytest.approx(expected, rel=1e-6)


def test_each_stretch_counts_for_its_length(decay: float) -> None:
    """Two times on add up; a pause, however long, does not count."""
    run = held(duration=4.0, on=[(0.0, 0.5), (3.0, 3.5)])
    once = held(duration=0.5)
    for name in ("mean_forward_velocity_on", "mean_tail_rotation_rate_on", "mean_electrical_power_on"):
        assert float(run[name]) == pytest.approx(float(once[name]), rel=1e-6)
    assert float(run["time_on"]) == 1.0


def test_duties_have_steady_motions_of_their_own(tmp_path: Path) -> None:
    table = tmp_path / "duty.csv"
    table.write_text("time_s,duty\n0,1\n1,0.5\n3,0\n", encoding="utf-8")
    run = held(duration=4.0, duty=table)
    whole, half = (sp.predict(robot(**{"drive.duty": duty}), model="rft").forward_velocity for duty in (1.0, 0.5))
    weights = np.array([1.0 - 4.6 * 0.008, 2.0 - 4.6 * 0.008])
    expected = (weights @ [whole, half]) / weights.sum()
    assert float(run["mean_forward_velocity_steady"]) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("motion", ["held", "free"])
def test_a_motion_that_still_starts_is_not_steady(motion: str, decay: float) -> None:
    run = sp.simulate(robot(), motion=motion, timing={"duration": 1.0, "on": [(0.0, 3.0 * decay)]}, model="rft")
    assert np.isnan(run["mean_forward_velocity_steady"])
    assert float(run["time_steady"]) == 0.0
    assert float(run["mean_forward_velocity_on"]) > 0
    from spirillum.dynamics.run_summary import run_answer

    assert run_answer(run)["mean_forward_velocity_steady"]["value"] is None


def test_a_run_that_is_never_on_has_no_means_while_on() -> None:
    run = held(duration=0.5, on=[(1.0, 2.0)])
    assert np.isnan(run["mean_forward_velocity_on"])
    assert float(run["time_on"]) == 0.0
    assert "the remote switches nothing on before the run ends at 0.5 s" in run.attrs["warnings"].split("\n")


@pytest.mark.parametrize("motion", ["held", "free"])
def test_times_beyond_the_end_are_told(motion: str) -> None:
    run = sp.simulate(robot(), motion=motion, timing={"duration": 0.5, "on": [(0.0, 0.2), (0.5, 2.0)]}, model="rft")
    said = run.attrs["warnings"].split("\n")
    assert "on = 0.5 s to 2 s lies beyond the end of the run at 0.5 s" in said
    assert not any("switches nothing on" in line for line in said)


def test_a_free_robot_without_floor_swims_steadily_as_its_screw() -> None:
    afloat = robot(channel="none")
    run = sp.simulate(afloat, weight=False, timing={"duration": 6.0, "on": [(0.0, 3.0)]}, model="rft")
    tail = sp.predict(afloat, model="rft", motion="free")
    assert float(run["mean_tail_rotation_rate_steady"]) == pytest.approx(tail.tail_rotation_rate, rel=1e-3)
    turns = float(run["time_steady"]) * tail.tail_rotation_rate / (2 * np.pi)
    assert turns == pytest.approx(round(turns), abs=5e-3)
    assert turns >= 2


def test_samples_stay_evenly_spaced() -> None:
    for motion in ("held", "free"):
        run = sp.simulate(robot(), motion=motion, timing={"duration": 1.0, "on": [(0.0, 0.43217)]}, model="rft")
        np.testing.assert_allclose(np.diff(run["time"]), float(run["time"][1]), rtol=1e-9)
        assert run.attrs["steady"]
