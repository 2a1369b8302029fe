"""Who answers where nobody names a model: `tube` in a channel, `slender` without, and a calibration by its own."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.plant import Plant
from spirillum.errors import InputError
from spirillum.fluid.registry import find_swimmer_model, quickest
from spirillum.fluid.tube import library
from spirillum.papers.biorob2012.published import paper_study
from spirillum.studies import run
from spirillum.studies.study_loader import LoadedStudy, load_study
from spirillum.swimming.preparation import choose_model
from spirillum.virtual.motion import steady_rates
from spirillum.virtual.trial_options import MotionOptions
from spirillum.worker_pool import WorkerPool

WIDE, NARROW = "biorob2012-wide", "biorob2012-narrow"
FITTED_TO = (
    'source = "test"\nfitted_to = {channel_diameter = "40 mm", body_diameter = "18 mm", body_length = "35 mm"}\n'
)


def factors(model: str) -> str:
    return f"[calibration.{model}]\nbody_drag = 1.5\n{FITTED_TO}"


@pytest.fixture(scope="module")
def answer() -> Any:
    return sp.predict(WIDE, tail_rate="1.2 Hz")


def test_an_answer_nearer_to_the_glass_than_its_table_was_checked_says_so() -> None:
    near, far = (sp.predict(WIDE, placement={"gap": gap, "pitch": "0 deg"}) for gap in ("0.05 mm", "0.3 mm"))
    assert any(
        words.startswith("gap = 0.05 mm; accurate: at least 0.288 mm, because the table") for words in near.warnings
    )
    assert not any("the table was checked" in words for words in far.warnings)


def test_an_answer_beyond_the_yaws_at_which_its_table_was_checked_says_so_and_has_no_error() -> None:
    """There the tail is nearer to the glass than the flow can be solved for, and touches it at a yaw of 7.2 degrees."""
    near, far = (
        sp.predict(NARROW, placement={"gap": "0.3 mm", "pitch": "0 deg", "yaw": yaw}) for yaw in ("7.1 deg", "6 deg")
    )
    assert any(words.startswith("yaw = 7.1 deg; accurate: at most 6.8") for words in near.warnings)
    assert not any(words.startswith("yaw") for words in far.warnings)
    assert near.to_dict(others=False).get("error_estimate", {}).get("value") is None
    with pytest.raises(InputError, match=r"clearance of tail and wall .* allowed: at least 0"):
        sp.predict(NARROW, placement={"gap": "0.3 mm", "pitch": "0 deg", "yaw": "7.3 deg"})


def test_a_robot_in_a_channel_is_predicted_in_it_and_another_without(answer: Any) -> None:
    said = answer.to_dict(others=False)
    assert (said["model"], said["form"], said["calibrated"]) == ("tube", "table", False)
    assert "channel" in said["model_reason"]
    assert said["forward_velocity"]["kind"] == "band"
    swimmer = sp.predict(sp.load(WIDE, channel="none"), tail_rate="1.2 Hz")
    assert swimmer.answered_by == {"model": "slender", "model_reason": "the robot has no channel"}
    for preset in ("ecoli", "magnetic-helix"):
        assert choose_model("auto", sp.load(preset)).model == "slender"


def test_a_model_that_is_asked_for_has_no_reason() -> None:
    assert sp.predict(WIDE, model="sbt").answered_by == {"model": "sbt"}


@pytest.mark.parametrize("answer_of", [sp.predict, sp.simulate, Plant], ids=["predict", "simulate", "plant"])
def test_a_robot_that_does_not_fit_its_tube_is_refused_and_told_how_to_leave_walls_out(answer_of: Any) -> None:
    tight = sp.load(WIDE, **{"channel.diameter": "18.5 mm"})
    with pytest.raises(sp.InputError, match=r"channel\.diameter = 18\.5 mm.*or model 'slender', which leaves out"):
        answer_of(tight)
    with pytest.raises(sp.InputError, match=r"coupling\.length = 0 mm.*or model 'sbt', which leaves out"):
        sp.predict(sp.load("biorob2012-wide", coupling="none"))  # slender refuses it, too


def test_a_place_in_a_tube_that_is_too_tight_needs_walls() -> None:
    tight = sp.load(WIDE, **{"channel.diameter": "18.5 mm"})
    with pytest.raises(sp.InputError, match=r"model 'tube'.*channel\.diameter"):
        sp.predict(tight, tail_rate="1.2 Hz", placement={"gap": "0.1 mm"})
    assert sp.predict(tight, tail_rate="1.2 Hz", model="slender").forward_velocity > 0.0


def test_a_missing_table_does_not_change_the_model(monkeypatch: Any) -> None:
    monkeypatch.setattr(library, "find_table", lambda *_: None)
    assert choose_model("auto", sp.load(WIDE)).model == "tube"


def test_one_place_without_a_table_says_what_a_table_adds() -> None:
    """On the paper's body with a short, thick tail, which takes a fraction of a second."""
    small = {"coupling.diameter": "0 mm", "tail.length": "20 mm", "tail.wire_diameter": "1.5 mm"}
    robot = sp.load(WIDE, **small, **{"model.tube.tolerance": 0.04, "model.tube.phases": 1})
    found = sp.predict(robot, tail_rate="1.2 Hz", placement={"gap": "4 mm"})
    assert found.answered_by["form"] == "direct"
    assert found.band is None
    assert any(said.startswith("pitch is unknown") and "`spirillum prepare ROBOT`" in said for said in found.warnings)


