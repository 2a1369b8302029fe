"""Observation files: what is read, and the sentence for everything that is wrong."""

from pathlib import Path

import numpy as np
import pytest

from spirillum import InputError
from spirillum.measurement.observations import read_observations, summarised

HEADER = "robot,channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"


def written(folder: Path, *lines: str) -> Path:
    path = folder / "observations.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_trials_become_means_in_si(tmp_path: Path) -> None:
    path = written(tmp_path, "# synthetic", HEADER, "a,40,25,2.5,1,1.0,1.2,-0.1", "", "a,40,25,2.5,2,1.2,1.4,")
    trials = read_observations(path)
    assert [item.row for item in trials] == [3, 5]
    found = summarised(trials)[(0.04, 0.025, 0.0025)]
    assert found.forward_velocity.value == pytest.approx(1.1e-3)
    assert found.tail_rate.value == pytest.approx(1.3 * 2 * np.pi)
    assert found.body_rate.value == pytest.approx(-0.1 * 2 * np.pi)
    assert (found.forward_velocity.trials, found.body_rate.trials) == (2, 1)
    # Not observed: tail less body rate, of the one trial that has both.
    assert (found.motor_rate.value, found.motor_rate.trials) == (pytest.approx(1.3 * 2 * np.pi), 1)


def test_trials_numbered_by_timestamps_are_told_apart(tmp_path: Path) -> None:
    """As are whole numbers beyond those of floating point, of any number of digits."""
    named = ("20261129224300121", "20261129224300122", f"{5000 * '1'}2", f"{5000 * '1'}3", "inf", "1e400")
    rows = [f"a,40,25,2.5,{trial},1.{place},1.2,-0.1" for place, trial in enumerate(named)]
    found = [item.trial for item in read_observations(written(tmp_path, HEADER, *rows))]
    assert found == [*named[:5], f"1{400 * '0'}"]
    for again, words in (("2.0261129224300121e16", "rows 2 and 8 are both"), ("20261129224300121.5", "row 8, column")):
        with pytest.raises(InputError, match=words):
            read_observations(written(tmp_path, HEADER, *rows, f"a,40,25,2.5,{again},1,1.2,-0.1"))


def test_a_mean_keeps_its_own_interval(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "channel_diameter_mm,wavelength_mm,amplitude_mm,trials,forward_velocity_mm_s,forward_velocity_mm_s_ci95",
        "30,20,1.5,5,0.7,0.05",
    )
    found = next(iter(summarised(read_observations(path)).values())).forward_velocity
    assert (found.value, found.half_width, found.trials) == (pytest.approx(7e-4), pytest.approx(5e-5), 5)


def test_one_trial_keeps_the_interval_that_it_states(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_Hz,body_rate_Hz,tail_rate_Hz_ci95,body_rate_Hz_ci95",
        "30,20,1.5,1.2,-0.3,0.03,0.04",
    )
    found = next(iter(summarised(read_observations(path)).values()))
    assert (found.tail_rate.half_width, found.tail_rate.trials) == (pytest.approx(0.03 * 2 * np.pi), 1)
    # Tail and body are read one by one: errors of their difference add in squares.
    assert found.motor_rate.half_width == pytest.approx(0.05 * 2 * np.pi)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([HEADER], "no observations"),
        (["# only a comment"], "no observations"),
        (["channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_hz", "40,25,2.5,1"], "tail_rate_Hz"),
        (["channel_diameter_mm,wavelength_mm,tail_rate_Hz", "40,25,1"], "'amplitude_mm' is missing"),
        (["channel_diameter_mm,wavelength_mm,amplitude_mm", "40,25,2.5"], "no measured column"),
        ([HEADER + ",robot", "a,40,25,2.5,1,1.0,1.2,-0.1,a"], "'robot' is a duplicate"),
        ([HEADER, "a,40,25,2.5,1,fast,1.2,-0.1"], "row 2, column forward_velocity_mm_s: 'fast'"),
        ([HEADER, "a,40,25,2.5,1,nan,1.2,-0.1"], "row 2, column forward_velocity_mm_s: 'nan'"),
        ([HEADER, "a,40,25,2.5,1,1e999,1.2,-0.1"], "column forward_velocity_mm_s"),
        ([HEADER, "a,-40,25,2.5,1,1,1.2,-0.1"], "column channel_diameter_mm: '-40'"),
        ([HEADER, "a,,25,2.5,1,1,1.2,-0.1"], "column channel_diameter_mm"),
        ([HEADER, "a,40,25,2.5,1,,,"], "nothing was measured"),
        ([HEADER, "a,40,25"], "row 2: 3 cells"),
        ([HEADER, "a,40,25,2.5,1,1,0,-0.1"], "column tail_rate_Hz: 0; allowed: a rate other than 0"),
        ([HEADER, "a,40,25,2.5,1,1e7,1,-0.1"], "a number up to 1e+06"),
        ([HEADER, "a,40,25,2.5,1,1_0,1,-0.1"], "'1_0'"),
        ([HEADER, "a,40,25,2.5,1,1,1,-0.1", "a,40,25,2.5,1,2,1,-0.1"], "rows 2 and 3 are both trial 1"),
        ([HEADER, "a,40,25,2.5,1,1,1,-0.1", "a,40,25,2.5,01,2,1,-0.1"], "rows 2 and 3 are both trial 1"),
        ([HEADER, "a,40,25,2.5,10,1,1,-0.1", "a,40,25,2.5,1.0e1,2,1,-0.1"], "rows 2 and 3 are both trial 10"),
        (
            ["channel_diameter_mm,wavelength_mm,amplitude_mm,trials,tail_rate_Hz", "40,25,2.5,5,1", "40,25,2.5,5,2"],
            "rows 2 and 3",
        ),
        (["channel_diameter_mm,wavelength_mm,amplitude_mm,trials,tail_rate_Hz", "40,25,2.5,0,1"], "column trials"),
        (
            [
                "channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_Hz,body_rate_Hz,motor_rate_Hz",
                "40,25,2.5,1,-0.1,5",
            ],
            "motor_rate_Hz: 5, but tail less body rate is 1.1",
        ),
        (
            [
                "channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_Hz,body_rate_Hz,motor_rate_Hz",
                *("40,25,2.5,1.5,-0.067,1.43", "40,25,2.5,1.2,-0.12,1.08", "40,25,2.5,0.9,-0.17,0.73"),
            ],
            "rows 2 to 4, column motor_rate_Hz: 1.43 is tail plus body rate in row 2; allowed: tail less body rate",
        ),
        (
            ["channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_Hz,tail_rate_Hz_ci95", "40,25,2.5,1,-1"],
            "tail_rate_Hz_ci95",
        ),
    ],
)
def test_wrong_files_are_refused_with_row_and_column(tmp_path: Path, lines: list[str], words: str) -> None:
    with pytest.raises(InputError, match=r"allowed|needed") as caught:
        read_observations(written(tmp_path, *lines))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_binary_empty_and_missing_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))
    (tmp_path / "empty.csv").touch()
    for name in ("binary.csv", "empty.csv", "missing.csv", "."):
        with pytest.raises(InputError, match="allowed"):
            read_observations(tmp_path / name)
