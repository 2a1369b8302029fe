"""The posterior: uniform ranks of the truth, discrepancy of a wrong model, and diagnostics that fail loudly."""

import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

import spirillum as sp
from spirillum.calibration.posterior import Sampling
from spirillum.results.calibration import write_calibration
from synthetic_experiments import SHORT

WIDE = "biorob2012-wide"


@pytest.fixture(scope="module")
def wrong(made: Callable[..., Path]) -> Any:
    """Resistive force theory fitted to data that slender-body theory made."""
    small = {"wavelengths": (10.0, 15.0, 25.0), "amplitudes": (1.5, 3.5), "presets": (WIDE,)}
    path = made(drag=(3.0,), rotation=(1.5,), **small)
    return sp.calibrate(path, WIDE, model="rft", sampling=SHORT)


def test_a_wrong_model_reports_its_discrepancy_and_not_a_certain_factor(wrong: Any) -> None:
    found = wrong.discrepancy["advance"]
    assert found.low > 0.03
    assert wrong.error["advance"] == pytest.approx(0.02, rel=0.4)
    fitted = wrong.values["body_drag"]
    assert (fitted.high - fitted.low) / fitted.value > 0.1
    assert any("misses the speed" in warning for warning in wrong.warnings)


def test_interval_of_each_tail_holds_its_own_mean(wrong: Any) -> None:
    for name, (_, low, high) in wrong.predicted.items():
        seen = wrong.problem.ratio(name).mean
        inside = (seen > np.minimum(low, high)) & (seen < np.maximum(low, high))
        assert np.count_nonzero(inside) >= seen.size - 1


def test_draws_do_not_depend_on_the_number_of_processes(
    made: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spirillum.worker_pool.slowdown", lambda _: 1.0)
    path = made(presets=(WIDE,))
    few = Sampling(ensembles=3, walkers=24, warm_up=5, steps=20, doublings=1)
    alone, shared = (sp.calibrate(path, WIDE, sampling=few, model="sbt", workers=count) for count in (1, 2))
    np.testing.assert_array_equal(alone.posterior.z, shared.posterior.z)


def test_chains_that_have_not_mixed_are_refused_loudly(
    made: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    hasty = Sampling(ensembles=2, walkers=24, warm_up=2, steps=10, doublings=0)
    found = sp.calibrate(made(), [WIDE, "biorob2012-narrow"], sampling=hasty, model="sbt")
    assert not found.converged
    assert found.warnings[0].startswith("do not use the posterior")
    write_calibration(found, tmp_path, figures=False)
    assert "has not converged" in (tmp_path / "calibration.toml").read_text()

    from spirillum.cli import main

    monkeypatch.setattr("spirillum.calibration.posterior.Sampling", lambda **_: hasty)
    with pytest.raises(SystemExit) as stopped:
        main(["calibrate", str(made()), WIDE, "biorob2012-narrow", "--model=sbt", "-o", str(tmp_path), "--no-figures"])
    assert stopped.value.code == 1
    assert "do not use the posterior" in " ".join(capsys.readouterr().out.split())


def test_the_same_seed_gives_the_same_draws(made: Callable[..., Path]) -> None:
    few = Sampling(ensembles=2, walkers=24, warm_up=5, steps=20, doublings=0, seed=3)
    settings: dict[str, Any] = {"robots": [WIDE, "biorob2012-narrow"], "sampling": few, "model": "sbt"}
    first, second = (sp.calibrate(made(), **settings).posterior for _ in range(2))
    assert first is not None
    assert second is not None
    assert np.array_equal(first.z, second.z)


def test_the_file_holds_arviz_groups(wrong: Any, tmp_path: Path) -> None:
    import xarray as xr

    write_calibration(wrong, tmp_path, figures=False)
    with xr.open_datatree(tmp_path / "posterior.nc", engine="h5netcdf") as tree:
        assert {"posterior", "log_likelihood", "observed_data", "sample_stats"} <= set(tree.children)
        assert set(tree["posterior"].dims) == {"chain", "draw"}
        assert tree["log_likelihood"]["robot"].dims == ("chain", "draw", "tail")
        assert tree.attrs["schema"] == "spirillum.posterior/1"


def test_half_normal_coordinates_have_their_quantiles() -> None:
    from scipy.stats import halfnorm, norm

    from spirillum.calibration.likelihood import half_normal

    z = np.linspace(-7.0, 7.0, 57)
    assert half_normal(z, 0.3) == pytest.approx(0.3 * halfnorm.ppf(norm.cdf(z)), rel=1e-6, abs=1e-9)


def test_log_likelihood_is_that_of_a_multivariate_normal(made: Callable[..., Path]) -> None:
    """The joint density of one robot's two means, written out with its 2x2 covariance."""
    from scipy.stats import multivariate_normal

    from spirillum.calibration.experiment import read_experiment
    from spirillum.calibration.likelihood import Density
    from spirillum.calibration.problem import posed
    from spirillum.robot.load import load

    problem = posed(read_experiment(made(), [load(WIDE), load("biorob2012-narrow")]), "sbt", ("body_drag",))
    density = Density(problem)
    z = np.random.default_rng(0).normal(size=(1, density.size))
    (tau, sigma), predicted = density.nuisances(z), problem.predicted(z[:, :2])
    u, o = problem.experiment.advance, problem.experiment.turning
    place = 11
    noise = [sigma[name][0] * ratio.scale[place] / np.sqrt(5) for name, ratio in (("advance", u), ("turning", o))]
    means = [predicted["advance"][0, place], predicted["turning"][0, place]]
    spread = [
        noise[n] ** 2 + (tau[name][0] * means[n]) ** 2 + (1e-4 * ratio.scale[place]) ** 2
        for n, (name, ratio) in enumerate((("advance", u), ("turning", o)))
    ]
    shared = problem.experiment.correlation * noise[0] * noise[1]
    covariance = [[spread[0], shared], [shared, spread[1]]]
    joint = multivariate_normal.logpdf([u.mean[place], o.mean[place]], means, covariance)
    scatter = sum(
        -0.5 * (4 * np.log(s**2 + 1e-8) + ratio.squares[place] / (s**2 + 1e-8))
        for s, ratio in ((sigma["advance"][0], u), (sigma["turning"][0], o))
    )
    assert density.by_robot(z)[0, place] == pytest.approx(joint + scatter, rel=1e-9)


@pytest.mark.slow
def test_ranks_of_the_truth_are_uniform_and_intervals_hold_it() -> None:
    """Simulation-based calibration, small: truths from the prior, data from the model, ranks in the posterior.

    With more experiments it is a benchmark, whose code this runs.
    """
    benchmark = Path(__file__).parents[2] / "benchmarks" / "simulation_based_calibration.py"
    found = runpy.run_path(str(benchmark))["simulated_ranks"](
        experiments=16, tails=((10.0, 1.5), (15.0, 2.5), (20.0, 3.5), (25.0, 2.0)), seed=11
    )
    for name, ranks in found.ranks.items():
        assert kstest(ranks, "uniform").pvalue > 0.01 / len(found.ranks), name
    every = np.concatenate(list(found.inside.values()))
    assert 0.90 <= every.mean() <= 0.99
