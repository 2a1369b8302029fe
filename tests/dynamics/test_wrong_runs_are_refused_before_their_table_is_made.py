"""A table takes minutes: whatever is wrong in a run is said before one is made, and a written run is never lost."""

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import spirillum as sp
from spirillum.cli.app import app
from spirillum.dynamics import tube_simulation
from spirillum.errors import InputError
from spirillum.swimming import preparation

ODD = {"channel.diameter": "39.5 mm"}  # of which no table is there


@pytest.fixture(autouse=True)
def no_table(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def made(*_: Any, **__: Any) -> Any:
        raise AssertionError("a table would be made")

    monkeypatch.setattr(tube_simulation, "table_for", made)
    monkeypatch.setenv("SPIRILLUM_CACHE", str(tmp_path))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"timing": {"duration": "1 s", "on": [b"ab"]}}, "on = .*allowed: pairs of start and stop"),
        ({"timing": {"duration": "bad"}}, 'duration = "bad" is not a time'),
        ({"timing": {"duration": "-1 s"}}, 'duration = "-1 s" is out of range'),
        ({"timing": {"turns": 0.0}}, "turns = 0.0; allowed"),
        ({"timing": {"turns": float("nan"), "duration": "1 s"}}, "turns = nan; allowed"),
        ({"timing": {"samples_per_turn": 0}}, "samples_per_turn = 0; allowed"),
        ({"timing": {"on": [("1 s", "0 s")]}}, "on = 1 s to 0 s; allowed"),
        ({"timing": {"duty": "nowhere.csv"}}, "nowhere.csv does not exist"),
        ({"friction": "bad"}, "friction = 'bad'; allowed"),
        ({"draws": 3}, "draws = 3; allowed"),
        ({"roughness": "-1 um"}, 'roughness = "-1 um" is out of range'),
        ({"roughness": "10 mm"}, "roughness = 1e.04 um with a gap of 500 um at the start"),
        ({"placement": {"gap": "15 mm"}}, "placement.gap = 15 mm; allowed: at most 10.75 mm"),
        ({"in_tube": {"flow": "nowhere.csv"}}, "nowhere.csv does not exist"),
    ],
    ids=str,
)
def test_wrong_input_costs_no_table(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        sp.simulate(sp.load("biorob2012-wide", **ODD), model="tube", **wrong)


def test_gap_above_the_start_is_refused_before_a_table_is_made() -> None:
    robot = sp.load("biorob2012-wide", **ODD)
    with pytest.raises(InputError, match="until = 5 mm; allowed: less than 1 mm, the gap at the start"):
        sp.settle(robot, until="5 mm", placement={"gap": "1 mm"})


def test_table_that_could_not_be_kept_is_not_made(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(preparation, "prepared_tables", tube_simulation.table_for)
    (tmp_path / "file").touch()
    monkeypatch.setenv("SPIRILLUM_CACHE", str(tmp_path / "file"))
    with pytest.raises(InputError, match=r"SPIRILLUM_CACHE = .*file' cannot be written to; allowed: a folder"):
        sp.prepare(sp.load("biorob2012-wide", **ODD))
    monkeypatch.setenv("SPIRILLUM_CACHE", "off")
    with pytest.raises(
        InputError, match=r"a table would be lost .* SPIRILLUM_CACHE is off .*; allowed: SPIRILLUM_CACHE ="
    ):
        sp.prepare(sp.load("biorob2012-wide", **ODD))


def test_thin_gap_is_no_reason_against_a_table() -> None:
    """A table knows films that are too thin to be resolved directly."""
    with pytest.raises(AssertionError, match="a table would be made"):
        sp.simulate(sp.load("biorob2012-wide", **ODD), model="tube", placement={"gap": "0.03 mm"})


def test_least_gap_that_is_resolved_directly_is_told() -> None:
    robot = sp.load("biorob2012-wide", **ODD)
    with pytest.raises(InputError, match=r"here at least placement.gap = .* mm, or a table") as refused:
        sp.predict(robot, model="tube", placement={"gap": "0.02 mm", "pitch": 0.0})
    told = float(str(refused.value).split("placement.gap = ")[-1].split(" mm")[0])
    assert 0.02 < told < 0.5
    from spirillum.robot.placement import Placement
    from spirillum.swimming.preparation import prepared

    prepared(robot, "tube", placement=Placement.of({"gap": 1.001e-3 * told}))  # is not refused
    with pytest.raises(InputError, match="unknowns"):
        prepared(robot, "tube", placement=Placement.of({"gap": 0.97e-3 * told}))


@pytest.mark.usefixtures("unplaced")
def test_run_whose_picture_cannot_be_written_is_refused_before_it(tmp_path: Path) -> None:
    run, lost = tmp_path / "run.nc", "/proc/run.png"
    arguments = ["simulate", "biorob2012-wide", "--motion", "held", "--turns", "0.1", "-o", str(run), "--plot", lost]
    found = CliRunner().invoke(app, arguments)
    assert found.exit_code != 0
    assert not run.exists()
    assert "/proc/run.png cannot be written" in str(found.exception)


@pytest.mark.parametrize("given", ["robot", "resolution"])
def test_a_table_that_has_to_be_there_is_not_made(monkeypatch: pytest.MonkeyPatch, given: str) -> None:
    """Every function that would make one first says how it is made instead; where it is, it answers."""

    def made(*_: Any, **__: Any) -> Any:
        raise AssertionError("a table would be made")

    monkeypatch.setattr(tube_simulation, "table_for", preparation.table_for)
    monkeypatch.setattr(preparation, "prepared_tables", made)
    monkeypatch.setattr("spirillum.studies.run.prepared_tables", made)
    own = {"model.tube.form": "table"} if given == "robot" else {}
    form = {} if own else {"resolution": {"form": "table"}}
    odd = sp.load("biorob2012-wide", **ODD, **own)
    calls = [lambda: sp.simulate(odd, **form), lambda: sp.predict(odd, motion="free", **form)]
    if own:
        study = {"robots": ["biorob2012-wide"], "models": ["auto"]}
        calls += [lambda: sp.settle(odd), lambda: sp.Plant(odd), lambda: sp.study(study, overrides={**ODD, **own})]
    for call in calls:
        with pytest.raises(InputError, match=r"form = 'table': .*no table of .*`spirillum prepare`"):
            call()
    monkeypatch.undo()
    short = {"timing": {"duration": "0.1 s"}, "in_tube": {"wait": "0 s"}}
    assert sp.simulate(sp.load("biorob2012-wide", **own), **short, **form).attrs["model"] == "tube"
