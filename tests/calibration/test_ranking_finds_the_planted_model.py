"""`rank-models`: the model that made the data wins, leave-one-out agrees with leaving out, and closeness is said."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum import InputError
from synthetic_experiments import SHORT

WIDE = "biorob2012-wide"


@pytest.fixture(scope="module")
def ranking(made: Callable[..., Path]) -> Any:
    """Both of the paper's models on data of slender-body theory, missed by 2 % from tail to tail."""
    path = made(presets=(WIDE,), wavelengths=(10.0, 15.0, 25.0), discrepancy=0.02, seed=8)
    return sp.rank_models(path, WIDE, sampling=SHORT)


def test_the_model_that_made_the_data_wins_without_doubt(ranking: Any) -> None:
    assert [item.model for item in ranking.ranked] == ["sbt", "rft"]
    assert ranking.clear
    assert "sbt predicts left-out tails better than rft" in ranking.verdict()
    assert ranking.ranked[1].fit.discrepancy["turning"].value > 3 * ranking.best.fit.discrepancy["turning"].value


def test_failures_name_the_tails_with_the_largest_misfit(ranking: Any) -> None:
    worst = ranking.failures(ranking.ranked[1])
    sizes = [abs(row["standard_deviations"]["value"]) for row in worst]
    assert sizes == sorted(sizes, reverse=True)
    assert "tail" in worst[0]["tail"]
    for item in ranking.ranked:
        for row in ranking.failures(item):
            more = row["observed_over_predicted"]["value"] - 1.0
            assert more * row["standard_deviations"]["value"] > 0
    answer = ranking.to_dict()
    assert answer["models"][0]["difference"]["value"] == 0.0


def test_leave_one_out_is_the_density_of_a_robot_given_the_others(ranking: Any) -> None:
    """Against importance sampling written out without smoothing, where the weights are tame."""
    from scipy.special import logsumexp

    for item in ranking.ranked:
        posterior = item.fit.posterior
        logs = posterior.density.by_robot(posterior.flat)
        plain = -(logsumexp(-logs, axis=0) - np.log(logs.shape[0]))
        tame = item.pareto < 0.4
        assert np.count_nonzero(tame) > 4
        assert item.pointwise[tame] == pytest.approx(plain[tame], abs=0.15)


@pytest.mark.slow
def test_equal_models_are_not_told_apart(made: Callable[..., Path]) -> None:
    from spirillum.calibration.ranking import ranked_fits

    path = made(presets=(WIDE,), wavelengths=(10.0, 15.0, 25.0), discrepancy=0.02, seed=8)
    settings: dict[str, Any] = {"free": "body_drag,body_rotation", "sampling": SHORT}
    other = {"extends": WIDE, "model": {"sbt": {"eps_constant": "exact"}}}
    fits = {"printed": sp.calibrate(path, WIDE, **settings), "exact": sp.calibrate(path, other, **settings)}
    ranking = ranked_fits(fits)
    assert not ranking.clear
    assert "cannot be distinguished" in ranking.verdict()


def test_robots_that_cannot_be_left_out_name_no_winner(ranking: Any) -> None:
    """Where each robot decides the fit, importance sampling does not say what the others would predict for it."""
    from dataclasses import replace

    bad = tuple(replace(item, pareto=np.full(item.pareto.size, 1.2)) for item in ranking.ranked)
    untrusted = replace(ranking, ranked=bad)
    assert ranking.trusted
    assert not untrusted.clear
    assert "sbt and rft are not ranked" in untrusted.verdict()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_tails_name_no_winner(ranking: Any, count: int) -> None:
    from dataclasses import replace

    few = tuple(
        replace(item, pointwise=item.pointwise[:count], difference=-30.0 * place, difference_error=0.0)
        for place, item in enumerate(ranking.ranked)
    )
    short = replace(ranking, ranked=few)
    assert not short.clear
    assert "too few to distinguish sbt from rft" in short.verdict()


