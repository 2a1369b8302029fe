"""Bad input: one sentence on standard error, exit code 2, nothing on standard output, nothing written."""

import os
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

WIDE = "biorob2012-wide"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["predict"], "Missing argument"),
        (["swim"], "No such command"),
        (["predict", WIDE, "--modle", "sbt"], "No such option"),
        (["simulate", WIDE, "--tail-rate", "1Hz", "-o", "x.nc"], "--set drive.kind=rate --set drive.rate=1.2Hz"),
        (["predict", "biorob2012-wild"], "did you mean biorob2012-wide?"),
        (["predict", "missing.toml"], "missing.toml does not exist"),
        (["predict", "."], "is a folder"),
        (["predict", ""], "robot = ''; allowed: a preset"),
        (["predict", WIDE, "--plot", ""], "--plot '' is empty; allowed: --plot FILE"),
        (["settle", WIDE, "-o", "a.png", "--plot", "b.png"], "is given twice; allowed: one FILE"),
        (["predict", WIDE, "--tail-rate", "1Hz", "--tail-rate=2Hz"], "--tail-rate is given twice; allowed: one RATE"),
        (["predict", WIDE, "--plot", "a\x01b.png"], r"'a\x01b.png' holds a control character"),
        (
            ["compare-models", WIDE, "--model", "rft", "--plot", "a.png"],
            "--plot with --model rft: effects need sbt and",
        ),
        (["compare-models", WIDE, "--calibrated", "--plot", "a.png"], "--plot with --calibrated: effects need"),
        (["simulate", WIDE, "--output="], "--output '' is empty; allowed: --output FILE"),
        (["predict", WIDE, "--plot", "/proc/x.png"], "/proc/x.png cannot be written"),
        (["predict", WIDE, "--eccentricity", "1"], "placement.eccentricity = 1: gap = 0 mm; allowed: at least"),
        (["predict", WIDE, "--set", "tail.wavelength=２０mm"], '"２０mm" is not a length'),
        (["predict", WIDE, "--set", "body={}"], "--set 'body={}' sets no field"),
        (["predict", WIDE, "--phases", "３"], "--phases '３' is not a number; allowed: the digits 0 to 9"),
        (["predict", WIDE, "--phases", "2.5"], "--phases = '2.5' is not allowed; allowed: a whole number"),
        (["prepare", WIDE, "--workers", "0"], "--workers = '0' is not allowed; allowed: greater than or equal to 1"),
        (["predict", WIDE, "--set", "tail.starts=40"], "--set over preset biorob2012-wide: tail.starts = 40 is not"),
        (["render", WIDE, "-o", "film.mp4", "--trouble", ""], "trouble ''; allowed: lost-frames"),
        (
            ["simulate", WIDE, "--model", "tube", "-o", "x.nc", "--roughness", "1nm", "--wait", "100s"],
            "roughness = 0.001 um; allowed: at least 0.18 um, because thinner films are not resolved",
        ),
        (["predict", WIDE, "--model", "cfd"], "model = 'cfd'; allowed: auto, sbt, rft"),
        (["predict", WIDE, "--model", "perrin"], "model = 'perrin'"),
        (
            ["predict", WIDE, "--model", "slender", "--band"],
            "--band with model 'slender'; allowed: only with",
        ),
        (["predict", WIDE, "--friction", "ice"], "friction = 'ice'; allowed: none, rotor, body, paper"),
        (["predict", WIDE, "--friction", ""], "friction = ''; allowed: none, rotor, body, paper"),
        (["predict", WIDE, "--tail-rate", "1"], 'tail-rate = "1" has no unit'),
        (["predict", WIDE, "--tail-rate", "1/s"], "does not say what turns"),
        (["predict", WIDE, "--tail-rate", "0 Hz"], "a tail at rest drives nothing"),
        (["predict", WIDE, "--tail-rate", "nan Hz"], "is not finite"),
        (["predict", WIDE, "--set", "tail.wavelength"], "is not PATH=VALUE"),
        (["predict", WIDE, "--set", "tail.wavelength=20"], "tail.wavelength = 20 has no unit"),
        (["predict", WIDE, "--set", "tail.wavelength=20 s"], '"s" is not a unit of length'),
        (["predict", WIDE, "--set", "tail.wavelength=0mm"], "out of range"),
        (["predict", WIDE, "--set", "tail.wavelenght=20mm"], "did you mean wavelength?"),
        (["predict", WIDE, "--set", "tail.amplitude=21mm"], "tail.amplitude = 21 mm; allowed: less than 19.5 mm"),
        (["predict", WIDE, "--set", "tail.wire_diameter=6mm", "--model", "rft"], "reversing the thrust"),
        (["predict", WIDE, "--set", "a" * 5000 + "=1"], "is not a known field"),
        (["predict", WIDE, "--set", "tail=" + "[" * 3000], "tail = "),
        (["predict", WIDE, "--set", "tail.wavelength=\x1b[31m"], "tail.wavelength"),
        (["predict", WIDE, "--set", "drive.kind=rate"], "drive.rate is missing"),
        (
            ["predict", WIDE, "--set", "friction.effective=1e-3 N m s/rad", "--friction", "paper"],
            "friction.effective = 0.001 N m s/rad; allowed: less than E_x",
        ),
        (["resistance", WIDE, "--part", "tail", "--model", "perrin"], "allowed: body"),
        (["resistance", WIDE, "--part", "coupling"], "allowed: body, tail, rotor, robot"),
        (
            ["compare-models", WIDE, "--model", "sbt", "--model", "slender", "--phases", "3"],
            "phases = 3 with models 'sbt' and 'slender'; allowed: only with model 'tube'",
        ),
        (
            ["compare-models", WIDE, "--model", "sbt", "--accuracy", "high"],
            "accuracy = 'high' with model 'sbt'; allowed: only with model 'slender' or 'tube'",
        ),
        (["compare-models", WIDE, "--model", "sbt", "--tolerance", "0.01"], "tolerance = 0.01 with model 'sbt'"),
        (["compare-models", WIDE, "--model", "sbt", "--model", "sbt"], "model 'sbt' is named twice; allowed: each"),
        (["resistance", WIDE, "--part", "wing"], "part = 'wing'"),
        (["resistance", WIDE, "--about", "nose"], "allowed: body, tail-root"),
        (["resistance", WIDE, "--phase", "1"], "has no unit"),
        (["magnetic-sweep", "magnetic-helix"], "Missing option"),
        (["simulate", WIDE, "-o", "no/such/folder/run.nc"], "cannot be written"),
        (["simulate", WIDE, "-o", "run.nc", "--on", "2s"], "is not FROM:TO"),
        (["simulate", WIDE, "-o", "run.nc", "--on", "2s:1s"], "start before stop"),
        (["simulate", WIDE, "-o", "run.nc", "--turns", "many"], "--turns"),
        (["simulate", WIDE, "-o", "run.nc", "--turns", "3", "--duration", "1s"], "turns = 3 together with a duration"),
        (["simulate", WIDE, "-o", "run.nc", "--draws", "100"], "draws = 100 without a posterior"),
        (["simulate", WIDE, "-o", "run.nc", "--column", "double"], "column = 'double' without a plot"),
        (
            ["simulate", WIDE, "--panels", "all"],
            "panels = 'all' without a plot, whose look it is; allowed: with --plot",
        ),
        (["simulate", WIDE, "--plot", "run.png", "--panels", "x"], "panels = 'x'; allowed: main, all"),
        (["calibrate", "a.csv", "b.csv", WIDE], "b.csv is a second observations file; allowed: one, which `spirillum"),
        (["export", "run.nc", "x.stl"], "run.nc is a run, which has no shape to write as .stl; allowed: .mcap"),
        (["control", WIDE, "--task", "hold-speed", "--speed", "1m/s"], "allowed: below 0.5349 mm/s, the robot's speed"),
        (["simulate", WIDE, "-o", "run.nc", "--model", "sbt"], "motion = 'free' with model 'sbt'"),
        (["simulate", WIDE, "-o", "run.nc", "--motion", "loose"], "motion = 'loose'; allowed: held, free"),
        (["simulate", WIDE, "-o", "run.nc", "--duty", "missing.csv"], "missing.csv does not exist"),
        (["simulate", WIDE, "-o", "run.nc", "--gap", "30mm"], "placement.gap = 30 mm; allowed: at most 11 mm"),
        (["simulate", WIDE, "-o", "run.nc", "--pitch", "30deg"], "placement.pitch"),
        (["simulate", WIDE, "-o", "run.nc", "--plot", "run.txt"], "does not end in"),
        (["simulate", WIDE, "-o", "run.nc", "--movie", "run.txt"], "does not end in"),
        (["simulate", WIDE, "-o", "run.nc", "--roughness", "1"], 'roughness = "1" has no unit'),
        (["predict", WIDE, "--model", "sbt", "--motion", "free"], "motion = 'free' with model 'sbt'"),
        (["predict", "magnetic-helix", "--set", "drive.joint=revolute"], "drive.joint = 'revolute'"),
        (["predict", "magnetic-helix", "--set", "magnetic.field=1mm"], "magnetic.field"),
        (["predict", WIDE, "--set", "drive.kind=magnetic"], "magnetic"),
        (["magnetic-sweep", WIDE, "-o", "sweep.nc"], "drive.kind = 'dc-motor'; allowed: 'magnetic'"),
        (["magnetic-sweep", "magnetic-helix", "-o", "sweep.nc", "--rate", "1"], "has no unit"),
        (["study", "missing.toml"], "missing.toml does not exist"),
        (["study", "--observations", "missing.csv"], "missing.csv does not exist"),
        (["study", "--set", "tail.taper=1e9"], "tail.taper"),
        (["schema", "robots"], "did you mean robot?"),
        (["simulate", WIDE, "-o", "run.txt"], "does not end in .nc"),
        (["simulate", WIDE, "-o", "run.nc", "--set", "drive.duty=0"], "drive.duty = 0"),
        (["predict", WIDE, "--set", 'tail.wavelength="20 mm"\nfluid.viscosity="1 Pa s"'], "tail.wavelength = "),
        (["predict", WIDE, "--set", 'name="a\\u0000b"'], "text without control characters"),
        (["predict", WIDE, "--set", "calibration.typo.body_drag=2.0"], "calibration.typo"),
        (["predict", WIDE, "--friction", "paper", "--tail-rate=-0.001Hz"], "tail-rate = -0.006283 rad/s"),
        (["predict", WIDE, "--tail-rate=238671 rad/s"], "positive battery voltage"),
        (["predict", WIDE, "--model", "x" * 50_000], "model = 'xxx"),
        (
            ["predict", WIDE, "--set", 'tail={amplitude="2 mm"}', "--set", "tail.amplitude=3mm"],
            "tail.amplitude is set by tail and again by tail.amplitude; allowed: each field once",
        ),
        (
            ["predict", WIDE, "--set", "body=none", "--set", "body.length=1mm"],
            "body is set by body and again",
        ),
        (["predict", WIDE, "--set", "tail.length=1mm", "--set", "tail.length=2mm"], "names tail.length twice"),
        (
            ["control", WIDE, "--with", "camera.latency=1ms", "--with", "camera.latency=2ms"],
            "names camera.latency twice",
        ),
        (
            ["compare-models", WIDE, "-o", "x.png", "--plot", "./x.png"],
            "x.png is named for two results; allowed: a file",
        ),
        (["simulate", WIDE, "-o", "run.nc", "--motion", "held", "--no-weight"], "--no-weight with motion = 'held'"),
        (["study", ""], "an empty word after study; allowed: a name"),
        (["calibrate", "", WIDE], "an empty word after calibrate; allowed: a name"),
        (["film", "", "-o", "a.mp4"], "an empty word after film; allowed: a name"),
        (
            ["predict", WIDE, "--set", "tail.curve=no.csv"],
            "no.csv does not exist; allowed: for tail.curve a CSV file of points (x, y, z) in mm",
        ),
        (["predict", WIDE, "--set", f"name={'x' * 300}"], "is not allowed; allowed: at most 200 characters"),
        (["citation", "cfd"], "allowed"),
        (["robot", "check", "missing.toml"], "does not exist"),
        (["robot", "new", "x.toml", "--from", "nothing"], "preset 'nothing'"),
        (["robot", "new", "no/such/folder/x.toml"], "cannot be written"),
    ],
)
def test_one_sentence_and_code_2(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run(*arguments)
    assert outcome.code == 2
    assert outcome.out == ""
    assert words in outcome.err
    assert outcome.err.startswith("spirillum: ")
    assert outcome.err.count("\n") == 1
    assert outcome.err.rstrip("\n").isprintable()
    assert len(outcome.err) < 900
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"\n \n", "is empty"),
        (bytes(range(256)), "is not text"),
        (b"[body", "is not TOML"),
        (b"body = 1\n", "body = 1"),
        (b"a = " + b"[" * 4000 + b"]" * 4000, "nested too deeply"),
        (b"a." * 20 + b"b = 1\n", "a is not a known field"),
        (b"a." * 2000 + b"b = 1\n", "a key of more than 24 parts"),
        (b'extends = "nothing"\n', "extends"),
        (b'extends = "biorob2012-wide"\n[tail]\nwavelength = nan\n', "tail.wavelength = nan"),
        (b'extends = "biorob2012-wide"\n[tail]\nwavelength = 1979-05-27\n', "tail.wavelength"),
        (b'extends = "biorob2012-wide"\ntail.wavelength = 1' + b"0" * 5000, "too long"),
    ],
)
def test_broken_robot_files(run: Callable[..., Any], tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(content)
    outcome = run("predict", str(path))
    assert outcome.code == 2
    assert words in outcome.err
    assert outcome.err.count("\n") == 1


def test_huge_file_is_refused_unread(run: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "huge.toml"
    with path.open("wb") as stream:
        os.truncate(stream.fileno(), 100 * 2**20)
    outcome = run("predict", str(path))
    assert outcome.code == 2
    assert "104857600 bytes" in outcome.err


def test_devices_are_not_replaced(run: Callable[..., Any], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.nc")
    outcome = run("simulate", WIDE, "-o", str(tmp_path / "pipe.nc"))
    assert outcome.code == 2
    assert "is not a regular file" in outcome.err
    assert (tmp_path / "pipe.nc").is_fifo()


def test_a_link_keeps_pointing_to_its_file(run: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "link.nc").symlink_to("real.nc")
    assert run("simulate", WIDE, "-o", str(tmp_path / "link.nc"), "--duration", "0.1s").code == 0
    assert (tmp_path / "link.nc").is_symlink()
    assert (tmp_path / "real.nc").is_file()


def test_interruption_leaves_with_130(run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from spirillum.studies import run as study_run

    def interrupted(*_: object, **_more: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(study_run, "map_tasks", interrupted)
    outcome = run("study", "-o", str(tmp_path / "out"))
    assert outcome.code == 130
    assert "interrupted" in outcome.err
    assert not (tmp_path / "out" / "dataset.nc").exists()


def test_interrupt_that_a_library_has_caught_leaves_with_130(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is being imported may take it for an import that failed, and fail later, for another reason."""
    from spirillum import cli
    from spirillum.studies import run as study_run

    def interrupted(*_: object, **_more: object) -> None:
        with suppress(KeyboardInterrupt):
            cli._interrupt(signal.SIGINT, None)
        raise TypeError("unsupported operand")

    monkeypatch.setattr(cli, "_interrupts", [])
    monkeypatch.setattr(study_run, "map_tasks", interrupted)
    outcome = run("study", "-o", str(tmp_path / "out"))
    assert outcome.code == 130
    assert outcome.err.endswith("spirillum: interrupted; finished files are kept\n")


@pytest.mark.parametrize(
    ("command", "work", "words"),
    [
        ("study -o out", "spirillum.studies.run.map_tasks", "robots that were finished are kept; the same"),
        ("prepare magnetic-helix", "spirillum.cli.renderer.progress_bar", "finished tables and poses are kept"),
        ("calibrate o.csv x.toml -o fit", "spirillum.robot.load.load", "an unfinished fit is not kept"),
        ("predict magnetic-helix", "spirillum.dynamics.prediction.predict", "finished files are kept"),
    ],
)
def test_an_interrupt_says_what_is_kept(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, work: str, words: str
) -> None:
    def interrupted(*_: object, **_more: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(work, interrupted)
    outcome = run(*command.split())
    assert outcome.code == 130
    assert outcome.err.splitlines()[-1].startswith(f"spirillum: interrupted; {words}")


def test_our_own_errors_are_not_hidden(run: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """A defect of ours must not look like bad input."""
    from spirillum.cli import main
    from spirillum.dynamics import prediction

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(prediction, "predict", broken)
    with pytest.raises(ZeroDivisionError):
        main(["predict", WIDE])
