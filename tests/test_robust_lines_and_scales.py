"""Robust lines ignore planted outliers; scales are those of the distribution they were drawn from."""

import numpy as np
import pytest

from spirillum.robust import (
    MAD_TO_SIGMA,
    least_squares_line,
    mad_scale,
    repeated_median_line,
    running_median,
    stretches_of,
    theil_sen_line,
)

TIME = np.linspace(0.0, 3.0, 60)


def test_factor_makes_a_standard_deviation_of_normal_residuals() -> None:
    from scipy.special import ndtri

    assert pytest.approx(1.0 / ndtri(0.75), rel=1e-4) == MAD_TO_SIGMA
    assert mad_scale(np.random.default_rng(0).normal(0.0, 2.0, 100_000)) == pytest.approx(2.0, rel=0.02)


def test_nan_is_left_out_of_a_scale_along_each_axis() -> None:
    residuals = np.array([[1.0, -2.0], [np.nan, 2.0], [-1.0, 2.0]])
    assert mad_scale(residuals, axis=0) == pytest.approx(MAD_TO_SIGMA * np.array([1.0, 2.0]))


def test_robust_lines_ignore_a_quarter_of_outliers() -> None:
    values = 0.7 - 1.3 * TIME
    values[::4] += 50.0
    assert repeated_median_line(TIME, values).at(TIME[1]) == pytest.approx(0.7 - 1.3 * TIME[1])
    two = np.stack([values, 2.0 * values], axis=1)
    assert theil_sen_line(TIME, two).at(TIME[1]) == pytest.approx((0.7 - 1.3 * TIME[1]) * np.array([1.0, 2.0]))


def test_least_squares_line_is_numpys() -> None:
    values = np.random.default_rng(1).normal(size=TIME.size)
    line = least_squares_line(TIME, values)
    assert line.at(TIME) == pytest.approx(np.polyval(np.polyfit(TIME, values, 1), TIME))


def test_running_median_takes_out_single_outliers_and_keeps_a_step() -> None:
    values = np.where(TIME > 1.0, 5.0, 1.0)
    spoiled = values.copy()
    spoiled[[5, 40]] = 100.0
    assert np.array_equal(running_median(spoiled, 5), values)


def test_stretches_are_those_of_the_mask() -> None:
    mask = np.array([True, True, False, True, False, False, True, True])
    assert [part.tolist() for part in stretches_of(mask)] == [[0, 1], [3], [6, 7]]
    assert stretches_of(np.zeros(3, dtype=bool)) == []
