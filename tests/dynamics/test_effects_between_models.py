"""The effects between the models: their ends are the models' own answers, and each is what it says."""

import numpy as np
import pytest
from matplotlib.text import Text

import spirillum as sp
from spirillum.view.figures.comparison import effects_figure


@pytest.fixture(scope="module")
def compared() -> sp.ModelComparison:
    return sp.compare_models("biorob2012-wide", models=["sbt", "slender", "tube"])


def test_the_effects_lead_from_lighthill_to_the_trial(compared: sp.ModelComparison) -> None:
    """Three of the models' answers and the trial stand among them, in that order."""
    speeds = {effect.name: effect.speed for effect in compared.effects}
    answers = compared.predictions
    assert next(iter(speeds)) == "Lighthill's theory"
    assert speeds["Lighthill's theory"] == answers["sbt"].forward_velocity
    assert speeds["interaction of the parts"] == answers["slender"].forward_velocity
    assert speeds["walls"] == answers["tube"].forward_velocity
    trial = answers["tube"].trial
    assert trial is not None
    assert compared.effects[-1].speed == trial.values["forward_velocity"]
    written = compared.to_dict()["effects"]
    assert [item["forward_velocity"]["value"] for item in written] == list(speeds.values())


def test_the_coupling_and_the_walls_slow_it(compared: sp.ModelComparison) -> None:
    speeds = {effect.name: effect.speed for effect in compared.effects}
    assert speeds["coupling"] < speeds["body and wire resolved"] < speeds["Lighthill's theory"]
    assert speeds["walls"] < speeds["interaction of the parts"] < speeds["coupling"]


def test_parts_far_apart_swim_as_if_alone() -> None:
    """Without a coupling's solid and with the tail far behind, the flow between the parts does little."""
    far = {"coupling.diameter": "0 mm", "coupling.length": "300 mm", "channel.length": "1 m"}
    robot = sp.load("biorob2012-wide", **far)
    found = sp.compare_models(robot, models=["sbt", "slender"], tail_rate="1 Hz").effects
    assert [effect.name for effect in found][1:] == ["body and wire resolved", "interaction of the parts"]
    assert found[2].speed == pytest.approx(found[1].speed, rel=0.02)


def test_there_are_none_without_the_models_they_lie_between() -> None:
    comparison = sp.compare_models("biorob2012-wide", models=["rft", "slender"])
    assert comparison.effects == ()
    with pytest.raises(sp.InputError, match="need sbt and slender"):
        effects_figure(comparison)


def test_the_figure_shows_the_speeds(compared: sp.ModelComparison) -> None:
    axes = effects_figure(compared).axes[0]
    factors = [text.get_text().split() for text in axes.texts]
    speeds = [effect.speed for effect in compared.effects]
    assert [float(words[0]) for words in factors] == pytest.approx([1e3 * speed for speed in speeds], rel=5e-3)
    assert [float(words[2]) for words in factors[1:]] == pytest.approx(
        np.divide(speeds[1:], speeds[:-1]).tolist(), abs=5e-3
    )


def test_a_figure_without_a_trial_says_why() -> None:
    figure = effects_figure(sp.compare_models("biorob2012-wide", tail_rate="1.2 Hz"))
    words = " ".join(text.get_text() for text in figure.findobj(Text)).replace("\n", " ")
    assert "No trial: a tail rate is prescribed" in words
