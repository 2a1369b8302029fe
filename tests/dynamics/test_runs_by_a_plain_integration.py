"""Runs of the paper's robot on a film that cavitates, against the same runs with other films and other steps."""

import numpy as np
import pytest
from tests.support.plain_run import PlainRun

import spirillum as sp

TURN = 0.65


@pytest.mark.slow
@pytest.mark.parametrize(("pressure", "wait"), [("100 kPa", "60 s"), ("10 kPa", "600 s"), ("none", "60 s")])
def test_means_of_turns_are_those_of_a_plain_integration(pressure: str, wait: str) -> None:
    """Two turns of the tail."""
    robot = sp.load("biorob2012-wide", **{"fluid.cavitation_pressure": pressure})
    run = sp.simulate(robot, model="tube", timing={"duration": "2.5 s"}, in_tube={"wait": wait})
    assert not np.nanmin(run["tail_gap"].values, initial=np.inf) < run.attrs["roughness"]
    first, last = np.searchsorted(run["time"].values, [1.0, 1.0 + 2.0 * TURN]).tolist()
    own, other = PlainRun(run).integrate(first, last)
    assert other.speed == pytest.approx(own.speed, rel=0.02)
    assert other.body_rate == pytest.approx(own.body_rate, rel=0.03)
    assert other.gap == pytest.approx(own.gap, rel=0.04)


def test_rates_are_those_of_a_plain_balance() -> None:
    """At one moment, with the cavity."""
    run = sp.simulate("biorob2012-wide", model="tube", timing={"duration": "1 s"}, in_tube={"wait": "60 s"})
    plain = PlainRun(run)
    state = plain.state_at(-1)
    moved = plain.derivative(0.0, state)
    assert moved[8] == pytest.approx(float(run["velocity"][-1, 0]), rel=0.02)
    assert moved[9] == pytest.approx(float(run["body_rotation_rate"][-1]), rel=0.02)
    assert np.linalg.norm(state[2:6]) == pytest.approx(1.0, abs=1e-9)
