"""What a fit reads from an observations file: trials, means, motor rates alone, several rows without a number."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.calibration.experiment import read_experiment
from spirillum.robot.load import load

WIDE = "biorob2012-wide"
SMALL = {"presets": (WIDE,), "wavelengths": (15.0, 25.0), "amplitudes": (1.5, 2.5)}


def _cells(path: Path) -> tuple[list[str], list[list[str]]]:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return lines[0].split(","), [line.split(",") for line in lines[1:]]


def test_each_trial_is_divided_by_its_own_rate(made: Callable[..., Path]) -> None:
    path = made(**SMALL, seed=12)
    header, rows = _cells(path)
    experiment = read_experiment(path, [load(WIDE)])
    own = [dict(zip(header, row, strict=True)) for row in rows[:5]]
    ratios = [1e-3 * float(r["forward_velocity_mm_s"]) / (2 * np.pi * float(r["tail_rate_Hz"])) for r in own]
    assert experiment.advance.mean[0] == pytest.approx(np.mean(ratios), rel=1e-12)
    assert experiment.advance.squares[0] == pytest.approx(np.var(ratios) * 5 / np.mean(ratios) ** 2, rel=1e-9)
    assert experiment.advance.pooled_error == pytest.approx(0.02, rel=0.5)
    assert experiment.synthetic
    assert experiment.size == 4


def test_means_with_intervals_give_nearly_what_their_trials_give(made: Callable[..., Path], tmp_path: Path) -> None:
    from spirillum.measurement.observations import read_observations, summarised

    path = made(**SMALL, seed=12)
    lines = ["channel_diameter_mm,wavelength_mm,amplitude_mm,trials,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"]
    lines[0] += ",forward_velocity_mm_s_ci95,tail_rate_Hz_ci95,body_rate_Hz_ci95"
    for (channel, wavelength, amplitude), seen in summarised(read_observations(path)).items():
        u, w, b = seen.forward_velocity, seen.tail_rate, seen.body_rate
        cells = [1e3 * channel, 1e3 * wavelength, 1e3 * amplitude, 5, 1e3 * u.value, w.value / 2 / np.pi]
        cells += [b.value / 2 / np.pi, 1e3 * u.half_width, w.half_width / 2 / np.pi, b.half_width / 2 / np.pi]
        lines.append(",".join(f"{cell:.10g}" for cell in cells))
    (tmp_path / "means.csv").write_text("\n".join(lines) + "\n")
    trials, means = (sp.calibrate(p, WIDE, method="least-squares", model="sbt") for p in (path, tmp_path / "means.csv"))
    for name, item in trials.values.items():
        assert means.values[name].value == pytest.approx(item.value, rel=0.01)
    # Without the trials nobody knows that rate and speed of a trial go together: its error looks larger.
    assert trials.error["advance"] < means.error["advance"] < 4 * trials.error["advance"]


def test_motor_rates_alone_tell_the_drag(made: Callable[..., Path], tmp_path: Path) -> None:
    """As in the paper's figures, which show speed and motor rate only."""
    header, rows = _cells(made(**SMALL, error=0.0, trials=1, drag=(2.3,)))
    place = {name: n for n, name in enumerate(header)}
    lines = ["channel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,motor_rate_Hz"]
    for row in rows:
        motor = float(row[place["tail_rate_Hz"]]) - float(row[place["body_rate_Hz"]])
        lines.append(",".join([*row[1:4], row[place["forward_velocity_mm_s"]], repr(motor)]))
    (tmp_path / "motor.csv").write_text("\n".join(lines) + "\n")
    found = sp.calibrate(tmp_path / "motor.csv", WIDE, free="body_drag,friction", method="least-squares")
    assert found.values["body_drag"].value == pytest.approx(2.3, rel=1e-6)
    assert [item.value for item in found.friction] == pytest.approx([1e-5] * 4, rel=1e-5)
    with pytest.raises(sp.InputError, match="column tail_rate_Hz: empty"):
        sp.calibrate(tmp_path / "motor.csv", WIDE, method="paper")


