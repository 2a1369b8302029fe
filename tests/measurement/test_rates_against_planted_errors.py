"""Intervals of rates cover the truth, whatever the errors have in common."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from spirillum.measurement.outliers import outlying_frames, outlying_trial
from spirillum.measurement.rates import PeriodicError, Rate, mean_of, rate_of

FRAMES = 300
TIME = np.arange(FRAMES) / 30.0


def autoregression(rng: np.random.Generator, rho: float) -> np.ndarray:
    kicks = rng.normal(size=FRAMES) * np.sqrt(1.0 - rho**2)
    values = np.empty(FRAMES)
    values[0] = rng.normal()
    for i in range(1, FRAMES):
        values[i] = rho * values[i - 1] + kicks[i]
    return values


def white(rng: np.random.Generator) -> tuple[np.ndarray, list[PeriodicError]]:
    return rng.normal(size=FRAMES), []


def short_memory(rng: np.random.Generator) -> tuple[np.ndarray, list[PeriodicError]]:
    return autoregression(rng, 0.9) + rng.normal(size=FRAMES), []


def long_memory(rng: np.random.Generator) -> tuple[np.ndarray, list[PeriodicError]]:
    return autoregression(rng, 0.97), []


def few_cycles(rng: np.random.Generator) -> tuple[np.ndarray, list[PeriodicError]]:
    """The stretch is a third of a period: nothing in the residuals shows it."""
    angle = 2 * np.pi * 0.3 * TIME / TIME[-1]
    returning = 1.4 * np.cos(angle + rng.uniform(0, 2 * np.pi))
    return returning + rng.normal(size=FRAMES), [PeriodicError(angle, 1.0)]


def many_cycles(rng: np.random.Generator) -> tuple[np.ndarray, list[PeriodicError]]:
    """Larger than usual, but seen often enough to be known."""
    angle = 2 * np.pi * 2.7 * TIME / TIME[-1]
    return 10.0 * np.cos(angle + rng.uniform(0, 2 * np.pi)) + rng.normal(size=FRAMES), [PeriodicError(angle, 1.0)]


@pytest.mark.parametrize("errors", [white, short_memory, long_memory, few_cycles, many_cycles])
def test_intervals_cover_the_truth_as_often_as_they_say(errors: Callable[..., Any]) -> None:
    """30 series: at a level of 95 % fewer than 24 are covered less than once in a thousand times."""
    rng = np.random.default_rng(5)
    covered, trials = 0, 30
    for _ in range(trials):
        noise, cycles = errors(rng)
        truth = rng.uniform(5.0, 20.0)
        rate = rate_of(
            TIME, truth * TIME + 0.1 * noise, periodic=[PeriodicError(c.angle, 0.1 * c.amplitude) for c in cycles]
        )
        covered += rate.low <= truth <= rate.high
        assert rate.steady
    assert covered >= 24


def test_three_readings_by_hand_that_agree_by_chance_do_not_look_certain() -> None:
    time, eye = np.array([0.0, 2.0, 4.0]), np.full(3, 0.1)
    rate = rate_of(time, 1.5 * time, eye, read=np.ones(3, dtype=bool))
    assert rate.value == pytest.approx(1.5)
    # one residual of the eye's size beside one of none: t of two degrees of freedom, 4.303, times 0.1/sqrt(2)/sqrt(8)
    assert rate.high - rate.value == pytest.approx(4.302653 * 0.1 / np.sqrt(2.0) / np.sqrt(8.0), rel=1e-6)
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(300):
        rate = rate_of(time, 1.5 * time + rng.normal(0.0, 0.1, 3), eye, read=np.ones(3, dtype=bool))
        inside += rate.low <= 1.5 <= rate.high
    assert inside >= 276  # of 300 at 95 %, fewer come up less than once in a hundred times


def test_white_noise_gives_the_interval_of_least_squares() -> None:
    """sigma sqrt(12/n)/T, within the price of not knowing that it is white."""
    rng = np.random.default_rng(1)
    widths = []
    for _ in range(10):
        rate = rate_of(TIME, TIME + 0.01 * rng.normal(size=FRAMES))
        widths.append(rate.high - rate.low)
    ideal = 2 * 1.96 * 0.01 * np.sqrt(12.0 / FRAMES) / TIME[-1]
    assert 0.9 * ideal < np.median(widths) < 1.35 * ideal


def test_rate_scales_with_units_and_does_not_see_an_offset() -> None:
    rng = np.random.default_rng(2)
    values = 3.0 * TIME + 0.01 * rng.normal(size=FRAMES)
    one, other = rate_of(TIME, values), rate_of(TIME + 7.0, 1e-3 * values + 5.0)
    assert 1e3 * other.value == pytest.approx(one.value, rel=1e-9)
    assert 1e3 * (other.high - other.low) == pytest.approx(one.high - one.low, rel=1e-4)


def test_exact_lines_come_back_exactly() -> None:
    rate = rate_of(TIME, 2.0 - 0.7 * TIME)
    assert rate.value == pytest.approx(-0.7, rel=1e-12)
    assert rate.high - rate.low < 1e-9


def test_gaps_do_not_bias_a_rate_over_true_times() -> None:
    rng = np.random.default_rng(3)
    kept = (rng.uniform(size=FRAMES) > 0.05) & ~((TIME > 3.0) & (TIME < 5.0))
    rate = rate_of(TIME[kept], 1.5 * TIME[kept] + 0.01 * rng.normal(size=int(kept.sum())))
    assert rate.low <= 1.5 <= rate.high
    assert rate.frames + rate.outliers == int(kept.sum())


def test_outlying_frames_are_counted_and_do_not_move_the_rate() -> None:
    rng = np.random.default_rng(4)
    values = 1.5 * TIME + 0.01 * rng.normal(size=FRAMES)
    without = rate_of(TIME, values)
    spoiled = values.copy()
    bad = np.array([7, 50, 51, 120, 200, 201, 202, 280])
    spoiled[bad] += rng.choice([-1.0, 1.0], bad.size) * rng.uniform(0.3, 2.0, bad.size)
    found = outlying_frames(TIME, spoiled)
    assert set(bad) <= set(np.flatnonzero(found))
    rate = rate_of(TIME, spoiled)
    assert rate.outliers == found.sum() <= bad.size + 2
    assert rate.value == pytest.approx(without.value, abs=0.2 * (without.high - without.low))
    assert np.isnan(rate.residual[bad]).all()


UNDER_HIGHLIGHT = """
    0.79 0.40 0.18 -0.50 -0.05 -0.05 -0.15 0.00 0.39 1.11 -0.95 -0.74 0.18
    0.32 0.19 0.41 1.22 1.54 -1.81 -0.77 -0.33 -0.70 -0.41 -0.14 0.50"""
"""Error of a body's angle on a path-traced video of 25 frames, deg: it climbs and falls as stripes pass a highlight."""


