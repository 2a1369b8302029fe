"""Stopping at a place: the rests that theory leaves, and the filter behind it against its own statistics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from spirillum.controllers.estimators import PositionFilter
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import run_loop
from spirillum.controllers.sensors import Detection, FlowPulse
from spirillum.controllers.stop_task import KnowingStop, StopController, Timed

SPEED, GOAL, TOLERANCE = 1e-3, 5e-3, 1e-3


def test_with_exact_sensors_the_rest_is_what_it_moves_in_a_period(toy: Any) -> None:
    """Latency and delay do not count: the follower looks ahead over both."""
    lab = Lab.exact()
    lab = lab.model_copy(
        update={
            "camera": lab.camera.model_copy(update={"latency": 0.3}),
            "remote": lab.remote.model_copy(update={"delay": 0.2}),
        }
    )
    run = run_loop(toy(SPEED), StopController(lab, SPEED, 1.0, GOAL, TOLERANCE), lab, 12.0)
    rest = run.moments[-1].pose.position[0] - (GOAL - 0.5 * TOLERANCE)
    assert 0.0 <= rest <= SPEED * lab.remote.period + 2e-5


@pytest.mark.parametrize("velocity", [-1e-3, -3e-4, 3e-4])
@pytest.mark.parametrize("start", [1.0, 8.0])
def test_pulses_before_and_after_the_stop_leave_it_within_the_tolerance(
    toy: Any, velocity: float, start: float
) -> None:
    lab = Lab.of({"camera": {"dropped": 0.1}, "remote": {"lost": 0.1}})
    controller = StopController(lab, 0.5 * SPEED, 1.0, GOAL, TOLERANCE)  # it expects half the speed
    run = run_loop(toy(SPEED), controller, lab, 20.0, flow=FlowPulse(start, start + 2.0, velocity), seed=2)
    assert abs(run.moments[-1].pose.position[0] - GOAL) < TOLERANCE


def test_open_loop_goes_as_far_as_its_time_and_nothing_stays(toy: Any) -> None:
    lab = Lab.exact()
    run = run_loop(toy(SPEED), Timed(lab, GOAL / SPEED, 1.0), lab, 12.0)
    assert run.moments[-1].pose.position[0] == pytest.approx(GOAL, abs=0.5 * SPEED * lab.remote.period + 1e-9)
    assert run_loop(toy(SPEED), Timed(lab, 0.0, 1.0), lab, 3.0).moments[-1].pose.position[0] == 0.0


def test_who_knows_a_coming_pulse_lets_it_carry(toy: Any) -> None:
    lab, flow = Lab.exact(), FlowPulse(8.0, 10.0, 1e-3)
    run = run_loop(toy(SPEED), KnowingStop(lab, 1.0, GOAL, 1.0, flow, 0.8), lab, 15.0, flow=flow)
    before = max(moment.pose.position[0] for moment in run.moments if moment.time < 8.0)
    assert before == pytest.approx(GOAL - 1.6e-3, abs=SPEED * lab.remote.period)
    assert run.moments[-1].pose.position[0] == pytest.approx(GOAL, abs=SPEED * lab.remote.period)


def test_a_robot_that_swims_backwards_stops_alike(toy: Any) -> None:
    lab = Lab.exact()
    run = run_loop(toy(-SPEED), StopController(lab, -SPEED, 1.0, -GOAL, TOLERANCE), lab, 12.0)
    assert 0.0 <= -run.moments[-1].pose.position[0] - (GOAL - 0.5 * TOLERANCE) <= SPEED * lab.remote.period + 2e-5


def test_the_followers_error_is_what_it_says() -> None:
    """On its own model: the surprise over its standard deviation has mean 0 and size 1."""
    lab, dt = Lab.of({"camera": {"position_wander": "0.03 mm", "position_noise": "0.01 mm"}}), 1.0 / 30.0
    found = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        follower = PositionFilter(lab, SPEED)
        follower.send(0.0, 1.0)
        x, speed, drift = 0.0, SPEED * (1.0 + 0.3 * rng.standard_normal()), 0.0
        slow, kept = 3e-5 * rng.standard_normal(), np.exp(-dt)
        for number in range(1, 301):
            time = dt * number
            x += dt * (speed * (time > 0.068) + drift)
            speed += 0.15 * SPEED * np.sqrt(dt) * rng.standard_normal()
            left = np.exp(-dt / 2.0)
            drift = left * drift + 3e-4 * np.sqrt(1 - left**2) * rng.standard_normal()
            slow = kept * slow + 3e-5 * np.sqrt(1 - kept**2) * rng.standard_normal()
            follower.see(Detection(time, x + slow + 1e-5 * rng.standard_normal(), 0.0, 0.0, 0.0))
        mean, spread = follower.ahead(10.0)
        found.append((mean - (x, speed, drift, slow)) / np.sqrt(np.diag(spread)))
    assert np.abs(np.mean(found, axis=0)).max() < 0.5
    assert np.std(found, axis=0) == pytest.approx(np.ones(4), abs=0.3)


def test_a_stray_sight_is_left_out() -> None:
    follower = PositionFilter(Lab.of(None), SPEED)
    for number in range(1, 60):
        follower.see(Detection(number / 30.0, 0.0 if number != 40 else 5e-3, 0.0, 0.0, 0.0))
    assert abs(follower.ahead(2.0)[0][0]) < 1e-4
