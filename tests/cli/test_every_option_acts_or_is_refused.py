"""Every option of a command, given with another value than its own, changes what is answered or is refused."""

import hashlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import spirillum as sp
from spirillum.cli.app import command_line
from spirillum.files import loaded_netcdf
from spirillum.fluid.registry import find_swimmer_model, quickest
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import with_resolution

WIDE = "biorob2012-wide"
BASES = {
    "predict": ["predict", WIDE, "--model", "sbt"],
    "compare-models": ["compare-models", WIDE, "--model", "sbt", "--model", "rft"],
    "resistance": ["resistance", WIDE, "--model", "rft"],
    "simulate": ["simulate", WIDE, "-o", "run.nc", "--model", "sbt", "--motion", "held", "--duration", "0.1s"],
    "magnetic-sweep": [
        "magnetic-sweep",
        "magnetic-helix",
        "-o",
        "a.nc",
        "--model",
        "rft",
        "--rate",
        "9Hz",
        "--turns",
        "4",
    ],
    "export": ["export", WIDE, "robot.vtp"],
    "control": ["control", WIDE, "--at", "1mm", "--model", "rft", "--duration", "0.3s", "--gap", "0.5mm"],
    "design": [
        "design",
        WIDE,
        "--vary",
        "tail.wavelength=20mm:30mm",
        "--model",
        "sbt",
        "--maximise",
        "forward_velocity",
    ],
    "render": ["render", WIDE, "-o", "a.mp4", "--model", "sbt", "--duration", "0.1s", "--size", "64x64"],
    "flow": ["flow", WIDE, "-o", "a.nc", "--model", "rft", "--resolution", "4"],
}
SLOW = ("control", "design", "render", "flow")
OTHER: dict[str, list[str]] = {
    "--tail-rate": ["0.7Hz"],
    "--friction": ["none"],
    "--no-calibration": [],
    "--calibrated": [],
    "--accuracy": ["high"],
    "--gap": ["0.45mm"],
    "--eccentricity": ["0.5"],
    "--pitch": ["1deg"],
    "--yaw": ["0.5deg"],
    "--tail-drop": ["0.1mm"],
    "--ends": ["closed"],
    "--flow": ["0.3mm/s"],
    "--tolerance": ["0.01"],
    "--phases": ["5"],
    "--band": [],
    "--roughness": ["3um"],
    "--interval": [],
    "--friction-coefficient": ["0.3"],
    "--motion": ["free"],
    "--for": ["measured"],
    "--model": ["slender"],
    "--set": ["tail.wavelength=24mm"],
    "--about": ["tail-root"],
    "--part": ["tail"],
    "--phase": ["40deg"],
    "--turns": ["5"],
    "--duration": ["0.2s"],
    "--on": ["0s:0.05s"],
    "--samples-per-turn": ["37"],
    "--azimuth": ["5deg"],
    "--no-weight": [],
    "--wait": ["0.2s"],
    "--field-yaw": ["3deg"],
    "--field-pitch": ["3deg"],
    "--column": ["single"],
    "--panels": ["all"],
    "--draws": ["30"],
    "--rate": ["8Hz"],
    "--fineness": ["0.5"],
    "--unit": ["m"],
    "--sidecar": [],
    "--film": ["a.mp4"],
    "--speed": ["2"],
    "--at": ["2mm"],
    "--task": ["hold-speed"],
    "--law": ["0.1"],
    "--controller": ["open-loop"],
    "--with": ["camera.fps=10"],
    "--learn": [],
    "--seen-by": ["tracker"],
    "--seed": ["7"],
    "--seeds": ["1"],
    "--vary": ["tail.amplitude=2mm:3mm"],
    "--maximise": ["advance_per_radian"],
    "--minimise": ["drive_torque"],
    "--subject-to": ["forward_velocity >= 1um/s"],
    "--unknown": ["fluid.viscosity=5%"],
    "--statistic": ["mean"],
    "--level": ["0.5"],
    "--confidence": ["0.8"],
    "--mandrel": ["20"],
    "--clearance": ["17.5mm"],
    "--forward-velocity": ["0.3mm/s"],
    "--body-rate": ["0.02Hz"],
    "--start": ["5mm"],
    "--lateral": ["1mm"],
    "--heading": ["2deg"],
    "--wobble": ["0.1mm"],
    "--body-angle": ["20deg"],
    "--tail-phase": ["30deg"],
    "--view": ["side"],
    "--direction": ["left"],
    "--fps": ["25"],
    "--size": ["96x64"],
    "--exposure": ["1ms"],
    "--field-of-view": ["120mm"],
    "--distortion": ["0.01"],
    "--preset": ["bench"],
    "--noise": ["5"],
    "--lamp-drift": ["0.1"],
    "--crf": ["30"],
    "--dropped": ["0.4"],
    "--tilt": ["2deg"],
    "--glare": ["2"],
    "--glare-fixed": [],
    "--bubbles": ["3"],
    "--hand": [],
    "--trouble": ["clock-jump"],
    "--depth-error": ["1mm"],
    "--depth-uncertainty": ["1mm"],
    "--resolution": ["5"],
    "--volume-resolution": ["5"],
    "--plane": ["xy"],
    "--offset": ["1mm"],
    "--extent": ["4mm"],
    "--frame": ["body"],
    "--time": ["0.1s"],
    "--workers": ["2"],
}
GRANTED = {
    "--beyond-stokes": "allows an answer that is given anyway",
    "--no-band": "asks for no band where there is none",
    "--no-sidecar": "asks for no file where there is none",
    "--no-calibration": "asks for none where the robot has none for this model",
    "--all": "is of the tables: JSON holds all quantities",
    "--json": "is of the form",
    "--notes": "is of the form",
    "--workers": "changes the time alone",
    "--live": "changes the pace alone",
}
FILES = ("--output", "--plot", "--movie", "--calibration", "--posterior", "--duty", "--continue", "--lab", "--remote")
MORE_FILES = ("--run", "--volume", "--stl")
"""Options that name files are tried where these files are."""


