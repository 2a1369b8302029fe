"""A placement reaches the models that compute walls, and only them: Python, studies and the command line."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.robot.load import with_resolution
from spirillum.robot.placement import Placement

WIDE = "biorob2012-wide"
LOW = {"gap": "0.5 mm"}
STUDY = {"friction": ["rotor"], "robots": [WIDE]}


def refused(call: Callable[[], Any]) -> str:
    with pytest.raises(sp.InputError) as caught:
        call()
    return str(caught.value)


def test_prediction(walled: Any) -> None:
    answer = sp.predict(WIDE, model="walled", tail_rate="1.2 Hz", placement=LOW, band=False)
    assert answer.batch.placement == Placement.of(LOW)
    assert answer.placement == {"kind": "in the channel", "gap": {"value": 5e-4, "unit": "m"}, "ends": "open"}
    written = answer.to_dict()
    assert written["placement"] == answer.placement
    assert written["plug_velocity"] == {"value": answer.plug_velocity, "unit": "m/s"}
    assert not any("no calibration" in sentence for sentence in answer.warnings)
    carried = sp.predict(WIDE, model="walled", tail_rate="1.2 Hz", placement={"flow": 1e-3}, band=False)
    assert carried.forward_velocity > answer.forward_velocity
    assert sp.predict(WIDE, tail_rate="1 Hz", model="sbt").to_dict()["plug_velocity"]["value"] is None


def test_a_tail_at_rest_is_carried_by_a_flow(walled: Any) -> None:
    answer = sp.predict(WIDE, model="walled", tail_rate=0.0, placement={"flow": 1e-3}, band=False)
    assert answer.forward_velocity > 0
    assert answer.to_dict()["advance_per_radian"]["value"] is None
    assert "a tail at rest drives nothing" in refused(lambda: sp.predict(WIDE, model="walled", tail_rate=0.0))


def test_a_robot_without_weight_is_not_known_to_lie_on_the_floor(walled: Any) -> None:
    light = sp.load(WIDE, **{"body.mass": None})
    for robot, placement, said in ((light, None, True), (light, {"gap": "1 mm"}, False), (sp.load(WIDE), None, False)):
        answer = sp.predict(robot, model="walled", tail_rate="1 Hz", placement=placement, band=False)
        assert any("the robot is assumed to rest on the floor" in sentence for sentence in answer.warnings) is said


def test_fast_flow_warns(walled: Any) -> None:
    answer = sp.predict(WIDE, model="walled", tail_rate="1 Hz", placement={"flow": "-50 mm/s"}, band=False)
    assert any("Reynolds number (imposed flow, body diameter) = 0.25" in sentence for sentence in answer.warnings)
    assert any("the imposed flow does work on the robot" in sentence for sentence in answer.warnings)


def test_resistance(walled: Any) -> None:
    answer = sp.resistance(WIDE, model="walled", placement={"gap": 1e-3, "ends": "closed"})
    assert answer.to_dict()["placement"]["ends"] == "closed"
    assert sp.resistance(WIDE, model="perrin").placement == {"kind": "unbounded fluid"}


def test_comparison_places_those_that_ask(walled: Any) -> None:
    answer = sp.compare_models(WIDE, models=["sbt", "walled"], tail_rate="1 Hz", placement=LOW)
    assert answer.predictions["walled"].batch.placement == Placement.of(LOW)
    assert not answer.predictions["sbt"].batch.placement.is_set
    assert any("wall effects are modelled by walled and not by sbt" in sentence for sentence in answer.warnings)
    both = sp.compare_models(WIDE, models=["sbt", "walled"], tail_rate="1 Hz", calibrated=True)
    assert not any("for sbt and not for walled" in sentence for sentence in both.warnings)


def test_models_without_walls_refuse(walled: Any) -> None:
    for call in (
        lambda: sp.predict(WIDE, model="sbt", placement=LOW),
        lambda: sp.resistance(WIDE, model="perrin", placement=LOW),
        lambda: sp.compare_models(WIDE, models=["sbt", "rft"], placement=LOW),
        lambda: sp.study({**STUDY, "models": ["sbt", "rft"], "placement": LOW}),
    ):
        text = refused(call)
        assert "placement.gap = 0.0005 m with model '" in text
        assert text.endswith("which does not compute the channel's walls; allowed: only with model tube, walled")
    assert "placement.ends = closed" in refused(lambda: sp.predict(WIDE, placement={"ends": "closed"}, model="sbt"))
    assert "placement.gap = 6 mm; allowed: at most 5 mm" in refused(
        lambda: sp.predict(WIDE, model="walled", placement={"gap": "6 mm"})
    )


def test_study(walled: Any) -> None:
    placed = sp.study({**STUDY, "models": ["walled", "sbt"], "placement": {"flow": "-1 mm/s"}})
    alone = sp.predict(WIDE, model="walled", placement={"flow": "-1 mm/s"}, band=False)
    found = placed.sel(model="walled", friction="rotor", robot=WIDE)
    assert float(found["forward_velocity"]) == alone.forward_velocity
    assert float(found["plug_velocity"]) == alone.plug_velocity
    assert np.isnan(placed["plug_velocity"].sel(model="sbt")).all()
    still = sp.study({**STUDY, "models": ["walled", "sbt"]})
    assert placed.attrs["fingerprint"] != still.attrs["fingerprint"]
    assert json.loads(placed.attrs["settings"])["study"]["placement"]["flow"] == -1e-3
    grid = {"channels": {"wide": WIDE}, "wavelengths": ["25 mm"], "amplitudes": ["2.5 mm"]}
    on_grid = sp.study({"friction": ["rotor"], "models": ["walled"], "grid": grid, "placement": {"flow": "-1 mm/s"}})
    assert float(on_grid["forward_velocity"].squeeze()) == pytest.approx(alone.forward_velocity, rel=1e-12)


def test_study_file_needs_units(walled: Any) -> None:
    text = refused(lambda: sp.study({**STUDY, "models": ["walled"], "placement": {"gap": 5e-4}}))
    assert text == 'the study: placement.gap = 0.0005 has no unit; allowed: a number with its unit, for example "18 mm"'
    text = refused(lambda: sp.study({**STUDY, "models": ["walled"], "placement": {**LOW, "eccentricity": 0.5}}))
    assert text.startswith("the study: placement.eccentricity = 0.5 is given together with placement.gap = 0.5 mm")


def test_command_line(walled: Any, run: Callable[..., tuple[int, str, str]]) -> None:
    model = ("--model", "walled")
    code, out, _ = run("predict", WIDE, *model, "--gap", "0.5mm", "--ends", "closed", "--no-band", "--json")
    answer = json.loads(out)
    assert (code, answer["placement"]["gap"]["value"], answer["placement"]["ends"]) == (0, 5e-4, "closed")
    direct = sp.predict(WIDE, model="walled", placement={"gap": 5e-4, "ends": "closed"}, band=False)
    assert answer["forward_velocity"]["value"] == direct.forward_velocity
    code, out, _ = run("predict", WIDE, *model, "--flow", "-2mm/s", "--tail-rate", "1Hz", "--no-band", "--all")
    assert code == 0
    assert "placement: in the channel, gap - mm" not in out
    assert "plug velocity" in out
    code, out, _ = run(
        "resistance", WIDE, *model, "--eccentricity", "0.5", "--pitch", "0deg", "--tail-drop", "1mm", "--notes"
    )
    assert (code, "placement: in the channel, ends open" in out) == (0, True)
    code, out, _ = run("compare-models", WIDE, *model, "--model", "rft", "--gap", "1mm", "--json")
    walls = next(entry for entry in json.loads(out)["models"] if entry["model"] == "walled")
    assert (code, walls["placement"]["gap"]["value"]) == (0, 1e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--gap", "0.5"), 'placement.gap = "0.5" has no unit'),
        (("--gap", "0mm"), 'placement.gap = "0mm" is out of range'),
        (("--eccentricity", "1.5"), "placement.eccentricity = 1.5"),
        (("--pitch", "60deg"), "-45 deg to 45 deg"),
        (("--yaw", "60deg"), "-45 deg to 45 deg"),
        (("--tail-drop", "-1mm"), 'placement.tail_drop = "-1mm"'),
        (("--ends", "shut"), "placement.ends = 'shut'"),
        (("--flow", "nan mm/s"), 'placement.flow = "nan mm/s" is not finite'),
        (("--flow", "1mm/s", "--ends", "open"), "allowed: one of them"),
        (("--tolerance", "0.01"), "tolerance = 0.01 with model 'walled'; allowed: only with model 'tube'"),
        (("--phases", "3"), "phases = 3 with model 'walled'; allowed: only with model 'tube'"),
        (("--accuracy", "high"), "allowed: only with model 'slender' or 'tube'"),
    ],
)
def test_wrong_options_exit_with_two(
    walled: Any, run: Callable[..., tuple[int, str, str]], options: tuple[str, ...], words: str
) -> None:
    code, out, err = run("predict", WIDE, "--model", "walled", *options)
    assert (code, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1


def test_options_of_the_tube() -> None:
    robot = sp.load(WIDE)
    assert (robot.model.tube.tolerance, robot.model.tube.phases) == (0.005, 3)
    changed = with_resolution(robot, {"accuracy": "high", "tolerance": 0.02, "phases": 6}, "tube")
    assert (changed.model.tube.tolerance, changed.model.tube.phases) == (0.02, 6)
    assert changed.model.slender.accuracy == "high"
    assert sp.load(WIDE, **{"model.tube.tolerance": 0.02, "model.tube.phases": 6}).model.tube == changed.model.tube
    for wrong in (0.0, 0.1, float("nan"), "0.01", True):
        text = refused(lambda wrong=wrong: with_resolution(robot, {"tolerance": wrong}, "tube"))
        assert text == f"tolerance = {wrong!r}; allowed: 0.0001 to 0.05"
    for wrong in (0, 65, 2.5):
        text = refused(lambda wrong=wrong: with_resolution(robot, {"phases": wrong}, "tube"))
        assert text == f"phases = {wrong!r}; allowed: a whole number from 1 to 64"
    assert "model.tube.tolerance = 1.0" in refused(lambda: sp.load(WIDE, **{"model.tube.tolerance": 1.0}))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((WIDE, "--gap", "0.0001mm"), "placement.gap = 0.0001 mm; allowed: at least 0.00018 mm"),
        (("biorob2012-narrow", "--pitch", "30deg"), "there is no more room in the channel (placement.pitch = 30 deg)"),
    ],
)
def test_a_gap_outside_a_table_gets_one_limit(
    run: Callable[..., tuple[int, str, str]], options: tuple[str, ...], words: str
) -> None:
    code, out, err = run("predict", *options, "--model", "tube")
    assert (code, out) == (2, "")
    assert words in err
    assert err.count("allowed") == 1
    assert "here at least" not in err
