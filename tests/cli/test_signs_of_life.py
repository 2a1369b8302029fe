"""Who waits at a terminal is told what for; pipes and machines get the answer alone."""

import pytest

from spirillum.cli import renderer


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
