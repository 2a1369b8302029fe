"""`suggest`: no information from certainty, more trials tell more, and the promised narrowing comes true."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum import InputError
from spirillum.results.calibration import write_calibration
from synthetic_experiments import SHORT

WIDE, NARROW = "biorob2012-wide", "biorob2012-narrow"
FEW = {"wavelengths": (15.0, 25.0), "amplitudes": (2.0, 3.0), "discrepancy": 0.03, "seed": 9}


@pytest.fixture(scope="module")
def fitted(made: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A posterior from four tails in the wide channel."""
    found = sp.calibrate(made(presets=(WIDE,), **FEW), WIDE, free="body_drag,body_rotation", sampling=SHORT)
    folder = tmp_path_factory.mktemp("suggest")
    write_calibration(found, folder, figures=False)
    return folder


def candidates(folder: Path, *rows: str) -> Path:
    path = folder / "candidates.csv"
    path.write_text("\n".join(["# tails in stock", "channel_diameter_mm,wavelength_mm,amplitude_mm", *rows]) + "\n")
    return path


def test_more_trials_tell_more_up_to_the_discrepancy(fitted: Path) -> None:
    path = candidates(fitted, "40,20,2.5")
    gains = [
        sp.suggest(fitted / "posterior.nc", WIDE, candidates=path, trials=n).candidates[0].gain for n in (1, 5, 10**6)
    ]
    assert 0 < gains[0] < gains[1] < gains[2] < 2 * gains[1]


def test_a_posterior_of_held_motion_is_not_one_of_trials(fitted: Path) -> None:
    with pytest.raises(InputError, match="is of held motion; allowed: as held"):
        sp.suggest(fitted / "posterior.nc", WIDE, answer="trial")


