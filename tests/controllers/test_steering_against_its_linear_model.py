"""Steering by the place across the tube: on a robot that is the linear equation itself, and on one in its tube."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun, run_loop
from spirillum.controllers.steering import MOST_TILT, Replay, Steer, Steering

LENGTH, RATE = 0.03, 6.0
PUSHER = Steering(complex(0.02, 0.7), 2e-3 * np.exp(-0.9j), RATE, LENGTH)
"""An orbit that grows."""


class Linear:
    """d zeta/dt = m zeta + g theta; its body turns with the field up to a step-out rate."""

    def __init__(self, toy: Any, known: Steering, place: complex, step_out: float = np.inf) -> None:
        self.known, self.place, self.step_out = known, place, step_out
        self.toy, self.turned, self.rates = toy(), 0.0, []

    @property
    def state(self) -> Any:
        return self.toy.state

    def step(self, dt: float, *, duty: float, field: Any = None) -> Any:
        if field is not None and duty > 0.0:
            tilt = complex(field.yaw, field.pitch)
            assert abs(tilt) <= MOST_TILT * (1.0 + 1e-12)
            self.place = self.known.moved(self.place, tilt, dt)
            self.turned += dt * (field.rotation_rate if abs(field.rotation_rate) <= self.step_out else 0.0)
            self.rates.append(field.rotation_rate)
        self.toy.step(dt, duty=duty)
        return self.observe()

    def observe(self) -> Any:
        moment = self.toy.observe()
        moment.pose.position[1:] = self.place.real, self.place.imag
        moment.values["body_angle"] = self.turned
        return moment


def distances(run: LoopRun, times: Any) -> Any:
    return np.interp(times, [m.time for m in run.moments], [np.hypot(*m.pose.position[1:]) for m in run.moments])


def test_the_place_goes_to_the_axis_with_the_time_constant_that_was_asked_for(toy: Any) -> None:
    """d zeta/dt = (i Omega - 1/T) zeta, T = 5 s, once the tilt is below its limit; errors of the camera remain."""
    lab = Lab.exact()
    run = run_loop(Linear(toy, PUSHER, 2e-4 + 0j), Steer(lab, PUSHER, "position"), lab, 20.0)
    at = distances(run, [2.0, 7.0, 12.0])
    assert at[:-1] / at[1:] == pytest.approx(np.full(2, np.e), rel=0.05)
    usual = Lab.of({"unknown": {"friction_factor": 1.0}})
    run = run_loop(Linear(toy, PUSHER, 1e-3j), Steer(usual, PUSHER, "position"), usual, 60.0, seed=2)
    assert distances(run, np.arange(40.0, 60.0)).max() < 2e-4


def test_a_line_of_sight_does_as_well_where_nothing_orbits_and_not_where_it_grows(toy: Any) -> None:
    lab, still = Lab.exact(), Steering(0j, 2e-3 + 0j, RATE, LENGTH)
    run = run_loop(Linear(toy, still, 2e-4 + 0j), Steer(lab, still, "aim"), lab, 60.0)
    at = distances(run, [10.0, 40.0])
    assert np.log(at[0] / at[1]) / 30.0 == pytest.approx(2e-3 / (2.0 * LENGTH), rel=0.02)
    growing = Steering(complex(0.05, 0.7), PUSHER.gain, RATE, LENGTH)
    run = run_loop(Linear(toy, growing, 2e-4 + 0j), Steer(lab, growing, "aim"), lab, 40.0)
    assert distances(run, [40.0])[0] > 2e-4


def test_the_field_slows_down_until_the_robot_follows(toy: Any) -> None:
    """The step-out rate is 0.7 of what was thought: the field comes to 0.64 of its rate, and stays."""
    lab = Lab.exact()
    robot = Linear(toy, PUSHER, 1e-4 + 0j, step_out=0.7 * RATE)
    run_loop(robot, Steer(lab, PUSHER, "position"), lab, 20.0)
    assert robot.rates[-1] == pytest.approx(0.64 * RATE)
    follows = Linear(toy, PUSHER, 1e-4 + 0j)
    run_loop(follows, Steer(lab, PUSHER, "position"), lab, 10.0)
    assert set(follows.rates) == {RATE}


def test_tilts_are_replayed_when_they_were_due(toy: Any) -> None:
    lab = Lab.exact()
    robot = Linear(toy, PUSHER, 0j)
    run_loop(robot, Replay(RATE, [(1.0, 0.01 + 0j), (2.0, 0j)]), lab, 3.0)
    pushed = PUSHER.moved(PUSHER.moved(0j, 0.01 + 0j, 1.0), 0j, 1.0)
    assert abs(robot.place) == pytest.approx(abs(pushed), rel=0.15)  # decisions come every 108 ms


MAGNETIC = {
    "drive": {"kind": "magnetic", "joint": "fixed"},
    "magnetic": {"moment": "0.3 A m^2", "field": "5 mT", "rotation_rate": "1 Hz"},
    "body.mass": "8.2712 g",
    "tail.density": "985 kg/m^3",
}
LAB = {"unknown": {"friction_factor": 1.0}, "pulse": {"velocity": 0.0}}


def test_a_pusher_in_its_tube_leaves_its_orbit() -> None:
    """It orbits the axis of the paper's tube at 2.5 mm; 0.1 mm/s is what a tilt of 3 degrees gives."""
    robot = sp.load("biorob2012-wide", **MAGNETIC)
    answers = {
        name: sp.control(
            robot,
            {"kind": "keep-axis", "duration": "7 s"},
            lab=LAB,
            controller=name,
            plant={"placement": {"gap": "8.5 mm"}},
        )
        for name in ("feedback", "nothing")
    }
    last = {name: distances(answer.run, [7.0])[0] for name, answer in answers.items()}
    assert last["nothing"] > 2.1e-3
    assert last["feedback"] < last["nothing"] - 5e-4
    assert answers["feedback"].to_dict()["motor_off_at_end"]
    tilts = np.hypot(answers["feedback"].dataset["field_yaw"], answers["feedback"].dataset["field_pitch"])
    assert float(tilts.max()) <= MOST_TILT * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("task", "words"),
    [
        ({"rate": "1.3 Hz"}, r"task.rate = 1.3 Hz; allowed: up to 1.2 Hz"),
        ({"law": "push"}, r"task.law = 'push'; allowed: position, aim"),
    ],
)
def test_wrong_tasks_are_a_sentence(task: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        sp.control(
            sp.load("biorob2012-wide", **MAGNETIC),
            {"kind": "keep-axis", **task},
            lab=LAB,
            plant={"placement": {"gap": "8.5 mm"}},
        )


def test_a_robot_with_a_motor_cannot_be_steered() -> None:
    with pytest.raises(sp.InputError, match=r"keep-axis' with biorob2012-wide; allowed: .* 'magnetic'"):
        sp.control("biorob2012-wide", {"kind": "keep-axis"}, lab=LAB)
