"""`settle`, and `predict` of free motion in the tube: tables, JSON and a picture."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

WIDE = "biorob2012-wide"
QUICK = ("--roughness", "100um", "--set", "friction.effective=1.1e-5 N m s/rad")


def test_tables_and_json_say_the_same(run: Callable[..., Any], tmp_path: Path) -> None:
    picture = tmp_path / "settling.png"
    tables = run("settle", WIDE, *QUICK, "-o", str(picture), "--until", "0.2mm")
    assert tables.code == 0
    assert picture.stat().st_size > 10_000
    outcome = run("settle", WIDE, *QUICK, "--until", "0.2mm", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    answer = json.loads(outcome.out)
    assert answer["schema"] == "spirillum.settling/1"
    assert answer["file"] is None
    assert answer["lying"]["state"] == "steady"
    gap = answer["lying"]["gap"]
    assert gap["low"] <= gap["value"] <= gap["high"]
    assert f"{answer['drainage_time']['value']:.4g}" in tables.out
    assert "as the gap first falls to 0.2 mm" in tables.out
    assert "laid down there and followed: steady, azimuth" in tables.out
    way = answer["way"]
    assert len(way["time"]["value"]) == len(way["gap"]["value"]) <= 400
    assert answer["film"]["gap"]["value"] == pytest.approx([5e-4, 3.976e-4, 3.162e-4, 2.515e-4, 2e-4], rel=1e-3)


def test_prediction_says_where_it_lies(run: Callable[..., Any]) -> None:
    """In its own drive, on the default wall of micrometres."""
    outcome = run("predict", WIDE, "--model", "tube", "--motion", "free", *QUICK[2:], "--json")
    answer = json.loads(outcome.out)
    assert answer["motion"] == "free"
    assert answer["lying"]["state"] == "steady"
    assert 0 < answer["forward_velocity"]["value"] < 4e-4
    assert answer["placement"]["gap"]["value"] == pytest.approx(5e-4)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--until", "1mm"], "until = 1 mm; allowed: less than 0.5 mm"),
        (["-o", "settling.nc"], "does not end in .png or .pdf or .svg"),
        (["--set", "channel=none"], "channel"),
        (["--gap", "15mm"], "placement.gap = 15 mm"),
        (["--friction", "ice"], "friction"),
    ],
)
def test_bad_input_is_one_sentence(run: Callable[..., Any], arguments: list[str], words: str) -> None:
    outcome = run("settle", WIDE, *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert outcome.err.count("\n") == 1