def test_errors_that_climb_and_fall_as_stripes_pass_are_no_stray_frames() -> None:
    time, off = np.arange(25) / 6.0, np.array(UNDER_HIGHLIGHT.split(), dtype=float)
    assert rate_of(time, -34.5 * time + off, np.full(25, 0.15)).outliers == 0
    off[12] += 6.0  # a stripe's width is 10 times as much
    assert outlying_frames(time, -34.5 * time + off).tolist() == [number == 12 for number in range(25)]


def test_frames_off_by_their_own_error_are_no_strays_where_others_lie_on_a_line_by_chance() -> None:
    time, off = np.arange(26) / 1.25, 0.03 * np.cos(2.0 * np.arange(26.0))
    off[[5, 8, 17, 25]] = 0.76, -0.39, 0.35, -0.41
    assert rate_of(time, 8.4 * time + off, np.full(26, 0.45)).outliers == 0
    assert rate_of(time, 8.4 * time + off).outliers >= 3
    off[5] = 1.5
    assert rate_of(time, 8.4 * time + off, np.full(26, 0.45)).outliers == 1


def test_a_changing_rate_is_seen_and_its_mean_is_from_end_to_end() -> None:
    rng = np.random.default_rng(6)
    span, covered = TIME[-1], 0
    for _ in range(10):
        values = TIME + 0.2 * span * (TIME / span) ** 2 + 0.002 * rng.normal(size=FRAMES)  # the rate rises by 40 %
        rate = rate_of(TIME, values)
        assert not rate.steady
        assert rate.value == pytest.approx(1.2, rel=3e-3)
        covered += rate.low <= 1.2 <= rate.high
    assert covered >= 7


