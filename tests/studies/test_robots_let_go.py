"""Robots of a study that are released answer as each does alone, and order the ranking."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.free_motion import free_motion
from spirillum.errors import InputError
from spirillum.results.study_content import ranking_content
from spirillum.robot.placement import Placement
from spirillum.studies.ranking import STEADY_SPEED, StudyRanking, best_in_words, ranking_of
from spirillum.studies.released_robots import SETTLED_STATES, SettledTask, not_settled
from spirillum.studies.spec import Contact
from spirillum.view.figures.comparison import ranking_picture

LET = {
    "models": ["tube"],
    "friction": ["rotor"],
    "settled": True,
    "contact": {"roughness": "20 um", "friction_coefficient": 0.0},
    "grid": {
        "channels": {"wide": "biorob2012-wide"},
        "wavelengths": ["20 mm"],
        "amplitudes": ["2.5 mm"],
    },
}


@pytest.fixture(scope="module")
def let_go():
    return sp.study(LET)


def test_its_steady_motion_is_slower_than_held_and_beside_the_floor(let_go) -> None:
    here = let_go.squeeze()
    assert SETTLED_STATES[int(here["settled"])] == "steady"
    assert 0.0 < float(here["forward_velocity_settled"]) < float(here["forward_velocity"])
    assert 0.0 < float(here["gap_settled"]) < 2e-5  # on its asperities
    assert 0.0 < float(here["approach_time_settled"]) < 1e3
    assert here["forward_velocity_settled"].attrs["units"] == "m/s"


@pytest.mark.slow
def test_each_robot_answers_as_alone(let_go) -> None:
    here = let_go.squeeze()
    robot = sp.load("biorob2012-wide", **{"tail.wavelength": "20 mm"})
    alone = free_motion(robot, roughness="20 um", in_tube={"friction_coefficient": 0.0}).prediction
    for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_current"):
        assert float(here[f"{name}_settled"]) == pytest.approx(getattr(alone, name), rel=1e-9)
    assert float(here["gap_settled"]) == pytest.approx(alone.steady_state.gap, rel=1e-9)
    assert SETTLED_STATES[int(here["settled"])] == alone.steady_state.state


def test_robots_without_a_table_are_told_and_left_out(let_go) -> None:
    grid = {**LET["grid"], "amplitudes": ["2.6 mm"]}
    without = sp.study({**LET, "models": ["rft"], "grid": grid})
    assert "forward_velocity_settled" not in without
    assert "1 of 1 robots have no table with yawed poses and were not released" in without.attrs["warnings"]
    assert "have no table" not in let_go.attrs["warnings"]
    assert "robots are held at a pose" not in let_go.attrs["warnings"]
    assert "assume asperities of 20 um and a friction coefficient of 0" in let_go.attrs["warnings"]


def ranked(*speeds: float, error: float = np.nan) -> StudyRanking:
    """Three held tails, with these speeds of steady motions as if they had been released, and their stated error."""
    grid = {**LET["grid"], "wavelengths": ["15 mm", "20 mm", "25 mm"]}
    held = sp.study({**LET, "grid": grid, "settled": False})
    values = np.reshape(speeds, (1, 3, 1))
    columns = {"forward_velocity_settled": values, "error_estimate_settled": np.full((1, 3, 1), error)}
    return ranking_of(held.assign({name: (("channel", "wavelength", "amplitude"), of) for name, of in columns.items()}))


def test_a_lead_below_the_errors_of_both_robots_is_said_and_drawn() -> None:
    """Each robot's table has an error of its own: the lead of one on another counts beyond the sum of both."""
    close = ranked(2.97e-4, 1e-4, 3e-4, error=0.008)
    words = "the next is 1 % behind, within the model's error of 1.6 %"
    assert close.message == f"fastest once settled: 25 x 2.5 mm, 0.3 mm/s, {words}"
    assert close.best[0].within == ("15 x 2.5 mm",)
    assert words in ranking_picture(close).title
    near, drawn = ranking_picture(close).draw().axes[0].lines, {}
    for line in near:
        if line.get_marker() == "o":
            drawn[tuple(line.get_ydata())] = line.get_markerfacecolor()
    assert len(set(drawn.values())) == len(drawn) == 3  # the best, one that is not told from it, the last
    far = ranked(2.9e-4, 1e-4, 3e-4, error=0.008)
    assert far.message.endswith("the next is 3.3 % behind, the model's error is 1.6 %")
    assert far.best[0].within == ()
    several = ranked(2.96e-4, 2.98e-4, 3e-4, error=0.008)
    assert several.message.endswith("within the model's error of 1.6 %, as 1 other is")


