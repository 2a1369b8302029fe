"""What a calibration refuses: one sentence with row and column, exit code 2, nothing written."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import spirillum as sp
from spirillum import InputError
from spirillum.cli import main
from spirillum.results.calibration import write_calibration

WIDE = "biorob2012-wide"
HEADER = "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"
GOOD = ("40,25,2.5,1,1.0,1.2,-0.1", "40,20,2.5,1,0.9,1.2,-0.12", "40,15,2.5,1,0.8,1.2,-0.14")


def written(folder: Path, *lines: str) -> Path:
    path = folder / "observations.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["channel_diameter_mm,wavelength_mm,trial,tail_rate_Hz", "40,25,1,1"], "column 'amplitude_mm' is missing"),
        ([HEADER.replace("tail_rate_Hz", "tail_rate_rpm"), *GOOD], "column 'tail_rate_rpm' is unknown"),
        ([HEADER, *GOOD, "30,25,2.5,1,1.0,1.2,-0.1"], "row 5, column channel_diameter_mm: 30; allowed: the channel"),
        ([HEADER, *GOOD, "40,25,9,1,1.0,1.2,-0.1", "40,25,30,1,1.0,1.2,-0.1"], "row 6: no robot has this tail"),
        ([HEADER, "40,25,2.5,1,1.0,1.2,"], "has 1 means of 1 robots, fewer than the 2 free numbers"),
        (
            [HEADER, *(row.replace(row.split(",")[4], "1.0", 1) for row in GOOD)],
            "column forward_velocity_mm_s: all are 1",
        ),
        ([HEADER, *GOOD, "40,10,2.5,1,nan,1.2,-0.1"], "row 5, column forward_velocity_mm_s: 'nan'"),
        ([HEADER, *GOOD, "40,25,2.5,1,1.4,1.2,-0.1"], "rows 2 and 5 are both trial 1"),
        ([HEADER, *GOOD, "40,10,2.5,1,1.0,-1.2,0.1"], "row 5, column tail_rate_Hz: -1.2; allowed: positive"),
        ([HEADER, *GOOD, "40,10,2.5,1,1.0,1.2,0.1"], "row 5, column body_rate_Hz: 0.1; allowed: negative"),
        ([HEADER, *GOOD, "40,10,2.5,1,-1.0,1.2,-0.1"], "row 5, column forward_velocity_mm_s: the mean is backwards"),
        ([HEADER, *(row.rsplit(",", 1)[0] + "," for row in GOOD)], "free = 'body_rotation': nothing observed"),
        ([HEADER, *GOOD, "40,10,2.5,0.5,1.0,1.2,-0.1"], "row 5, column trial: '0.5'; allowed: a whole number"),
        (
            [HEADER, *GOOD, "40,10,2.5,1,1e6,1.2,-0.1"],
            "observations.csv, row 5, column forward_velocity_mm_s: Reynolds number (body diameter) = ",
        ),
        (
            [HEADER, *GOOD, "40,25,2.5,2,1.0,1e6,-0.1"],
            "observations.csv, row 5, column tail_rate_Hz: Reynolds number (tail amplitude) = ",
        ),
        (
            [f"{HEADER},motor_rate_Hz", *(f"{row}," for row in GOOD), "40,10,2.5,1,1.0,,-0.1,1e6"],
            "observations.csv, row 5, column motor_rate_Hz: Reynolds number (tail amplitude) = ",
        ),
        (
            [HEADER.rsplit(",", 2)[0], *(row.rsplit(",", 2)[0] for row in GOOD)],
            "row 2, column tail_rate_Hz: empty, as in all rows with a speed; allowed: tail_rate_Hz or motor_rate_Hz",
        ),
        (
            [HEADER + ",tail_rate_Hz_ci95", *(f"{row},-0.1" for row in GOOD)],
            "row 2, column tail_rate_Hz_ci95: '-0.1'; allowed: a number",
        ),
        (
            [HEADER, *(f"{row.rpartition(',')[0]},0" for row in GOOD)],
            "row 2, column body_rate_Hz: 0, as in all rows; allowed: what was observed, or an empty column",
        ),
    ],
)
def test_wrong_observations_name_row_and_column(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lines: list[str], words: str
) -> None:
    path = written(tmp_path, *lines)
    arguments = ["calibrate", str(path), WIDE, "--method", "least-squares", "--free", "body_drag,body_rotation"]
    with pytest.raises(SystemExit) as stopped:
        main([*arguments, "-o", str(tmp_path / "out")])
    printed = capsys.readouterr()
    assert stopped.value.code == 2
    assert words in printed.err
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"model": "cfd"}, "model = 'cfd'"),
        ({"method": "guess"}, "method = 'guess'"),
        ({"friction": "body"}, "friction = 'body'; allowed: rotor, paper"),
        ({"free": "drag"}, "free = 'drag'"),
        ({"free": "body_drag,body_drag"}, "is a duplicate"),
        ({"free": "normal_factor"}, "free = 'normal_factor' with model 'sbt'"),
        ({"free": "friction,shared_friction"}, "one of them"),
        ({"free": "friction", "method": "least-squares"}, "nothing to fit"),
        ({"free": "wire_diameter", "method": "paper"}, "method = 'paper' with free = 'wire_diameter'"),
        ({"robots": []}, "no robot is given"),
        ({"robots": [WIDE, {"extends": WIDE}]}, "the same channel.diameter"),
        ({"robots": [{"extends": WIDE, "channel": "none"}]}, "has no channel"),
    ],
)
def test_wrong_requests_name_what_is_allowed(tmp_path: Path, settings: dict[str, Any], words: str) -> None:
    path = written(tmp_path, HEADER, *GOOD)
    robots = settings.pop("robots", WIDE)
    with pytest.raises(InputError, match="allowed") as caught:
        sp.calibrate(path, robots, **settings)
    assert words in str(caught.value)


def test_friction_needs_a_motor_and_its_rate(tmp_path: Path) -> None:
    path = written(tmp_path, HEADER, *GOOD)
    driven = {"extends": WIDE, "drive": {"kind": "rate", "rate": "1 Hz"}}
    with pytest.raises(InputError, match="has no dc-motor"):
        sp.calibrate(path, driven, free="body_drag,friction")
    path = written(tmp_path, HEADER, *(row.rsplit(",", 1)[0] + "," for row in GOOD))
    with pytest.raises(InputError, match="has no motor rates"):
        sp.calibrate(path, WIDE, free="body_drag,friction")


def test_a_folder_of_other_origin_is_left_alone(tmp_path: Path, made: Callable[..., Path]) -> None:
    (tmp_path / "calibration.toml").write_text("[calibration.sbt]\n")
    found = sp.calibrate(made(), [WIDE, "biorob2012-narrow"], method="paper")
    with pytest.raises(InputError, match="unknown origin"):
        write_calibration(found, tmp_path)
    assert (tmp_path / "calibration.toml").read_text() == "[calibration.sbt]\n"


def test_a_robot_in_anothers_channel_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, f"robot,{HEADER}", *(f"{WIDE},{row}" for row in GOOD), f"{WIDE},30,15,2.5,1,.8,1.2,-.14")
    with pytest.raises(InputError, match="row 5, column robot: 'biorob2012-wide', but its channel of 30 mm"):
        sp.calibrate(path, [WIDE, "biorob2012-narrow"], method="paper")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["calibrate", "observations.csv", WIDE, "-o", ""], "-o '' is empty; allowed: -o DIR"),
        (["suggest", "posterior.nc", "--rows", "0"], "rows = 0; allowed: at least 1"),
    ],
)
def test_wrong_options_are_refused_before_anything_is_read(
    capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2
    assert words in capsys.readouterr().err