def test_other_models_say_what_they_say_alone(answer: Any) -> None:
    beside = answer.other_models
    said = {(item.model, item.calibrated): item for item in beside.answers}
    assert set(said) == {("sbt", False), ("sbt", True), ("rft", False), ("rft", True), ("slender", False)}
    for (model, calibrated), item in said.items():
        alone = sp.predict(WIDE, model=model, tail_rate="1.2 Hz", calibrated=calibrated).forward_velocity
        assert item.forward_velocity == pytest.approx(alone, rel=1e-12)
        assert item.ratio == pytest.approx(alone / answer.forward_velocity, rel=1e-12)
        assert f"{model} {item.ratio:.2g}" in beside.statement
    assert answer.to_dict()["other_models"]["answers"][0]["forward_velocity"]["unit"] == "m/s"


def test_other_models_are_left_out_where_they_answer_another_question() -> None:
    carried = sp.predict(WIDE, tail_rate="1.2 Hz", placement={"flow": "1 mm/s"}, band=False)
    assert carried.other_models is None
    assert sp.predict(WIDE, model="rft").other_models is None
    afloat = sp.predict(sp.load(WIDE, channel="none"), tail_rate="1.2 Hz").other_models
    assert afloat is not None
    assert [item.model for item in afloat.answers] == ["sbt", "rft"]


@pytest.mark.parametrize("model", ["sbt", "rft", "slender"])
def test_a_calibration_is_answered_by_the_model_that_it_was_fitted_with(tmp_path: Path, model: str) -> None:
    file = tmp_path / "calibration.toml"
    file.write_text(factors(model))
    found = sp.predict(WIDE, tail_rate="1.2 Hz", calibration=file)
    assert (found.model.name, found.calibrated) == (model, True)
    assert str(file) in found.answered_by["model_reason"]
    run = sp.simulate(WIDE, motion="held", calibration=file, timing={"turns": 0.1})
    assert (run.attrs["model"], run.attrs["calibrated"]) == (model, 1)
    assert load_study({"robots": [WIDE]}, calibration=file).study.models == (model,)


def test_a_calibration_of_several_models_asks_for_one(tmp_path: Path) -> None:
    file = tmp_path / "both.toml"
    file.write_text(factors("sbt") + factors("rft"))
    with pytest.raises(sp.InputError, match="holds factors for models sbt, rft; allowed: --model with one of them"):
        sp.predict(WIDE, calibration=file)
    assert sp.predict(WIDE, model="rft", calibration=file).calibrated


def test_studies_take_one_model_for_all_robots() -> None:
    def loaded(**study: Any) -> LoadedStudy:
        return load_study({"friction": ["rotor"], **study})

    assert loaded(robots=[WIDE, NARROW]).study.models == ("tube",)
    with pytest.raises(sp.InputError, match=r"ecoli has no channel, but others have.*models = \[\"slender\"\]"):
        loaded(robots=[WIDE, "ecoli"])
    assert loaded(robots=["ecoli"]).study.models == ("slender",)
    assert loaded(robots=[WIDE], models=["sbt", "auto", "tube"]).study.models == ("sbt", "tube")
    paper = load_study(paper_study())
    assert (paper.study.models, paper.makes_tables) == (("sbt", "rft"), False)


