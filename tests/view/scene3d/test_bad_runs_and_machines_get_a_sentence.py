"""Files that are no runs, missing packages, no display: one sentence, exit code 2, nothing written."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import spirillum as sp
from spirillum.cli import main
from spirillum.dynamics.run_file import open_run, robot_of
from spirillum.files import write_dataset

HINT = "pip install '.[3d]' in the project's folder, or require spirillum[3d]"


@pytest.fixture
def sentence(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """What a command that has to fail says."""

    def command(*arguments: str) -> str:
        with pytest.raises(SystemExit) as stopped:
            main(list(arguments))
        printed = capsys.readouterr()
        assert stopped.value.code == 2
        assert printed.out == ""
        assert printed.err.startswith("spirillum: ")
        assert printed.err.count("\n") == 1
        return printed.err

    return command


@pytest.mark.parametrize("robot", ["biorob2012-wide", "biorob2012-narrow"])
def test_robot_of_a_run_is_the_one_that_swam(robot: str, run_of: Callable[..., Any], tmp_path: Path) -> None:
    loaded = sp.load(robot, **{"tail.taper": "none", "tail.handedness": "left"})
    write_dataset(run_of(loaded), tmp_path / "run.nc")
    assert robot_of(open_run(tmp_path / "run.nc")) == loaded


def test_files_that_are_no_runs(sentence: Callable[..., str], tmp_path: Path, run_of: Callable[..., Any]) -> None:
    whole, cut, text = (tmp_path / name for name in ("whole.nc", "cut.nc", "text.nc"))
    target = str(tmp_path / "run.mp4")
    write_dataset(run_of(sp.load("biorob2012-wide")), whole)
    content = whole.read_bytes()
    cut.write_bytes(content[: len(content) // 2])
    text.write_text("time,position\n0,0\n")
    before = sorted(entry.name for entry in tmp_path.iterdir())
    assert "does not exist" in sentence("film", str(tmp_path / "none.nc"), "-o", target)
    assert "is a folder" in sentence("film", str(tmp_path), "-o", target)
    assert "is not a NetCDF-4 file" in sentence("film", str(text), "-o", target)
    assert "cut.nc cannot be read" in sentence("film", str(cut), "-o", target)
    assert "does not end in .mp4 or .gif" in sentence("film", str(whole), "-o", str(tmp_path / "run.avi"))
    assert "cannot be written" in sentence("film", str(whole), "-o", str(tmp_path / "no" / "run.mp4"))
    assert sorted(entry.name for entry in tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (None, "no attribute 'settings'"),
        ("{", "is not JSON"),
        ("[" * 5000, "is not JSON"),
        ("[1]", "is no table"),
        ("{}", "body is missing"),
        ({"body": {"diameter": -1.0}}, "the run's settings: body.diameter"),
        ({"body": {"diameter": "1 mm; rm"}}, "the run's settings: body.diameter"),
        ({"wings": 2}, "wings is not a known field"),
    ],
)
def test_settings_are_not_believed_before_they_are_checked(
    free_robot: Any, run_of: Callable[..., Any], settings: Any, words: str
) -> None:
    run = run_of(free_robot)
    table = json.loads(run.attrs["settings"])
    if isinstance(settings, dict):
        settings = json.dumps(
            {**table, **{k: {**table.get(k, {}), **v} if isinstance(v, dict) else v for k, v in settings.items()}}
        )
    run.attrs["settings"] = settings
    if settings is None:
        del run.attrs["settings"]
    with pytest.raises(sp.InputError) as error:
        robot_of(run)
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--view", "back"], "view = 'back'; allowed: perspective"),
        (["--size", "1600"], "size = '1600'; allowed: WIDTHxHEIGHT"),
        (["--size", "9999x9999"], "64 to 4096 each"),
        (["--phase", "1"], "has no unit"),
        (["-o", "robot.svg"], "does not end in .png"),
        (["-o", "no/robot.png"], "cannot be written"),
        (["--set", "body.diameter=0mm"], "body.diameter"),
    ],
)
def test_wrong_options_of_a_picture(
    sentence: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert words in sentence("show", "biorob2012-wide", *arguments)
    assert list(tmp_path.iterdir()) == []


def test_missing_package_is_named_with_its_remedy(
    sentence: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    run_of: Callable[..., Any],
    free_robot: Any,
) -> None:
    write_dataset(run_of(free_robot), tmp_path / "run.nc")
    monkeypatch.chdir(tmp_path)
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "av", None)
        said = sentence("film", "run.nc", "-o", "run.mp4")
        assert said == f"spirillum: a film needs av, which is not installed; allowed: {HINT}\n"
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "pyvista", None)
        said = sentence("show", "biorob2012-wide")
    assert said == f"spirillum: a 3D picture needs pyvista, which is not installed; allowed: {HINT}\n"
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.nc"]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems always have a display")
def test_window_without_a_display(
    sentence: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert "--window: DISPLAY is not set; allowed: a display, or -o FILE" in sentence(
        "show", "biorob2012-wide", "--window"
    )
    monkeypatch.setenv("DISPLAY", ":4711")
    assert "DISPLAY = ':4711' cannot be opened" in sentence("show", "biorob2012-wide", "--window")


def test_machine_that_cannot_draw_says_what_to_install(
    sentence: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from spirillum.view.scene3d import rendering

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(rendering, "_can_draw", lambda _window: False)
    assert "this machine cannot draw in 3D" in sentence("show", "biorob2012-wide")
    assert list(tmp_path.iterdir()) == []
