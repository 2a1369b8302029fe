"""The columns of a study beside its models: held by `tube`, and trials, as `predict` has them."""

from pathlib import Path

import pytest

import spirillum as sp
from spirillum.cli.tables.studies import study as study_table
from spirillum.errors import InputError
from spirillum.results.study import study_answer
from spirillum.studies.ranking import HELD, TRIAL, ranking_of
from spirillum.view.figures.comparison import ranking_picture

ONE = {"title": "one", "robots": ["biorob2012-wide"], "models": ["sbt"], "friction": ["rotor"]}


def test_a_study_without_walls_shows_what_tube_answers() -> None:
    """Without being asked, and equal to `predict`; its own models keep their answers."""
    found = sp.study(ONE)
    alone = sp.predict("biorob2012-wide", motion="held")
    assert float(found["forward_velocity_held"][0]) == pytest.approx(alone.forward_velocity, rel=1e-9)
    assert float(found["tail_rotation_rate_held"][0]) == pytest.approx(alone.tail_rotation_rate, rel=1e-9)
    assert float(found["error_estimate_held"][0]) == pytest.approx(alone.error_estimate, rel=1e-9)
    assert "forward_velocity_held" not in sp.study({**ONE, "models": ["tube"]})
    assert "trial" not in found


def test_the_answer_with_walls_leads_a_study_of_models_without() -> None:
    """It orders the robots and comes first; the model's own fastest robot is named as its own."""
    grid = {
        "channels": {"wide": "biorob2012-wide"},
        "wavelengths": ["20 mm", "25 mm"],
        "amplitudes": ["2 mm", "3.5 mm"],
    }
    found = sp.study({"models": ["sbt"], "friction": ["rotor"], "grid": grid})
    ranking = ranking_of(found)
    assert [best.quantity for best in ranking.best[:2]] == [HELD, "forward_velocity"]
    assert ranking.robots[0].values[HELD] == found[HELD].values.max()
    assert ranking.message.startswith("fastest at a fixed pose by tube: 25 x 3.5 mm, 0.6631 mm/s")
    own = ranking.best[1]
    assert (own.what, own.robot.name) == ("fastest by sbt, walls not computed", "20 x 2 mm")
    assert ranking_picture(ranking).draw().axes[1].get_xlabel() == "sbt (mm/s)"
    assert ranking_of(found.assign({HELD: found[HELD].transpose()})).message == ranking.message
    lacking = ranking_of(found.assign({HELD: found[HELD].where(found["wavelength"] > 0.021)}))
    assert (lacking.lead, lacking.best[0].what) == ("forward_velocity", "fastest")


def test_trials_of_a_study_are_those_of_predict(tmp_path: Path) -> None:
    """One run each, equal to 1e-9, with its state and its pose; speed of contact that is stated too."""
    contact = {"roughness": "20 um", "friction_coefficient": 0.05}
    found = sp.study({**ONE, "trial": True, "contact": contact})
    alone = sp.predict("biorob2012-wide", roughness="20 um", in_tube={"friction_coefficient": 0.05}).trial
    assert alone is not None
    assert float(found[TRIAL][0]) == pytest.approx(alone.values["forward_velocity"], rel=1e-9)
    assert float(found["error_estimate_trial"][0]) == pytest.approx(alone.error, rel=1e-9)
    assert float(found["gap_trial"][0]) == pytest.approx(alone.values["gap"], rel=1e-9)
    assert found["trial"].attrs["flag_meanings"].split()[int(found["trial"][0])] == "swimming"
    assert "contact assumed, not validated" in str(found.attrs["warnings"])
    assert list(ranking_of(found).quantities)[:3] == [HELD, "forward_velocity", TRIAL]
    assert [best.quantity for best in ranking_of(found).best][:3] == [HELD, TRIAL, "forward_velocity"]
    said = [str(block) for block in study_table(study_answer(found, tmp_path))]
    assert [line.startswith("in the lab: a robot laid in its tube swims as in trial; ") for line in said].count(
        True
    ) == 1


@pytest.mark.slow
def test_intervals_of_a_study_are_those_of_predict(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Median, low and high of 64 runs; a rerun computes nothing anew."""
    found = sp.study(ONE, output=tmp_path / "one", interval=True)
    alone = sp.predict("biorob2012-wide", interval=True).trial
    assert alone is not None
    for end in ("median", "low", "high"):
        expected = getattr(alone.intervals["forward_velocity"], end)
        assert float(found[f"{TRIAL}_{end}"][0]) == pytest.approx(expected, rel=1e-9)


def test_an_interval_is_of_a_trial() -> None:
    """And a trial needs nothing fitted."""
    with pytest.raises(InputError, match="interval without trial"):
        sp.study({**ONE, "interval": True})
    with pytest.raises(InputError, match="trial with a store"):
        sp.study({**ONE, "trial": True}, store="never.zarr")
