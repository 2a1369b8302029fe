"""Frames without marks, from which the place jumps to the robot's, are left out; a robot without marks stays.

A robot at two places has no speed.
"""

import numpy as np
import pytest

from spirillum.vision.track.visibility import false_detection_flag, false_detections, far_apart, marks_lost_flag

LENGTH, PIXEL = 0.04, 2.5e-4
TIME = np.arange(150) / 30.0


def way(seed: int = 0) -> np.ndarray:
    """A robot at 1 mm/s along x, with noise of 20 um."""
    return np.stack([1e-3 * TIME, np.zeros(TIME.size)], axis=1) + np.random.default_rng(seed).normal(
        0.0, 2e-5, (TIME.size, 2)
    )


def other(place: np.ndarray, marked: np.ndarray) -> np.ndarray:
    """What is found where stripes are read on the marked frames, and the tail on none."""
    stripes = np.where(marked[:, None], 0.1, np.nan) * np.ones(2)
    return false_detections(TIME, place, (stripes, np.full(stripes.shape, np.nan)), LENGTH, PIXEL)


@pytest.mark.parametrize(("first", "last"), [(0, 60), (60, 100), (110, 150)])
@pytest.mark.parametrize("off", [(0.012, 0.0), (-0.02, 0.005), (0.0, 0.008)])
def test_a_stretch_beside_the_robot_is_found(first: int, last: int, off: tuple[float, float]) -> None:
    place, marked = way(), np.ones(TIME.size, dtype=bool)
    place[first:last] += off
    marked[first:last] = False
    found = other(place, marked)
    assert np.flatnonzero(found).tolist() == list(range(first, last))
    assert f"on {last - first} frames" in false_detection_flag(found)[0].sentence


@pytest.mark.parametrize(("first", "last"), [(0, 60), (60, 100), (110, 150)])
def test_the_robot_without_marks_stays(first: int, last: int) -> None:
    """Glare may hide stripes and tail for a while: the body goes on its way."""
    place, marked = way(), np.ones(TIME.size, dtype=bool)
    marked[first:last] = False
    assert not other(place, marked).any()
    assert false_detection_flag(np.zeros(3, dtype=bool)) == ()


@pytest.mark.parametrize(("first", "last"), [(0, 60), (60, 120), (90, 150)])
def test_an_outline_that_stays_behind_is_left_out(first: int, last: int) -> None:
    """The robot is taken away, or hidden, and the outline sticks to a line of a grid: nothing jumps."""
    place, marked = way(), np.ones(TIME.size, dtype=bool)
    place[first:last] = place[first - 1 if first else last]
    marked[first:last] = False
    found = other(place, marked)
    assert np.flatnonzero(found).tolist() == list(range(first, last))


def test_jumps_of_a_robot_whose_marks_are_read_are_not_its_business() -> None:
    """Cut films and lost frames have flags of their own."""
    place = way()
    place[75:] += (0.02, 0.0)
    assert not other(place, np.ones(TIME.size, dtype=bool)).any()
    few = np.arange(TIME.size) < 11
    assert not other(place, few).any()


def test_a_robot_that_goes_on_after_a_cut_without_marks_is_left_out_but_not_before() -> None:
    place, marked = way(), np.ones(TIME.size, dtype=bool)
    place[50] = np.nan
    place[51:70] += (0.0, 0.01)
    marked[51:70] = False
    assert np.flatnonzero(other(place, marked)).tolist() == list(range(51, 70))


@pytest.mark.parametrize("at", [6, 75, 143])
@pytest.mark.parametrize("jump", [0.03, -0.045])
@pytest.mark.parametrize("unseen", [0, 40])
def test_a_robot_at_two_places_has_no_speed(at: int, jump: float, unseen: int) -> None:
    x = way()[:, 0]
    x[at:] += jump
    x[at - unseen // 2 : at + unseen // 2 if at == 75 else at] = np.nan
    flags = far_apart(TIME, x, LENGTH)
    assert [flag.name for flag in flags] == ["something-else-followed"]
    assert "forward_velocity" in flags[0].spoils
    assert flags[0].frame == np.flatnonzero(np.isfinite(x) & (np.arange(TIME.size) >= at))[0]


def test_strays_other_edges_and_ways_that_nobody_saw_are_no_second_place() -> None:
    strays, edge, unseen = way()[:, 0], way()[:, 0], 60.0 * way()[:, 0]
    strays[40:60] += 0.03
    edge[75:] += 0.45 * LENGTH
    unseen[50:100] = np.nan
    for x in (way()[:, 0], strays, edge, unseen, np.full(TIME.size, np.nan)):
        assert far_apart(TIME, x, LENGTH) == ()


def test_an_outline_that_loses_the_marks_gives_nothing() -> None:
    place, read = np.ones(30), np.where(np.arange(30) < 6, 0.1, np.nan)
    [flag] = marks_lost_flag(place, read, np.full(30, np.nan))
    assert "80 % of the frames" in flag.sentence
    assert flag.frame == 29
    assert {"forward_velocity", "body_rotation_rate", "tail_rotation_rate"} <= set(flag.spoils)
    assert marks_lost_flag(place, read, np.full(30, 0.2)) == marks_lost_flag(place, np.full(30, 0.1), read) == ()
