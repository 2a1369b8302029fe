"""`flow`: a picture, numbers on grids, a summary; with a sphere's exact flow in place of the robot's."""

import json
import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

WIDE = "biorob2012-wide"
QUICK = ("--model", "slender", "--tail-rate", "1.2Hz")
PLANE = (*QUICK, "--resolution", "30")
BOX = (*QUICK, "--volume-resolution", "20")
SMALL = (*PLANE, "--volume-resolution", "20")


@pytest.fixture(autouse=True)
def _quick(sphere: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A model in closed form for the motion, and a sphere for the flow."""
    import spirillum.fields.flow as module
    from spirillum.fluid.tube.tube import Tube
    from spirillum.robot.placement import Placement
    from spirillum.swimming.prediction import predict_steady
    from spirillum.swimming.preparation import prepared

    def quick(robot: Any, **options: Any) -> Any:
        known = {"model": "sbt", "resolution": None}
        if options["model"] != "tube":
            return predict_steady(robot, **{**options, **known})
        placed = prepared(
            robot, "tube", placement=Placement.of(options["placement"]), resolution=options["resolution"]
        )[2]
        found = predict_steady(robot, **{**options, **known, "placement": None})
        return replace(found, model=Tube(), batch=placed)

    monkeypatch.setattr(module, "predict_steady", quick)
    monkeypatch.setattr(module, "tube_flow_field", lambda *_: sphere)
    monkeypatch.setattr(module, "flow_field", lambda *_: sphere)


def test_summary_agrees_with_the_files(run: Callable[..., Any], tmp_path: Path) -> None:
    plane, box = tmp_path / "plane.nc", tmp_path / "box.nc"
    outcome = run("flow", WIDE, *SMALL, "-o", str(plane), "--volume", str(box), "--phase", "90deg", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    answer = json.loads(outcome.out)
    assert answer["schema"] == "spirillum.flow/1"
    assert answer["frame"] == "lab"
    assert answer["phase"] == {"value": pytest.approx(np.pi / 2), "unit": "rad"}
    assert any("wall effects are not modelled" in warning for warning in answer["warnings"])
    assert [item["file"] for item in answer["files"]] == [str(plane), str(box)]
    for item in answer["files"]:
        with xr.open_dataset(item["file"]) as stored:
            speed = np.sqrt(sum(stored[f"velocity_{axis}"] ** 2 for axis in "xyz"))
            assert item["largest_speed"]["value"] == float(speed.max())
            at = dict(zip("xyz", item["largest_speed"]["at"]["value"], strict=True))
            place = {axis: at[axis] for axis in stored["inside"].dims}
            assert float(speed.sel(place)) == float(speed.max())
            assert item["lowest_pressure"]["value"] == float(stored["pressure"].min())
            assert item["highest_pressure"]["value"] == float(stored["pressure"].max())
            assert item["grid"]["points"] == dict(stored["inside"].sizes)
            assert item["points_inside"] == int(stored["inside"].sum())
            assert stored.attrs["phase"] == pytest.approx(np.pi / 2)
    first, second = answer["files"]
    assert first["flow_rate_through_plane"]["direction"] == "+y"
    assert "flow_rate_through_plane" not in second


VECTORS = [pytest.param(name, marks=pytest.mark.slow) for name in ("flow.pdf", "flow.svg")]


@pytest.mark.usefixtures("unplaced")
@pytest.mark.parametrize("name", ["flow.png", "flow.nc", *VECTORS])
def test_every_kind_of_plane_is_written(run: Callable[..., Any], tmp_path: Path, name: str) -> None:
    arguments = ("--plane", "yz", "--offset", "-50mm", "--extent", "10mm", "--frame", "body")
    outcome = run("flow", WIDE, *PLANE, *arguments, "-o", str(tmp_path / name))
    assert outcome.code == 0
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert "plane yz, 30 x 30 points" in " ".join(outcome.out.split())
    assert "largest speed" in outcome.out


@pytest.mark.parametrize("name", ["flow.vti", "flow.nc"])
def test_a_box_alone_is_written(run: Callable[..., Any], tmp_path: Path, name: str) -> None:
    outcome = run("flow", WIDE, *BOX, "--volume", str(tmp_path / name))
    assert outcome.code == 0
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert "box, 20 x 9 x 9 points" in " ".join(outcome.out.split())  # a long path wraps the title


def test_in_the_tube(run: Callable[..., Any], tmp_path: Path) -> None:
    """The placement goes into the answer, and what is said of unbounded fluid is gone."""
    files = ("-o", str(tmp_path / "plane.nc"), "--volume", str(tmp_path / "box.vti"))
    place = ("--model", "tube", "--gap", "1mm", "--pitch", "0deg", "--ends", "closed", "--tolerance", "0.05")
    answer = json.loads(run("flow", WIDE, *SMALL[2:], *files, *place, "--json").out)
    assert answer["model"] == "tube"
    assert answer["placement"]["gap"]["value"] == pytest.approx(1e-3)
    assert answer["placement"]["ends"] == "closed"
    assert "plug_velocity" in answer
    assert not any("wall" in warning for warning in answer["warnings"])
    table = run("flow", WIDE, *SMALL[2:], *files, *place, "--notes").out
    assert "model tube, lab frame" in table
    assert "ends of the channel: closed" in table
    assert "gap" in table
    imposed = ("--model", "tube", "--flow=-1mm/s", "--gap", "1mm", "--pitch", "0deg", "--tolerance", "0.05")
    assert run("flow", WIDE, *PLANE[2:], *imposed, "-o", str(tmp_path / "flow.nc")).code == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "no file is requested"),
        (["-o", "flow.vti"], "does not end in .png or .pdf or .svg or .nc"),
        (["-o", "flow"], "does not end in"),
        (["--volume", "flow.png"], "does not end in .vti or .nc"),
        (["-o", "no/such/folder/flow.png"], "no such folder"),
        (["-o", "flow.nc", "--volume", "flow.nc"], "allowed: two files"),
        (["-o", "flow.png", "--plane", "zz"], "plane = 'zz'"),
        (["-o", "flow.png", "--offset", "5"], 'offset = "5" has no unit'),
        (["-o", "flow.png", "--extent", "5"], 'extent = "5" has no unit'),
        (["-o", "flow.png", "--extent", "-5mm"], "out of range"),
        (["-o", "flow.png", "--resolution", "0"], "resolution = 0; allowed"),
        (["-o", "flow.png", "--resolution", "1000000"], "resolution = 1000000; allowed"),
        (["-o", "flow.png", "--resolution", "many"], "--resolution"),
        (["--volume", "flow.vti", "--volume-resolution", "900"], "allowed: at most 2000000 points"),
        (["--volume", "flow.vti", "--plane", "xz"], "--plane without a plane (-o FILE)"),
        (["--volume", "flow.vti", "--offset", "1mm"], "--offset without a plane (-o FILE)"),
        (["--volume", "flow.vti", "--resolution", "30"], "--resolution without a plane (-o FILE)"),
        (["-o", "flow.png", "--volume-resolution", "80"], "--volume-resolution without --volume FILE"),
        (["-o", "flow.png", "--phase", "1"], 'phase = "1" has no unit'),
        (["-o", "flow.png", "--frame", "tail"], "frame = 'tail'"),
        (["-o", "flow.png", "--model", "rft"], "model = 'rft'; allowed: auto, slender, tube"),
        (["-o", "flow.png", "--model", "tube", "--gap", "50mm"], "placement.gap"),
        (["-o", "flow.png", "--model", "tube", "--ends", "shut"], "placement.ends"),
        (["-o", "flow.png", "--model", "tube", "--tolerance", "2"], "tolerance = 2.0"),
        (["-o", "flow.png", "--model", "tube", "--resolution", "1"], "resolution = 1; allowed"),
        (["-o", "flow.png", "--tail-rate", "0Hz"], "a tail at rest"),
        (["-o", "flow.png", "--friction", "ice"], "friction = 'ice'"),
        (["-o", "flow.png", "--set", "tail.wavelength=20"], "has no unit"),
    ],
)
def test_bad_input_is_one_sentence_and_leaves_nothing(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run("flow", WIDE, *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert outcome.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_grids_are_checked_before_anything_is_solved(run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    import spirillum.fields.flow as module

    def solved(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(module, "predict_steady", solved)
    assert run("flow", WIDE, "-o", "flow.png", "--resolution", "1").code == 2
    assert run("flow", WIDE, "--volume", "flow.vti", "--volume-resolution", "1").code == 2
    assert run("flow", WIDE, "-o", "flow.png", "--phase", "1").code == 2


def test_a_run_is_not_written_over_and_its_grid_is_checked_before_anything_is_solved(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import spirillum.dynamics.flow_of_run as module

    def solved(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(module, "tube_flow_field", solved)
    kept = str(tmp_path / "run.nc")
    assert run("simulate", WIDE, "-o", kept, "--duration", "0.05s").code == 0
    moment = ("flow", "--run", kept, "--time", "0.02s")
    held = Path(kept).read_bytes()
    for target in ("-o", "--volume"):
        over = run(*moment, target, kept)
        assert over.code == 2
        assert "run.nc is read by this command and would be written over" in over.err
    assert Path(kept).read_bytes() == held
    for arguments in (("--plane", "xyz"), ("--resolution", "1"), ("--offset", "1m")):
        assert run(*moment, "-o", str(tmp_path / "flow.png"), *arguments).code == 2
    assert run(*moment, "--volume", str(tmp_path / "flow.vti"), "--volume-resolution", "1").code == 2


@pytest.mark.usefixtures("unplaced")
def test_the_example_of_the_help_runs(run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    example = re.search(r"Example: spirillum (.*)", run("flow", "--help").out)
    assert example
    assert run(*example[1].split()).code == 0


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_closed_folder_is_named_before_any_work(run: Callable[..., Any], tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    outcome = run("flow", "biorob2012-wide", "-o", str(closed / "flow.png"))
    assert outcome.code == 2
    assert "permission denied" in outcome.err
