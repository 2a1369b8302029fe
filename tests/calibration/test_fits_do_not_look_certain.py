"""Little data gives wide intervals, and what cannot be true is refused or named by its row."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.support.commands import run_command

import spirillum as sp
from spirillum import InputError
from spirillum.measurement.observations import ObservationRow, read_observations, without_copies
from spirillum.robot.batch import RobotBatch

WIDE = "biorob2012-wide"
PRESETS = (WIDE, "biorob2012-narrow")
HEADER = "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"
FOUR = {"presets": (WIDE,), "wavelengths": (15.0, 25.0), "amplitudes": (1.5, 2.5)}
BOTH = "body_drag,body_rotation"


def scaled(path: Path, out: Path, column: str, factor: float, rows: slice = slice(None)) -> Path:
    """The same file with some cells of a column times a factor; rows count from the first trial."""
    lines = path.read_text().splitlines()
    place = lines[1].split(",").index(column)
    for number in range(2, len(lines))[rows]:
        cells = lines[number].split(",")
        cells[place] = repr(float(cells[place]) * factor)
        lines[number] = ",".join(cells)
    out.write_text("\n".join(lines) + "\n")
    return out


@pytest.mark.parametrize(
    "rows", [["40,15,2.5,1,1.0,1.2,-0.12"], ["40,15,2.5,1,1.0,1.2,-0.12", "30,15,2.5,1,.7,1.2,-.12"]]
)
def test_as_many_numbers_as_means_give_wide_intervals_and_a_sentence(tmp_path: Path, rows: list[str]) -> None:
    path = tmp_path / "o.csv"
    path.write_text("\n".join([HEADER, *rows]) + "\n")
    found = sp.calibrate(path, PRESETS, free=BOTH, method="least-squares")
    assert all(item.high / item.low > 2.0 for item in found.values.values())
    assert any("as many free numbers as means of the speed" in warning for warning in found.warnings)


@pytest.mark.parametrize("trials", [1, 3])
def test_the_friction_says_when_nothing_tells_the_error_of_its_rate(made: Callable[..., Path], trials: int) -> None:
    path = made(**FOUR, error=0.02, trials=trials)
    found = sp.calibrate(path, WIDE, model="sbt", free=f"{BOTH},friction", method="least-squares")
    sentence = "the motor rate states no error"
    assert any(sentence in warning for warning in found.warnings) == (trials == 1)


@pytest.mark.parametrize(("seeds", "least"), [(12, 20), pytest.param(24, 42, marks=pytest.mark.slow)])
def test_few_tails_widen_the_intervals_as_students_distribution_does(
    made: Callable[..., Path], seeds: int, least: int
) -> None:
    """Two tails leave the discrepancy all but unknown."""
    inside = []
    for seed in range(seeds):
        path = made(
            **FOUR | {"amplitudes": (2.5,)}, seed=300 + seed, discrepancy=0.06, error=0.01, trials=3, drag=(2.0,)
        )
        found = sp.calibrate(path, WIDE, model="sbt", free=BOTH, method="least-squares")
        for name, truth in (("body_drag", 2.0), ("body_rotation", 0.6)):
            inside.append(found.values[name].low <= truth <= found.values[name].high)
    # 22.8 of 24 and 45.6 of 48 are expected, 20 and 42 are two and a half standard deviations less.
    assert sum(inside) >= least


def test_the_spread_of_a_discrepancy_follows_its_degrees_of_freedom() -> None:
    from spirillum.calibration.least_squares import _sampled_discrepancy

    rng = np.random.default_rng(1)
    # Far below the prior's scale, total/tau^2 is chi-squared (density of tau flat: one degree of freedom fewer).
    draws = _sampled_discrepancy(1e-2 * 31, 0.0, 31.0, 200_000, rng)
    assert np.mean(1e-2 * 31 / draws**2) == pytest.approx(30.0, rel=0.05)
    unseen = _sampled_discrepancy(0.0, 0.0, 0.0, 200_000, rng)
    assert np.median(unseen) == pytest.approx(0.3 * 0.6745, rel=0.02)


def test_what_no_observation_tells_stays_at_its_prior(made: Callable[..., Path], tmp_path: Path) -> None:
    lines = made(**FOUR, seed=5).read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    place = rows[0].index("forward_velocity_mm_s")
    kept = [",".join(cells[:place] + cells[place + 1 :]) for cells in rows]
    path = tmp_path / "o.csv"
    path.write_text("\n".join(kept) + "\n")
    found = sp.calibrate(path, WIDE, free=BOTH, method="least-squares")
    drag = found.values["body_drag"]
    assert 0.28 < drag.value < 14.0
    assert drag.high / drag.low > 10.0


@pytest.mark.parametrize("factor", [1e3, 1e-3])
@pytest.mark.parametrize("method", ["least-squares", "paper"])
def test_a_slip_of_units_is_refused(made: Callable[..., Path], tmp_path: Path, factor: float, method: str) -> None:
    path = scaled(made(**FOUR, seed=5), tmp_path / "o.csv", "forward_velocity_mm_s", factor)
    with pytest.raises(InputError, match="allowed"):
        sp.calibrate(path, WIDE, method=method, model="sbt")


def test_a_trial_that_swims_against_the_others_is_refused(made: Callable[..., Path], tmp_path: Path) -> None:
    path = scaled(made(**FOUR, seed=5), tmp_path / "o.csv", "forward_velocity_mm_s", -1.0, slice(6, 7))
    with pytest.raises(InputError, match=r"row 9, column forward_velocity_mm_s: .* allowed: the same sign"):
        sp.calibrate(path, WIDE, method="least-squares", model="sbt")


@pytest.mark.parametrize("method", ["least-squares", "paper"])
def test_an_outlying_trial_is_named_by_its_row(made: Callable[..., Path], tmp_path: Path, method: str) -> None:
    path = made(**FOUR, seed=5)
    assert not sp.calibrate(path, WIDE, method=method, model="sbt").experiment.outliers
    wrong = scaled(path, tmp_path / "o.csv", "forward_velocity_mm_s", 10.0, slice(6, 7))
    found = sp.calibrate(wrong, WIDE, method=method, model="sbt")
    assert any(
        w.startswith("row 9, column forward_velocity_mm_s: ") and "check the number" in w for w in found.warnings
    )


def test_a_tail_that_is_off_all_others_is_named_by_its_rows(made: Callable[..., Path], tmp_path: Path) -> None:
    path = made(**FOUR | {"amplitudes": (1.5, 2.0, 2.5, 3.0)}, seed=5)
    wrong = scaled(path, tmp_path / "o.csv", "forward_velocity_mm_s", 3.0, slice(5, 10))
    found = sp.calibrate(wrong, WIDE, method="least-squares", model="sbt")
    assert any(w.startswith("row 8, 9, 10, 11, 12: the speed of channel 40 mm") for w in found.warnings)


def test_the_papers_method_says_by_how_much_it_misses(made: Callable[..., Path]) -> None:
    path = made(drag=(3.0,), rotation=(1.5,), **FOUR, seed=6)
    found = sp.calibrate(path, WIDE, model="rft", method="paper")
    assert any("misses the body rate by" in warning for warning in found.warnings)


def test_trials_that_are_equal_in_every_number_count_once(made: Callable[..., Path], tmp_path: Path) -> None:
    lines = made(**FOUR, seed=5).read_text().splitlines()
    header = next(line for line in lines if line.startswith("robot"))
    place = header.split(",").index("trial")
    rows = [
        [cell for n, cell in enumerate(line.split(",")) if n != place] for line in lines if not line.startswith("#")
    ]
    copied = tmp_path / "copied.csv"
    copied.write_text("\n".join(",".join(row) for row in [*rows, rows[1], rows[1]]) + "\n")
    plain = tmp_path / "plain.csv"
    plain.write_text("\n".join(",".join(row) for row in rows) + "\n")
    found, alone = (sp.calibrate(file, WIDE, method="least-squares", model="sbt") for file in (copied, plain))
    assert any(line.startswith("rows 22, 23: equal to row 2 in every number") for line in found.warnings)
    assert found.values == alone.values
    study = {"models": ["sbt"], "friction": ["rotor"], "robots": [WIDE]}
    vary = {"tail.wavelength": ["15 mm", "25 mm"], "tail.amplitude": ["1.5 mm", "2.5 mm"]}
    twice, once = (sp.study({**study, "vary": vary}, observations=file) for file in (copied, plain))
    assert twice["observed_forward_velocity"].equals(once["observed_forward_velocity"])
    assert twice["observed_forward_velocity_ci95"].equals(once["observed_forward_velocity_ci95"])
    assert "equal to row 2 in every number" in twice.attrs["warnings"]
    assert "equal to row" not in once.attrs["warnings"]
    said = run_command("observations", "check", str(copied)).out
    assert "rows 22, 23: equal to row 2" in " ".join(said.split())


def test_the_mean_of_a_robots_motor_has_the_errors_of_tail_and_body(tmp_path: Path) -> None:
    names = "channel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz,trials"
    file = tmp_path / "means.csv"
    rows = [f"40,{w},{a},{0.3 * a + 0.01 * w},1.5,-0.067,5,0.02,0.01,0.001" for w in (15, 25) for a in (1.5, 2.5)]
    file.write_text(
        "\n".join([f"{names},forward_velocity_mm_s_ci95,tail_rate_Hz_ci95,body_rate_Hz_ci95", *rows]) + "\n"
    )
    found = sp.calibrate(file, WIDE, method="least-squares", model="sbt")
    assert not any("states no error" in line for line in found.warnings)


def test_one_tail_alone_is_not_said_to_be_missed(made: Callable[..., Path]) -> None:
    """There the discrepancy is its prior, which says nothing of the model."""
    one = {"wavelengths": (25.0,), "amplitudes": (2.5,), "presets": (WIDE,)}
    for free in ("body_drag", None):
        found = sp.calibrate(made(**one, seed=7), WIDE, free=free, method="least-squares", model="sbt")
        assert not any("from tail to tail, beyond" in warning for warning in found.warnings)
        assert any("a typical one is used" in warning for warning in found.warnings)
        best = sp.calibrate(made(**one, seed=7), WIDE, method="least-squares", model="sbt")  # as many factors as means
        assert not any("the best fit is" in warning for warning in best.warnings)


def test_one_tail_far_off_the_fit_is_not_laid_on_the_model(tmp_path: Path) -> None:
    """A wrong pose or viscosity would look the same: the sentence names both, the table blames neither."""
    file = tmp_path / "one.csv"
    rows = [f"40,25,2.5,{trial},0.{speed},1.2,-0.067" for trial, speed in enumerate((2184, 2264, 2175), 1)]
    names = "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"
    file.write_text("\n".join([names, *rows]) + "\n")
    fast = ["--method", "least-squares", "--no-figures", "-o", str(tmp_path / "fit")]
    said = " ".join(run_command("calibrate", str(file), WIDE, *fast).out.split())
    assert re.search(r"the best fit is \d+ % off the speed, and one tail cannot tell whether 'tube' or a fixed", said)
    assert "one tail cannot tell it from wrong fixed numbers" in said
    assert "misses the" not in said


def test_rows_that_state_other_intervals_are_no_copies() -> None:
    """And zero is zero, whatever its sign."""
    row = ObservationRow(2, WIDE, 0.04, 0.025, 2.5e-3, 1e-3, 5.0, 0.0, 5.0, 1, (1e-4, 0.1, 0.1, 0.1))
    other = replace(row, row=3, intervals=(1e-6, 0.1, 0.1, 0.1))
    kept, notes = without_copies([row, other, replace(row, row=4, body_rate=-0.0)])
    assert [item.row for item in kept] == [2, 3]
    assert [note.code for note in notes] == ["copy-of-a-trial"]


def test_a_row_that_leaves_its_intervals_out_is_a_copy() -> None:
    """Of the row that states them; two that state an interval each of another rate are trials of their own."""
    row = ObservationRow(2, WIDE, 0.04, 0.025, 2.5e-3, 1e-3, 5.0, -0.5, 5.5, 1, (np.nan,) * 4)
    other = replace(row, row=3, intervals=(np.nan, 0.1, np.nan, np.nan))
    most = replace(row, row=4, intervals=(1e-4, 0.1, 0.1, 0.1))
    kept, notes = without_copies([row, other, most])
    assert [item.row for item in kept] == [4]
    assert "rows 2, 3: equal to row 4" in str(notes[0])
    assert len(without_copies([replace(row, intervals=(1e-4, *row.intervals[1:])), other])[0]) == 2


def test_a_row_whose_third_rate_follows_from_the_others_is_a_copy_of_one_that_states_it(tmp_path: Path) -> None:
    """Whichever is left out; rows that state motor rates of their own are trials of their own."""
    file = tmp_path / "observations.csv"
    rows = [
        "0.51,1.45,-0.036,",
        "0.51,1.45,-0.036,1.486",
        "0.51,,-0.036,1.486",
        "0.51,1.45,,1.486",
        "0.51,1.45,-0.036,1.5",
    ]
    names = (
        "channel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz,motor_rate_Hz"
    )
    file.write_text("\n".join([names, *(f"40,25,2.5,{row}" for row in rows)]) + "\n")
    kept, notes = without_copies(read_observations(file))
    assert [item.row for item in kept] == [3, 6]
    assert [str(note).partition(";")[0] for note in notes] == [
        "rows 2, 4, 5: equal to row 3 in every number: a copy does not count"
    ]


def test_a_number_far_from_its_prior_is_named(made: Callable[..., Path]) -> None:
    found = sp.calibrate(made(**FOUR, seed=5, drag=(60.0,)), WIDE, method="least-squares", model="sbt")
    assert any(w.startswith("body_drag = ") and "from its prior's median" in w for w in found.warnings)
    with pytest.raises(InputError, match="body_drag comes out as"):
        sp.calibrate(made(**FOUR, seed=5, drag=(600.0,)), WIDE, method="paper")


@pytest.mark.parametrize(("share", "words"), [(0.0372, "3.7 %"), (1.0, "100 %"), (0.123, "12 %"), (-0.5, "-50 %")])
def test_shares_are_written_without_powers_of_ten(share: float, words: str) -> None:
    from spirillum.display import percent

    assert percent(share) == words


def test_a_wrong_model_is_said_to_miss_without_repeated_trials_too(made: Callable[..., Path], tmp_path: Path) -> None:
    path = made(presets=(WIDE,), trials=1, error=0.0, seed=21)
    found = sp.calibrate(path, WIDE, model="rft", method="least-squares")
    assert found.discrepancy["turning"].value > 0.1
    assert any("observed once a tail" in warning for warning in found.warnings)
    assert any("'rft' misses the body rate by" in warning for warning in found.warnings)
    own = sp.calibrate(path, WIDE, model="sbt", method="least-squares")
    assert not any("misses" in warning for warning in own.warnings)
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    means = [lines[0].replace("trial,", "trials,"), *(line.replace(",1,", ",3,", 1) for line in lines[1:])]
    (tmp_path / "means.csv").write_text("\n".join(means) + "\n")
    several = sp.calibrate(tmp_path / "means.csv", WIDE, method="least-squares", model="sbt").warnings
    assert any("has means without scatter" in warning for warning in several)
    assert not any("observed once" in warning for warning in several)


def test_a_number_that_was_pulled_far_is_not_called_unidentifiable(made: Callable[..., Path]) -> None:
    found = sp.calibrate(
        made(**FOUR, seed=22, friction=3e-5), WIDE, method="least-squares", free="viscosity", model="sbt"
    )
    assert any("standard deviations from its prior's median" in warning for warning in found.warnings)
    assert not any("hardly identifiable" in warning for warning in found.warnings)
    assert any("friction.effective is unset, and B_m alone acts" in warning for warning in found.warnings)
    rubbing = {"extends": WIDE, "friction": {"effective": "3e-5 N m s/rad"}}
    known = sp.calibrate(
        made(**FOUR, seed=22, friction=3e-5), rubbing, method="least-squares", free="viscosity", model="sbt"
    )
    assert not any("B_m" in warning for warning in known.warnings)


def test_friction_as_printed_says_that_it_does_not_give_the_rates_back(made: Callable[..., Path]) -> None:
    """At the observed motor rate (19) turns the body at K_m I/(f E_x): held against `predict` with that reading."""
    path = made(**FOUR, seed=23, error=0.0, trials=1)
    found = sp.calibrate(path, WIDE, method="paper", friction="paper")
    assert any("B_eff does not reproduce it" in words for words in found.warnings)
    assert not any("(19)" in words for words in sp.calibrate(path, WIDE, method="paper").warnings)
    z = found.problem.coordinate_of({name: np.array(item.value) for name, item in found.values.items()})
    turning = found.problem.printed_turning(z[None])[0]
    for place, robot in enumerate(found.experiment.robots):
        factors = {"body_drag": found.values["body_drag"].value, "body_rotation": found.values["body_rotation"].value}
        own = robot.calibration["sbt"].model_copy(update=factors)
        calibrated = robot.model_copy(update={"calibration": {"sbt": own}})
        seen = found.experiment
        swum = sp.swim(
            RobotBatch.of(calibrated),
            tail_rate=seen.tail_rate[place : place + 1],
            motor_rate=seen.motor_rate.mean[place : place + 1],
            friction="paper",
        )
        if swum.valid[0]:
            ratio = swum.body_rotation_rate[0] / swum.tail_rotation_rate[0]
            assert turning[place] == pytest.approx(ratio, rel=1e-9)


def test_rates_in_radians_are_suspected(made: Callable[..., Path], tmp_path: Path) -> None:
    path = scaled(made(**FOUR, seed=24), tmp_path / "a.csv", "tail_rate_Hz", 2 * np.pi)
    path = scaled(path, tmp_path / "b.csv", "body_rate_Hz", 2 * np.pi)
    found = sp.calibrate(path, WIDE, method="least-squares", model="sbt")
    assert any("check that rates are in Hz and not in rad/s" in warning for warning in found.warnings)


def test_every_value_lies_inside_its_interval(made: Callable[..., Path]) -> None:
    free = "body_drag,viscosity,torque_constant,shared_friction"
    stated = {"motor.torque_constant": "20%"}
    found = sp.calibrate(
        made(**FOUR, seed=25), WIDE, method="least-squares", free=free, assume_uncertainty=stated, model="sbt"
    )
    items = [*found.values.values(), *found.discrepancy.values(), *found.friction]
    assert all(item.low <= item.value <= item.high for item in items)
    assert all(item.value > 0 for item in found.discrepancy.values())
    for values, low, high in found.predicted.values():
        assert np.all((low <= values) & (values <= high))
