"""A call reads each of its files once and loads its robot once."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import posteriors
import spirillum as sp
from spirillum.files import read_toml
from spirillum.fitted.posterior_file import read_posterior
from spirillum.robot.load import load, new_robot_file
from spirillum.robot.robot import Robot

WIDE = "biorob2012-wide"
FITTED = """
[calibration.{model}]
body_drag = 2.0
source = "trial"
fitted_to = {{channel_diameter = "40 mm", body_diameter = "18 mm", body_length = "35 mm"}}
"""


def reads(call: Callable[[], Any]) -> Counter[str]:
    """Number of reads of each file by name, and of `load` for what is no checked robot."""
    found: Counter[str] = Counter()
    readers = {read_toml.__code__, read_posterior.__code__}

    def count(frame: Any, event: str, _: object) -> None:
        if event != "call":
            return
        if frame.f_code in readers:
            found[Path(frame.f_locals["path"]).name] += 1
        elif frame.f_code is load.__code__ and not isinstance(frame.f_locals["robot"], Robot):
            found["load"] += 1

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        call()
    finally:
        sys.setprofile(before)
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A robot file, a study of it, calibration files of two models, a fit of no model, and a posterior."""
    new_robot_file(tmp_path / "robot.toml", WIDE)
    (tmp_path / "study.toml").write_text('robots = ["robot.toml"]\nmodels = ["sbt"]\n', encoding="utf-8")
    for model in ("sbt", "rft"):
        (tmp_path / f"{model}.toml").write_text(FITTED.format(model=model), encoding="utf-8")
    (tmp_path / "contact.toml").write_text('[contact]\nroughness = "100 um"\n', encoding="utf-8")
    posteriors.write(tmp_path / "posterior.nc")
    return tmp_path


TURN = {"turns": 1}
CALLS: dict[str, tuple[str, Callable[[Path, Path], Any]]] = {
    "predict": ("sbt.toml", lambda robot, file: sp.predict(robot, calibration=file).to_dict()),
    "predict over a posterior": ("posterior.nc", lambda robot, file: sp.predict(robot, posterior=file).to_dict()),
    "simulate axial motion": ("sbt.toml", lambda robot, file: sp.simulate(robot, calibration=file, timing=TURN)),
    "simulate free motion": (
        "rft.toml",
        lambda robot, file: sp.simulate(robot, model="rft", calibration=file, timing=TURN),
    ),
    "simulate over a posterior": (
        "posterior.nc",
        lambda robot, file: sp.simulate(robot, posterior=file, draws=20, timing=TURN),
    ),
    "compare models": (
        "sbt.toml",
        lambda robot, file: sp.compare_models(robot, models=["sbt", "rft"], calibration=file),
    ),
    "control": (
        "rft.toml",
        lambda robot, file: sp.control(
            robot, {"kind": "stop-at", "at": "20 mm"}, plant={"model": "rft", "calibration": file}
        ),
    ),
}
SLOW: dict[str, tuple[str, Callable[[Path, Path], Any]]] = {
    "predict free motion in the tube": (
        "contact.toml",
        lambda robot, file: sp.predict(robot, model="tube", motion="free", calibration=file),
    ),
    "settle": ("contact.toml", lambda robot, file: sp.settle(robot, calibration=file)),
    "simulate in the tube": (
        "contact.toml",
        lambda robot, file: sp.simulate(robot, model="tube", calibration=file, timing=TURN),
    ),
    "design": (
        "posterior.nc",
        lambda robot, file: sp.design(
            robot, {"tail.wavelength": "20 mm:30 mm"}, maximise="forward_velocity", posterior=file
        ),
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_files_are_read_once(name: str, folder: Path) -> None:
    fitted, call = CALLS[name]
    found = reads(lambda: call(folder / "robot.toml", folder / fitted))
    assert found == {"robot.toml": 1, fitted: 1, "load": 1}


@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_files_of_long_calls_are_read_once(name: str, folder: Path) -> None:
    fitted, call = SLOW[name]
    found = reads(lambda: call(folder / "robot.toml", folder / fitted))
    assert found == {"robot.toml": 1, fitted: 1, "load": 1}


def test_a_study_reads_its_files_once(folder: Path) -> None:
    found = reads(lambda: sp.study(folder / "study.toml", calibration=folder / "sbt.toml"))
    assert found == {"study.toml": 1, "robot.toml": 1, "sbt.toml": 1, "load": 1}


@pytest.mark.slow
def test_a_virtual_trial_loads_its_robot_once(folder: Path) -> None:
    camera = {"fps": 5.0}
    found = reads(lambda: sp.render(folder / "robot.toml", folder / "films", motion={"model": "rft"}, camera=camera))
    assert found["robot.toml"] == found["load"] == 1
