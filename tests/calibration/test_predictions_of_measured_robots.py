"""What a posterior knows of a robot that was measured, against Gaussian conditioning and by coverage."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.fitted.posterior_file import PosteriorFile, posterior_checksum
from spirillum.results.calibration import write_calibration
from spirillum.robot.load import load
from spirillum.swimming.intervals import sampled_discrepancy
from synthetic_experiments import SHORT

WIDE = "biorob2012-wide"


@cache
def wide() -> Any:
    return load(WIDE)


def known(size: int, tau: float, error: float, observed: dict[str, float], trials: int = 4, **tail: Any) -> Any:
    """A posterior with known discrepancy and error, and one robot that was observed; nothing was measured."""
    robot = wide()
    seen = {name: {"mean": mean, "trials": trials, "scale": abs(mean)} for name, mean in observed.items()}
    own = {
        "channel_diameter": 0.04,
        "wavelength": robot.tail.wavelength,
        "amplitude": robot.tail.amplitude,
        "seen": seen,
        "by_motor": False,
        "correlation": 0.0,
        "floor": 1e-9,
    }
    return robot, PosteriorFile(
        source="made up",
        sha256="",
        model="sbt",
        observations="none",
        synthetic=True,
        channels=(0.04,),
        body=(robot.body.diameter, robot.body.length),
        draws={"body_drag": np.ones((size, 1))},
        middle={},
        discrepancy={name: np.full(size, tau) for name in observed},
        error={name: np.full(size, error) for name in observed},
        friction=(),
        friction_reading="",
        tails=(own | tail,),
    )


def test_discrepancy_of_a_measured_robot_is_conditioned_on_its_mean() -> None:
    """Mean f tau^2 r/(tau^2 + s^2) and variance tau^2 s^2/(tau^2 + s^2) of a normal number seen with an error."""
    robot, posterior = known(400_000, 0.05, 0.04, {"advance": 1.1e-4})
    predicted = {"advance": np.full(400_000, 1.0e-4), "turning": np.full(400_000, -0.1)}
    factor = sampled_discrepancy(posterior, predicted, np.random.default_rng(0), posterior.measured(robot))["advance"]
    error = 0.04 * 1.1 / 2.0
    share = 0.05**2 / (0.05**2 + error**2)
    assert factor.mean() == pytest.approx(1.0 + 0.1 * share, abs=3e-4)
    assert factor.std() == pytest.approx(0.05 * np.sqrt(1.0 - share), rel=5e-3)


def test_correlated_errors_are_conditioned_together() -> None:
    """Against the covariance of a joint normal: cov(d, y) cov(y)^-1."""
    observed = {"advance": 1.05e-4, "turning": -0.09}
    robot, posterior = known(400_000, 0.05, 0.1, observed, trials=4, correlation=0.8)
    predicted = {"advance": np.full(400_000, 1e-4), "turning": np.full(400_000, -0.1)}
    found = sampled_discrepancy(posterior, predicted, np.random.default_rng(0), posterior.measured(robot))
    values = np.array([1e-4, -0.1])
    seen = np.array([1.05e-4, -0.09])
    errors = 0.1 * np.abs(seen) / 2.0
    noise = np.outer(errors, errors) * np.array([[1.0, 0.8], [0.8, 1.0]])
    prior = np.diag((0.05 * values) ** 2)
    gain = prior @ np.linalg.inv(prior + noise)
    mean = 1.0 + gain @ (seen - values) / values
    covariance = (prior - gain @ prior) / np.outer(values, values)
    draws = np.stack([found["advance"], found["turning"]])
    np.testing.assert_allclose(draws.mean(axis=1), mean, atol=3e-4)
    np.testing.assert_allclose(np.cov(draws), covariance, atol=2e-5)


def test_advance_over_the_motors_rate_is_compared_as_it_was_observed() -> None:
    observed = {"advance": 1.0e-4}
    robot, posterior = known(50_000, 0.05, 1e-4, observed, by_motor=True)
    predicted = {"advance": np.full(50_000, 1.2e-4), "turning": np.full(50_000, -0.2)}
    factor = sampled_discrepancy(posterior, predicted, np.random.default_rng(0), posterior.measured(robot))["advance"]
    assert factor.mean() == pytest.approx(1.0, abs=1e-3)  # 1.2e-4 over 1.2 is what was seen


def test_intervals_hold_the_truth_of_measured_robots() -> None:
    rng = np.random.default_rng(3)
    held = []
    for _ in range(400):
        truth = 1e-4 * (1.0 + 0.05 * rng.normal())
        mean = truth + 0.03 * abs(truth) / 2.0 * rng.normal()
        robot, posterior = known(1000, 0.05, 0.03, {"advance": mean})
        predicted = {"advance": np.full(1000, 1e-4), "turning": np.full(1000, -0.1)}
        drawn = 1e-4 * sampled_discrepancy(posterior, predicted, rng, posterior.measured(robot))["advance"]
        low, high = np.quantile(drawn, [0.025, 0.975])
        held.append(low <= truth <= high)
    assert 0.92 < np.mean(held) < 0.98


@pytest.fixture(scope="module")
def fitted(made: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Any:
    small = {"presets": (WIDE,), "wavelengths": (15.0, 25.0), "amplitudes": (1.5, 2.5), "discrepancy": 0.06}
    found = sp.calibrate(made(**small, seed=4), WIDE, sampling=SHORT, model="sbt")
    assert found.converged
    folder = tmp_path_factory.mktemp("measured")
    write_calibration(found, folder, figures=False)
    return found, folder


def test_a_measured_robot_is_predicted_at_its_own_mean(fitted: Any) -> None:
    found, folder = fitted
    for place, robot in enumerate(found.experiment.robots):
        rate = float(found.experiment.tail_rate[place])
        new, own = (
            sp.predict(robot, posterior=folder / "posterior.nc", tail_rate=rate, posterior_for=whose)
            for whose in ("new", "measured")
        )
        seen = rate * found.experiment.advance.mean[place]
        assert new.intervals is not None
        assert own.intervals is not None
        narrow = own.intervals.high["forward_velocity"] - own.intervals.low["forward_velocity"]
        assert narrow < 0.6 * (new.intervals.high["forward_velocity"] - new.intervals.low["forward_velocity"])
        assert own.intervals.low["forward_velocity"] < seen < own.intervals.high["forward_velocity"]
        assert own.intervals.low["forward_velocity"] < own.forward_velocity < own.intervals.high["forward_velocity"]
        answer = own.to_dict()
        assert answer["forward_velocity"]["value"] == own.forward_velocity
        assert answer["interval_of"].startswith("of this robot, which was measured")
        assert "this robot was measured itself: --for measured" in new.to_dict()["interval_of"]
        json.dumps(answer, allow_nan=False)


def test_the_own_drive_of_a_measured_robot_gives_back_its_rates(made: Callable[..., Path], tmp_path: Path) -> None:
    """B_eff was inferred with the body rate that was seen, and not with that of a draw, which the model misses."""
    one = {"presets": (WIDE,), "wavelengths": (25.0,), "amplitudes": (2.5,), "error": 0.002, "pace": 0.0005}
    found = sp.calibrate(made(**one, seed=6), WIDE, sampling=SHORT, model="sbt")
    write_calibration(found, tmp_path / "fitted", figures=False)
    answer = sp.predict(
        found.experiment.robots[0], posterior=tmp_path / "fitted" / "posterior.nc", posterior_for="measured"
    )
    assert answer.intervals is not None
    seen = float(found.experiment.tail_rate[0])
    low, high = (side["tail_rotation_rate"] for side in (answer.intervals.low, answer.intervals.high))
    assert low < seen < high
    assert high - low < 0.005 * seen  # with the body rates of the draws it was 6 % wide
    motor = answer.intervals.high["motor_rotation_rate"] - answer.intervals.low["motor_rotation_rate"]
    assert motor < 0.01 * seen


def test_only_what_was_measured_has_intervals_of_its_own(fitted: Any) -> None:
    path = fitted[1] / "posterior.nc"
    other = load(WIDE, **{"tail.wavelength": "20 mm"})
    with pytest.raises(
        sp.InputError, match="for = 'measured': biorob2012-wide with its body, channel and tail is none"
    ):
        sp.predict(other, posterior=path, posterior_for="measured", tail_rate=7.0)
    assert "--for" not in sp.predict(other, posterior=path, tail_rate=7.0).to_dict()["interval_of"]
    with pytest.raises(sp.InputError, match="allowed: with --posterior FILE"):
        sp.predict(WIDE, posterior_for="measured", tail_rate=7.0)
    with pytest.raises(sp.InputError, match="for = 'both'; allowed: new, measured"):
        sp.predict(WIDE, posterior=path, posterior_for="both", tail_rate=7.0)


def test_runs_take_model_and_motion_of_what_was_fitted(fitted: Any) -> None:
    folder, timing = fitted[1], {"duration": "1 s"}
    run = sp.simulate(WIDE, calibration=folder / "calibration.toml", timing=timing)
    assert (run.attrs["model"], run.attrs["motion"], run.attrs["calibrated"]) == ("sbt", "held", 1)
    said = run.attrs["warnings"].split("\n")
    assert said[0].startswith("the run uses model 'sbt': ")
    assert said[1].startswith(
        "model 'sbt' has the entries along and about the motor axis only: the run is axial motion"
    )
    other = sp.simulate(WIDE, model="rft", calibration=folder / "calibration.toml", timing=timing)
    assert (other.attrs["model"], other.attrs["motion"]) == ("rft", "free")
    assert "on which its factors do not act; use --model sbt" in other.attrs["warnings"].split("\n")[0]
    plain = sp.simulate(WIDE, motion="held", timing=timing)
    assert (plain.attrs["model"], plain.attrs["motion"]) == ("tube", "held")
    with pytest.raises(sp.InputError, match="allowed: --model sbt"):
        sp.simulate(WIDE, model="rft", posterior=folder / "posterior.nc", timing=timing)
    with pytest.raises(sp.InputError, match="a posterior alone"):
        sp.simulate(WIDE, posterior=folder / "posterior.nc", calibration=folder / "calibration.toml")
    with pytest.raises(sp.InputError, match="draws = 5; allowed: a whole number from 20 to 1000, or 0"):
        sp.simulate(WIDE, posterior=folder / "posterior.nc", draws=5, timing=timing)


def test_steady_means_of_runs_have_the_intervals_of_predictions(fitted: Any, tmp_path: Path) -> None:
    """Of the same draws, few enough that a run takes all of them as a prediction does."""
    import xarray as xr

    from spirillum.dynamics.run_summary import run_answer

    path = tmp_path / "posterior.nc"
    with xr.open_datatree(fitted[1] / "posterior.nc") as whole:
        few = whole.isel(chain=slice(24), draw=slice(4)).load()
    values = {str(name): item.to_numpy() for name, item in few["posterior"].data_vars.items()}
    few.attrs["checksum"] = posterior_checksum(few.attrs, values)
    few.to_netcdf(path)
    run = sp.simulate(WIDE, posterior=path, draws=100, timing={"duration": "2 s", "on": [("0 s", "1 s")]})
    steady = sp.predict(WIDE, posterior=path)
    assert steady.intervals is not None
    for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate"):
        low, high = steady.intervals.low[name], steady.intervals.high[name]
        item = run_answer(run)[f"mean_{name}_steady"]
        assert item["value"] == pytest.approx(getattr(steady, name), rel=2e-3)
        assert [item["low"], item["high"]] == pytest.approx([low, high], abs=0.01 * (high - low))
        assert (item["kind"], item["level"]) == ("interval", 0.95)
    assert "low" not in run_answer(run)["mean_electrical_power"]
    assert 75 < run_answer(run)["draws"] <= 100


def test_each_draw_is_run_with_its_own_numbers(fitted: Any) -> None:
    """Robots of draws against the batch that predictions swim, in which every draw is a row."""
    from spirillum.fitted.posterior_file import read_posterior

    posterior = read_posterior(fitted[1] / "posterior.nc")
    robot = posterior.central(load(WIDE))
    drawn = posterior.sampled_robots(robot, 5, np.random.default_rng(1))
    values = posterior.of(robot, np.random.default_rng(1))
    for one, place in zip(drawn, posterior.places(5), strict=True):
        assert one.calibration["sbt"].body_drag == values["body_drag"][place]
        assert one.calibration["sbt"].body_rotation == values["body_rotation"][place]
        assert one.friction.effective == values["friction"][place]
