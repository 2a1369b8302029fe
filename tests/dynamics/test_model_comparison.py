"""The models side by side say what each says alone; what one of them cannot do is a row, not a failure."""

from typing import Any

import pytest

import spirillum as sp
from spirillum.cli.tables import blocks_of
from spirillum.cli.tables.parts import Detail
from spirillum.dynamics import comparison as module
from spirillum.fluid.registry import SWIMMER_MODELS

WIDE = "biorob2012-wide"
THICK = {"tail.wire_diameter": "6 mm"}
"""Outside the domain of `rft` with the printed coefficients, inside that of `sbt`."""
QUANTITIES = ("forward_velocity", "body_rotation_rate", "tail_torque", "hydrodynamic_efficiency", "motor_current")


@pytest.mark.parametrize("settings", [{"tail_rate": "1.2 Hz"}, {"friction": "none"}, {"calibrated": True}])
def test_every_model_answers_as_it_does_alone(settings: dict[str, Any]) -> None:
    found = sp.compare_models(WIDE, models=["sbt", "rft"], **settings)
    for name in ("sbt", "rft"):
        alone = sp.predict(WIDE, model=name, **{"calibrated": False, **settings})
        for quantity in QUANTITIES:
            assert getattr(found.predictions[name], quantity) == getattr(alone, quantity)


def test_without_a_choice_all_models_are_asked() -> None:
    short = {"tail.length": "20 mm", "tail.wavelength": "20 mm", "tail.wire_diameter": "1.5 mm"}
    ball = {"body.shape": "sphere", "body.length": "18 mm", "body.front": "none", "body.rear": "none"}
    robot = sp.load(WIDE, **short, **ball, **{"coupling.diameter": "0 mm", "model.tube.phases": 1})
    found = sp.compare_models(robot, tail_rate=1.0, placement={"gap": "2 mm"}, resolution={"tolerance": 0.05})
    assert found.models == tuple(SWIMMER_MODELS)
    assert {*found.predictions, *found.refusals} == set(SWIMMER_MODELS)


def test_a_model_outside_its_domain_says_why_and_the_others_answer() -> None:
    found = sp.compare_models(sp.load(WIDE, **THICK), models=["rft", "sbt"])
    assert list(found.predictions) == ["sbt"]
    assert "reversing the thrust" in found.refusals["rft"]
    first, second = found.to_dict()["models"]
    assert (first["model"], first["answered"], "reversing the thrust" in first["reason"]) == ("rft", False, True)
    assert (second["model"], second["answered"]) == ("sbt", True)


def test_no_answer_at_all_is_an_error_with_every_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = sp.load(WIDE, **THICK)
    with pytest.raises(sp.InputError, match="reversing the thrust"):
        sp.compare_models(robot, models=["rft"])

    def refuse(_robot: Any, *, model: str, **_: Any) -> None:
        raise sp.InputError(f"{model} cannot")

    monkeypatch.setattr(module, "predict_steady", refuse)
    with pytest.raises(sp.InputError, match="no model answers: sbt cannot; rft cannot") as caught:
        sp.compare_models(robot, models=["sbt", "rft"])
    assert caught.value.problems == ("sbt cannot", "rft cannot")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"models": ["cfd"]}, "model = 'cfd'"),
        ({"models": []}, "models = \\[\\]; allowed: one or more of sbt, rft"),
        ({"friction": "ice"}, "friction = 'ice'"),
        ({"tail_rate": "1"}, '^tail-rate = "1" has no unit'),
        ({"tail_rate": 0.0}, "^tail-rate = 0 Hz: a tail at rest"),
        ({"calibration": "missing.toml"}, "missing.toml does not exist"),
    ],
)
def test_wrong_input_is_said_once(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError, match=words) as caught:
        sp.compare_models(WIDE, **arguments)
    assert len(caught.value.problems) == 1


def test_the_reference_is_the_last_model_that_bounds_its_own_error(monkeypatch: pytest.MonkeyPatch) -> None:
    errors: dict[str, float | None] = {}
    monkeypatch.setattr(module, "estimated_error", lambda answer: errors.get(answer.model.name))

    def reference(*models: str) -> str:
        return sp.compare_models(WIDE, models=models).reference

    assert (reference("sbt", "rft"), reference("rft", "sbt")) == ("sbt", "rft")  # nobody does: the first asked
    errors["rft"] = 0.01
    assert (reference("sbt", "rft"), reference("rft", "sbt")) == ("rft", "rft")
    errors["sbt"] = 0.5
    assert (reference("sbt", "rft"), reference("rft", "sbt")) == ("rft", "sbt")