def test_rates_without_speeds_tell_the_rotation(made: Callable[..., Path], tmp_path: Path) -> None:
    header, rows = _cells(made(**SMALL, error=0.0, trials=1, rotation=(0.9,)))
    lines = [",".join(name for name in header if name != "forward_velocity_mm_s")]
    lines += [
        ",".join(cell for cell, name in zip(row, header, strict=True) if name != "forward_velocity_mm_s")
        for row in rows
    ]
    (tmp_path / "rates.csv").write_text("\n".join(lines) + "\n")
    found = sp.calibrate(tmp_path / "rates.csv", WIDE, free="body_rotation", method="least-squares")
    assert found.values["body_rotation"].value == pytest.approx(
        0.9, rel=2e-3
    )  # the drag is Table III's, not the planted
    assert found.problem.quantities == ("turning",)


def test_correlation_of_the_errors_is_found(tmp_path: Path) -> None:
    """Rates measured badly, all else well: both ratios err together, in opposite senses as the body turns backwards."""
    rng = np.random.default_rng(1)
    lines = ["channel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"]
    for wavelength in (15, 20, 25):
        for _ in range(8):
            error = 1 + 0.03 * rng.normal()
            lines.append(
                f"40,{wavelength},2.5,{1 + 1e-4 * rng.normal():.9g},{1.2 * error:.9g},{-0.1 + 1e-5 * rng.normal():.9g}"
            )
    (tmp_path / "o.csv").write_text("\n".join(lines) + "\n")
    assert read_experiment(tmp_path / "o.csv", [load(WIDE)]).correlation == pytest.approx(-0.95, abs=1e-6)  # clipped


def test_a_byte_order_mark_does_not_make_synthetic_data_measured(made: Callable[..., Path], tmp_path: Path) -> None:
    path = tmp_path / "bom.csv"
    path.write_bytes(b"\xef\xbb\xbf" + made(**SMALL, seed=12).read_bytes())
    assert read_experiment(path, [load(WIDE)]).synthetic


def test_what_was_derived_is_not_counted_as_measured(tmp_path: Path) -> None:
    from spirillum.measurement.observations import observations_answer

    path = tmp_path / "o.csv"
    lines = ["channel_diameter_mm,wavelength_mm,amplitude_mm,trial,tail_rate_Hz,body_rate_Hz,motor_rate_Hz"]
    # The row of commas is what a spreadsheet leaves of an empty one.
    path.write_text("\n".join([*lines, "40,15,2.5,1,1.2,-0.1,", ",,,,,,", "40,15,2.5,2,1.2,-0.1,1.3"]) + "\n")
    found = observations_answer(path)
    assert found["rows"] == 2
    assert found["measured"] == {"forward_velocity": 0, "tail_rate": 2, "body_rate": 2, "motor_rate": 1}


def test_what_a_trial_states_of_one_of_its_measurements_counts(made: Callable[..., Path], tmp_path: Path) -> None:
    """Whichever the ratio's parts it is; the answer says the error that the fit takes."""
    header, rows = _cells(made(**SMALL, seed=12))
    found = {}
    for column in ("", "forward_velocity_mm_s", "tail_rate_Hz"):
        of = header.index(column) if column else 0
        lines = [f"{','.join(header)},{column or 'tail_rate_Hz'}_ci95"]
        lines += [",".join([*row, f"{0.5 * float(row[of])}" if column else ""]) for row in rows]
        (tmp_path / "o.csv").write_text("\n".join(lines) + "\n")
        found[column] = sp.calibrate(tmp_path / "o.csv", WIDE, method="least-squares", model="sbt")
    widths = {name: one.values["body_drag"].high - one.values["body_drag"].low for name, one in found.items()}
    errors = {name: one.to_dict()["error_of_a_trial"]["advance"]["value"] for name, one in found.items()}
    for column in ("forward_velocity_mm_s", "tail_rate_Hz"):
        assert widths[column] > 2.0 * widths[""]
        assert errors[column] == pytest.approx(0.5 / 1.96, rel=1e-3)
    assert errors[""] == pytest.approx(found[""].error["advance"])
    reach = {name: one.friction_given[0].high - one.friction_given[0].low for name, one in found.items()}
    assert reach["tail_rate_Hz"] > 2.0 * reach[""]  # the motor's rate is the tail's less the body's
    assert reach["forward_velocity_mm_s"] == pytest.approx(reach[""], rel=0.3)
