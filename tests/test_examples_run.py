"""Every example runs, and what it asserts holds."""

import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))
SLOW = (
    "calibration_on_synthetic_data",
    "from_video_to_prediction",
    "learn_to_hold_a_speed",
    "one_piece_swimmer_in_tubes",
)
"""Of ten seconds to half a minute each."""


@pytest.mark.parametrize(
    "script",
    [pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * (path.stem in SLOW)) for path in EXAMPLES],
)
def test_example_runs_and_its_assertion_holds(
    script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(script)])
    monkeypatch.setenv("MPLBACKEND", "Agg")
    runpy.run_path(str(script), run_name="__main__")
    assert capfd.readouterr().err == ""
    assert not list(tmp_path.iterdir())
    assert "assert " in script.read_text("utf-8")