@pytest.mark.parametrize(("count", "said"), [(1, "1 robot"), (2, "2 robots"), (3, "3 robots")])
def test_a_few_tails_have_no_standard_error(
    ranking: Any, count: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Over one tail it would be 0, over two the half of how far they are apart."""
    from dataclasses import replace
    from types import SimpleNamespace

    from rich.console import Console

    from spirillum.calibration.ranking import _cautions
    from spirillum.cli.tables import blocks_of

    few = tuple(
        replace(item, pointwise=item.pointwise[:count], difference=-30.0 * place, difference_error=0.0)
        for place, item in enumerate(ranking.ranked)
    )
    answer = replace(ranking, ranked=few).to_dict()
    for item in answer["models"]:
        assert item["difference"]["standard_error"] is None
        assert item["expected_log_density"]["standard_error"] is None
    Console(width=300).print(*blocks_of(answer))
    printed = capsys.readouterr().out
    assert "-30.0 (error: -)" in printed
    assert "+-" not in printed
    seen = vars(ranking.best.fit.experiment) | {"size": count, "synthetic": False}
    fit = SimpleNamespace(experiment=SimpleNamespace(**seen), warnings=())
    words = _cautions([replace(ranking.best, fit=fit, pareto=np.zeros(count))])
    assert words == [
        f"only {said}: standard errors of the log density are chance below 4, and not given; measure more tails"
    ]


def test_failures_say_on_which_scale_they_are(ranking: Any, capsys: pytest.CaptureFixture[str]) -> None:
    from rich.console import Console

    from spirillum.cli.tables import blocks_of

    Console(width=300).print(*blocks_of(ranking.to_dict()))
    printed = capsys.readouterr().out
    assert "standard deviations" in printed
    assert "misses motor rate by" not in printed


def test_models_without_common_free_numbers_are_refused(made: Callable[..., Path]) -> None:
    with pytest.raises(InputError, match="'tube' has no body_drag to fit, and models are ranked with the same free"):
        sp.rank_models(made(), models=["tube", "sbt"], free="body_drag")


def test_a_single_model_is_no_ranking(made: Callable[..., Path]) -> None:
    with pytest.raises(InputError, match="at least two models"):
        sp.rank_models(made(), models=["sbt"])


def test_names_of_all_models_are_looked_at_before_the_first_is_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    from spirillum.calibration import ranking as module

    monkeypatch.setattr(module, "fit_model", lambda *_, **__: pytest.fail("a model was fitted"))
    with pytest.raises(InputError, match=r"model = 'foo'.*; allowed: "):
        sp.rank_models("observations.csv", models=["sbt", "foo"])


def test_fitted_numbers_have_their_units(made: Callable[..., Path]) -> None:
    from spirillum.calibration.ranking import ModelRank, Ranking

    path = made(presets=(WIDE,), wavelengths=(10.0, 15.0, 25.0))
    fit = sp.calibrate(path, WIDE, free="body_drag,wire_diameter", method="least-squares")
    one = np.zeros(fit.experiment.size)
    ranked = ModelRank("sbt", 0.0, 0.0, 0.0, 0.0, pareto=one, pointwise=one, fit=fit)
    said = Ranking((ranked,), ()).to_dict()["models"][0]["parameters"]
    assert {name: item["unit"] for name, item in said.items()} == {"body_drag": "1", "wire_diameter": "m"}
    for name, item in said.items():
        assert (item["value"], item["level"]) == (fit.values[name].value, 0.95)
        assert item["low"] < item["value"] < item["high"]


def test_a_model_that_explains_nothing_is_named_and_the_others_are_ranked(tmp_path: Path) -> None:
    """Robots as slow as with dry friction: no gap is thin enough, and factors of sbt explain anything."""
    rows = [f"{channel},25,2.5,{n},{speed},{rate},{body}" for n in (1, 2) for channel, speed, rate, body in
            ((40, 0.07 + 1e-3 * n, 1.1, -0.0035), (30, 0.024 + 1e-3 * n, 0.8, -0.0017))]  # fmt: skip
    path = tmp_path / "slow.csv"
    head = "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"
    path.write_text("\n".join(["# synthetic", head, *rows]))
    found = sp.rank_models(path, models=["tube", "sbt"], sampling=SHORT)
    assert [item.model for item in found.ranked] == ["sbt"]
    assert any(line.startswith("tube is not ranked, it does not explain the observations") for line in found.warnings)
    with pytest.raises(InputError, match="no value of it explains"):
        sp.calibrate(path, ["biorob2012-wide", "biorob2012-narrow"], model="tube", free="gap,pitch")
