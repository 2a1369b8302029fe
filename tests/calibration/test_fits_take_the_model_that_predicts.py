"""Without a named model a fit takes the one that predicts, `tube` in a channel; what no model knows."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.calibration.parameters import check_not_set
from spirillum.swimming.intervals import OF_TORQUE, knows_torque, without_torque
from spirillum.swimming.motions import Intervals

PLANTED = 8e-6
MINE: Mapping[str, Any] = {
    "extends": "biorob2012-wide",
    "name": "my-robot",
    "tail": {"wavelength": "20 mm", "amplitude": "2 mm"},
}
QUICK: dict[str, Any] = {"method": "least-squares"}


@pytest.fixture(scope="module")
def observed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three trials of a robot in its tube with a planted friction, 1 % off each; synthetic."""
    robot = sp.load({**MINE, "friction": {"effective": f"{PLANTED} N m s/rad"}})
    true = sp.predict(robot, model="tube", band=False)
    rng = np.random.default_rng(4)
    header = "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"
    rows = ["# synthetic", header]
    for trial in range(3):
        speed, tail, body = (true.forward_velocity, true.tail_rotation_rate, true.body_rotation_rate) * (
            1.0 + 0.01 * rng.normal(size=3)
        )
        rows.append(f"40,20,2,{trial},{1e3 * speed:.6g},{tail / (2 * np.pi):.6g},{body / (2 * np.pi):.6g}")
    path = tmp_path_factory.mktemp("observed") / "observations.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_a_planted_friction_comes_back_inside_its_interval(observed: Path) -> None:
    found = sp.calibrate(observed, MINE, **QUICK)
    assert (found.problem.model.name, found.to_dict()["model_reason"]) == (
        "tube",
        "the robot is in a channel, whose walls this model computes",
    )
    (friction,) = found.friction
    assert friction.low < PLANTED < friction.high
    assert friction.high - friction.low < 0.2 * PLANTED
    assert found.values["gap"].low < 5e-4 < found.values["gap"].high
    # The error of the torque, that of the wire and that of the table, widens the interval of the observations.
    (within,) = found.friction_within_model
    assert friction.high - friction.low > within.high - within.low


def test_a_model_without_walls_gives_friction_no_interval(observed: Path, tmp_path: Path) -> None:
    found = sp.calibrate(observed, MINE, tmp_path / "fitted", model="sbt", figures=False, **QUICK)
    (friction,) = found.friction
    assert friction.value > 1.1 * PLANTED  # it holds what walls do to the torque
    assert np.isnan([friction.low, friction.high]).all()
    assert set(found.to_dict()["tails"][0]["effective_friction"]) == {"value", "unit"}
    assert "misses of the torque, walls above all, so that it is given no interval" in found.friction_statement
    lines = (tmp_path / "fitted" / "predictions.csv").read_text(encoding="utf-8").splitlines()
    row = next(row for row in csv.DictReader(line for line in lines if not line.startswith("#")))
    assert float(row["effective_friction"]) == pytest.approx(friction.value, rel=1e-3)
    assert row["effective_friction_low"] == row["effective_friction_high"] == ""


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"free": "body_drag", **QUICK}, "the free numbers are of a model with drag factors"),
        ({"method": "paper"}, "method 'paper' inverts a model with drag factors"),
    ],
)
def test_what_only_a_model_with_factors_knows_is_fitted_by_one(
    observed: Path, settings: dict[str, Any], reason: str
) -> None:
    found = sp.calibrate(observed, MINE, **settings)
    assert (found.problem.model.name, found.model_reason) == ("sbt", reason)


def test_a_robot_without_a_table_is_refused_with_both_ways_on(observed: Path) -> None:
    new = {**MINE, "body": {"length": "30 mm"}}
    with pytest.raises(sp.InputError, match=r"1 of 1 have none.*--prepare.*or model 'sbt', which leaves out the walls"):
        sp.calibrate(observed, new, **QUICK)
    assert sp.calibrate(observed, new, model="sbt", **QUICK).problem.model.name == "sbt"


def test_predictions_without_walls_have_no_intervals_of_torques() -> None:
    values = dict.fromkeys(("forward_velocity", *OF_TORQUE), 1.0)
    found = without_torque(Intervals(values, values, values))
    assert {name for name, low in found.low.items() if np.isnan(low)} == set(OF_TORQUE)
    assert found.middle == values
    wide, bare = sp.load("biorob2012-wide"), sp.load("biorob2012-wide", channel="none")
    known = [knows_torque(robot, sp.predict(robot, model="sbt").model) for robot in (wide, bare)]
    assert known == [False, True]


def test_fields_that_no_possible_fit_looks_at_are_refused() -> None:
    for field in ("friction.effective", "calibration.sbt.body_drag"):
        with pytest.raises(sp.InputError, match=f"{field} is set"):
            check_not_set([field], None, "auto")
    check_not_set(["calibration.sbt.body_drag"], "gap", "auto")
