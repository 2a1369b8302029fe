"""The ranking of a study: the fastest first, bands at the same places, units that fit the robots."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.notes import notes_in
from spirillum.results.study import robot_picture, write_report
from spirillum.studies.ranking import HELD, TRIAL, best_in_words, ranking_of

GRID = {
    "models": ["rft", "sbt"],
    "friction": ["none", "rotor"],
    "grid": {
        "wavelengths": ["10 mm", "25 mm"],
        "amplitudes": ["1.5 mm", "3.5 mm"],
        "channels": {"wide": "biorob2012-wide", "narrow": "biorob2012-narrow"},
    },
}


def models_alone(study: dict[str, Any]) -> xr.Dataset:
    """Return a study without what `tube` answers beside its models."""
    return sp.study(study).drop_vars(HELD)


def test_ranking_is_that_of_the_dataset_with_one_model_and_the_robots_own_reading() -> None:
    dataset = models_alone(GRID)
    found = ranking_of(dataset)
    assert (found.model, found.friction, found.walls, found.kind) == ("rft", "rotor", True, "")
    speeds = [robot.values["forward_velocity"] for robot in found.robots]
    own = dataset["forward_velocity"].sel(model="rft", friction="rotor").values.ravel()
    assert speeds == sorted(own[np.isfinite(own)], reverse=True)
    assert found.robots[0].name in ("wide, 10 x 1.5 mm", "wide, 25 x 1.5 mm", "wide, 25 x 3.5 mm")
    best = {item.what: item.robot for item in found.best}
    assert best["fastest"] is found.robots[0]
    name = "hydrodynamic_efficiency"
    assert best["most efficient"].values[name] == max(robot.values[name] for robot in found.robots)
    assert best["least current"].values["motor_current"] == min(r.values["motor_current"] for r in found.robots)


def test_band_counts_the_places_at_which_the_fastest_is_the_fastest() -> None:
    dataset = models_alone(GRID)
    shape = dataset["forward_velocity"].shape
    names = ("forward_velocity", "hydrodynamic_efficiency")
    factors = np.array([0.5, 1.0, 2.0])  # of robots at three places: alike for all but the last one
    for name in names:
        there = dataset[name].values[..., None] * factors
        there.reshape(-1, *shape[-2:], 3)[-1, ..., 2] *= 1e3
        dataset[f"{name}_at_place"] = ((*dataset[name].dims, "place"), there)
        dataset[f"{name}_low"], dataset[f"{name}_high"] = 0.5 * dataset[name], 2.0 * dataset[name]
    found = ranking_of(dataset)
    fastest = found.best[0]
    assert (found.kind, fastest.places, fastest.of_places) == ("band", 3, 4)  # the reference place is one
    assert found.robots[0].low["forward_velocity"] == pytest.approx(0.5 * found.robots[0].values["forward_velocity"])
    assert "(" in found.message
    words = best_in_words(fastest.to_dict(), "1 mm/s")
    assert words.startswith(f"fastest: {fastest.robot.name}, 1 mm/s, ")
    assert words.endswith(", at 3 of 4 poses")
    for name in (*names, *(f"{name}_at_place" for name in names)):  # a robot without any answer takes no place away
        dataset[name][{"wavelength": 0, "amplitude": 0}] = np.nan
    assert ranking_of(dataset).best[0].of_places == 4


@pytest.mark.usefixtures("unplaced")
def test_report_starts_with_the_ranking(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its other figures have tests of their own."""
    monkeypatch.setattr("spirillum.results.study.figures_of", lambda _: {})
    monkeypatch.setattr("spirillum.results.study.robot_picture", lambda *_: None)
    dataset = sp.study(GRID)
    found = ranking_of(dataset)
    write_report(dataset, tmp_path, lambda *_: None)
    rows = list(csv.DictReader((tmp_path / "ranking.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["rank"] for row in rows] == [str(n + 1) for n in range(len(found.robots))]
    assert float(rows[0]["forward_velocity_m_s"]) == found.robots[0].values["forward_velocity"]
    assert rows[0]["forward_velocity_high_m_s"] == ""
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.index('id="ranking"') < page.index('id="figures"') < page.index('id="settings"')
    assert (tmp_path / "figures" / "ranking.png").stat().st_size > 5_000


def test_the_fastest_robot_is_drawn() -> None:
    dataset = sp.study(GRID)
    ranking = ranking_of(dataset)
    place = np.unravel_index(ranking.robots[0].place, (2, 2, 2))
    picture = robot_picture(dataset, ranking)
    assert picture is not None
    assert ranking.robots[0].name in picture.caption
    at = dict(zip(("channel", "wavelength", "amplitude"), place, strict=True))
    wanted = dataset.isel(at)
    for words in (f"{1e3 * float(wanted[name]):g} mm" for name in ("wavelength", "amplitude", "channel_diameter")):
        assert words in picture.alternative


def test_a_motor_that_turns_the_other_way_draws_no_less_current() -> None:
    twins = {"vary": {"tail.handedness": ["left", "right"]}}
    found = ranking_of(sp.study({"models": ["sbt"], "friction": ["rotor"], "robots": ["biorob2012-wide"], **twins}))
    first, second = (robot.values["motor_current"] for robot in found.robots)
    assert first == pytest.approx(second, rel=1e-9) == pytest.approx(abs(first))
    (least,) = (item for item in found.best if item.what == "least current")
    assert least.alike


def test_robots_of_a_study_are_named_by_what_differs() -> None:
    bodies = [{"shape": "capsule", "length": "35 mm", "diameter": size} for size in ("16 mm", "18 mm")]
    study = {"models": ["rft"], "friction": ["none"], "robots": ["biorob2012-wide"]}
    tables = sp.study(study | {"vary": {"body": bodies}})
    assert tables.robot.values.tolist() == ["diameter 16 mm", "diameter 18 mm"]
    lengths = {"body.length": ["30 mm", "35 mm"], "tail.length": ["60 mm"]}
    both = sp.study(study | {"vary": lengths})
    assert both.robot.values.tolist() == [f"body length {size} mm, tail length 60 mm" for size in (30, 35)]
    tails = {"tail.wavelength": ["20 mm", "2.5 cm"], "fluid.viscosity": ["1 Pa s"], "tail.amplitude": ["2 mm"]}
    named = sp.study(study | {"vary": tails}).robot.values.tolist()
    assert named == ["20 x 2 mm, viscosity 1 Pa s", "wavelength 2.5 cm, viscosity 1 Pa s, amplitude 2 mm"]


def test_a_lead_within_the_models_error_is_said_to_be_so() -> None:
    study = {"models": ["sbt"], "robots": ["biorob2012-wide"], "friction": ["rotor"]}
    near, far = (
        ranking_of(models_alone(study | {"vary": {"tail.amplitude": sizes}})).best[0].to_dict()
        for sizes in (["2 mm", "2.5 mm"], ["0.5 mm", "2.5 mm"])
    )
    assert near["lead"]["value"] < 0.31 < far["lead"]["value"]
    assert near["model_error"]["value"] == pytest.approx(0.31)
    assert "within the model's error of 31 %" in best_in_words(near)
    assert "within" not in best_in_words(far)
    assert "the model's error is 31 %" in best_in_words(far)


def test_one_robot_alone_is_not_said_to_be_like_the_others() -> None:
    found = ranking_of(sp.study({"models": ["sbt"], "friction": ["none"], "robots": ["ecoli"]}))
    assert not any(item.alike for item in found.best)


def test_robots_without_a_motor_are_ranked_by_power_and_equal_ones_are_called_so() -> None:
    twins = {"vary": {"fluid.density": ["985 kg/m^3", "990 kg/m^3"]}}  # which decides no speed without weight
    found = ranking_of(sp.study({"models": ["sbt"], "friction": ["none"], "robots": ["ecoli"], **twins}))
    assert [item.what for item in found.best] == ["fastest", "most efficient", "least power"]
    assert all(item.alike for item in found.best)
    assert "um/s, no difference that counts" in found.message
    assert found.walls is False


def test_robots_that_rounding_alone_tells_apart_are_named_together() -> None:
    """Efficiency at a given rate does not know the viscosity: neither oil is the better one."""
    study = {
        "robots": ["biorob2012-wide"],
        "models": ["rft"],
        "friction": ["none"],
        "vary": {"tail.amplitude": ["2 mm", "3 mm"], "fluid.viscosity": ["1 Pa s", "2 Pa s"]},
    }
    ranking = ranking_of(sp.study(study))
    efficient = next(best for best in ranking.best if best.quantity == "hydrodynamic_efficiency")
    assert {efficient.robot.name, *efficient.ties} == {f"amplitude 3 mm, viscosity {mu} Pa s" for mu in (1, 2)}
    assert f"no better than {efficient.ties[0]}" in best_in_words(efficient.to_dict())
    fastest = next(best for best in ranking.best if best.quantity == "forward_velocity")
    assert fastest.ties == ()
    assert "ties" not in fastest.to_dict()


def test_the_order_of_a_datasets_dimensions_changes_no_ranking() -> None:
    dataset = sp.study(GRID)
    shape = (*dataset["forward_velocity"].shape, 3)
    dataset["forward_velocity_at_place"] = (
        (*dataset["forward_velocity"].dims, "place"),
        np.random.default_rng(1).random(shape),
    )
    turned = dataset.transpose("amplitude", "place", "wavelength", "channel", ...)
    assert repr(ranking_of(turned)) == repr(ranking_of(dataset))
    assert str(turned).splitlines()[:8] == str(dataset).splitlines()[:8]


@pytest.mark.parametrize(
    "changed",
    [
        lambda study: study.isel(model=[0, 0]),
        lambda study: study.isel(model=slice(0, 0)),
        lambda study: study.drop_vars("model"),
        lambda study: study.stack(tail=("wavelength", "amplitude")),
        lambda study: xr.concat([study, study], dim="again"),
        lambda study: study.assign(forward_velocity=np.nan * study["forward_velocity"]),
    ],
)
def test_a_study_that_was_changed_prints_what_it_can(changed: Callable[[xr.Dataset], xr.Dataset]) -> None:
    assert str(changed(sp.study({**GRID, "models": ["rft"]})))


def test_a_ranking_of_robots_held_in_a_tube_says_so() -> None:
    held = ranking_of(sp.study({"robots": ["biorob2012-wide"], "models": ["tube"]}))
    assert held.held
    assert held.message.startswith("fastest at a fixed pose: biorob2012-wide, 0.5349 mm/s")
    assert best_in_words(held.best[0].to_dict(), held=held.held).startswith("fastest at a fixed pose: biorob2012-wide")
    assert not ranking_of(sp.study({"robots": ["biorob2012-wide"], "models": ["rft"]})).held


def test_a_caution_of_several_robots_counts_them(tmp_path: Path) -> None:
    light = [tmp_path / f"light-{mass}.toml" for mass in (5, 6)]
    for mass, path in zip((5, 6), light, strict=True):
        path.write_text(f'extends = "biorob2012-wide"\nname = "{path.stem}"\n[body]\nmass = "{mass} g"\n')
    study = sp.study({"models": ["sbt"], "friction": ["rotor"], "robots": [*map(str, light), "biorob2012-wide"]})
    (note,) = (note for note in notes_in(study.attrs) if note.code == "robot-floats")
    assert note.startswith("2 of 3 robots, the first: the robot floats")


def test_a_lead_in_a_trial_stands_beside_its_error_or_says_that_none_is_stated() -> None:
    best = {"what": "fastest in a trial", "quantity": TRIAL, "robot": "a", "alike": False, "robots": 2, "of_robots": 2}
    best["lead"] = {"value": 0.035}
    assert best_in_words(best).endswith("3.5 % behind (no error is stated: contact assumed, not validated)")
    best |= {"model_error": {"value": 0.01}, "within_error": []}
    assert best_in_words(best).endswith("3.5 % behind, the model's error is 1 %")