def test_a_handful_of_readings_has_the_interval_of_the_textbook() -> None:
    from scipy.stats import linregress, t

    time, values = np.array([0.0, 1.0, 2.0, 4.0, 7.0]), np.array([0.1, 0.9, 2.2, 3.9, 7.1])
    fit = linregress(time, values)
    rate = rate_of(time, values)
    assert rate.value == pytest.approx(fit.slope, rel=1e-12)
    assert rate.high - rate.value == pytest.approx(t.ppf(0.975, 3) * fit.stderr, rel=1e-9)


def test_two_readings_have_a_rate_but_no_interval_and_one_has_none() -> None:
    two = rate_of(np.array([0.0, 4.0]), np.array([1.0, 3.0]))
    assert two.value == pytest.approx(0.5)
    assert np.isnan([two.low, two.high]).all()
    assert not rate_of(np.array([0.0]), np.array([1.0])).measured
    assert not rate_of(TIME, np.full(FRAMES, np.nan)).measured


def test_mean_with_a_memory_is_less_sure_than_without() -> None:
    rng = np.random.default_rng(8)
    free, bound = rng.normal(size=FRAMES), autoregression(rng, 0.97)
    widths = [np.diff(mean_of(TIME, values)[1:])[0] for values in (free, bound)]
    assert widths[1] > 3.0 * widths[0]
    assert widths[0] == pytest.approx(2 * 1.97 / np.sqrt(FRAMES), rel=0.4)


def test_grubbs_test_against_its_table() -> None:
    """Two-sided at 1 % for five trials the bound is 1.764: just above and just below."""
    base = np.array([-1.0, 1.0, -0.5, 0.5])

    def largest(value: float) -> float:
        numbers = np.append(base, value)
        return float(np.abs(numbers - numbers.mean()).max() / numbers.std(ddof=1))

    assert largest(30.0) > 1.764
    assert outlying_trial([*base, 30.0]) == 4
    assert largest(8.0) < 1.764
    assert outlying_trial([*base, 8.0]) is None
    assert outlying_trial([1.0, 1.0, 9.0]) is None or outlying_trial([1.0, 1.0, 9.0]) == 2
    assert outlying_trial([1.0, 9.0]) is None


def test_what_rests_is_steady() -> None:
    time = np.arange(300) / 30.0
    found = rate_of(time, np.full(300, 3.7e-3))
    assert found.steady
    assert abs(found.value) < 1e-12


@pytest.mark.parametrize("seed", range(6))
def test_a_start_half_way_keeps_the_mean_from_end_to_end_in_the_interval(seed: int) -> None:
    time = np.arange(600) / 30.0
    values = np.maximum(time - 10.0, 0.0) + 0.01 * np.random.default_rng(seed).normal(size=600)
    found = rate_of(time, values)
    assert not found.steady
    assert found.low <= 9.9667 / 19.9667 <= found.high
    assert found.high - found.low < 0.2


def wandering(seconds: float, noise: float) -> Callable[..., Any]:
    """Errors with a memory of some seconds, and white noise."""

    def errors(rng: np.random.Generator) -> tuple[np.ndarray, list[PeriodicError]]:
        return autoregression(rng, float(np.exp(-1.0 / (30.0 * seconds)))) + noise * rng.normal(size=FRAMES), []

    return errors


def false_alarms(errors: Callable[..., Any], trials: int) -> int:
    """How many of some steady rates are taken to change: errors of a tenth of the whole way, of one per second."""
    rng = np.random.default_rng(7)
    return sum(
        not rate_of(TIME, TIME + noise, periodic=cycles).steady
        for noise, cycles in (errors(rng) for _ in range(trials))
    )


