"""Who waits at a terminal is told what for; pipes and machines get the answer alone."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from spirillum.cli import renderer
from spirillum.errors import InputError
from spirillum.fluid.tube.progress_messages import LEVEL


@pytest.mark.parametrize(
    ("terminal", "quiet", "told"), [(True, False, True), (True, True, False), (False, False, False)]
)
def test_work_is_named_at_a_terminal_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], terminal: bool, quiet: bool, told: bool
) -> None:
    monkeypatch.setattr("rich.console.Console.is_terminal", terminal)
    with renderer.at_work("looking at a film", quiet=quiet):
        pass
    shown = capsys.readouterr()
    assert ("looking at a film" in shown.err) == told
    assert not shown.out


def test_piped_work_is_named_where_it_takes_long(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for first, told in ((0.0, "looking at a film, 0 s elapsed\n"), (60.0, "")):
        monkeypatch.setattr("spirillum.cli.progress.FIRST", first)
        said, end = "", time.monotonic() + 20.0
        with renderer.at_work("looking at a film", quiet=False):
            while said != told and time.monotonic() < end:
                time.sleep(0.05)
                said += capsys.readouterr().err
        assert said == told


@pytest.mark.parametrize(("terminal", "told"), [(True, True), (False, False)])
def test_work_that_is_silent_shows_that_it_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], terminal: bool, told: bool
) -> None:
    monkeypatch.setattr("rich.console.Console.is_terminal", terminal)
    monkeypatch.setattr(renderer, "_SOON", 0.0)
    with renderer.progress_bar(quiet=False):
        time.sleep(0.3)
    shown = capsys.readouterr()
    assert ("at work" in shown.err) == told
    assert not shown.out


@pytest.mark.parametrize("quiet", [True, False])
@pytest.mark.parametrize(("soon", "told"), [(0.0, 1), (60.0, 0)])
def test_a_tube_without_a_table_is_named_where_its_answer_takes_a_while(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], quiet: bool, soon: float, told: int
) -> None:
    monkeypatch.setattr(renderer, "_SOON", soon)
    with renderer.progress_bar(quiet=quiet) as progress:
        for _ in range(2):  # once for a command
            progress(f"{LEVEL}; `spirillum prepare` makes further answers immediate", 0, 1)
        time.sleep(0.2)
    assert capsys.readouterr().err.count("no table of this tube: the flow is solved for") == told


def test_an_answer_is_printed_though_its_picture_cannot_be_drawn(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise InputError("the disk is full")

    monkeypatch.setattr("spirillum.view.figures.style.save_as", full)
    outcome = run("predict", "ecoli", "--model", "rft", "--plot", str(tmp_path / "a.png"))
    assert (outcome.code, "forward velocity" in outcome.out, "disk is full" in outcome.err) == (2, True, True)


def test_endings_in_capitals_are_taken(run: Callable[..., Any], tmp_path: Path) -> None:
    outcome = run("predict", "ecoli", "--model", "rft", "--plot", str(tmp_path / "A.PNG"))
    assert (outcome.code, (tmp_path / "A.PNG").read_bytes()[:4]) == (0, b"\x89PNG")


def test_a_study_without_figures_names_no_earlier_report(run: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text('title = "One"\nrobots = ["biorob2012-wide"]\nmodels = ["rft"]\n')
    request = ("study", str(tmp_path / "study.toml"), "-o", str(tmp_path / "out"))
    assert f"open {tmp_path / 'out'}/report.html" in run(*request).out.replace("\n  ", "")
    assert "report.html" not in run(*request, "--no-figures").out