def answered(arguments: list[str], folder: Path, run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    """What a command answers: its exit code, its JSON and its files."""
    folder.mkdir()
    monkeypatch.chdir(folder)
    found = run(*arguments, "--json")
    if found.code:
        assert found.code == 2, found
        assert found.err.count("\n") == 1, found
        return found.code
    files = {path.name: hashlib.sha256(content(path)).digest() for path in folder.rglob("*") if path.is_file()}
    return re.sub(r'"(seconds|versions)": [^,}]*', "", found.out), files


def content(path: Path) -> bytes:
    """What a file holds, without the times at which datasets are written."""
    if path.suffix != ".nc":
        return path.read_bytes()
    return repr(loaded_netcdf(path, "an answer").to_dict()).encode()


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in BASES])
def test_options_act_or_are_refused(
    name: str, tmp_path: Path, run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    base = BASES[name]
    usual = answered(base, tmp_path / "usual", run, monkeypatch)
    assert usual != 2
    silent = []
    for number, parameter in enumerate(command_line().commands[name].params):
        option = max(parameter.opts, key=len)
        if (
            not option.startswith("--")
            or option in (*FILES, *MORE_FILES)
            or (option in GRANTED and option not in OTHER)
        ):
            continue
        arguments = list(base)
        if option in arguments and option not in ("--model", "--vary", "--maximise") and len(OTHER[option]):
            where = arguments.index(option)
            arguments[where : where + 2] = [option, *OTHER[option]]
        else:
            arguments += [option, *OTHER[option]]
        found = answered(arguments, tmp_path / str(number), run, monkeypatch)
        if found == usual and option not in GRANTED:
            silent.append(arguments)
    assert not silent


@pytest.mark.parametrize("asked", [{"tolerance": 0.005}, {"phases": 3}, {"accuracy": "standard"}, {"phases": 5}])
def test_a_resolution_that_is_asked_for_is_solved_for(asked: dict[str, Any]) -> None:
    """Also where it is the usual one: a table has its own."""
    robot, model = sp.load(WIDE), find_swimmer_model("tube")
    assert quickest(model, RobotBatch.of(robot)).form == "table"
    assert quickest(model, RobotBatch.of(with_resolution(robot, asked, "tube"))).form == "direct"
    with pytest.raises(sp.InputError, match="with form = 'table', which has its own; allowed"):
        with_resolution(robot, {**asked, "form": "table"}, "tube")
    assert with_resolution(robot, {"form": "table"}, "tube").model.tube.form == "table"


@pytest.mark.parametrize("field", ["model.tube.tolerance=0.01", "model.tube.phases=5", "model.slender.accuracy=high"])
@pytest.mark.parametrize(
    "command",
    [
        ["settle", WIDE],
        ["simulate", WIDE, "-o", "a.nc", "--model", "tube"],
        ["control", WIDE, "--at", "1mm", "--model", "tube"],
        ["prepare", WIDE],
        ["predict", WIDE, "--motion", "free"],
        ["predict", WIDE, "--set", "model.tube.form=table"],
    ],
)
def test_a_resolution_of_a_robot_is_refused_where_its_table_answers(
    field: str, command: list[str], run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = run(*command, "--set", field)
    assert found.code == 2
    assert f"{field.split('=', maxsplit=1)[0]} = " in found.err
    assert "its own resolution; allowed: " in found.err
