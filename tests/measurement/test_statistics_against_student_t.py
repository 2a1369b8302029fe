"""Mean and 95 % interval of a few trials, against the tabulated quantiles of Student's t."""

import math

import numpy as np
import pytest

from spirillum.measurement.statistics import NORMAL, mean_with_interval

# Two-sided 95 % quantiles by degrees of freedom (Student, 1908, in every table).
QUANTILES = {1: 12.706, 2: 4.303, 4: 2.776, 9: 2.262}


@pytest.mark.parametrize(("freedom", "quantile"), QUANTILES.items())
def test_half_width_is_the_quantile_times_the_standard_error(freedom: int, quantile: float) -> None:
    values = [float(i * i) for i in range(freedom + 1)]
    count = len(values)
    mean = sum(values) / count
    spread = math.sqrt(sum((v - mean) ** 2 for v in values) / freedom)
    found = mean_with_interval(values)
    assert found.value == pytest.approx(mean)
    assert found.trials == count
    assert found.half_width == pytest.approx(quantile * spread / math.sqrt(count), rel=2e-4)


def test_missing_trials_are_left_out() -> None:
    assert mean_with_interval([1.0, math.nan, 3.0])[:1] == (2.0,)
    assert mean_with_interval([1.0, math.nan, 3.0]).trials == 2
    assert math.isnan(mean_with_interval([math.nan]).value)
    single = mean_with_interval([5.0])
    assert (single.value, single.trials) == (5.0, 1)
    assert math.isnan(single.half_width)


@pytest.mark.parametrize(
    ("between", "agree", "held"),
    [(0.0, 0.1, (0.94, 0.96)), (0.0, math.inf, (0.95, 1.0)), (3.0, math.inf, (0.94, 0.97))],
    ids=["agree by chance", "repeat", "differ"],
)
def test_two_trials_hold_the_truth_whether_they_agree_or_not(
    between: float, agree: float, held: tuple[float, float]
) -> None:
    """By sampling trials with errors of 1 each, and a scatter of the robot between them."""
    rng = np.random.default_rng(1)
    pairs = rng.normal(0.0, math.hypot(1.0, between), (40000, 2))
    pairs = pairs[np.abs(pairs[:, 0] - pairs[:, 1]) < agree][:8000]
    means = [mean_with_interval(pair, within=(NORMAL, NORMAL)) for pair in pairs.tolist()]
    inside = np.mean([abs(mean.value) < mean.half_width for mean in means])
    assert held[0] < inside < held[1]


def test_an_unknown_error_of_a_trial_is_that_of_the_others() -> None:
    """So that a trial without one narrows the mean no more than one that states it, and never below a single trial."""
    both, one, alone = (
        mean_with_interval([1.0, 1.0001, last], within=within)
        for last, within in ((math.nan, (0.5, 0.5, 0.5)), (math.nan, (0.5, math.nan, 0.1)), (1.0, (0.3, 0.4, math.nan)))
    )
    assert both.half_width == pytest.approx(0.5 / math.sqrt(2.0))
    assert one == both
    assert alone.half_width == pytest.approx(0.5 / math.sqrt(2.0) / math.sqrt(3.0))
    assert mean_with_interval([1.0, math.nan], within=(0.5, 0.1)) == (1.0, 0.5, 1)


def test_an_error_below_the_scatter_of_trials_widens_nothing() -> None:
    without = mean_with_interval([1.0, 3.0])
    assert mean_with_interval([1.0, 3.0], within=(math.nan, 0.1)) == without
    assert mean_with_interval([1.0, 1.0, math.nan], within=(3.0, 4.0, 9.0)).half_width == pytest.approx(2.5)
