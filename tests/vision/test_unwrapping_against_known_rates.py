"""Angles that go on have the rate that was put in; rates that cannot be known are said."""

import numpy as np
import pytest

from spirillum.fluid.registry import resistance
from spirillum.robot.load import load
from spirillum.vision.setup import CameraSetup, Markers, RobotSetup, Setup, stripes_of
from spirillum.vision.track.colours import pattern_period
from spirillum.vision.track.track import RobotMotion
from spirillum.vision.track.unwrapping import _largest_advance, contradictions, no_stripe_passes, unwrapped

FPS = 30.0
TURN = 2 * np.pi


def series(rate: float, *, noise: float = 0.02, period: float = TURN, count: int = 600) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(7)
    time = np.arange(count) / FPS
    angle = 0.4 + rate * time
    return time, angle, (angle + rng.normal(0.0, noise, count)) % period, np.full(count, noise)


@pytest.mark.parametrize("rate", [-31.4, -2.0, -0.06, 0.0, 0.06, 7.5, 31.4, 80.0])
def test_angles_go_on_at_their_rate(rate: float) -> None:
    time, angle, read, error = series(rate)
    found, flags = unwrapped(time, read, error, TURN)
    assert flags == ()
    turns = (found - angle) / TURN
    assert np.ptp(np.round(turns)) == 0
    assert np.nanmax(np.abs(found - angle - TURN * np.round(turns[0]))) < 0.1


def test_gaps_and_stray_readings_cost_no_turn() -> None:
    time, angle, read, error = series(25.0)
    rng = np.random.default_rng(2)
    kept = rng.random(time.size) > 0.1
    kept[200:245] = False
    stray = rng.random(time.size) < 0.05
    read[stray] = rng.uniform(0.0, TURN, stray.sum())
    read[rng.random(time.size) < 0.05] = np.nan
    found, flags = unwrapped(time[kept], read[kept], error[kept], TURN, "tail")
    missed = found - angle[kept]
    assert flags == ()
    good = np.isfinite(missed) & ~stray[kept]
    assert good.sum() > 0.85 * np.sum(~stray[kept] & np.isfinite(read[kept]))
    assert np.ptp(missed[good]) < 0.2
    assert np.nanmax(np.abs(missed - np.nanmedian(missed))) < 0.35 * TURN


def test_a_rate_that_changes_is_followed() -> None:
    time = np.arange(600) / FPS
    angle = 20.0 * (time + 4.0 * np.exp(-time / 4.0)) + 0.3 * np.sin(3.0 * time)
    found, flags = unwrapped(time, angle % TURN, np.full(600, 0.01), TURN)
    assert flags == ()
    assert np.ptp(found - angle) < 1e-6


@pytest.mark.parametrize("share", [0.47, 0.5, -0.49])
def test_a_step_near_half_a_period_is_doubtful(share: float) -> None:
    time, _, read, error = series(share * np.pi * FPS, period=np.pi)
    _, (flag,) = unwrapped(time, read, error, np.pi, "body")
    assert flag.name == "aliased-body"
    assert flag.spoils == ("body_rotation_rate",)


def test_angles_without_order_are_no_rotation() -> None:
    time = np.arange(300) / FPS
    read = np.random.default_rng(1).uniform(0.0, TURN, 300)
    _, flags = unwrapped(time, read, np.full(300, 0.1), TURN, "tail")
    assert any(flag.name == "aliased-tail" and flag.spoils == ("tail_rotation_rate",) for flag in flags)


def test_uneven_times_betray_a_rate_beyond_the_limit() -> None:
    rng = np.random.default_rng(4)
    time = (np.arange(300) + rng.uniform(-0.2, 0.2, 300)) / FPS
    _, flags = unwrapped(time, (TURN * 31.0 * time) % TURN, np.full(300, 0.02), TURN, "tail")
    assert [flag.name for flag in flags] == ["aliased-tail"]
    assert "31" in flags[0].sentence
    assert unwrapped(time, (TURN * 3.0 * time) % TURN, np.full(300, 0.02), TURN, "tail")[1] == ()


def test_a_long_gap_may_hide_turns() -> None:
    time, _, read, error = series(25.0)
    read[100:500] = np.nan
    _, flags = unwrapped(time, read, error, TURN, "tail")
    assert "tail-turns-lost" in [flag.name for flag in flags]


def test_nothing_read_is_nothing_given() -> None:
    found, (flag,) = unwrapped(np.arange(10.0), np.full(10, np.nan), np.full(10, np.nan), TURN, "tail")
    assert np.isnan(found).all()
    assert flag.spoils == ("tail_rotation_rate",)


