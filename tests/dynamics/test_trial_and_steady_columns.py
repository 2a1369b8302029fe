"""Held, trial and steady motion of one robot in its tube: `predict`, `simulate` and `settle` give the same numbers."""

import math
import pickle
from collections.abc import Callable
from typing import Any

import pytest

import spirillum as sp
from spirillum.cli.tables import blocks_of

WIDE = "biorob2012-wide"
MEANS = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "electrical_power")


@pytest.fixture(scope="module")
def driven() -> sp.Robot:
    """At a rate of its drive it comes to its steady motion sooner than with its motor."""
    return sp.load(WIDE, **{"drive.kind": "rate", "drive.rate": "1.2 Hz"})


@pytest.fixture(scope="module")
def answer(driven: sp.Robot) -> Any:
    return sp.predict(driven)


def test_a_run_by_its_defaults_is_the_trial() -> None:
    """With its motor: released at the reference place, 60 s of waiting, 20 s of swimming."""
    trial, run = sp.predict(WIDE).trial, sp.simulate(WIDE)
    assert trial is not None
    assert (float(run.attrs["wait"]), float(run["time"][-1])) == (60.0, 20.0)
    for name in MEANS:
        assert trial.values[name] == pytest.approx(float(run[f"mean_{name}_on"]), rel=1e-9)
    assert trial.values["gap"] == pytest.approx(float(run["wall_gap"].integrate("time")) / 20.0, rel=1e-9)
    moved = float(run["position"][-1, 0] - run["position"][0, 0])
    assert trial.values["forward_velocity"] == pytest.approx(moved / 20.0, rel=1e-9)


def test_a_trial_of_another_length_is_the_run_of_that_length(driven: sp.Robot) -> None:
    asked = {"in_tube": {"wait": "2 s"}, "roughness": "20 um"}
    trial = sp.predict(driven, duration="3 s", **asked).trial
    run = sp.simulate(driven, timing={"duration": "3 s"}, **asked)
    assert trial is not None
    assert trial.values["forward_velocity"] == pytest.approx(float(run["mean_forward_velocity_on"]), rel=1e-9)
    assert [trial.basis[name]["value"] for name in ("wait", "duration")] == [2.0, 3.0]


def test_the_steady_column_is_what_settle_finds(driven: sp.Robot, answer: Any) -> None:
    found = sp.settle(driven)
    for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "drive_torque"):
        assert answer.steady.values[name] == pytest.approx(getattr(found.prediction, name), rel=1e-9)
    assert answer.steady.basis["time_constant"]["value"] == pytest.approx(found.steady_state.approach_time, rel=1e-9)
    assert (answer.steady.basis["state"], answer.steady.values["gap"]) == ("steady", found.steady_state.gap)


def test_the_held_answer_stays_the_headline(driven: sp.Robot, answer: Any) -> None:
    alone, beside = sp.predict(driven, motion="held").to_dict(), answer.to_dict()
    assert {name: beside[name] for name in alone} == alone
    assert set(beside) - set(alone) == {"trial", "steady"}
    assert str(answer).endswith("answer.trial, answer.steady (values, or why there are none)")
    assert "answer.trial" not in str(sp.predict(driven, motion="held"))
    assert beside["trial"]["assumption"] == "contact assumed, not validated"
    speeds = [item["forward_velocity"]["value"] for item in (beside, beside["trial"], beside["steady"])]
    assert speeds[0] > speeds[2] > speeds[1] > 0.0


def test_columns_stand_side_by_side(answer: Any) -> None:
    table, *lines = (block for block in blocks_of(answer.to_dict()) if not isinstance(block, str) or "t" in block)
    assert [str(column.header) for column in table.columns] == [
        "quantity", "held", "held low", "held high", "trial", "steady",
    ]  # fmt: skip
    basis = "released, motor on after 60 s, mean over 20 s; contact assumed, not validated"
    assert f"trial: {basis}; its interval: --interval" in lines
    (held,) = (line for line in lines if line.startswith("held: at a fixed pose"))
    assert held.count("held low and high: extremes over") == 1
    (lab,) = (line for line in lines if line.startswith("in the lab"))
    assert lab.endswith("swims as in trial, later as in steady; held is for a known gap and pitch")


def test_ends_of_a_posterior_say_whose_interval_they_are(answer: Any) -> None:
    """In the answer itself, for the column that they belong to."""
    fitted = {**answer.to_dict(), "interval_of": "of a tail like those that were fitted"}
    fitted["forward_velocity"] = fitted["forward_velocity"] | {"kind": "interval", "level": 0.95}
    for shown, column in ((fitted, "held "), ({**fitted, "trial": {"reason": "-"}, "steady": {"reason": "-"}}, "")):
        (line,) = (one for one in map(str, blocks_of(shown)) if "95 % interval" in one)
        assert line == f"{column}low and high: 95 % interval of the posterior, of a tail like those that were fitted"


def test_an_answer_over_poses_alone_says_what_the_lab_shows() -> None:
    """Of a robot in a tube; none without one, and none at a stated pose."""
    band = sp.predict("biorob2012-wide", tail_rate="1 Hz").to_dict()
    at_a_pose = sp.predict("biorob2012-wide", tail_rate="1 Hz", placement={"gap": "1 mm", "pitch": "0 deg"}).to_dict()
    said = [[one for one in blocks_of(item) if str(one).startswith("in the lab")] for item in (band, at_a_pose)]
    assert [len(lines) for lines in said] == [1, 0]
    assert "mostly slower than at a pose" in said[0][0]
    assert "value: at a fixed pose (gap 1 mm, pitch 0 deg)" in list(map(str, blocks_of(at_a_pose)))


