"""The same robot and the same question give the same numbers in every command: held, and the trial."""

from pathlib import Path

import pytest

import spirillum as sp

WIDE = "biorob2012-wide"
MEANS = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate")


def test_the_held_answer(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Of `predict`, `compare-models`, a study by `tube`, a study beside its own models, and the motion of a video."""
    held = sp.predict(WIDE, motion="held")
    compared = sp.compare_models(WIDE, models=["tube"]).predictions["tube"]
    by_tube = sp.study({"robots": [WIDE], "models": ["tube"], "friction": ["rotor"]})
    beside = sp.study({"robots": [WIDE], "models": ["sbt"], "friction": ["rotor"]})
    video = {"trial": {"duration": "0.5 s"}, "camera": {"size": "160x120", "fps": 10}}
    filmed = sp.render(WIDE, tmp_path / "held.mp4", **video)
    assert filmed.to_dict()["motion"] == "held"
    for name in MEANS:
        value = getattr(held, name)
        assert getattr(compared, name) == pytest.approx(value, rel=1e-9)
        assert float(by_tube[name].squeeze()) == pytest.approx(value, rel=1e-9)
        assert float(beside[f"{name}_held"].squeeze()) == pytest.approx(value, rel=1e-9)
        assert filmed.rates[name] == pytest.approx(value, rel=1e-9)


def test_the_trial(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Of `predict`, `compare-models`, `study`, `simulate` and the motion of a video: one run, so equal to 1e-9."""
    trial = sp.predict(WIDE).trial
    compared = sp.compare_models(WIDE, models=["tube"]).predictions["tube"].trial
    study = sp.study({"robots": [WIDE], "models": ["tube"], "friction": ["rotor"], "trial": True})
    run = sp.simulate(WIDE)
    word = Path("trial")  # as the command line has it
    filmed = sp.render(WIDE, tmp_path / "trial.mp4", run=word, camera={"size": "160x120", "fps": 2})
    assert trial is not None
    assert compared is not None
    assert filmed.to_dict()["motion"] == "trial"
    assert filmed.rates["forward_velocity"] == pytest.approx(trial.values["forward_velocity"], rel=1e-9)
    for name in MEANS:
        value = trial.values[name]
        assert compared.values[name] == pytest.approx(value, rel=1e-9)
        assert float(study[f"{name}_trial"].squeeze()) == pytest.approx(value, rel=1e-9)
        assert float(run[f"mean_{name}_on"]) == pytest.approx(value, rel=1e-9)
        assert filmed.rates[name] == pytest.approx(value, rel=0.01)  # angles between frames of the run


def test_a_trial_is_filmed_of_a_robot_in_its_tube(tmp_path) -> None:  # type: ignore[no-untyped-def]
    robot = sp.load(WIDE, channel="none")
    with pytest.raises(sp.InputError, match="no walls to rest on"):
        sp.render(robot, tmp_path / "none.mp4", run="trial")
    with pytest.raises(sp.InputError, match="tail_rate with run = 'trial'"):
        sp.render(WIDE, tmp_path / "none.mp4", run="trial", motion={"tail_rate": "1 Hz"})
