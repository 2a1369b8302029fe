"""`settle`, and `predict` of free motion in the tube: tables, JSON and a picture."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from spirillum.dynamics import free_motion, settling

WIDE = "biorob2012-wide"
QUICK = ("--roughness", "100um", "--set", "friction.effective=1.1e-5 N m s/rad")


@pytest.fixture
def settled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first answer stands for all that follow: to follow the robot takes most of a command's time."""
    settle, answers = settling.settle, []

    def once(*asked: Any, **options: Any) -> Any:
        if not answers:
            answers.append(settle(*asked, **options))
        return answers[0]

    monkeypatch.setattr(settling, "settle", once)


@pytest.mark.usefixtures("settled_once")
def test_tables_and_json_say_the_same(run: Callable[..., Any], tmp_path: Path) -> None:
    picture = tmp_path / "settling.png"
    tables = run("settle", WIDE, *QUICK, "-o", str(picture), "--until", "0.2mm", "--notes")
    assert tables.code == 0
    assert picture.stat().st_size > 10_000
    outcome = run("settle", WIDE, *QUICK, "--until", "0.2mm", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    answer = json.loads(outcome.out)
    assert answer["schema"] == "spirillum.settling/1"
    assert answer["file"] is None
    assert f"model tube: {answer['model_reason']}" in tables.out
    assert answer["steady_state"]["state"] == "steady"
    gap = answer["steady_state"]["gap"]
    assert gap["low"] <= gap["value"] <= gap["high"]
    assert f"{answer['drainage_time']['value']:.4g}" in tables.out
    assert "in transit, as the gap first falls to 0.2 mm" in tables.out
    assert "(mean over a turn of the tail, at least " in tables.out
    assert "found from the run at" in tables.out
    way = answer["trajectory"]
    assert len(way["time"]["value"]) == len(way["gap"]["value"]) <= 400
    assert answer["film"]["gap"]["value"] == pytest.approx([5e-4, 3.976e-4, 3.162e-4, 2.515e-4, 2e-4], rel=1e-3)


@pytest.mark.parametrize("wall", [("--roughness", "100um"), pytest.param((), marks=pytest.mark.slow)])
def test_prediction_says_where_it_lies(run: Callable[..., Any], wall: tuple[str, ...]) -> None:
    """In its own drive, on a rough wall and on the default one of micrometres, which it takes longer to come to."""
    outcome = run("predict", WIDE, "--model", "tube", "--motion", "free", *wall, *QUICK[2:], "--json")
    answer = json.loads(outcome.out)
    assert answer["motion"] == "free"
    assert answer["steady_state"]["state"] == "steady"
    assert 0 < answer["forward_velocity"]["value"] < 4e-4
    assert answer["placement"]["gap"]["value"] == pytest.approx(5e-4)
    said = answer["other_models"]["statement"]
    assert "rft leaves out the coupling and the flow between body and tail" in said
    assert "sbt" not in said  # it knows no free motion


def test_first_line_says_that_no_steady_motion_was_reached(
    run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without an error of numbers that are steady nowhere, and with roughness and friction as they were asked for."""
    monkeypatch.setattr(free_motion, "_MOST_TURNS", 2)
    asked = ("predict", WIDE, "--motion", "free", "--roughness", "50um", "--friction-coefficient", "0")
    tables = run(*asked)
    first = tables.out.partition("\n")[0]
    assert first.startswith("no steady motion was reached: the motion still changes after 1.")
    assert "numerical error" not in tables.out
    assert "times this speed" not in tables.out
    answer = json.loads(run(*asked, "--json").out)
    assert answer["steady_state"]["statement"] == first
    assert answer["error_estimate"]["value"] is None
    assert run("settle", WIDE, *asked[4:]).out.startswith(first)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--motion", "free", "--phases", "3"], "phases = 3 with model 'tube' and motion 'free'"),
        (["--motion", "free", "--accuracy", "high"], "accuracy = 'high' with model 'tube' and motion 'free'"),
        (["--motion", "free", "--band"], "--band with motion 'free' in the tube"),
        (["--motion", "held", "--roughness", "20um"], "roughness = 20um is of released motion in the tube"),
        (["--tail-rate", "1Hz", "--friction-coefficient", "0.2"], "--friction-coefficient = 0.2 is of released"),
    ],
)
def test_what_a_motion_does_not_read_is_refused(run: Callable[..., Any], arguments: list[str], words: str) -> None:
    outcome = run("predict", WIDE, *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--until", "1mm"], "until = 1 mm; allowed: less than 0.5 mm"),
        (["-o", "settling.nc"], "does not end in .png or .pdf or .svg"),
        (["--set", "channel=none"], "there is no [channel]; allowed: a robot with a channel.diameter, because"),
        (["--gap", "15mm"], "placement.gap = 15 mm"),
        (["--friction", "ice"], "friction"),
    ],
)
def test_bad_input_is_one_sentence(run: Callable[..., Any], arguments: list[str], words: str) -> None:
    outcome = run("settle", WIDE, *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert outcome.err.count("\n") == 1
