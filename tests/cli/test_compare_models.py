"""`compare-models`: one table for people, one document for machines, a picture if asked for."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import spirillum as sp

WIDE = "biorob2012-wide"
TWO = ("--model", "sbt", "--model", "rft")


def test_the_document_holds_every_model_and_nothing_else_is_printed(run: Callable[..., Any], tmp_path: Path) -> None:
    picture = tmp_path / "models.png"
    outcome = run("compare-models", WIDE, *TWO, "--tail-rate", "1.2Hz", "--json", "-o", str(picture))
    assert (outcome.code, outcome.err) == (0, "")
    answer = json.loads(outcome.out)
    assert answer["schema"] == "spirillum.model-comparison/1"
    assert (answer["robot"], answer["reference"], answer["file"]) == (WIDE, "sbt", str(picture))
    assert list(answer)[-1] == "warnings"
    assert picture.read_bytes().startswith(b"\x89PNG")
    for entry in answer["models"]:
        alone = sp.predict(WIDE, model=entry["model"], tail_rate="1.2 Hz", calibrated=False)
        assert entry["forward_velocity"] == {"value": alone.forward_velocity, "unit": "m/s"}
        assert entry["error_estimate"]["statement"] == alone.to_dict()["error_estimate"]["statement"]
    assert [path.name for path in tmp_path.iterdir()] == ["models.png"]


def test_the_table_shows_numbers_differences_and_errors(run: Callable[..., Any], monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    outcome = run("compare-models", WIDE, *TWO, "--tail-rate", "1.2Hz")
    found = sp.compare_models(WIDE, models=["sbt", "rft"], tail_rate="1.2 Hz")
    everything = run("compare-models", WIDE, *TWO, "--tail-rate", "1.2Hz", "--all")
    noted = run("compare-models", WIDE, *TWO, "--tail-rate", "1.2Hz", "--notes")
    (row,) = [line for line in everything.out.splitlines() if line.startswith(" forward velocity, mm/s")]
    for answer in found.predictions.values():
        (own,) = [line for line in outcome.out.splitlines() if line.startswith(f" {answer.model.name} ")]
        assert f"{1e3 * answer.forward_velocity:.4g}" in row
        assert f"{1e3 * answer.forward_velocity:.4g}" in own
        assert f"known error of {answer.model.name}: " in noted.out
    assert f"{100 * found.relative_difference('rft', 'forward_velocity'):+.1f}%" in own
    assert "against sbt" in everything.out
    tables = [line for line in (everything.out + outcome.out).splitlines() if "│" in line or "┃" in line]
    assert max(map(len, tables)) <= 80
    assert "…" not in "".join(tables)
    assert "motor residual torque" not in outcome.out  # no model has one here


def test_a_refusing_model_is_a_line(run: Callable[..., Any]) -> None:
    outcome = run("compare-models", WIDE, *TWO, "--set", "tail.wire_diameter=6 mm")
    assert outcome.code == 0
    (line,) = [line for line in outcome.out.splitlines() if line.startswith("no answer by rft: ")]
    assert "reversing the thrust" in line


def test_options_reach_the_models(run: Callable[..., Any]) -> None:
    arguments = ("--calibrated", "--friction", "none", "--set", "tail.wavelength=20mm", "--json")
    answer = json.loads(run("compare-models", WIDE, *TWO, *arguments).out)
    robot = sp.load(WIDE, **{"tail.wavelength": "20 mm"})
    for entry in answer["models"]:
        alone = sp.predict(robot, model=entry["model"], friction="none")
        assert entry["forward_velocity"]["value"] == alone.forward_velocity
        assert entry["calibrated"] is True


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--model", "cfd"], "model = 'cfd'"),
        (["--tail-rate", "1"], 'tail-rate = "1" has no unit'),
        (["--friction", "ice"], "friction = 'ice'"),
        (["-o", "models.jpg"], "does not end in .png or .pdf or .svg"),
        (["-o", "no/such/folder/models.png"], "no such folder"),
        (["-o", "."], "does not end in"),
        (["--model", "rft", "--set", "tail.wire_diameter=6 mm"], "reversing the thrust"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run("compare-models", WIDE, *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert outcome.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_example_of_the_help_runs(run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    example = re.search(r"Example: spirillum (.*)", run("compare-models", "--help").out)
    assert example
    assert run(*example[1].split(), *TWO).code == 0  # all models answer in docs/commands.md
