"""`measure` and `setup`: readings by hand from file to answer, feasibility with its exit code, sentences."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]


@pytest.fixture
def setup_file(run: Run, tmp_path: Path) -> str:
    path = str(tmp_path / "setup.toml")
    assert run("setup", "new", path).code == 0
    return path


def test_a_new_setup_is_valid_and_says_what_depth_costs(run: Run, setup_file: str) -> None:
    outcome = run("setup", "check", setup_file)
    assert outcome.code == 0
    assert "robot.axis_height" in outcome.out
    answer = json.loads(run("setup", "check", setup_file, "--json").out)
    assert f"{100 * answer['scale_uncertainty']:.2g} %" in outcome.out
    assert run("setup", "new", setup_file).code == 2


def test_readings_by_hand_alone_are_measured(run: Run, tmp_path: Path, setup_file: str) -> None:
    """Five trials as the paper has taken them: 1 mm/s, tail 0.5 Hz, body -0.1 Hz, all exact but for the third speed.

    They start at other places: equal ones would be copies of one trial.
    """
    marks = tmp_path / "marks.csv"
    rows = ["video,time_s,x_mm,tail_phase_deg,body_angle_deg"]
    for trial in range(5):
        speed = 1.02 if trial == 2 else 1.0
        rows += [f"trial-{trial}.mp4,{t},{trial + speed * t},{180 * t},{-36 * t}" for t in range(0, 21, 2)]
    marks.write_text("\n".join(rows))
    videos = [f"trial-{trial}.mp4" for trial in range(5)]
    folder = tmp_path / "out"
    common = ("--setup", setup_file, "--marks", str(marks), "--no-tracking", "--no-figures", "-o", str(folder))
    outcome = run("measure", *videos, *common, "--json")
    assert (outcome.code, outcome.err) == (0, "")
    answer = json.loads(outcome.out)
    summary = answer["summary"]
    assert summary["n"] == 5
    assert summary["forward_velocity"]["value"] == pytest.approx(1.004e-3)
    assert summary["tail_rotation_rate"]["value"] == pytest.approx(3.14159265, rel=1e-6)
    assert summary["motor_rotation_rate"]["value"] == pytest.approx(1.2 * 3.14159265, rel=1e-6)
    assert {name for trial in answer["trials"] for name in (flag["name"] for flag in trial["flags"])} >= {"by-hand"}
    assert "outlier-forward-velocity" in [flag["name"] for flag in answer["trials"][2]["flags"]]
    assert {path.name for path in folder.iterdir()} == set(answer["files"])
    table = run("measure", *videos, *common)
    assert "means over trials" in table.out
    assert "1.004" in table.out
    assert run("observations", "check", str(folder / "observations.csv")).code == 0


def test_two_readings_are_shown_without_interval_and_with_the_reason(run: Run, tmp_path: Path, setup_file: str) -> None:
    marks = tmp_path / "marks.csv"
    marks.write_text("time_s,x_mm,tail_phase_deg,body_angle_deg\n0,0,0,0\n2,3,360,-36\n")
    common = ("--setup", setup_file, "--marks", str(marks), "--no-tracking", "--no-figures")
    outcome = run("measure", "a.mp4", *common, "-o", str(tmp_path / "out"))
    assert outcome.code == 0
    assert "95 % interval" not in outcome.out
    noted = run("measure", "a.mp4", *common, "--notes", "-o", str(tmp_path / "noted"))
    assert "no interval of forward velocity, body rotation rate, tail rotation rate" in noted.out.replace("\n", " ")


def test_feasibility_says_yes_and_no(run: Run, setup_file: str) -> None:
    common = ("measure", "--feasibility", "--setup", setup_file, "--expect-speed", "1mm/s", "--expect-body-rate=-0.1Hz")
    fine = run(*common, "--expect-tail-rate", "1.2Hz", "--view-width", "160mm")
    assert fine.code == 0
    assert "all rates can be resolved" in fine.out
    fast = run(*common, "--expect-tail-rate", "16Hz", "--json")
    assert fast.code == 1
    answer = json.loads(fast.out)
    assert answer["schema"] == "spirillum.feasibility/1"
    assert [check["name"] for check in answer["checks"] if not check["passed"]] == ["tail-rate"]


def test_feasibility_takes_one_film(run: Run, setup_file: str) -> None:
    outcome = run("measure", "a.mp4", "b.mp4", "--feasibility", "--setup", setup_file)
    assert (outcome.code, outcome.out) == (2, "")
    assert "--feasibility with 2 videos" in outcome.err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--view-width", "160mm"], "view-width = 160mm with the video none.mp4"),
        (["--width", "640"], "width = 640 with the video none.mp4"),
    ],
)
def test_feasibility_takes_no_size_that_its_film_shows(
    run: Run, setup_file: str, options: list[str], words: str
) -> None:
    outcome = run("measure", "none.mp4", "--feasibility", "--setup", setup_file, *options)
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["a.mp4"], "--setup is missing"),
        (["--setup", "none.toml"], "none.toml does not exist"),
        (["--setup", "SETUP"], "no video; allowed: at least one, or --feasibility"),
        (["a.mp4", "./b/../a.mp4", "--setup", "SETUP"], "a.mp4 is given twice; allowed: each video once"),
        (["", "--setup", "SETUP"], "an empty word after measure; allowed: a name"),
        (["a.mp4", "--setup", "SETUP", "--marks", ""], "an empty word after --marks"),
        (["a.mp4", "--setup", "SETUP", "-o", ""], "an empty word after -o"),
        (["a.mp4", "--setup", "SETUP", "--output="], "an empty word after --output="),
        (["a.mp4", "--setup", "SETUP", "--fps", "30"], "without --feasibility"),
        (["a.mp4", "--setup", "SETUP", "--no-tracking"], "--no-tracking without --marks"),
        (["a.mp4", "--setup", "SETUP", "--start", "2"], 'start = "2" has no unit'),
        (["a.mp4", "--setup", "SETUP", "--marks", "none.csv"], "none.csv does not exist"),
        (["nowhere.mp4", "--setup", "SETUP"], "nowhere.mp4 does not exist"),
        (["a.mp4", "--feasibility", "--setup", "SETUP"], "--output with --feasibility"),
        (["--feasibility", "--setup", "SETUP", "--start", "1s"], "--output, --start with --feasibility"),
        (
            ["--feasibility", "--setup", "SETUP", "--marks", "none.csv", "--track", "none.csv", "--no-tracking"],
            "--output, --marks, --no-tracking, --track with --feasibility",
        ),
        (["a.mp4", "--setup", "SETUP", "--width", "640"], "--width without --feasibility"),
    ],
)
def test_bad_usage_is_one_sentence_and_leaves_nothing(
    run: Run, setup_file: str, tmp_path: Path, arguments: list[str], words: str
) -> None:
    folder = tmp_path / "out"
    named = [setup_file if argument == "SETUP" else argument for argument in arguments]
    outcome = run("measure", *named, "-o", str(folder))
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert outcome.err.count("\n") == 1
    assert not folder.exists()
