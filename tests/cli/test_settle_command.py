"""`settle`: tables, JSON and a picture, at a coarse resolution."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

WIDE = "biorob2012-wide"
QUICK = ("--tail-rate", "1.2Hz", "--gap", "2mm", "--tolerance", "0.05", "--drain", "8mm:2mm", "--gaps", "2")
QUICK += ("--set", "tail.length=25mm", "--phases", "2")  # as in tests/dynamics, whose solutions it then shares


def test_tables_and_json_say_the_same(run: Callable[..., Any], tmp_path: Path) -> None:
    picture = tmp_path / "settling.png"
    tables = run("settle", WIDE, *QUICK, "-o", str(picture))
    assert tables.code == 0
    assert picture.stat().st_size > 10_000
    outcome = run("settle", WIDE, *QUICK, "--json")
    assert (outcome.code, outcome.err) == (0, "")
    answer = json.loads(outcome.out)
    assert answer["schema"] == "spirillum.settling/1"
    assert answer["file"] is None
    assert answer["sideways_force"]["low"] <= answer["sideways_force"]["value"] <= answer["sideways_force"]["high"]
    assert answer["sideways_force"]["kind"] == "band"
    assert f"{1e3 * answer['sideways_force']['value']:.4g}" in tables.out
    assert f"{answer['drainage_time']['value']:.4g}" in tables.out
    assert "at rest on the wall: level" in tables.out
    drainage = answer["drainage"]
    assert drainage["gap"]["value"] == pytest.approx([8e-3, 2e-3])
    assert drainage["time"]["value"][-1] == pytest.approx(answer["drainage_time"]["value"])
    assert drainage["gap_over_time"]["value"][-1] == pytest.approx(2e-3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--drain", "1mm"], "drain = '1mm' is not FROM:TO, for example 1mm:0.2mm"),
        (["--drain", "1mm:2mm"], "drain = 1 mm to 2 mm; allowed"),
        (["--drain", "2mm:1"], 'drain = "1" has no unit'),
        (["--gaps", "1"], "gaps = 1; allowed: 2 to 32"),
        (["-o", "settling.nc"], "does not end in .png or .pdf or .svg"),
        (["--set", "body.mass=1g"], "floats: its submerged weight is"),
        (["--set", "channel=none"], "channel"),
        (["--gap", "15mm"], "placement.gap = 15 mm"),
        (["--friction", "ice"], "friction"),
    ],
)
def test_bad_input_is_one_sentence(run: Callable[..., Any], arguments: list[str], words: str) -> None:
    outcome = run("settle", WIDE, "--tail-rate", "1.2Hz", *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert outcome.err.count("\n") == 1