def test_errors_that_wander_are_no_change_of_the_rate() -> None:
    assert false_alarms(wandering(3.0, 0.3), 8) == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("errors", "most"),
    [
        *((errors, 5) for errors in (white, short_memory, long_memory, few_cycles, many_cycles)),
        (wandering(1.0, 0.0), 5),
        (wandering(3.0, 0.3), 5),
        (wandering(7.0, 1.0), 20),
    ],
)
def test_steady_rates_are_hardly_ever_taken_to_change(errors: Callable[..., Any], most: int) -> None:
    """Two tests at 0.1 % each; six of 200 would come up less than once in ten thousand times.

    Errors with a memory of most of the film, half hidden in white noise, look like a change in one of twenty.
    """
    assert false_alarms(errors, 200) <= most


def test_a_parabola_is_told_where_errors_hang_together() -> None:
    """A rate that falls by a third in four seconds, under errors that last for a fifth of a second."""
    rng, time = np.random.default_rng(9), np.arange(118) / 30.0
    for _ in range(5):
        errors = autoregression(rng, float(np.exp(-1.0 / 6.0)))[:118]
        rate = rate_of(time, -0.2 * time * (1.2 - 0.2 * time / time[-1]) + 2e-3 * errors)
        assert not rate.steady
        assert rate.low < -0.2 < rate.high
        assert rate.thirds == pytest.approx([-0.2 * (1.2 - 0.4 * at) for at in (1 / 6, 1 / 2, 5 / 6)], rel=0.06)


def test_a_rate_that_changes_is_told_third_by_third_as_it_is() -> None:
    """A rest in the middle, and nothing seen in the last third but its end: no cubic goes through it."""
    time = np.arange(300) / 30.0
    way = np.where(time < 4.0, time, np.where(time < 6.0, 4.0, time - 2.0))
    noise = 1e-3 * np.random.default_rng(4).standard_normal(300)
    assert rate_of(time, way + noise).thirds == pytest.approx((1.0, 0.4, 1.0), abs=0.04)
    unseen = np.where((time > 6.6) & (time < 9.95), np.nan, way + noise)
    first, middle, last = rate_of(time, unseen, unsteady=True).thirds
    assert (first, middle) == pytest.approx((1.0, 0.4), abs=0.04)
    assert np.isnan(last)


def test_residuals_lie_about_0_where_errors_wander() -> None:
    rate = rate_of(TIME, TIME + wandering(7.0, 0.1)(np.random.default_rng(1))[0])
    assert np.nanmean(rate.residual) == pytest.approx(0.0, abs=1e-9)


def test_a_fast_start_is_a_part_of_the_rate_and_no_outlier() -> None:
    """A body that settles: the first tenth lies far from the line, and belongs to the way from end to end."""
    rng, time = np.random.default_rng(10), np.arange(99) / 10.0
    values = -0.13 * time - 0.08 * (1.0 - np.exp(-time / 1.5)) + 2e-4 * rng.normal(size=time.size)
    rate = rate_of(time, values)
    truth = -0.13 - 0.08 * (1.0 - np.exp(-time[-1] / 1.5)) / time[-1]
    assert not rate.steady
    assert rate.outliers == 0
    assert rate.low < truth < rate.high
    assert rate.value == pytest.approx(truth, rel=0.01)


@pytest.mark.parametrize(("alike", "reach"), [(0.0, 0.5), (-1.0, 0.7), (1.0, 0.5)])
def test_the_rate_of_a_difference_is_that_of_the_rates_and_as_sure_as_their_errors_allow(
    alike: float, reach: float
) -> None:
    """Independent errors add up in quadrature, 0.3 and 0.4; those against each other add up, 0.3 + 0.4."""
    own = np.array([1.0, -1.0, 1.0, -1.0])
    other = alike * own if alike else np.array([1.0, 1.0, -1.0, -1.0])
    one = Rate(5.0, 4.7, 5.3, 4, 0, steady=True, correlation_time=0.0, residual=own)
    another = Rate(-2.0, -2.4, -1.6, 4, 1, steady=True, correlation_time=0.0, residual=other)
    found = one.less(another)
    assert (found.value, found.frames) == (7.0, 4)
    assert (found.low, found.high) == pytest.approx((7.0 - reach, 7.0 + reach))
    apart = Rate(-2.0, -2.4, -1.6, 4, 0, steady=True, correlation_time=0.0, residual=np.full(4, np.nan))
    assert not one.less(apart).measured