def test_body_and_tail_cannot_turn_the_same_way() -> None:
    robot = load("biorob2012-wide")
    time = np.arange(300) / FPS
    forward, back, still = 0.005 * time, -0.005 * time, 0.0 * time
    assert contradictions(RobotMotion(time, forward, -0.7 * time, 7.0 * time), robot) == ()
    assert contradictions(RobotMotion(time, back, still, -7.0 * time), robot) == ()
    for hand, name in ((0, "handedness"), (1, "aliased-tail")):
        (flag,) = contradictions(RobotMotion(time, forward, -0.7 * time, -7.0 * time), robot, hand)
        assert flag.name == name
        assert "tail_rotation_rate" in flag.spoils
    (flag,) = contradictions(RobotMotion(time, forward, np.full(300, np.nan), -7.0 * time), robot)
    assert flag.name == "aliased-tail"


def test_no_wire_advances_more_than_it_can_without_a_body() -> None:
    time = np.arange(300) / FPS
    robot = load("biorob2012-wide")
    advance = 0.3 * robot.tail.wavelength * 3.0 / TURN
    assert contradictions(RobotMotion(time, advance * time, -0.1 * time, 3.0 * time), robot) == ()
    (flag,) = contradictions(RobotMotion(time, 1.2 * advance * time, -0.1 * time, 3.0 * time), robot)
    assert (flag.name, flag.spoils) == ("aliased-tail", ("tail_rotation_rate",))
    for amplitude in ("1 mm", "3 mm", "8 mm"):  # the tail alone, free of any body, by resistive force theory
        tail = load("biorob2012-wide", **{"tail.amplitude": amplitude, "tail.wavelength": "15 mm"})
        matrix = resistance(tail, part="tail", model="rft").matrix
        assert 0.0 < -matrix[0, 3] / matrix[0, 0] * TURN < _largest_advance(tail)


def test_a_robot_that_swims_on_a_tail_at_rest_betrays_a_tail_at_the_frame_rate() -> None:
    time = np.arange(300) / FPS
    robot = load("biorob2012-wide")
    still = 1e-3 * np.sin(time)
    (flag,) = contradictions(RobotMotion(time, 1e-3 * time, -0.1 * time, still), robot)
    assert (flag.name, flag.spoils) == ("aliased-tail", ("tail_rotation_rate",))
    assert contradictions(RobotMotion(time, 1e-5 * time, still, still), robot) == ()  # a robot at rest
    assert (
        contradictions(RobotMotion(time, 1e-3 * time, -0.1 * time, np.full(300, np.nan)), robot) == ()
    )  # a tail that is not seen


def test_largest_rates_are_half_a_period_a_frame() -> None:
    setup = Setup(
        camera=CameraSetup(height="200 mm"),
        markers=Markers(length_per_pixel="0.3 mm"),
        robot=RobotSetup(file="biorob2012-wide", axis_height="10 mm"),
    )
    body = pattern_period(stripes_of(setup, load("biorob2012-wide")))
    assert body == pytest.approx(np.pi)
    assert stripes_of(setup, load("biorob2012-wide", seal="none")) == ()
    time, error = np.arange(300) / 30.0, np.full(300, 0.01)
    for period, largest in ((2.0 * np.pi, 30.0 * np.pi), (body, 15.0 * np.pi)):
        for rate, seen in ((0.95 * largest, 0.95 * largest), (1.05 * largest, -0.95 * largest)):
            angle, _ = unwrapped(time, (rate * time) % period, error, period)
            assert np.polyfit(time, angle, 1)[0] == pytest.approx(seen)


@pytest.mark.parametrize(("leaps", "said"), [(0, False), (1, False), (2, True), (5, True)])
def test_a_body_that_leaps_twice_has_other_stripes(leaps, said):
    time = np.arange(240) / 30.0
    true = -0.7 * time + 0.05 * np.sin(8.0 * time)
    for place in np.linspace(30, 200, leaps):
        true = np.where(time >= time[int(place)], true + np.radians(40.0), true)
    _, found = unwrapped(time, true % np.pi, np.full(240, 0.01), np.pi)
    assert ("stripes-do-not-fit" in [flag.name for flag in found]) == said
    assert not said or found[-1].spoils == ("body_rotation_rate",)


def test_stripes_read_on_few_frames_give_no_rate():
    time = np.arange(240) / 30.0
    angle = np.where(np.arange(240) % 12 == 0, -0.7 * time % np.pi, np.nan)
    _, (flag,) = unwrapped(time, angle, np.full(240, 0.01), np.pi)
    assert (flag.name, flag.spoils) == ("stripes-unreadable", ("body_rotation_rate",))


@pytest.mark.parametrize(("turned", "names"), [(2.0, ["stripes-do-not-pass"]), (8.0, [])])
def test_a_body_that_rests_while_its_tail_turns_shows_no_stripes(turned: float, names: list[str]) -> None:
    time = np.arange(150) / FPS
    body = -np.radians(turned) * time / time[-1]
    motion = RobotMotion(time, 1e-4 * time, body, TURN * 1.2 * time)
    assert [flag.name for flag in no_stripe_passes(motion, load("biorob2012-wide"))] == names
