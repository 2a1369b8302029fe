"""A piece that is missing from a film shows in place, body and tail at once; noise, gaps and pushes do not.

A robot whose tail turns while it stays where it is has no speed.
"""

import numpy as np
import pytest

from spirillum.vision.track.cuts import clock_of, cuts_in, one_picture, standstill_flag
from spirillum.vision.track.track import RobotMotion

PIXEL = 2.5e-4


def series(noise=1.0, frames=300, fps=30.0, missing=(), seed=1, seconds=17.0):
    """Times that go on evenly, and what a robot of 1 mm/s, -0.12 Hz and 1.2 Hz shows; `missing`: true seconds."""
    rng = np.random.default_rng(seed)
    true = np.arange(round(seconds * fps)) / fps
    for start, end in missing:
        true = true[(true < start) | (true >= end)]
    true = true[:frames]
    x = 1e-3 * true + noise * 0.05 * PIXEL * rng.normal(size=true.size)
    body = -2 * np.pi * 0.12 * true + noise * 0.01 * rng.normal(size=true.size)
    tail = 2 * np.pi * 1.2 * true + noise * 0.03 * rng.normal(size=true.size)
    return true, x, body, tail


def unwrapped(angle, period):
    return np.unwrap(angle, period=period)


@pytest.mark.parametrize(("start", "end"), [(4.0, 6.0), (2.0, 3.1), (7.0, 7.4)])
def test_a_missing_piece_is_found_where_it_is(start, end):
    true, x, body, tail = series(missing=[(start, end)])
    (flag,) = cuts_in(
        RobotMotion(np.arange(true.size) / 30.0, x, unwrapped(body, np.pi), unwrapped(tail, 2 * np.pi)), PIXEL
    )
    assert flag.name == "video-is-cut"
    assert f"at {start - 0.5 / 30:.2f} s" in flag.sentence
    assert "forward_velocity" in flag.spoils


@pytest.mark.parametrize("seed", range(20))
def test_whole_films_are_whole(seed):
    _, x, body, tail = series(noise=3.0, seed=seed)
    assert cuts_in(RobotMotion(np.arange(x.size) / 30.0, x, body, tail), PIXEL) == ()


@pytest.mark.parametrize("gap", [0.2, 0.5, 2.0, 5.0, 60.0])
def test_a_gap_with_true_times_is_honest(gap):
    true, x, body, tail = series(frames=300, seconds=gap + 20.0, missing=[(4.0, 4.0 + gap)])
    assert cuts_in(RobotMotion(true, x, body, tail), PIXEL) == ()
    assert clock_of(RobotMotion(true, x, body, tail), PIXEL, np.pi) == (0.0, ())


@pytest.mark.parametrize("jump", [0.5, 1.7, 4.7, 40.1, 1000.3])
def test_times_that_jump_alone_are_said(jump):
    true, x, body, tail = series()
    stamps = np.where(true > 4.0, true + jump, true)
    tail = np.where(true > 4.0, tail + 2 * np.pi * np.round(1.2 * jump), tail)  # as it is unwrapped by these times
    body = np.where(true > 4.0, body - np.pi * np.round(0.24 * jump), body)
    (flag,) = clock_of(RobotMotion(stamps, x, body, tail), PIXEL, np.pi).flags
    assert flag.name == "times-do-not-fit"
    assert f"jump by {jump + 1 / 30:.2f} s at {true[120]:.2f} s" in flag.sentence
    assert "tail_rotation_rate" in flag.spoils


def test_the_clock_of_a_slow_robot_is_told_by_all_series_together():
    """Neither place nor body is clear by itself: 0.25 mm/s, and a body whose pattern nearly comes round again."""
    true, x, _, tail = series(frames=60)
    body, jump = 2 * np.pi * 0.15 * true, 3.2
    stamps = np.where(true > 1.0, true + jump, true)
    tail = np.where(true > 1.0, tail + 2 * np.pi * np.round(1.2 * jump), tail)
    body = np.where(true > 1.0, body + np.pi * np.round(0.3 * jump), body)
    (flag,) = clock_of(RobotMotion(stamps, 0.25 * x, body, tail), PIXEL, np.pi).flags
    assert flag.name == "times-do-not-fit"


