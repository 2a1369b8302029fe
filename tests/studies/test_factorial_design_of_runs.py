"""The design's columns are balanced and orthogonal, and its main effects are those of a planted response."""

import numpy as np
import pytest

from spirillum.studies.released_robots import half_fraction, main_effects


@pytest.mark.parametrize("factors", [3, 4, 5, 6])
def test_columns_are_balanced_and_orthogonal(factors: int) -> None:
    levels = half_fraction(factors)
    assert levels.shape == (2 ** (factors - 1), factors)
    np.testing.assert_array_equal(levels.T @ levels, len(levels) * np.eye(factors))
    np.testing.assert_array_equal(levels.sum(axis=0), 0)


def test_five_factors_keep_interactions_of_two_apart() -> None:
    """Resolution V: products of two columns are orthogonal to every column and to each other."""
    levels = half_fraction(5)
    pairs = np.stack([levels[:, i] * levels[:, j] for i in range(5) for j in range(i)], axis=1)
    both = np.concatenate([levels, pairs], axis=1)
    np.testing.assert_array_equal(both.T @ both, 16 * np.eye(15))


def test_effects_of_a_planted_response() -> None:
    """y = 3 + a_i x_i + b x_0 x_1: an effect is twice the coefficient, whatever the interaction is."""
    levels, slopes = half_fraction(5), np.array([1.0, -2.0, 0.0, 0.5, 4.0])
    response = 3.0 + levels @ slopes + 0.7 * levels[:, 0] * levels[:, 1]
    np.testing.assert_allclose(main_effects(response[None], levels)[0], 2.0 * slopes, atol=1e-12)


def test_runs_without_an_answer_are_left_out() -> None:
    levels = half_fraction(3)
    response = np.where(levels[:, 0] > 0, 2.0, 1.0)
    response[0] = np.nan
    assert main_effects(response, levels)[0] == pytest.approx(1.0)
    assert np.isnan(main_effects(np.full(4, np.nan), levels)).all()
