"""`spirillum render` and `spirillum virtual-experiment`: options in, answers out."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from spirillum.units import Hz

Run = Callable[..., tuple[int, str, str]]
TINY = ("--duration", "0.1s", "--size", "96x64", "--tail-rate", "1.2Hz")


def test_render_answers_with_the_truth(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    words = ("--body-rate", "-0.1Hz", "--forward-velocity", "1mm/s", "--preset", "degraded", "--noise", "3", "--hand")
    code, out, _ = run("render", "biorob2012-wide", "-o", str(path), *TINY, *words, "--glare-fixed", "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["schema"] == "spirillum.virtual-trial/1"
    assert answer["synthetic"] is True
    assert answer["body_rotation_rate"]["value"] == pytest.approx(-0.1 * Hz)
    truth = json.loads(Path(answer["truth"]).read_text())
    what = truth["degradation"]
    assert (what["noise"], what["crf"], what["hand"], what["glare_moves"]) == (3.0, 33, True, False)
    assert truth["model"] == "prescribed"


def test_render_for_people_says_synthetic(run: Run, tmp_path: Path) -> None:
    code, out, _ = run(
        "render", "biorob2012-narrow", "-o", str(tmp_path / "a.mp4"), *TINY, "--set", "tail.wavelength=20mm"
    )
    assert code == 0
    assert "synthetic, 4 frames" in out
    assert "forward velocity" in out
    assert (tmp_path / "a.robot.toml").is_file()


def test_a_virtual_experiment_is_answered(run: Run, tmp_path: Path) -> None:
    code, out, _ = run("virtual-experiment", "-o", str(tmp_path / "e"), *TINY, "--trials", "1", "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["schema"] == "spirillum.virtual-experiment/1"
    assert [robot["robot"] for robot in answer["robots"]] == ["biorob2012-wide", "biorob2012-narrow"]
    code, out, _ = run("virtual-experiment", "-o", str(tmp_path / "e"), *TINY, "--trials", "1")
    assert code == 0
    assert "2 of them there before" in out


def test_a_film_is_of_a_robot_that_is_named_or_of_a_run(run: Run, tmp_path: Path) -> None:
    code, out, err = run("render", "-o", str(tmp_path / "a.mp4"), "--set", "tail.length=40mm")
    assert (code, out, err) == (
        2,
        "",
        "spirillum: set = tail.length=40mm without a robot; allowed: with a preset's name or a robot file\n",
    )
    code, out, err = run("render", "-o", str(tmp_path / "a.mp4"))
    assert (code, out) == (2, "")
    assert err.startswith("spirillum: no robot; allowed: a preset's name or a robot file, or a run")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", "a.avi"), "does not end in .mp4"),
        (("-o", "a.mp4", "--preset", "awful"), "allowed: clean, degraded"),
        (("-o", "a.mp4", "--tilt", "2"), "has no unit"),
        (("-o", "a.mp4", "--crf", "99"), "crf = 99"),
        (("-o", "frames", "--crf", "30"), "crf = 30 (of --crf or --trouble compression) for a folder of PNG files"),
        (("-o", "frames", "--trouble", "compression"), "allowed: with a video (.mp4)"),
        (("-o", "a.mp4", "--distortion", "nan"), "distortion = nan; allowed: -0.5 to 0.5"),
        (("-o", "a.mp4", "--distortion", "inf"), "distortion = inf"),
        (("-o", "a.mp4", "--distortion=-100"), "distortion = -100"),
        (("-o", "a.mp4", "--heading", "90deg"), "heading = 90 deg; allowed: -45 to 45 deg"),
        (("-o", "a.mp4", "--depth-error", "1m"), "--depth-error = 1000 mm"),
        (("-o", "a.mp4", "--depth-error=-20mm"), "--depth-error = -20 mm"),
        (("-o", "a.mp4", "--run", "no.nc"), "no.nc does not exist"),
        (("-o", "a.mp4", "--glare-fixed"), "--glare-fixed without glare; allowed: "),
        (
            (
                "-o",
                "a.mp4",
                "--forward-velocity",
                "1mm/s",
                "--body-rate",
                "1Hz",
                "--friction",
                "body",
            ),
            "friction = 'body' with a prescribed forward velocity, body and tail rate",
        ),
        (("-o", "no/where/a.mp4"), "no such folder"),
    ],
)
def test_bad_input_gets_one_sentence(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run("render", "biorob2012-wide", *TINY, *words)
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())
