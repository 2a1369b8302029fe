"""Who waits at a terminal is told what for; pipes and machines get the answer alone."""

import time

import pytest

from spirillum.cli import renderer
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
