"""`control`: table, JSON, run and picture of one run; wrong input in a sentence."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

WIDE = "biorob2012-wide"
QUICK = ("--set", "friction.effective=4.7e-6 N m s/rad", "--at", "2mm", "--tolerance", "0.3mm", "--duration", "4s")


def test_json_run_and_picture_say_the_same(run: Callable[..., Any], tmp_path: Path) -> None:
    file, picture = tmp_path / "run.nc", tmp_path / "run.png"
    asked = ("control", WIDE, *QUICK, "--with", "pulse.start=1s", "--with", "camera.fps=20", "--learn")
    outcome = run(*asked, "--seeds", "1", "-o", str(file), "--plot", str(picture), "--json")
    assert (outcome.code, outcome.err) == (0, "")
    answer = json.loads(outcome.out)
    assert answer["schema"] == "spirillum.control/1"
    assert answer["motor_off_at_end"] is True
    assert answer["lab"]["camera"]["fps"] == 20.0
    assert picture.stat().st_size > 10_000
    with xr.open_dataset(file, engine="h5netcdf") as found:
        assert float(found.position[-1, 0]) - 2e-3 == pytest.approx(answer["error"]["value"], rel=1e-12)
        assert found.imposed_flow.values.max() == pytest.approx(5e-4)
        assert found.sizes["frame_time"] == answer["frames"]["taken"]
        assert int(np.isnan(found.seen_position).sum()) == answer["frames"]["lost"]
        settings = json.loads(found.attrs["control"])
        assert (settings["seed"], settings["lab"]["camera"]["latency"]) == (0, 0.1)
        assert found.estimated_friction_factor_low.values[-1] == answer["learnt"]["friction_factor"]["low"]
    learnt, true = answer["learnt"]["friction_factor"], answer["drawn"]["friction_factor"]
    assert learnt["told"]
    assert learnt["low"] < true < learnt["high"]
    controllers = answer["scores"]["controllers"]
    assert set(controllers) == {"feedback", "nothing", "open-loop", "knowing"}
    first = next(one for one in answer["scores"]["runs"] if one["controller"] == "feedback" and one["seed"] == 0)
    assert first["error"]["value"] == answer["error"]["value"]  # the run that was asked for is the first that is scored


def test_table_and_json_say_the_same(run: Callable[..., Any]) -> None:
    asked = ("control", WIDE, "--model", "rft", "--at", "0.2mm", "--tolerance", "0.1mm", "--duration", "1s")
    answer = json.loads(run(*asked, "--json").out)
    table = run(*asked)
    assert table.code == 0
    assert f"{1e3 * answer['error']['value']:.4g}" in table.out or "um" in table.out
    assert "the drive is off at the end" in table.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--at", "500mm"], "--at = 500 mm; allowed: between 0 mm and 122.5 mm"),
        (["--at", "-5mm"], "for the robot cannot swim backwards"),
        (["--at", "nan"], "--at"),
        ([], "--at is missing"),
        (["--at", "1mm", "--tolerance", "2mm"], "--tolerance = 2 mm; allowed: less than"),
        (["--at", "1mm", "--with", "camera.fps=0"], "camera.fps = 0; allowed: 0.1 to 1000 frames a second"),
        (["--at", "1mm", "--with", "camera.late=1s"], "camera.late is not a known field (did you mean latency?)"),
        (["--at", "1mm", "--with", "optics.fps=1"], "lab.optics is not a known table"),
        (["--at", "1mm", "--with", "remote.delay=2h"], "remote.delay"),
        (["--at", "1mm", "--with", "camera.latency=50"], "camera.latency = 50 has no unit; allowed: a number with its"),
        (["--at", "1mm", "--with", "camera"], "--with 'camera' is not PATH=VALUE"),
        (["--at", "2mm", "--seen-by", "me"], "seen-by = 'me'; allowed: model, tracker"),
        (["--at", "2mm", "--remote", "/dev/no-such-port"], "/dev/no-such-port cannot be opened"),
        (["--task", "keep-axis"], "task 'keep-axis' with biorob2012-wide; allowed: a robot with drive.kind 'magnetic'"),
        (["--at", "1mm", "--with", "="], "--with '=' is not PATH=VALUE"),
        (["--at", "1mm", "--task", "stopp"], "(did you mean stop-at?)"),
        (["--at", "1mm", "--controller", "pid"], "controller = 'pid'"),
        (["--at", "1mm", "--workers", "3"], "workers = 3 without seeds, whose runs they share; allowed: 1, or seeds"),
        (["--at", "1mm", "--seeds", "-1"], "seeds = -1; allowed: 0 to"),
        (["--at", "1mm", "--duration", "0s"], "--duration = 0 s"),
        (["--at", "1mm", "--lab", "nowhere.toml"], "nowhere.toml does not exist"),
        (["--at", "1mm", "-o", "run.csv"], "run.csv"),
        (["--task", "hold-speed"], "--speed is missing"),
        (["--task", "hold-speed", "--speed", "-1mm/s"], "--speed = -0.001 m/s; allowed: above 0 m/s"),
        (["--task", "ride-out", "--speed", "9mm/s", "--duration", "1s"], "--speed = 9 mm/s; allowed: below"),
        (["--task", "ride-out", "--speed", "0.1mm/s", "--at", "1mm"], "--at is not a known field"),
    ],
)
def test_bad_input_is_one_sentence(run: Callable[..., Any], arguments: list[str], words: str) -> None:
    outcome = run("control", WIDE, *arguments)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert outcome.err.count("\n") == 1
