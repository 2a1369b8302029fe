"""Robots released from rest: the readings are those of the runs, and verdicts follow from them alone."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.papers.biorob2012.evidence import Evidence, FrictionModelRuns
from spirillum.papers.registry import claims_of, predictions_of
from spirillum.studies.ranking import ranking_of
from spirillum.studies.released_robots import (
    FACTORS,
    INFERRED_BY,
    READ,
    levels,
    levels_of_readings,
    release_runs,
    without_answer,
)
from spirillum.studies.spec import LaidDown
from spirillum.view.figures.release import release_picture

SHORT = {
    "models": ["sbt", "rft"],
    "friction": ["rotor"],
    "claims": "biorob2012",
    "predicted": True,
    "laid_down": {"duration": "2.4 s", "wait": ["0 s", "0.5 s"]},
    "grid": {
        "channels": {"wide": "biorob2012-wide", "narrow": "biorob2012-narrow"},
        "wavelengths": ["25 mm"],
        "amplitudes": ["2.5 mm", "2.6 mm"],
    },
}
"""Two channels; the second tail has no table."""


@pytest.fixture(scope="module")
def short():
    """Both presets, released from rest for 2.4 s."""
    return sp.study(SHORT)


@pytest.fixture(scope="module")
def readings(short) -> FrictionModelRuns:
    """Its readings."""
    return FrictionModelRuns(Evidence(short))


def test_a_reading_is_that_of_the_run_itself(short) -> None:
    """Run 1 of the narrow robot, read over the whole of it, against `simulate`, and its B_eff against `predict`."""
    robot = sp.load("biorob2012-narrow")
    laid = release_runs(robot, LaidDown(duration="2.4 s", wait=("0 s", "0.5 s")))[1]
    assert (laid.gap, laid.pitch, laid.wait, laid.roughness, laid.friction_coefficient) == (1e-4, 0.0, 0.0, 3e-5, 0.0)
    run = sp.simulate(
        robot,
        model="tube",
        timing={"duration": 2.4},
        placement={"gap": laid.gap, "pitch": laid.pitch},
        roughness=laid.roughness,
        in_tube={"wait": laid.wait, "friction_coefficient": laid.friction_coefficient},
    )
    there = short.isel(amplitude=0, wavelength=0).sel(channel="narrow", window="whole run").isel(run=1)
    assert float(there["forward_velocity_at_run"]) == pytest.approx(float(run["mean_forward_velocity"]), rel=1e-3)
    assert float(there["body_rotation_rate_at_run"]) == pytest.approx(float(run["mean_body_rotation_rate"]), rel=1e-3)
    tail, body = (float(there[f"{part}_rotation_rate_at_run"]) for part in ("tail", "body"))
    assert float(there["motor_rotation_rate_at_run"]) == pytest.approx(tail - body, rel=1e-9)
    motor, friction = robot.motor, float(there["effective_friction_at_run"].sel(inferred_by="rft"))
    load = sp.predict(robot, model="rft", tail_rate=tail).tail_torque
    assert motor.torque_constant * float(there["motor_current_at_run"]) - load == pytest.approx(
        friction * (tail - body), rel=1e-2
    )


def test_the_report_draws_every_reading_over_its_median(short) -> None:
    picture = release_picture(short, ranking_of(short))
    assert picture is not None
    axes = picture.figure().axes[0]
    rates = np.abs(
        short["body_rotation_rate_at_run"].isel(amplitude=0, wavelength=0).sel(channel="wide").values.ravel()
    )
    row = [label.get_text() for label in axes.get_yticklabels()].index("body rate")
    drawn = [x for line in axes.get_lines() for x, y in line.get_xydata() if abs(y - row) < 0.5]
    assert sorted(drawn) == pytest.approx(sorted(rates / np.median(rates)), rel=1e-12)
    assert release_picture(short.drop_vars("forward_velocity_at_run"), ranking_of(short)) is None


def test_the_factor_on_the_drag_gives_the_speed_back(short) -> None:
    """With the inferred factor as calibration, the model swims at the speed of the run."""
    there = short.isel(amplitude=0, wavelength=0, run=2).sel(channel="wide", window="three turns")
    for model in INFERRED_BY:
        factor = float(there["body_drag_factor_at_run"].sel(inferred_by=model))
        fitted = {"body_drag": factor, "body_rotation": 1.0, "source": "this test"}
        robot = sp.load("biorob2012-wide", **{f"calibration.{model}.{name}": value for name, value in fitted.items()})
        swum = sp.predict(robot, model=model, tail_rate=float(there["tail_rotation_rate_at_run"]))
        assert swum.forward_velocity == pytest.approx(float(there["forward_velocity_at_run"]), rel=0.02)


def test_least_largest_and_effects_are_those_of_the_readings(short) -> None:
    speeds = short["forward_velocity_at_run"].sel(channel="wide").isel(amplitude=0, wavelength=0)
    assert float(short["forward_velocity_predicted_high"].sel(channel="wide")[0, 0]) == pytest.approx(
        float(speeds.max())
    )
    effects = short["forward_velocity_effect"].sel(channel="wide").isel(amplitude=0, wavelength=0)
    rough = speeds.sel(window="three turns") * 0.5 + speeds.sel(window="whole run") * 0.5
    column = levels()[:, FACTORS.index("roughness")]
    planted = float(rough.values[column > 0].mean() - rough.values[column < 0].mean())
    assert float(effects.sel(factor="roughness")) == pytest.approx(planted)


def test_robots_without_a_table_are_named(short) -> None:
    assert np.isnan(short["forward_velocity_at_run"].isel(amplitude=1)).all()
    assert "2 of 4 robots have no table" in short.attrs["warnings"]
    all_tails = [c for c in predictions_of(short) if c.claim.startswith("Motor rates are identical")]
    assert all_tails[0].verdict == "depends"
    assert "no table" in all_tails[0].reason


def test_verdicts_of_the_third_kind_never_mix_with_the_others(short) -> None:
    third = {"predicted-agrees", "predicted-disagrees", "depends"}
    assert {claim.verdict for claim in predictions_of(short)} <= third
    assert not {claim.verdict for claim in claims_of(short)} & third
    without = sp.study(SHORT, predicted=False)
    assert predictions_of(without) == []
    assert [claim.to_dict() for claim in claims_of(without)] == [claim.to_dict() for claim in claims_of(short)]
    for claim in predictions_of(short):
        assert all(claim.to_dict().values()), claim


def test_a_verdict_names_the_factor_that_decides(readings: FrictionModelRuns, monkeypatch: pytest.MonkeyPatch) -> None:
    column = levels_of_readings()[:, READ.index("wait")]
    found = readings.verdict_on((column > 0).astype(float))
    assert found.verdict == "depends"
    assert found.reason.startswith("waiting time: it holds in 16 of 32 readings, 0 of 16 at a waiting time of 0 s")
    assert readings.verdict_on(np.zeros(32)).verdict == "predicted-disagrees"
    assert readings.verdict_on(np.ones(32)).verdict == "depends"  # robots without a table keep it open
    monkeypatch.setattr(FrictionModelRuns, "missing", "")
    assert readings.verdict_on(np.ones(32)).verdict == "predicted-agrees"


def test_a_stated_number_is_met_missed_or_straddled(readings: FrictionModelRuns) -> None:
    column = levels_of_readings()[:, READ.index("gap")]
    values = 2.0 + 0.5 * column
    assert readings.compare(values, 2.0, "mm", 1.0).verdict == "depends"
    assert readings.compare(values, 2.0, "mm", 1.0).reason.startswith("gap: ")
    assert readings.compare(values, 4.0, "mm", 1.0).verdict == "predicted-disagrees"
    assert readings.compare(0.01 * column + 2.0, 2.0, "mm", 1.0).verdict == "predicted-agrees"


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"gap": ["1 mm", "0.1 mm"]}, "laid_down.gap goes from 1 mm to 0.1 mm"),
        ({"gap": ["1 mm"]}, "laid_down.gap has too few entries"),
        ({"gap": "1 mm"}, r"laid_down.gap = '1 mm' is not allowed; allowed: a list"),
        ({"roughness": ["1 um", "0.5 mm"]}, "asperities would carry"),
        ({"pitch": [0.0, 2.0]}, r"laid_down.pitch.1 = 2.0; allowed: 0 to 1"),
        ({"duration": "0 s"}, "duration = 0 s; allowed: 1 s to 600 s"),
        ({"wait": ["0 s", "1e6 s"]}, r"wait = 1e\+06 s; allowed"),
    ],
)
def test_wrong_ranges_are_refused(table, words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        sp.study(SHORT | {"laid_down": table})


def test_runs_that_tell_nothing_are_counted() -> None:
    speeds = np.array([[[np.nan, np.nan], [1e-3, np.nan]]])
    assert without_answer([{"forward_velocity": speeds}])[0].startswith("1 of 2 runs of released robots")
    assert without_answer([{"forward_velocity": speeds[:, 1:]}]) == []


def test_a_calibration_is_refused(tmp_path) -> None:
    with pytest.raises(sp.InputError, match="nothing fitted"):
        sp.study(SHORT, calibration=tmp_path / "calibration.toml")


@pytest.mark.parametrize(("table", "switch"), [("laid_down", "predicted"), ("contact", "settled")])
def test_a_table_that_nothing_would_read_is_refused(table: str, switch: str) -> None:
    study = {"robots": ["biorob2012-wide"], "models": ["sbt"], "friction": ["rotor"], table: {}}
    with pytest.raises(sp.InputError, match=rf"{table} without {switch}.*, which reads it; allowed: {switch} = true"):
        sp.study(study)
    assert sp.study(study | {switch: False}).sizes["robot"] == 1