def test_what_a_trial_does_not_have_has_its_reason(answer: Any) -> None:
    missing = answer.to_dict()["trial"]["hydrodynamic_efficiency"]
    assert missing["value"] is None
    assert any(missing["reason"] in str(block) for block in blocks_of(answer.to_dict()))


def test_lines_end_between_words_at_80_columns(run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    for arguments in (("predict", WIDE, "--all", "--notes"), ("predict", WIDE, "--model", "cfd")):
        outcome = run(*arguments)
        lines = (outcome.out + outcome.err).splitlines()
        assert max(map(len, lines)) <= 80
        assert any(line.startswith("  validated") for line in lines) or outcome.code == 2


@pytest.mark.parametrize(
    ("overrides", "options", "reason"),
    [
        pytest.param({"body.mass": "9 g"}, {"duration": "3 s"}, "", id="light"),
        pytest.param({"body.mass": "7.82 g"}, {"duration": "3 s"}, "", id="neutral"),
        pytest.param({"body.mass": "3 g"}, {"duration": "3 s"}, "", id="rising"),
        pytest.param({}, {"placement": {"flow": "1 mm/s"}}, "", id="imposed flow"),
        pytest.param({}, {"placement": {"ends": "closed"}}, "", id="closed ends"),
        pytest.param({}, {"tail_rate": "1.2 Hz"}, "a tail rate is prescribed", id="prescribed tail rate"),
        pytest.param({"channel": "none"}, {}, "the robot has no channel", id="no channel"),
        pytest.param({}, {"model": "sbt"}, "model 'sbt' has no walls", id="sbt"),
        pytest.param({}, {"model": "rft"}, "model 'rft' has no walls", id="rft"),
        pytest.param({}, {"model": "slender"}, "model 'slender' has no walls", id="slender"),
    ],
)
def test_a_missing_trial_has_its_reason(overrides: dict[str, Any], options: dict[str, Any], reason: str) -> None:
    """The table of cases in docs/motion.md."""
    trial = sp.predict(sp.load(WIDE, **overrides), **options).trial
    assert trial is not None
    assert reason in trial.reason if reason else not trial.reason
    assert bool(trial.values) != bool(trial.reason)
    if not reason:
        assert trial.basis["wait"]["value"] == (0.0 if "flow" in options.get("placement", {}) else 60.0)


@pytest.mark.parametrize(
    ("overrides", "options", "state"),
    [
        pytest.param({"body.mass": "3 g"}, {}, "ceiling", id="rising"),
        pytest.param({}, {"placement": {"flow": "1 mm/s"}}, "steady", id="imposed flow"),
        pytest.param({}, {"placement": {"ends": "closed"}}, "steady", id="closed ends"),
        pytest.param({}, {"tail_rate": "1.2 Hz"}, "a tail rate is prescribed", id="prescribed tail rate"),
        pytest.param({"channel": "none"}, {}, "the robot has no channel", id="no channel"),
        pytest.param({}, {"model": "slender"}, "model 'slender' has no walls", id="without walls"),
    ],
)
def test_a_steady_column_has_its_state_or_its_reason(
    overrides: dict[str, Any], options: dict[str, Any], state: str
) -> None:
    steady = sp.predict(sp.load(WIDE, **overrides), **options).steady
    assert steady is not None
    assert state in (steady.reason or steady.basis["state"])
    assert math.isfinite(steady.values.get("forward_velocity", math.nan)) == (state in ("ceiling", "steady"))


def test_a_magnetic_robot_in_one_piece_has_a_trial_and_the_reason_why_nothing_is_steady() -> None:
    magnet = {"moment": "0.1 A m^2", "moment_angle": "90 deg", "field": "5 mT", "rotation_rate": "0.5 Hz"}
    robot = sp.load(WIDE, drive={"kind": "magnetic", "joint": "fixed"}, magnetic=magnet)
    found = sp.predict(robot)
    assert found.trial is not None
    assert found.steady is not None
    assert math.isfinite(found.trial.values["forward_velocity"])
    assert "drive.kind = 'magnetic': the motion depends on the phase of the field" in found.steady.reason


def test_without_a_table_the_reason_says_how_to_get_one() -> None:
    """On the paper's body with a short, thick tail, which takes a fraction of a second."""
    small = {"coupling.diameter": "0 mm", "tail.length": "20 mm", "tail.wire_diameter": "1.5 mm"}
    robot = sp.load(WIDE, **small, **{"model.tube.tolerance": 0.04, "model.tube.phases": 1})
    trial = sp.predict(robot).trial
    assert trial is not None
    assert "`spirillum prepare` makes it" in trial.reason


def test_an_answer_goes_to_another_process_before_its_columns_are_computed(driven: sp.Robot) -> None:
    for sent in (sp.predict(driven), sp.predict(driven, tail_rate="1.2 Hz")):
        there = pickle.loads(pickle.dumps(sent))
        assert set(there.released) == {"trial", "steady"}
        assert there.forward_velocity == sent.forward_velocity


@pytest.mark.parametrize("options", [{"motion": "held"}, {"tail_rate": "1.2 Hz"}, {"model": "sbt"}])
def test_settings_of_a_trial_are_refused_where_there_is_none(options: dict[str, Any]) -> None:
    for setting in ({"roughness": "20 um"}, {"in_tube": {"wait": "5 s"}}, {"duration": "5 s"}, {"interval": True}):
        with pytest.raises(sp.InputError, match="is of released motion in the tube"):
            sp.predict(WIDE, **setting, **options)
