"""A robot that is moved step by step swims the run that `simulate` computes in one piece."""

import pytest

import spirillum as sp
from spirillum.pages.motion import SteppedMotion
from spirillum.robot.placement import Placement

STEPS = (0.05, 1.0 / 30.0, 0.2, 1e-3, 0.0156666666666667)


@pytest.mark.parametrize(
    ("robot", "model"), [("biorob2012-wide", "tube"), ("biorob2012-wide", "rft"), ("magnetic-helix", "rft")]
)
def test_steps_of_any_length_are_the_run_in_one_piece(robot: str, model: str) -> None:
    motion = SteppedMotion(sp.load(robot), model=model, placement=Placement())
    for dt in STEPS:
        moment = motion.step(dt, 1.0)
    run = sp.simulate(robot, model=model, timing={"duration": moment.time})
    assert moment.pose.position == pytest.approx(run.position.values[-1], rel=1e-6, abs=1e-10)
    assert moment.pose.tail_phase + moment.values["body_angle"] == pytest.approx(float(run.tail_angle[-1]), rel=1e-6)
    assert moment.values["forward_velocity"] == pytest.approx(float(run.forward_velocity[-1]), rel=1e-5)


def test_remote_acts_where_simulate_switches() -> None:
    motion = SteppedMotion(sp.load("biorob2012-wide"), model="tube", placement=Placement())
    for duty in (1.0, 1.0, 0.0, 0.0, 1.0):
        moment = motion.step(0.05, duty)
    on = [("0 s", "0.1 s"), ("0.2 s", "0.25 s")]
    run = sp.simulate("biorob2012-wide", model="tube", timing={"duration": "0.25 s", "on": on})
    assert moment.time == pytest.approx(0.25)
    assert moment.pose.position == pytest.approx(run.position.values[-1], rel=1e-6, abs=1e-10)
    assert moment.values["motor_current"] == pytest.approx(float(run.motor_current[-1]), rel=1e-6)
