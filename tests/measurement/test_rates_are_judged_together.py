"""Observed rates: noise refuses no file, a wrong convention of signs does, and the sentence names its rows."""

from pathlib import Path

import numpy as np
import pytest

from spirillum import InputError
from spirillum.calibration.experiment import read_experiment
from spirillum.measurement.observations import observations_answer, read_observations
from spirillum.robot.load import load

HEADER = "channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_Hz,body_rate_Hz,motor_rate_Hz"
STATED = f"{HEADER},tail_rate_Hz_ci95,body_rate_Hz_ci95,motor_rate_Hz_ci95"
WIDE = "biorob2012-wide"


def written(path: Path, rows: np.ndarray, header: str = HEADER) -> Path:
    lines = [",".join(f"{value:.6g}" for value in row) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


def noisy(rng: np.random.Generator, count: int, body: float, noise: float, sense: int) -> np.ndarray:
    """Rows of one tail whose rates err alike; `sense` 1: the motor's is tail less body rate, -1: tail plus body."""
    tail = np.full(count, 1.3)
    rates = np.stack([tail, -body * tail, tail + sense * body * tail], axis=1)
    lengths = np.tile([40.0, 25.0, 2.5], (count, 1))
    return np.hstack([lengths, rates * (1.0 + noise * rng.normal(size=rates.shape))])


@pytest.mark.parametrize("body", [0.02, 0.045, 0.1, 0.3])
def test_honest_noise_of_five_per_cent_refuses_no_file(tmp_path: Path, body: float) -> None:
    """The old rule for single rows refused most of these files."""
    rng = np.random.default_rng(11)
    for count in (1, 3, 10, 100, 100, 100, 100, 100):
        path = written(tmp_path / "o.csv", noisy(rng, count, body, 0.05, 1))
        assert len(read_observations(path)) == count


@pytest.mark.parametrize(("body", "noise"), [(0.045, 0.05), (0.1, 0.05), (0.3, 0.1), (0.1, 0.0)])
def test_a_wrong_convention_is_refused_and_its_rows_are_named(tmp_path: Path, body: float, noise: float) -> None:
    rng = np.random.default_rng(12)
    for _ in range(5):
        path = written(tmp_path / "o.csv", noisy(rng, 100, body, noise, -1))
        with pytest.raises(InputError, match=r"rows 2 to 101, column motor_rate_Hz: .* tail plus body rate in row 2"):
            read_observations(path)


def test_evidence_grows_with_rows_and_with_stated_precision(tmp_path: Path) -> None:
    """One row 9 % off is noise, doubted; where it is stated to half a per cent, or occurs five times, it is not."""
    row = [40, 25, 2.5, 1.5, -0.067, 1.43]
    (doubt,) = observations_answer(written(tmp_path / "1.csv", np.array([row])))["warnings"]
    assert doubt.startswith("row 2: motor_rate_Hz is nearer to tail plus body rate")
    five = np.array(row) * np.linspace(1.0, 1.1, 5)[:, None] ** [0, 0, 0, 1, 1, 1]
    stated = np.array([[*row, 0.007, 0.0005, 0.007]] * 2)
    for path in (written(tmp_path / "5.csv", five), written(tmp_path / "s.csv", stated, STATED)):
        with pytest.raises(InputError, match=r"rows 2.*, column motor_rate_Hz: 1.43 is tail plus body rate"):
            read_observations(path)


def test_a_slip_of_the_pen_is_refused_alone(tmp_path: Path) -> None:
    rows = noisy(np.random.default_rng(13), 30, 0.1, 0.05, 1)
    rows[7, 5] *= 10.0
    with pytest.raises(InputError, match=r"row 9, column motor_rate_Hz: .* but tail less body rate is"):
        read_observations(written(tmp_path / "o.csv", rows))


def test_a_body_at_rest_turns_either_way_by_chance(tmp_path: Path) -> None:
    """Body rates of 0.01 Hz to 0.02 Hz: some are positive. Stated errors or the scatter say that this is noise."""
    rng = np.random.default_rng(14)
    body = 0.02 * rng.normal(size=20) - 0.01
    assert np.any(body > 0)
    lengths = np.tile([40.0, 25.0, 2.5], (20, 1))
    rates = np.stack([np.full(20, 1.3), body, np.full(20, 0.04)], axis=1)
    header = "channel_diameter_mm,wavelength_mm,amplitude_mm,tail_rate_Hz,body_rate_Hz"
    plain = written(tmp_path / "o.csv", np.hstack([lengths, rates[:, :2]]), header)
    stated = written(tmp_path / "s.csv", np.hstack([lengths, rates]), f"{header},body_rate_Hz_ci95")
    for path in (plain, stated):
        assert read_experiment(path, [load(WIDE)]).size == 1
    rates[3, 1] = 0.2
    with pytest.raises(InputError, match=r"row 5, column body_rate_Hz: 0.2; allowed: negative"):
        read_experiment(written(tmp_path / "w.csv", np.hstack([lengths, rates[:, :2]]), header), [load(WIDE)])


def test_body_rates_without_signs_are_refused_with_all_their_rows(tmp_path: Path) -> None:
    rows = noisy(np.random.default_rng(15), 12, 0.1, 0.05, 1)[:, :5] * [1, 1, 1, 1, -1]
    path = written(tmp_path / "o.csv", rows, HEADER.rpartition(",")[0])
    with pytest.raises(InputError, match=r"rows 2 to 13, column body_rate_Hz: .* in row 2; allowed: negative"):
        read_experiment(path, [load(WIDE)])


def test_slow_trials_swim_either_way_by_chance(tmp_path: Path) -> None:
    header = "channel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,tail_rate_Hz"
    speeds = (0.02, 0.011, -0.012, 0.03, 0.024)
    rows = np.array([[40, 25, 2.5, speed, 1.2] for speed in speeds])
    assert read_experiment(written(tmp_path / "o.csv", rows, header), [load(WIDE)]).advance.trials[0] == 5
    rows[:, 3] = (1.18, 1.24, -1.17, 1.2, 1.21)
    with pytest.raises(InputError, match=r"row 4, column forward_velocity_mm_s: -1.17; allowed: the same sign"):
        read_experiment(written(tmp_path / "w.csv", rows, header), [load(WIDE)])


def test_equal_speeds_of_one_tail_may_be_rounded(tmp_path: Path) -> None:
    header = "channel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,tail_rate_Hz"
    rows = np.array([[40, 25, 2.5, 0.6, rate] for rate in (1.18, 1.2, 1.23)])
    assert read_experiment(written(tmp_path / "o.csv", rows, header), [load(WIDE)]).size == 1
    rows[:, 3] = 0.6184
    with pytest.raises(InputError, match=r"rows 2 to 4, column forward_velocity_mm_s: all are 0.6184"):
        read_experiment(written(tmp_path / "w.csv", rows, header), [load(WIDE)])


def test_a_mean_may_be_backwards_within_its_error(tmp_path: Path) -> None:
    header = "channel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,tail_rate_Hz"
    rows = np.array([[40, 25, 2.5, speed, 1.2] for speed in (0.01, -0.02, 0.005)])
    assert read_experiment(written(tmp_path / "o.csv", rows, header), [load(WIDE)]).advance.mean[0] < 0
    rows[:, 3] = (-0.21, -0.2, -0.19)
    with pytest.raises(InputError, match=r"rows 2 to 4, column forward_velocity_mm_s: the mean is backwards"):
        read_experiment(written(tmp_path / "w.csv", rows, header), [load(WIDE)])