def test_where_the_motion_does_not_tell_the_intervals_hold_both_readings():
    """A tail that makes whole turns meanwhile, and a body and a place that hardly move."""
    true, x, body, tail = series(frames=120)
    stamps = np.where(true > 2.0, true + 2.5, true)
    tail = np.where(true > 2.0, tail + 3 * 2 * np.pi, tail)
    found = clock_of(RobotMotion(stamps, 0.02 * x, 0.02 * body, tail), PIXEL, np.pi)
    assert found.relative_error == pytest.approx(0.5 * 2.5 / (119 / 30), rel=0.01)
    assert [flag.name for flag in found.flags] == ["clock-in-doubt"]
    assert not found.flags[0].spoils
    assert "no frame was taken for 2.53 s at 2.00 s" in found.flags[0].sentence
    put_back = clock_of(RobotMotion(stamps, 0.02 * x, 0.02 * body, tail), PIXEL, np.pi, stated=true)
    assert put_back == (0.0, ())  # frames that were lost there by the motion itself


def test_pauses_of_a_camera_are_honest_whatever_the_motor_does():
    rng = np.random.default_rng(0)
    for _ in range(200):
        speed, body, tail = np.exp(rng.uniform(np.log([1e-4, 0.1, 2.0]), np.log([3e-3, 12.0, 60.0])))
        time = np.concatenate([np.arange(120), 120 + 30 * np.exp(rng.uniform(-2, 4)) + np.arange(120)]) / 30
        way = time + 0.05 * rng.normal() * time**2 / time[-1]  # its rate drifts
        values = [
            rate * way + error * rng.normal(size=240)
            for rate, error in ((speed, 0.05 * PIXEL), (-body, 0.01), (tail, 0.03))
        ]
        assert clock_of(RobotMotion(time, *values), PIXEL, np.pi) == (0.0, ())


def test_a_push_moves_the_robot_alone():
    true, x, body, tail = series()
    assert cuts_in(RobotMotion(true, np.where(true > 5.0, x + 2e-3, x), body, tail), PIXEL) == ()


def test_short_and_unseen_series_say_nothing():
    true, x, body, tail = series(frames=20)
    assert cuts_in(RobotMotion(true, x, body, tail), PIXEL) == ()
    assert cuts_in(RobotMotion(true[:1], x[:1], body[:1], tail[:1]), PIXEL) == ()
    assert clock_of(RobotMotion(true[:1], x[:1], body[:1], tail[:1]), PIXEL, np.pi) == (0.0, ())
    assert clock_of(RobotMotion(np.array([0.0, 0.1, 9.0]), x[:3], body[:3], tail[:3]), PIXEL, np.pi) == (0.0, ())
    true, x, body, tail = series()
    assert cuts_in(RobotMotion(true, x, np.full_like(body, np.nan), np.full_like(tail, np.nan)), PIXEL) == ()


def test_a_robot_that_turns_but_does_not_advance_has_no_speed():
    true, x, body, tail = series()
    still = x[0] + 0.02 * PIXEL * np.random.default_rng(3).normal(size=x.size)
    unseen = np.full(x.size, np.nan)
    for motion in (
        RobotMotion(true, still, body, tail),
        RobotMotion(true, still, body, unseen),
        RobotMotion(true, still, unseen, tail),
    ):
        (flag,) = standstill_flag(motion, PIXEL)
        assert flag.name == "does-not-advance"
        assert set(flag.spoils) >= {"forward_velocity", "tail_rotation_rate"}
        assert "body_rotation_rate" not in flag.spoils
    assert "its tail turns 12.0 times" in standstill_flag(RobotMotion(true, still, body, tail), PIXEL)[0].sentence


def test_slow_and_resting_robots_are_not_said_to_stand():
    true, x, body, tail = series()
    rest = np.full(x.size, x[0])
    slow = 0.005 * PIXEL * np.arange(x.size)  # 1.5 pixels in all
    for motion in (
        RobotMotion(true, slow, body, tail),
        RobotMotion(true, x, body, tail),
        RobotMotion(true, rest, 0.01 * body, 0.01 * tail),
        RobotMotion(true, rest, np.zeros(x.size), np.full(x.size, np.nan)),
        RobotMotion(true, np.full(x.size, np.nan), body, tail),
    ):
        assert standstill_flag(motion, PIXEL) == ()


def test_one_picture_again_and_again_gives_nothing():
    """Without the noise of any camera; of few frames nothing is said, for their rates have wide intervals."""
    true, x, body, tail = (values[:40] for values in series())
    same = [np.full(40, values[0]) for values in (x, body, tail)]
    (flag,) = one_picture(RobotMotion(true, *same))
    assert flag.name == "one-picture"
    assert set(flag.spoils) >= {"forward_velocity", "body_rotation_rate", "tail_rotation_rate"}
    assert one_picture(RobotMotion(true, *same[:2], np.full(40, np.nan)))[0].name == "one-picture"
    assert one_picture(RobotMotion(*(values[:20] for values in (true, *same)))) == ()
    assert one_picture(RobotMotion(true, *same[:2], tail)) == ()
