"""Tails of several starts in a tube: alike after their part of a turn, in solutions and in what tables keep of them."""

import numpy as np
import pytest

from spirillum import load, resistance
from spirillum.fluid.tube.outer_resistance import HARMONICS, PHASES, even_phases, fourier

POSE = {"gap": "4 mm", "pitch": "2 deg"}


def of(phase: float, starts: int = 3) -> np.ndarray:
    robot = load("biorob2012-wide", tail={"starts": starts, "wire_diameter": "1.5 mm"})
    return resistance(
        robot, model="tube", part="both", phase=phase, resolution={"tolerance": 0.05}, placement=POSE
    ).matrix


def test_the_solution_is_that_of_the_turned_tail() -> None:
    first, third, half = of(0.3), of(0.3 + 2.0 * np.pi / 3.0), of(0.3 + np.pi / 3.0)
    size = np.sqrt(np.outer(np.diag(first), np.diag(first)))
    assert np.max(np.abs(third - first) / size) < 1e-4
    assert np.max(np.abs(half - first) / size) > np.max(np.abs(third - first) / size)
    assert np.max(np.abs(first - first.T) / size) < 1e-9


@pytest.mark.parametrize("starts", [1, 2, 3, 4])
def test_tables_keep_the_harmonics_of_their_starts(starts: int) -> None:
    kept = [m for m in range(1, HARMONICS + 1) if m % starts == 0]
    draw = np.random.default_rng(starts)
    waves = {m: draw.normal(size=2) for m in kept}

    def value(phase: np.ndarray) -> np.ndarray:
        total = np.full(phase.shape, 2.0)
        for m, (a, b) in waves.items():
            total += a * np.cos(m * phase) + b * np.sin(m * phase)
        return total

    found = fourier(value(np.array(even_phases(PHASES, starts)))[:, None], PHASES, starts)[:, 0]
    expected = np.zeros(PHASES)
    expected[0] = 2.0
    for m, pair in waves.items():
        expected[2 * m - 1 : 2 * m + 1] = pair
    assert np.allclose(found, expected, rtol=0.0, atol=1e-12)


def test_a_robot_of_five_starts_leaves_their_mean() -> None:
    phases = np.array(even_phases(PHASES, 5))
    found = fourier((2.0 + np.cos(5.0 * phases))[:, None], PHASES, 5)[:, 0]
    assert np.allclose(found, [2.0, *np.zeros(PHASES - 1)], rtol=0.0, atol=1e-12)
