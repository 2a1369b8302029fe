"""Cases have one form, and the program's values beside published ones stay where they were recorded."""

import json
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import spirillum as sp
from spirillum.citations import REFERENCES
from spirillum.papers.case import case_names, has_table, load_case, recorded_values, robot_of, trials_of
from spirillum.robot.load import preset_names, preset_text, shipped_robots
from spirillum.schemas import schema_of

ROWS = {
    "case",
    "point",
    "quantity",
    "published",
    "uncertainty",
    "unit",
    "ours",
    "difference",
    "stated_error",
    "low",
    "high",
    "covered",
    "covered_by",
    "assumptions",
    "recorded",
    "as_recorded",
    "computed",
}
CHEAP = [name for name in case_names() if load_case(name).cost == "seconds"]


@pytest.mark.parametrize("name", case_names())
def test_a_case_names_robots_references_and_quantities_that_are_there(name: str) -> None:
    case = load_case(name)
    labels = [point.label for point in case.points]
    assert len(labels) == len(set(labels))
    assert set(case.references) <= set(REFERENCES)
    assert case.source
    assert case.explanation
    for point in case.points:
        robot_of(case, point)
        assert set(point.published) <= set(case.quantities)
        assert set(point.uncertainty) <= set(point.published)
        assert {point.over, point.minus} - {""} <= set(labels)
    for assumption in case.assumptions:
        changes = (assumption.set, assumption.scale, assumption.placement, assumption.run)
        assert any(changes)
        for values in (values for change in changes for values in change.values()):
            assert len(values) == len(assumption.values)
    for point in case.points:
        nominal = robot_of(case, point)
        for trial in trials_of(case, point):
            assert trial.placement or trial.run or robot_of(case, point, trial) != nominal
    assert {(point.label, quantity) for point, quantity in case.rows()} == {
        (label, quantity) for label, values in recorded_values(name).items() for quantity in values
    }


def test_robots_that_are_released_have_tables_in_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPIRILLUM_CACHE", "off")
    cases = [load_case(name) for name in case_names()]
    released = [(case, point) for case in cases for point in case.points if point.run]
    assert released
    assert all(has_table(case, point) for case, point in released)


@pytest.mark.parametrize("name", CHEAP)
def test_cheap_cases_are_as_recorded(name: str) -> None:
    assert not sp.validate([name]).outside


@pytest.mark.parametrize(("name", "off"), [("rodenborn2013", 0.12), ("purcell1997", 0.35)])
def test_forces_on_helices_are_those_that_were_measured(name: str, off: float) -> None:
    """Every row within what `docs/validation.md` says of it; half of them within a tenth."""
    ratios = np.array([row.ours / row.published for row in sp.validate([name]).rows])
    assert np.max(np.abs(ratios - 1.0)) < off
    assert np.median(np.abs(ratios - 1.0)) < 0.1


@pytest.mark.slow
def test_all_cases_are_as_recorded(tmp_path: Path) -> None:
    found = sp.validate(output=tmp_path / "report")
    assert not found.outside
    assert all(row.computed for row in found.rows)
    assert {case.name for case in found.cases} == set(case_names())
    written = json.loads((tmp_path / "report" / "validation.json").read_text("utf-8"))
    assert len(written["rows"]) == len(found.rows)
    html = (tmp_path / "report" / "report.html").read_text("utf-8")
    assert "Released motion is not validated against an experiment." in html


def test_command_prints_rows_in_si_and_writes_a_report(run: Any, tmp_path: Path) -> None:
    outcome = run("validate", "rodenborn2013", "--json", "-o", str(tmp_path / "report"))
    assert outcome.code == 0
    answer = json.loads(outcome.out)
    assert answer["schema"] == "spirillum.validation/1"
    assert {frozenset(row) for row in answer["rows"]} == {frozenset(ROWS)}
    for row in answer["rows"]:
        assert row["difference"] == pytest.approx(row["ours"] / row["published"] - 1.0)
        assert row["low"] <= row["ours"] <= row["high"]
    assert (tmp_path / "report" / "report.html").is_file()
    assert (tmp_path / "report" / "figures" / "rodenborn2013.png").is_file()


def test_a_row_that_leaves_its_recorded_range_is_exit_code_1(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    label = "wavelength 2.226 radii"
    recorded = recorded_values("rodenborn2013")
    moved = {**recorded, label: {**recorded[label], "thrust": 9.0}}
    monkeypatch.setattr("spirillum.papers.validation.recorded_values", lambda _name: moved)
    outcome = run("validate", "rodenborn2013")
    assert outcome.code == 1
    assert "left its recorded range: rodenborn2013, wavelength 2.226 radii, thrust" in outcome.out


def test_an_unknown_case_is_a_sentence(run: Any) -> None:
    outcome = run("validate", "rodenborn2012")
    assert outcome.code == 2
    assert "unknown case 'rodenborn2012' (did you mean rodenborn2013?); allowed: bacteria" in outcome.err


@pytest.mark.parametrize("name", sorted(set(shipped_robots()) - set(preset_names())))
def test_each_robot_file_is_a_starting_point(name: str, run: Any, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    assert run("robot", "new", str(path), "--from", name).code == 0
    assert sp.load(path).name == "mine"
    assert sp.load(path).model_copy(update={"name": name}) == sp.load(name)
    assert preset_text(name).startswith("#")


def test_robots_of_papers_follow_the_schema() -> None:
    checker = jsonschema.Draft202012Validator(schema_of("robot"))
    for name in shipped_robots():
        checker.validate(tomllib.loads(preset_text(name)))
