"""Turns of the tail as a map, on a stand-in for a table: the law of orbit, and the mirror."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.free_motion import long_run
from spirillum.dynamics.release import state_at_release
from spirillum.dynamics.return_map import ReturnMap, fixed_place
from spirillum.dynamics.tube_robot import Surroundings, tube_robot
from spirillum.robot.placement import Placement
from spirillum.swimming.motions import LINKS
from spirillum.swimming.prediction import predict_steady
from spirillum.swimming.steady import calibrated_resistance

LENGTH, MIDDLE = 0.026, -0.0045  # of the straight side of the paper's body


def of_long_capsule(stand_in: Any, rate: float, hand: str = "right", *, weight: bool, rest: float) -> Any:
    """The paper's robot on the stand-in for a table, turned from outside or with its tail at a rate."""
    drive = {"kind": "rate", "joint": "fixed" if rest < 1e-6 else "revolute", "rate": f"{rate} rad/s"}
    one = sp.load("biorob2012-wide", drive=drive, **{"tail.handedness": hand})
    steady = predict_steady(one, model="slender")
    matrix = np.zeros((8, 8))
    twelve = calibrated_resistance(steady.batch, steady.model, calibrated=False)[0]
    matrix[:7, :7] = rest * LINKS.T @ twelve @ LINKS / one.fluid.viscosity
    matrix[7, 7] = 5.0
    table = stand_in.table(matrix, 0.02, 0.009, LENGTH, MIDDLE)
    around = Surroundings(roughness=2e-4)
    links = tube_robot(steady, table, around, turn=2.0 * np.pi / abs(rate), weight=weight)
    return one, links.at_duty(1.0)


@pytest.mark.parametrize("rate", [3.0, -3.0])
def test_weightless_capsule_orbits_at_its_two_dimensional_law(stand_in: Any, rate: float) -> None:
    """Free of force and turning at Omega: around the tube at Omega lambda^2/(1 + lambda^2), at the gap it was given."""
    one, links = of_long_capsule(stand_in, rate, weight=False, rest=1e-9)
    state = state_at_release(one, links, Placement.of({"gap": 5e-4}))
    run = long_run(links, state, np.sign(rate), heavy=False, until=None, progress=lambda *_: None)
    assert run.lying.state == "orbits"
    assert run.lying.orbit_rate == pytest.approx(rate * 0.45**2 / (1.0 + 0.45**2), rel=1e-5)
    assert run.lying.gap == pytest.approx(5e-4, rel=1e-5)
    assert np.isnan(run.lying.approach_time)


def test_mirrored_robot_comes_to_lie_on_the_other_side(stand_in: Any) -> None:
    places = []
    for hand, rate in (("right", 2.0), ("left", -2.0)):
        one, links = of_long_capsule(stand_in, rate, hand, weight=True, rest=1.0)
        turns, state = ReturnMap(links, np.sign(rate)), state_at_release(one, links, Placement.of({"gap": 3e-4}))
        for _ in range(20):
            state = turns.after(state).state
        place = fixed_place(turns, state, heavy=True)
        assert place is not None
        assert abs(place.multiplier) < 1.0
        steps = place.turn.steps
        places.append((steps[:, 4].mean(), steps[:, 6].mean(), steps[:, 3].mean(), place.turn.state[0]))
    there, back = places
    assert there[0] == pytest.approx(-back[0], rel=1e-2)
    assert there[1] == pytest.approx(-back[1], rel=1e-2)
    assert there[2] == pytest.approx(back[2], rel=1e-2)
    assert there[3] == pytest.approx(back[3], rel=1e-2)