@pytest.mark.parametrize(
    ("more", "made"),
    [({}, ["straight"]), ({"settled": True}, ["yaw"]), ({"models": ["tube"]}, []), ({"models": ["slender"]}, [])],
)
def test_studies_make_the_tables_that_their_robots_lack_and_say_what_is_cheaper(
    monkeypatch: Any, more: dict[str, Any], made: list[str]
) -> None:
    """The paper's tail has a table; the other has none, and neither has one that is wider than the tube."""
    stages: list[str] = []
    said: list[str] = []

    def prepared(missing: Any, *, stage: str, **_: Any) -> None:
        assert [round(1e3 * geometry.wavelength, 1) for geometry, _ in missing] == [24.3]
        stages.append(stage)

    monkeypatch.setattr(run, "prepared_tables", prepared)
    tails = {"wavelengths": ["25 mm", "24.3 mm"], "amplitudes": ["2.5 mm", "25 mm"], "channels": {"wide": WIDE}}
    loaded = load_study({"friction": ["rotor"], "grid": tails, **more})
    run.make_tables(loaded, WorkerPool(), lambda what, *_: said.append(what))
    assert stages == made
    assert [("'tube' by name" in words, "'slender'" in words) for words in said] == [(True, True)] * len(made)


def test_predictions_and_runs_agree_at_the_same_place() -> None:
    """The robot with its motor, lying level at the reference place of its tube."""
    held = sp.simulate(WIDE, motion="held", timing={"turns": 3.0})
    assert held.attrs["model"] == "tube"
    steady = sp.predict(WIDE, band=False)
    for name in ("forward_velocity", "body_rotation_rate", "tail_rotation_rate"):
        assert float(held[name][-1]) == pytest.approx(getattr(steady, name), rel=1e-3)


def test_unknown_names_are_refused_with_all_that_is_allowed() -> None:
    with pytest.raises(sp.InputError, match=r"did you mean auto\?.*allowed: auto, sbt, rft, slender, tube"):
        sp.predict(WIDE, model="atuo")


def test_factors_of_another_geometry_say_nothing_of_this_robot() -> None:
    own, other = (
        sp.predict(sp.load(WIDE, **changed), model="slender", tail_rate="1.2 Hz").other_models
        for changed in ({"tail.length": "25 mm"}, {"tail.length": "25 mm", "body.length": "34 mm"})
    )
    assert own is not None
    assert other is not None
    assert {item.model for item in own.answers if item.calibrated} == {"sbt", "rft"}
    assert not any(item.calibrated for item in other.answers)


def test_every_answer_gives_the_choice_and_its_reason_in_the_same_words() -> None:
    run = sp.simulate(WIDE, timing={"duration": "0.02 s"}, in_tube={"wait": 0.0})
    study = sp.study({"robots": [WIDE], "friction": ["rotor"]})
    answers = {
        "predict": sp.predict(WIDE, motion="held").answered_by,
        "simulate": run.attrs,
        "study": {**study.attrs, "model": str(study["model"].values[0])},
        "plant": Plant(WIDE).steady.answered_by,
        "render": dict(zip(("model", "model_reason"), steady_rates(sp.load(WIDE), MotionOptions())[1::2], strict=True)),
    }
    said = {name: (answer["model"], answer["model_reason"]) for name, answer in answers.items()}
    assert said == dict.fromkeys(said, ("tube", "the robot is in a channel, whose walls this model computes"))


def test_a_batch_counts_the_robots_nearer_to_the_glass_than_their_table_was_checked() -> None:
    near = sp.RobotBatch.of(sp.load(WIDE), sp.Placement.of({"gap": "0.05 mm", "pitch": "0 deg"}))
    batch = near.with_values({"body.mass": [1.0, 2.0, 3.0], "fluid.viscosity": [3.5, np.nan, 4.0]})
    model = quickest(find_swimmer_model("tube"), near)
    found = sp.swim(batch, model)
    assert found.valid.tolist() == [True, False, True]
    assert any(note.startswith("2 of 3 robots (tube), the first: gap = 0.05 mm; accurate") for note in found.warnings)
