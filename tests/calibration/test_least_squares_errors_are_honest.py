"""Least squares: exact without noise, right scatter over repetitions, and a wrong model that does not look certain."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import spirillum as sp

PRESETS = ["biorob2012-wide", "biorob2012-narrow"]


def test_planted_factors_come_back_without_noise(made: Callable[..., Path]) -> None:
    path = made(error=0.0, trials=1, drag=(2.2, 4.1), rotation=(0.7, 1.3))
    found = sp.calibrate(path, PRESETS, method="least-squares", model="sbt")
    assert found.values["body_drag[40 mm]"].value == pytest.approx(2.2, rel=1e-6)
    assert found.values["body_rotation[30 mm]"].value == pytest.approx(1.3, rel=1e-6)
    assert any("observed once a tail" in warning for warning in found.warnings)


@pytest.mark.parametrize(("seeds", "least"), [(4, 12), pytest.param(16, 54, marks=pytest.mark.slow)])
def test_intervals_hold_the_truth_as_often_as_they_say(made: Callable[..., Path], seeds: int, least: int) -> None:
    """95 % of 16 is 15 and of 64 is 61; fewer than `least` would happen once in a thousand such tests."""
    inside, count = 0, 0
    for seed in range(seeds):
        path = made(seed=100 + seed, discrepancy=0.05)
        found = sp.calibrate(path, PRESETS, method="least-squares", free="body_drag,body_rotation")
        planted = {"body_drag[40 mm]": 1.95, "body_drag[30 mm]": 3.6}
        planted |= {"body_rotation[40 mm]": 0.6, "body_rotation[30 mm]": 0.6}
        for name, value in planted.items():
            inside += found.values[name].low <= value <= found.values[name].high
            count += 1
    assert least <= inside <= count


def test_a_wrong_model_says_by_how_much_it_misses(made: Callable[..., Path]) -> None:
    small = {"wavelengths": (10.0, 15.0, 25.0), "amplitudes": (1.5, 3.5), "presets": PRESETS[:1]}
    path = made(drag=(3.0,), rotation=(1.5,), **small)
    found = sp.calibrate(path, PRESETS[0], model="rft", method="least-squares")
    fitted = found.values["body_drag"]
    assert found.discrepancy["advance"].value > 0.05
    assert any("'rft' misses the speed" in warning for warning in found.warnings)
    # The interval is as wide as the misfit says, not as narrow as five trials of 2 % would make it.
    assert (fitted.high - fitted.low) / fitted.value > 4 * 1.96 * 0.02 / np.sqrt(5 * 6)


def test_the_answer_takes_less_than_a_second(made: Callable[..., Path]) -> None:
    path = made()
    sp.calibrate(path, PRESETS, method="least-squares", model="sbt")
    start = time.process_time()  # other programs on the machine do not count
    sp.calibrate(path, PRESETS, method="least-squares", model="sbt")
    assert time.process_time() - start < 1.0


def test_a_direction_that_nothing_sees_is_named_and_keeps_the_width_of_its_stated_prior(
    made: Callable[..., Path],
) -> None:
    found = sp.calibrate(
        made(),
        PRESETS,
        method="least-squares",
        free="body_drag,body_rotation,viscosity,torque_constant,shared_friction",
        assume_uncertainty={"motor.torque_constant": np.expm1(0.196)},
    )
    report = found.identifiability
    assert report is not None
    assert report.unknown == 1
    words = next(warning for warning in found.warnings if "trade off" in warning)
    assert all(name in words for name in ("viscosity", "torque_constant", "shared_friction"))
    fitted = found.values["torque_constant"]
    assert np.log(fitted.high / fitted.low) > 0.5 * 2 * 1.96 * 0.1 / np.sqrt(3)


def test_profiles_are_parabolas_with_the_curvature_of_the_covariance(made: Callable[..., Path]) -> None:
    from spirillum.calibration.identifiability import profiles

    found = sp.calibrate(made(), PRESETS, method="least-squares", model="sbt")
    assert found.least_squares is not None
    for profile in profiles(found.problem, found.least_squares, count=5):
        assert profile.misfit == pytest.approx([9.0, 2.25, 0.0, 2.25, 9.0], rel=0.03, abs=1e-6)