def test_a_certain_posterior_learns_nothing(fitted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from spirillum.fitted import posterior_file

    known = posterior_file.read_posterior(fitted / "posterior.nc")
    drawn = {name: np.full_like(values, 1.5) for name, values in known.draws.items()}
    certain = known.model_copy(update={"draws": drawn})
    monkeypatch.setattr("spirillum.calibration.suggest.read_posterior", lambda _path, *, answer: certain)
    found = sp.suggest(fitted / "posterior.nc", WIDE, candidates=candidates(fitted, "40,20,2.5"))
    assert found.candidates[0].gain == pytest.approx(0.0, abs=1e-9)


def test_gain_and_narrowing_are_those_of_a_linear_gaussian_measurement(
    fitted: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Narrow normal draws: information and posterior covariance in closed form, with sensitivities of `swim`."""
    from spirillum.fitted import posterior_file
    from spirillum.robot.batch import RobotBatch
    from spirillum.robot.load import load

    rng = np.random.default_rng(4)
    spread, tau, sigma, trials = np.array([0.03, 0.02]), 0.01, 0.02, 5
    middle = np.array([2.5, 0.8])
    drawn = middle * np.exp(spread * rng.normal(size=(40_000, 2)))
    draws = {"body_drag": drawn[:, :1], "body_rotation": drawn[:, 1:]}
    one = np.ones(40_000)
    changed = {
        "draws": draws,
        "discrepancy": {"advance": tau * one, "turning": tau * one},
        "error": {"advance": sigma * one, "turning": sigma * one},
    }
    known = posterior_file.read_posterior(fitted / "posterior.nc").model_copy(update=changed)
    monkeypatch.setattr("spirillum.calibration.suggest.read_posterior", lambda _path, *, answer: known)
    found = sp.suggest("any", WIDE, candidates=candidates(fitted, "40,20,2.5"), trials=trials).candidates[0]

    robot = load(WIDE, **{"tail.wavelength": "20 mm", "tail.amplitude": "2.5 mm"})

    def seen(factors: np.ndarray) -> np.ndarray:
        entry = robot.calibration["sbt"].model_copy(
            update={"body_drag": float(factors[0]), "body_rotation": float(factors[1])}
        )
        swum = sp.swim(RobotBatch.of(robot.model_copy(update={"calibration": {"sbt": entry}})))
        return np.log([swum.advance_per_radian[0], -swum.body_rotation_rate[0] / swum.tail_rotation_rate[0]])

    steps = 1e-4 * np.eye(2)
    jacobian = np.stack([(seen(middle * np.exp(s)) - seen(middle * np.exp(-s))) / 2e-4 for s in steps], axis=1)
    noise = (tau**2 + sigma**2 / trials) * np.eye(2)
    before = np.diag(spread**2)
    after = np.linalg.inv(np.linalg.inv(before) + jacobian.T @ np.linalg.inv(noise) @ jacobian)
    gain = 0.5 * np.log2(np.linalg.det(before) / np.linalg.det(after))
    assert found.gain == pytest.approx(gain, rel=0.02)
    for place, name in enumerate(("body_drag", "body_rotation")):
        assert found.narrowing[name] == pytest.approx(np.sqrt(after[place, place]) / spread[place], rel=0.02)


def test_a_tail_for_which_the_model_is_not_accurate_is_said(fitted: Path) -> None:
    path = candidates(fitted, "40,20,2.5", "40,250,2.5")
    found = sp.suggest(fitted / "posterior.nc", WIDE, candidates=path)
    (said,) = [words for words in found.warnings if "accurate" in words]
    assert said.startswith("1 of 2 candidates, the first channel 40 mm, tail 250 x 2.5 mm: turns")


def test_a_candidate_that_stands_twice_is_refused(fitted: Path) -> None:
    path = candidates(fitted, "40,20,2.5", "40,12,1.5", "40.0,20,2.50")
    with pytest.raises(sp.InputError, match=r"candidates\.csv, .*wavelength_mm = 20, .* is a duplicate; allowed: each"):
        sp.suggest(fitted / "posterior.nc", WIDE, candidates=path)


def test_candidates_that_the_draws_do_not_tell_apart_are_a_tie(
    fitted: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The stated error is how much the difference varies between independent sets of draws."""
    from rich.console import Console

    from spirillum.cli.tables import blocks_of
    from spirillum.fitted import posterior_file

    path = candidates(fitted, "40,20,2.5", "40,20.01,2.5", "40,12,1.5")
    known, one = posterior_file.read_posterior(fitted / "posterior.nc"), np.ones(400)
    behind, errors = [], []
    for seed in range(40):
        drawn = np.array([2.5, 0.8]) * np.exp(np.array([0.1, 0.1]) * np.random.default_rng(seed).normal(size=(400, 2)))
        changed = {
            "draws": {"body_drag": drawn[:, :1], "body_rotation": drawn[:, 1:]},
            "discrepancy": {"advance": 0.01 * one, "turning": 0.01 * one},
            "error": {"advance": 0.02 * one, "turning": 0.02 * one},
        }
        drawn_anew = known.model_copy(update=changed)
        monkeypatch.setattr(
            "spirillum.calibration.suggest.read_posterior", lambda _path, *, answer, new=drawn_anew: new
        )
        found = sp.suggest("any", WIDE, candidates=path)
        last = next(item for item in found.candidates if item.wavelength < 0.015)
        sign = 1.0 if found.candidates[0].wavelength > 0.015 else -1.0
        behind.append(sign * (found.candidates[0].gain - last.gain))
        errors.append(last.behind_error)
        assert found.candidates[0].tied
    assert np.mean(errors) == pytest.approx(np.std(behind), rel=0.35)
    close = replace(
        found, candidates=tuple(replace(item, behind=0.002, behind_error=0.004) for item in found.candidates)
    )
    Console(width=300).print(*blocks_of(close.to_dict()))
    printed = capsys.readouterr().out
    assert "0.002 +- 0.004" in printed
    assert "a tie: 2 others are within two standard errors of the first" in printed
    assert [item["tied_with_the_best"] for item in close.to_dict()["candidates"]] == [True] * 3


def test_a_grid_is_ranked_and_what_cannot_be_built_is_said(fitted: Path) -> None:
    found = sp.suggest(fitted / "posterior.nc", [WIDE, NARROW])
    gains = [item.gain for item in found.candidates]
    assert gains == sorted(gains, reverse=True)
    assert len(gains) == 50
    path = candidates(fitted, "40,20,2.5", "40,20,30")
    assert any(
        "is left out" in warning for warning in sp.suggest(fitted / "posterior.nc", WIDE, candidates=path).warnings
    )


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (["40,20"], "row 3: 2 cells"),
        (["40,20,x"], "row 3, column amplitude_mm: 'x'"),
        (["40,20,-1"], "row 3, column amplitude_mm: '-1'"),
        (["30,20,2"], "row 3, column channel_diameter_mm: 30; allowed: 40 mm"),
        (["40,20,30"], "no candidate can be built"),
        ([], "holds 0 candidates"),
    ],
)
def test_wrong_candidates_are_refused_with_row_and_column(fitted: Path, rows: list[str], words: str) -> None:
    with pytest.raises(InputError) as caught:
        sp.suggest(fitted / "posterior.nc", WIDE, candidates=candidates(fitted, *rows))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("# nothing but a comment\n", "column 'channel_diameter_mm' is missing; allowed: a header line with"),
        ('channel_diameter_mm,wavelength_mm,amplitude_mm\n"40,20,2.5\n', "is not CSV"),
    ],
)
def test_a_file_that_is_no_table_of_candidates_is_refused(fitted: Path, tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "candidates.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        sp.suggest(fitted / "posterior.nc", WIDE, candidates=path)
    assert words in str(caught.value)


def test_trials_have_to_be_some(fitted: Path) -> None:
    with pytest.raises(InputError, match="trials = 0"):
        sp.suggest(fitted / "posterior.nc", WIDE, trials=0)


@pytest.mark.parametrize("robot", ["ecoli", "magnetic-helix"])
def test_a_robot_without_channel_is_refused(fitted: Path, robot: str) -> None:
    with pytest.raises(InputError, match="has no channel; allowed: robots with a channel"):
        sp.suggest(fitted / "posterior.nc", robot)


def test_two_robots_of_one_channel_are_refused(fitted: Path) -> None:
    with pytest.raises(
        InputError, match=r"robots biorob2012-wide and biorob2012-wide have the same channel\.diameter = 40 mm"
    ):
        sp.suggest(fitted / "posterior.nc", [WIDE, WIDE])


@pytest.mark.parametrize("field", ["tail.wavelength", "tail.amplitude"])
def test_a_set_tail_is_refused_for_every_candidate_has_its_own(
    fitted: Path, run: Callable[..., Any], field: str
) -> None:
    refused = run("suggest", str(fitted / "posterior.nc"), WIDE, "--set", f"{field}=4mm")
    said = f"spirillum: {field} is set, and every candidate has its own; allowed: other fields, or --candidates\n"
    assert (refused.code, refused.out, refused.err) == (2, "", said)


def test_a_set_field_of_robots_that_nobody_named_says_whose_they_are(fitted: Path, run: Callable[..., Any]) -> None:
    few = ("--candidates", str(candidates(fitted, "40,20,2.5")))
    found = run("suggest", str(fitted / "posterior.nc"), *few, "--set", "motor.resistance=5 ohm", "--json")
    assert found.code == 0
    assert "biorob2012-wide and biorob2012-narrow, are used" in json.loads(found.out)["warnings"][0]
    assert json.loads(found.out)["model_reason"].endswith(" was fitted with it")


def test_the_default_robots_are_for_their_own_posterior(fitted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from spirillum.fitted import posterior_file

    found = sp.suggest(fitted / "posterior.nc", candidates=candidates(fitted, "40,20,2.5", "30,20,2.5"))
    assert len(found.candidates) == 2
    assert "biorob2012-wide and biorob2012-narrow, are used" in found.warnings[0]
    known = posterior_file.read_posterior(fitted / "posterior.nc")
    for changed in (known.model_copy(update=new) for new in ({"channels": (0.024,)}, {"body": (0.016, 0.035)})):
        monkeypatch.setattr("spirillum.calibration.suggest.read_posterior", lambda _path, *, answer, one=changed: one)
        with pytest.raises(InputError, match="allowed: ROBOT, one for each channel"):
            sp.suggest("any")


def test_another_geometry_is_said(fitted: Path) -> None:
    other = {"extends": WIDE, "channel": {"diameter": "24 mm"}}
    found = sp.suggest(fitted / "posterior.nc", other, candidates=candidates(fitted, "24,20,2.5"))
    assert any("used outside its geometry, channel.diameter = 24 mm" in warning for warning in found.warnings)
    assert len(found.candidates) == 1
