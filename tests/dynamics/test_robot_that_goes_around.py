"""A robot that its weight does not hold, and what is said of a motion that is not steady."""

from __future__ import annotations

import re

import numpy as np
import pytest

from spirillum.dynamics.free_motion import FollowedPath, _around
from spirillum.dynamics.return_map import STEPS, Turn
from spirillum.kernels import core
from spirillum.swimming.motions import State, SteadyState


@pytest.mark.parametrize(
    ("state", "rate", "words"),
    [
        ("steady", 0.0, "a steady motion was reached"),
        ("orbits", 0.5 * np.pi, "no steady azimuth was reached: .* orbits the tube's axis in 4 s"),
        ("goes around", -np.pi, "no steady motion was reached: .* goes around the tube in 2 s"),
        ("changing", 0.1, "no steady motion was reached: the battery; all values are means over the last turn"),
    ],
)
def test_statement_says_whether_and_why(state: State, rate: float, words: str) -> None:
    lying = SteadyState(state, 0.0, 1e-3, (1e-3, 1e-3), 0.0, 0.0, rate, 0.0, 10.0, np.nan, "the battery")
    assert re.match(words, lying.statement)
    assert lying.to_dict()["gap"]["over"] == ("a circuit" if state == "goes around" else "a turn of the tail")


def test_means_are_over_the_last_circuit() -> None:
    """Turns of 0.5 s, 1.75 s around: the circuit begins in the seventh of ten turns, whose start is where it does."""
    path, steps = FollowedPath(), 100
    place = {name: column for column, name in enumerate(STEPS)}
    states = [np.zeros(core.STATE_SIZE)]
    for number in range(10):
        rows = np.zeros((steps, len(STEPS)))
        rows[:, place["time"]] = np.linspace(0.5 / steps, 0.5, steps)
        raw = -2.0 * np.pi / 1.75 * (0.5 * number + rows[:, place["time"]])
        rows[:, place["azimuth"]] = (raw + np.pi) % (2.0 * np.pi) - np.pi
        turn = Turn(np.full(core.STATE_SIZE, number + 1.0), 0.5, rows, np.eye(8))
        turn.state[:3] = 0.0
        path.add(turn)
        states.append(turn.state)
    found = _around(path, turn, states)
    assert found.time == pytest.approx(1.75, rel=0.01)
    assert found.lying.orbit_rate == pytest.approx(-2.0 * np.pi / 1.75, rel=1e-6)
    assert found.start[-1] == 6.0  # after six turns, at 3 s of 5 s: 3.25 s lies in the seventh