def test_ranking_orders_by_the_speed_when_let_go() -> None:
    ranking = ranked(2e-4, 1e-4, 3e-4)
    assert [robot.name for robot in ranking.robots] == ["25 x 2.5 mm", "15 x 2.5 mm", "20 x 2.5 mm"]
    assert ranking.message == "fastest once settled: 25 x 2.5 mm, 0.3 mm/s, the next is 33 % behind"
    first = ranking.to_dict()["best"][0]
    assert (first["what"], first["robot"]) == ("fastest once settled", "25 x 2.5 mm")
    assert "Fastest once settled" in ranking_picture(ranking).title
    slow = ranked(8e-5, 6e-5, 9e-5)  # in the unit of the held speeds beside it
    assert slow.message.startswith("fastest once settled: 25 x 2.5 mm, 0.09 mm/s, ")
    assert ranking_content(slow)["best"][0].startswith("fastest once settled: 25 x 2.5 mm, 0.09 mm/s, ")


def test_robots_that_were_not_let_go_come_last_the_faster_held_one_first() -> None:
    ranking = ranked(np.nan, 1e-4, np.nan)
    assert ranking.robots[0].name == "20 x 2.5 mm"
    held = [robot.values["forward_velocity"] for robot in ranking.robots[1:]]
    assert held[0] > held[1]
    assert all(np.isnan(robot.values[STEADY_SPEED]) for robot in ranking.robots[1:])
    said = best_in_words(ranking.best[0].to_dict())
    assert said.startswith("fastest once settled: 20 x 2.5 mm, among 1 of 3 robots")


def test_what_cannot_be_followed_is_no_number() -> None:
    robot = sp.load("biorob2012-wide")
    task = SettledTask(np.array([0]), robot, Placement.of({"gap": "30 mm"}), Contact())
    part = task.answer(None, None)
    assert set(part) == task.needed
    assert np.isnan(part["forward_velocity"]).all()
    (said,) = not_settled([(task, part)])
    assert "1 of 1 robots have no steady motion" in said


@pytest.mark.parametrize("given", ["calibration", "posterior"])
def test_nothing_fitted_goes_with_it(given: str, tmp_path) -> None:
    with pytest.raises(InputError, match="settled together with a calibration or posterior"):
        sp.study(LET, **{given: tmp_path / "a.toml"})
    with pytest.raises(InputError, match="settled with a store"):
        sp.study(LET, store=tmp_path / "a.zarr")


def test_robots_that_are_not_let_go_are_told_by_what_they_lack() -> None:
    """A table, or room at the initial pose; then no basis of settled speeds is given."""
    grid = {**LET["grid"], "amplitudes": ["2.4 mm", "9.3 mm"]}
    said = sp.study({**LET, "models": ["rft"], "grid": grid}).attrs["warnings"]
    assert "1 of 2 robots have no table with yawed poses and were not released, the first: " in said
    assert "1 of 2 robots do not fit at the initial pose and were not released, the first: " in said
    assert "settled speeds assume" not in said


def test_asperities_that_would_carry_more_than_the_weight_are_refused() -> None:
    with pytest.raises(InputError, match=r"contact\.roughness = 1200 um with a gap of 500 um"):
        sp.study({**LET, "contact": {"roughness": "1.2 mm"}})
