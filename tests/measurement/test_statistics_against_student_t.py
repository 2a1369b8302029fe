"""Mean and 95 % interval of a few trials, against the tabulated quantiles of Student's t."""

import math

import pytest

from spirillum.measurement.statistics import mean_with_interval

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
