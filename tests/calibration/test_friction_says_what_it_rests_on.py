"""B_eff rests on viscosity and motor constants: sensitivities, stated uncertainties, and what is not separable."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.table import Table

import spirillum as sp
from spirillum.calibration.fit_warnings import common_warnings
from spirillum.calibration.parameters import Estimate
from spirillum.cli import main
from spirillum.cli.tables.fits import _friction, calibration

PRESETS = ("biorob2012-wide", "biorob2012-narrow")
WIDE = PRESETS[0]
FOUR: dict[str, Any] = {"presets": (WIDE,), "wavelengths": (15.0, 25.0), "amplitudes": (1.5, 2.5)}
TRUTH = 1.1e-5


def fitted(path: Path, robots: Any = WIDE, **options: Any) -> Any:
    return sp.calibrate(path, robots, **{"method": "least-squares", "model": "sbt", **options})


@pytest.mark.parametrize("reading", ["rotor", "paper"])
def test_sensitivities_are_the_torques_of_the_balance(made: Callable[..., Path], reading: str) -> None:
    """B_eff = (K_m I - T_h)/omega_m: K_m moves it by K_m I/omega_m, viscosity by -T_h/omega_m."""
    found = fitted(made(**FOUR, seed=31, friction=TRUTH), friction=reading)
    seen = found.experiment
    for place, robot in enumerate(seen.robots):
        factors = {name: found.values[name].value for name in ("body_drag", "body_rotation")}
        own = robot.model_copy(update={"calibration": {"sbt": robot.calibration["sbt"].model_copy(update=factors)}})
        rate = float(seen.motor_rate.mean[place])
        steady = sp.predict(own, tail_rate=float(seen.tail_rate[place]), friction="rotor", model="sbt")
        torque = robot.motor.torque_constant * steady.motor_current
        change = {name: values[place] for name, values in found.friction_sensitivity.items()}
        assert change["motor.torque_constant"] == pytest.approx(torque / rate, rel=2e-3)
        friction = found.friction[place].value
        assert change["motor.torque_constant"] + change["fluid.viscosity"] == pytest.approx(friction, rel=1e-6)
        item = found.to_dict()["tails"][place]["effective_friction_per_percent"]["fluid.viscosity"]
        assert item == {"value": 0.01 * change["fluid.viscosity"], "unit": "N m s/rad"}


def test_answers_say_what_is_taken_as_exact(made: Callable[..., Path], tmp_path: Path) -> None:
    path = made(**FOUR, seed=31, friction=TRUTH)
    words = fitted(path, output=tmp_path, figures=False).to_dict()["effective_friction_statement"]
    assert "take fluid.viscosity, motor.torque_constant and motor.back_emf_constant as exact" in words
    assert words in (tmp_path / "calibration.toml").read_text()
    stated = fitted(path, assume_uncertainty={"fluid.viscosity": "5%"}).friction_statement
    assert "hold the stated uncertainty of fluid.viscosity (5 %) and take motor.torque_constant" in stated
    assert "effective_friction_statement" not in fitted(path, free="body_drag").to_dict()


def test_the_line_with_b_eff_names_what_it_takes_as_exact(made: Callable[..., Path]) -> None:
    """With how much each moves it, and without what was stated."""
    path = made(**FOUR, seed=31, friction=TRUTH)
    found = fitted(path)
    middle = np.median([item.value for item in found.friction])
    change = 100 * np.median(found.friction_sensitivity["fluid.viscosity"]) / middle
    (line,) = (line for line in _friction(found.to_dict()) if line.startswith("B_eff takes as exact: "))
    assert f"fluid.viscosity (1 % more: {0.01 * change:+.2g} %), motor.torque_constant (1 % more: +" in line
    stated = dict.fromkeys(("fluid.viscosity", "motor.torque_constant", "motor.back_emf_constant"), "5%")
    known = list(_friction(fitted(path, assume_uncertainty={"fluid.viscosity": "5%"}).to_dict()))
    assert any(line.startswith("B_eff takes as exact: motor.torque_constant") for line in known)
    assert not any("takes as exact" in line for line in _friction(fitted(path, assume_uncertainty=stated).to_dict()))


def test_an_interval_that_reaches_below_zero_says_so(made: Callable[..., Path]) -> None:
    found = fitted(made(**FOUR, seed=31, friction=TRUTH))
    sure, unsure = Estimate(TRUTH, 0.9 * TRUTH, 1.1 * TRUTH), Estimate(TRUTH, -TRUTH, 3.0 * TRUTH)
    assert "friction-negative" not in [note.code for note in common_warnings(found.problem, [sure] * 4)]
    (said,) = [n for n in common_warnings(found.problem, [sure, unsure] * 2) if n.code == "friction-negative"]
    assert f"B_eff of {found.experiment.labels()[1]}, ... may be zero or less" in said


def test_stated_uncertainties_widen_the_intervals_by_their_share(made: Callable[..., Path]) -> None:
    """Independent errors add in squares; values and what predictions rest on stay."""
    path = made(**FOUR, seed=31, friction=TRUTH)
    alone, stated = (
        fitted(path),
        fitted(path, assume_uncertainty={"motor.torque_constant": 0.08, "fluid.viscosity": 0.1}),
    )
    change = alone.friction_sensitivity
    for place, (one, other) in enumerate(zip(alone.friction_within_model, stated.friction_within_model, strict=True)):
        expected = np.sqrt(
            (0.5 * (one.high - one.low)) ** 2
            + (0.08 * change["motor.torque_constant"][place]) ** 2
            + (0.1 * change["fluid.viscosity"][place]) ** 2
        )
        assert 0.5 * (other.high - other.low) == pytest.approx(expected, rel=0.08)
        assert other.value == one.value
    assert stated.friction_given == alone.friction_within_model


def coverage(made: Callable[..., Path], count: int) -> tuple[float, float]:
    """Share of the intervals that hold the truth where the viscosity is off by 7 % (one standard deviation).

    Of intervals with that stated, and of those that take the viscosity as exact.
    """
    rng = np.random.default_rng(5)
    stated, unstated = [], []
    for seed in range(count):
        viscosity = 3.5 * np.exp(rng.normal() * np.log1p(0.14) / 1.96)
        path = made(
            friction=TRUTH,
            seed=100 + seed,
            discrepancy=0.03,
            overrides={"fluid.viscosity": f"{viscosity} Pa s"},
        )
        found = fitted(path, PRESETS, assume_uncertainty={"fluid.viscosity": "14%"})
        stated += [item.low <= TRUTH <= item.high for item in found.friction_within_model]
        unstated += [item.low <= TRUTH <= item.high for item in found.friction_given]
    return float(np.mean(stated)), float(np.mean(unstated))


def test_intervals_hold_the_truth_where_the_viscosity_is_off_as_stated(made: Callable[..., Path]) -> None:
    stated, unstated = coverage(made, 6)
    assert unstated < 0.85
    assert stated > 0.88


@pytest.mark.slow
def test_intervals_hold_the_truth_over_many_viscosities(made: Callable[..., Path]) -> None:
    stated, _ = coverage(made, 25)
    assert stated > 0.88


def _with_stated_errors(path: Path, rng: np.random.Generator, output: Path) -> Path:
    """One trial of each tail, its three rates off by relative errors that the file states."""
    comment, header, *rows = path.read_text().splitlines()
    lines = [comment, f"{header},forward_velocity_mm_s_ci95,tail_rate_Hz_ci95,body_rate_Hz_ci95"]
    for row in rows:
        cells = row.split(",")
        true, size = np.array(cells[5:], dtype=float), rng.uniform(0.003, 0.03, 3)
        seen = true * (1.0 + size * rng.normal(size=3))
        lines.append(",".join([*cells[:5], *(f"{v:.9g}" for v in (*seen, *np.abs(1.96 * size * true)))]))
    output.write_text("\n".join(lines) + "\n")
    return output


def test_intervals_hold_the_truth_where_single_trials_state_their_errors(
    made: Callable[..., Path], tmp_path: Path
) -> None:
    exact = made(friction=TRUTH, error=0.0, trials=1)
    held = []
    for seed in range(4):
        path = _with_stated_errors(exact, np.random.default_rng(seed), tmp_path / "observations.csv")
        found = fitted(path, PRESETS)
        held += [item.low <= TRUTH <= item.high for item in found.friction_within_model]
    # 95 % of 128 is 122; fewer than 113 or more than 127 would happen once in a thousand such tests.
    assert 113 <= sum(held) <= 127
    words = " ".join(found.warnings)
    assert "include its stated errors and not how trials differ" in words
    assert "too narrow" not in words


def test_the_scatter_of_trials_holds_their_stated_errors(made: Callable[..., Path], tmp_path: Path) -> None:
    """Stated errors that are small beside the scatter change nothing; large ones are what counts."""
    path = made(**FOUR, seed=31, friction=TRUTH)
    comment, header, *rows = path.read_text().splitlines()
    widths = []
    for share in ("", 1e-4, 0.2):
        halves = [share and share * float(row.split(",")[6]) for row in rows]
        lines = [comment, f"{header},motor_rate_Hz_ci95", *(f"{row},{h}" for row, h in zip(rows, halves, strict=True))]
        (tmp_path / "stated.csv").write_text("\n".join(lines) + "\n")
        widths.append(
            np.array([item.high - item.low for item in fitted(tmp_path / "stated.csv").friction_within_model])
        )
    assert widths[1] == pytest.approx(widths[0], rel=1e-9)
    assert np.all(widths[2] > 2.0 * widths[0])


def test_friction_of_each_tail_leaves_nothing_to_tell_viscosity_by(made: Callable[..., Path]) -> None:
    with pytest.raises(sp.InputError, match="free = 'friction' together with 'viscosity': B_eff of each tail takes up"):
        fitted(made(**FOUR), free="body_drag,friction,viscosity")


@pytest.mark.parametrize(
    ("free", "model", "named"),
    [
        (
            "body_drag,body_rotation,viscosity,torque_constant,shared_friction",
            "sbt",
            {"viscosity", "torque_constant", "shared_friction"},
        ),
        (
            "body_drag,body_rotation,normal_factor,tangential_factor",
            "rft",
            {"body_drag[30 mm]", "body_drag[40 mm]", "body_rotation[30 mm]", "normal_factor", "tangential_factor"},
        ),
    ],
)
def test_numbers_that_cannot_be_told_apart_are_refused_by_name(
    made: Callable[..., Path], free: str, model: str, named: set[str]
) -> None:
    """Torques scale with K_m, mu and B_eff together; motion per turn with ratios of resistances alone."""
    with pytest.raises(sp.InputError, match="cannot be distinguished by the observations") as caught:
        fitted(made(seed=1), PRESETS, free=free, model=model)
    words = str(caught.value).partition(": ")[2].partition(" cannot")[0]
    assert named <= set(words.replace(" and ", ", ").split(", "))
    assert ("body_drag" in words) == ("body_drag[30 mm]" in named)


def test_one_of_them_stated_settles_the_others(made: Callable[..., Path]) -> None:
    """K_m known to 4 %: viscosity and B_eff are then known to little more."""
    found = fitted(
        made(seed=1, friction=TRUTH),
        PRESETS,
        free="body_drag,body_rotation,viscosity,shared_friction",
        assume_uncertainty={"motor.torque_constant": "4%"},
    )
    assert "torque_constant" in found.values
    for name, truth in (("viscosity", 3.5), ("shared_friction", TRUTH)):
        item = found.values[name]
        assert item.low < truth < item.high
        assert 0.03 < 0.5 * np.log(item.high / item.low) < 0.06


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["fluid.viscosity"], "allowed: FIELD=SHARE"),
        (["fluid.viscosity=5%", "fluid.viscosity=6%"], "each field once"),
        (["fluid.density=5%"], "assume-uncertainty = 'fluid.density'"),
        (["fluid.viscosity=5 mm"], "such as 5%"),
        (["fluid.viscosity=-5%"], "such as 5%"),
        (["fluid.viscosity=80%"], "up to 50%"),
        (["fluid.viscosity=5%", "--free=body_drag"], "none of these depends on it"),
        (["fluid.viscosity=5%", "--method=paper"], "which gives no intervals"),
    ],
)
def test_wrong_statements_are_refused(
    made: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], given: list[str], words: str
) -> None:
    options = [item if item.startswith("--") else f"--assume-uncertainty={item}" for item in given]
    with pytest.raises(SystemExit) as stopped:
        main(["calibrate", str(made(**FOUR)), WIDE, "--model=sbt", "-o", str(tmp_path), "--no-figures", *options])
    assert stopped.value.code == 2
    assert words in capsys.readouterr().err


def test_a_narrow_channel_that_drags_less_is_remarked(made: Callable[..., Path]) -> None:
    path = made(drag=(3.0, 2.0), seed=3)
    for method in ("least-squares", "paper"):
        said = [
            words
            for words in fitted(path, PRESETS, method=method).warnings
            if "narrower channel has more drag" in words
        ]
        assert len(said) == 1
        assert said[0].startswith("body_drag[30 mm] = ")
        assert "overlap" not in said[0]
    assert not any("narrower channel has more drag" in words for words in fitted(made(seed=3), PRESETS).warnings)
    close = fitted(made(drag=(2.02, 2.0), seed=3), PRESETS).warnings
    assert all("intervals overlap" in words for words in close if "narrower channel has more drag" in words)


@pytest.mark.parametrize(
    ("factors", "names"), [((1,), ["B_eff"]), ((2, 1, 3), ["B_eff, least of 3 tails", "B_eff, greatest of them"])]
)
def test_the_table_gives_b_eff_with_the_intervals_of_its_tails(
    made: Callable[..., Path], factors: tuple[int, ...], names: list[str]
) -> None:
    tails = [
        {"effective_friction": {"value": 4 * f, "low": 3 * f, "high": 5 * f, "unit": "N m s/rad"}} for f in factors
    ]
    answer = fitted(made(**FOUR)).to_dict() | {"tails": tails, "folder": "", "files": ()}
    (table,) = (block for block in calibration(answer) if isinstance(block, Table))
    rows = [row for row in zip(*(column.cells for column in table.columns), strict=True) if str(row[0]) in names]
    ends = (min(factors), max(factors)) if len(factors) > 1 else factors
    shown = [(name, *(str(by * f) for by in (4, 3, 5)), "N m s/rad") for name, f in zip(names, ends, strict=True)]
    assert rows == shown
