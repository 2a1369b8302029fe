"""A plant that is moved step by step swims the run that `simulate` computes in one piece."""

from __future__ import annotations

import re
from typing import Any

import pytest

import spirillum as sp

STEPS = (0.05, 1.0 / 30.0, 0.2, 1e-3, 0.0156666666666667)


@pytest.fixture(scope="module")
def tube() -> sp.Plant:
    return sp.Plant("biorob2012-wide", model="tube")


@pytest.mark.parametrize(
    ("robot", "model", "closeness"),
    [("biorob2012-wide", "tube", 1e-9), ("biorob2012-wide", "rft", 1e-6), ("magnetic-helix", "rft", 1e-6)],
)
def test_steps_of_any_length_are_the_run_in_one_piece(robot: str, model: str, closeness: float) -> None:
    """Without walls each step begins a new integration, to its tolerance."""
    plant = sp.Plant(robot, model=model)
    for dt in STEPS:
        moment = plant.step(dt)
    start = {"in_tube": {"wait": 0.0}} if model == "tube" else {}
    run = sp.simulate(robot, model=model, timing={"duration": moment.time}, **start)
    assert moment.pose.position == pytest.approx(run.position.values[-1], rel=closeness, abs=1e-10)
    angle = moment.pose.tail_phase + moment.values["body_angle"]
    assert angle == pytest.approx(float(run.tail_angle[-1]), rel=closeness)
    assert moment.values["forward_velocity"] == pytest.approx(float(run.forward_velocity[-1]), rel=10.0 * closeness)


def test_remote_acts_where_simulate_switches(tube: sp.Plant) -> None:
    plant = tube.copy()
    for remote in (True, None, False, None, True):
        moment = plant.step(0.05, remote=remote)
    on = [("0 s", "0.1 s"), ("0.2 s", "0.25 s")]
    run = sp.simulate("biorob2012-wide", model="tube", timing={"duration": "0.25 s", "on": on}, in_tube={"wait": 0.0})
    assert moment.time == pytest.approx(0.25)
    assert moment.pose.position == pytest.approx(run.position.values[-1], rel=1e-9, abs=1e-13)
    assert moment.values["motor_current"] == pytest.approx(float(run.motor_current[-1]), rel=1e-8)


def test_copies_and_noted_states_go_on_alike(tube: sp.Plant) -> None:
    plant = tube.copy()
    plant.step(0.07)
    noted, twin, other = plant.state, plant.copy(), tube.copy()
    there = plant.step(0.04, duty=0.5).pose.position.tolist()
    assert twin.step(0.04, duty=0.5).pose.position.tolist() == there
    assert other.reset(noted).time == pytest.approx(0.07)
    assert other.step(0.04, duty=0.5).pose.position.tolist() == there
    assert tube.state.time == 0.0
    assert plant.reset().values["forward_velocity"] == tube.observe().values["forward_velocity"]


def test_flow_carries_the_robot_as_simulate_says(tube: sp.Plant) -> None:
    """A change of the flow begins a new integration, from a state between two steps."""
    plant = tube.copy()
    plant.step(0.05, flow="1 mm/s")
    still = tube.copy().step(0.05)
    moment = plant.step(0.05, flow=0.0)
    assert plant.state.flow == 0.0
    assert plant.observe().pose.position[0] == moment.pose.position[0]
    assert moment.pose.position[0] > still.pose.position[0]
    run = sp.simulate("biorob2012-wide", model="tube", placement={"flow": "1 mm/s"}, timing={"duration": "0.05 s"})
    again = tube.copy().step(0.05, flow=1e-3)
    assert again.pose.position == pytest.approx(run.position.values[-1], rel=1e-9, abs=1e-13)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"dt": 0.0}, "dt = 0.0; allowed: above 0, at most 1e+06 s"),
        ({"dt": float("nan")}, "dt = nan"),
        ({"dt": 0.1, "duty": float("nan")}, "duty = nan; allowed: a number from 0 to 1"),
        ({"dt": 0.1, "duty": 1.5}, "duty = 1.5"),
        ({"dt": 0.1, "remote": "on"}, "remote = on; allowed: True or False"),
        ({"dt": 0.1, "remote": True, "duty": 0.1}, "remote and duty are given together"),
        ({"dt": 0.1, "flow": "1"}, "flow"),
    ],
)
def test_wrong_commands_move_nothing(tube: sp.Plant, asked: dict[str, Any], words: str) -> None:
    plant = tube.copy()
    with pytest.raises(sp.InputError, match=re.escape(words)):
        plant.step(**asked)
    assert plant.state == tube.state


def test_a_step_below_the_rounding_error_of_the_time_is_none(tube: sp.Plant) -> None:
    plant = tube.copy()
    plant.step(0.1)
    with pytest.raises(sp.InputError, match=r"dt = 1e-18 s is none at t = 0\.1 s"):
        plant.step(1e-18)


def test_flow_needs_walls_and_a_state_its_own_kind(tube: sp.Plant) -> None:
    free = sp.Plant("biorob2012-wide", model="rft")
    with pytest.raises(sp.InputError, match="flow is known only to model 'tube'"):
        free.step(0.1, flow=1e-3)
    with pytest.raises(sp.InputError, match="state is none of this plant"):
        free.reset(tube.state)