def test_differences_are_ratios_to_the_reference_less_one() -> None:
    found = sp.compare_models(WIDE, models=["sbt", "rft"], tail_rate="1.2 Hz")
    sbt, rft = found.predictions["sbt"], found.predictions["rft"]
    for name in QUANTITIES:
        assert found.relative_difference("sbt", name) == 0
        assert found.relative_difference("rft", name) == pytest.approx(getattr(rft, name) / getattr(sbt, name) - 1)
    # Both rates are negative; the slower one is smaller, whatever its sign.
    assert abs(rft.body_rotation_rate) < abs(sbt.body_rotation_rate)
    assert found.relative_difference("rft", "body_rotation_rate") < 0
    entries = {entry["model"]: entry for entry in found.to_dict()["models"]}
    shown = entries["rft"]["relative_difference"]
    assert shown["tail_torque"] == {"value": found.relative_difference("rft", "tail_torque"), "unit": "1"}
    assert shown["motor_residual_torque"]["value"] is None  # no such torque with reading `rotor`
    with pytest.raises(sp.InputError, match="quantity = 'speed'"):
        found.relative_difference("rft", "speed")
    with pytest.raises(sp.InputError, match="model = 'cfd' has no answer here; allowed: sbt, rft"):
        found.relative_difference("cfd", "tail_torque")


def test_warnings_stand_once_and_name_their_models() -> None:
    found = sp.compare_models(WIDE, models=["sbt", "rft"])
    (unset,) = [sentence for sentence in found.warnings if "friction.effective is unset" in sentence]
    assert unset.startswith("friction.effective")
    thick = sp.compare_models(sp.load(WIDE, **{"tail.wire_diameter": "3 mm"}), models=["sbt", "rft"])
    for sentence in thick.warnings:
        holders = [name for name, answer in thick.predictions.items() if sentence in answer.warnings]
        named = [name for name in ("sbt", "rft") if sentence.startswith(f"{name}: ")]
        assert len(holders) == 2 or len(named) == 1


def test_factors_for_some_models_only_are_pointed_out(tmp_path: Any) -> None:
    path = tmp_path / "sbt-only.toml"
    path.write_text(
        '[calibration.sbt]\nbody_drag = 1.5\nsource = "test"\n[calibration.sbt.fitted_to]\n'
        'channel_diameter = "40 mm"\nbody_diameter = "18 mm"\nbody_length = "35 mm"\n'
    )
    uneven = sp.compare_models(WIDE, models=["sbt", "rft"], calibration=path)
    assert any("drag factors are fitted for sbt and not for rft" in sentence for sentence in uneven.warnings)
    even = sp.compare_models(WIDE, models=["sbt", "rft"], calibration=path, calibrated=False)
    assert not any("drag factors are fitted" in sentence for sentence in even.warnings)


def test_a_coupling_that_some_models_leave_out_is_pointed_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def pointed_out(robot: sp.Robot) -> bool:
        found = sp.compare_models(robot, models=["sbt", "rft"], tail_rate=1.0)
        return "the coupling is modelled by rft and not by sbt" in " ".join(found.warnings)

    assert not pointed_out(sp.load(WIDE))
    monkeypatch.setattr(type(SWIMMER_MODELS["rft"]), "parts", ("body", "coupling", "tail"))
    assert pointed_out(sp.load(WIDE))
    assert not pointed_out(sp.load(WIDE, **{"coupling.length": "0 mm"}))


def test_progress_is_told_before_each_model() -> None:
    told: list[tuple[str, int, int]] = []
    sp.compare_models(WIDE, models=["rft", "sbt"], progress=lambda *step: told.append(step))
    assert told == [("model rft", 0, 2), ("model sbt", 1, 2)]


def test_the_trial_stands_beside_the_held_answer_in_the_tube() -> None:
    found = sp.compare_models(WIDE, models=["slender", "tube"]).to_dict()
    slender, tube = found["models"]
    alone = sp.predict(WIDE, band=False)
    assert alone.trial is not None
    assert tube["trial"]["forward_velocity"]["value"] == pytest.approx(alone.trial.values["forward_velocity"], rel=1e-9)
    assert tube["forward_velocity"]["value"] == alone.forward_velocity
    assert "trial" not in slender
    text = [block for block in blocks_of(found) if not isinstance(block, Detail)]
    assert list(text[0].columns[0].cells) == ["slender", "tube", "trial"]
    assert any("contact assumed, not validated" in str(line) for line in text[1:])
