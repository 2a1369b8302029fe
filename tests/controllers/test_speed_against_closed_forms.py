"""Controllers of speed on a robot whose truth is a line: no rest, no windup, and the rests of a relay."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from spirillum.controllers.course_tasks import LEASH, KeepCourse, SaveBattery, Steady
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun, run_loop
from spirillum.controllers.sensors import FlowPulse

SPEED, ASKED = 1e-3, 4e-4


def places(run: LoopRun, times: Any) -> Any:
    return np.interp(times, [m.time for m in run.moments], [m.pose.position[0] for m in run.moments])


@pytest.mark.parametrize("share", [0.5, pytest.param(1.0, marks=pytest.mark.slow), 2.0])
@pytest.mark.parametrize(("lab", "within"), [(Lab.exact(), 0.005), (Lab.of(None), 0.05)])
def test_speed_is_held_whatever_the_robots_own_is(toy: Any, share: float, lab: Lab, within: float) -> None:
    """It expects SPEED, the robot has a share of it: no rest with exact sensors, 5 % with those that err as usual."""
    run = run_loop(toy(share * SPEED), KeepCourse(lab, SPEED, 1.0, ASKED, leash=LEASH), lab, 60.0, seed=4)
    assert np.diff(places(run, [30.0, 60.0]))[0] / 30.0 == pytest.approx(ASKED, rel=within)


def test_a_robot_that_slows_down_evenly_is_followed_without_a_rest(toy: Any) -> None:
    """Its speed at full duty falls by half; an integral of the speed's error alone would stay behind by its ramp."""

    class Slowing(toy):  # type: ignore[misc]
        def step(self, dt: float, **command: Any) -> Any:
            self.speed = SPEED * (1.0 - 0.5 * self.state.time / 60.0)
            return super().step(dt, **command)

    lab = Lab.exact()
    run = run_loop(Slowing(), KeepCourse(lab, SPEED, 1.0, ASKED, leash=LEASH), lab, 60.0)
    assert np.diff(places(run, [20.0, 60.0]))[0] / 40.0 == pytest.approx(ASKED, rel=0.003)


def test_no_more_than_the_leash_is_made_up_for_after_a_flow_that_it_cannot_swim_against(toy: Any) -> None:
    """Ten seconds of it; then it is back within seconds, faster than asked by the leash's share at most."""
    lab, flow = Lab.exact(), FlowPulse(10.0, 20.0, -2e-3)
    run = run_loop(toy(SPEED), KeepCourse(lab, SPEED, 1.0, ASKED, leash=LEASH), lab, 45.0, flow=flow)
    after = np.diff(places(run, np.arange(23.0, 45.0)))
    assert after.max() < ASKED * (1.0 + LEASH) * 1.05
    assert after[12:] == pytest.approx(np.full(after.size - 12, ASKED), rel=0.15)


def test_a_course_is_found_again_after_a_pulse(toy: Any) -> None:
    lab, flow = Lab.of(None), FlowPulse(10.0, 12.0, -1e-3)
    run = run_loop(toy(SPEED), KeepCourse(lab, SPEED, 1.0, ASKED), lab, 40.0, flow=flow, seed=1)
    missed = places(run, [9.0, 12.5, 40.0]) - ASKED * np.array([9.0, 12.5, 40.0])
    assert abs(missed[0]) < 1e-4
    assert missed[1] < -4e-4
    assert abs(missed[2]) < 1e-4


def test_backwards_alike(toy: Any) -> None:
    lab = Lab.exact()
    run = run_loop(toy(-SPEED), KeepCourse(lab, -SPEED, 1.0, ASKED), lab, 20.0)
    assert places(run, [20.0])[0] == pytest.approx(-ASKED * 20.0, abs=5e-5)
    run = run_loop(toy(-SPEED), KeepCourse(lab, -SPEED, 1.0, ASKED, leash=LEASH), lab, 30.0)
    assert np.diff(places(run, [20.0, 30.0]))[0] == pytest.approx(-ASKED * 10.0, rel=0.02)


def test_the_relay_keeps_to_its_band_and_is_on_for_its_share(toy: Any) -> None:
    lab, band = Lab.exact(), 2e-4
    run = run_loop(toy(SPEED), SaveBattery(lab, SPEED, 1.0, ASKED, band), lab, 60.0)
    times = np.arange(1.0, 60.0, 0.1)
    missed = places(run, times) - ASKED * times
    assert np.abs(missed).max() < band + SPEED * lab.remote.period + 2e-5
    on = np.mean([one.duty for one in run.decisions])
    assert on == pytest.approx(ASKED / SPEED, abs=0.02)


def test_open_loop_is_on_for_its_share(toy: Any) -> None:
    lab = Lab.exact()
    run = run_loop(toy(SPEED), Steady(1.0, share=0.4, cycle=5.0), lab, 50.0)
    assert places(run, [50.0])[0] == pytest.approx(0.4 * SPEED * 50.0, rel=0.02)
