"""Frames lost while the times go on evenly are put back, or nothing is given; whole films stay as they are."""

import re

import numpy as np
import pytest

from spirillum.vision.track.lost_frames import FrameSeries, Restored, multiples_of, restored_times

PIXEL, FPS = 2.5e-4, 30.0


def film(
    lost: int, seed: int, *, burst: int = 1, stray: float = 0.0, noise: float = 1.0
) -> tuple[np.ndarray, np.ndarray, tuple[FrameSeries, ...]]:
    """Even and true times, and readings of a robot at 1 mm/s, -0.12 Hz and 1.2 Hz; noise as on degraded films."""
    rng = np.random.default_rng(seed)
    count = 300 + lost
    kept = np.ones(count, dtype=bool)
    first = 1 + rng.permutation(count - 2 - burst)[: lost // burst]
    kept[np.concatenate([first + k for k in range(burst)]).astype(int)] = False
    true = np.arange(count)[kept] / FPS
    x = 1e-3 * true + 0.05 * noise * PIXEL * rng.normal(size=true.size)
    body = -2 * np.pi * 0.12 * true + 0.006 * noise * rng.normal(size=true.size)
    tail = 2 * np.pi * 1.2 * true + 0.03 * noise * rng.normal(size=true.size)
    misread = rng.random(true.size) < stray
    tail[misread] += rng.uniform(-3.0, 3.0, misread.sum())
    readings = (
        FrameSeries(tail % (2 * np.pi), 2 * np.pi, 0.009),
        FrameSeries(body % np.pi, np.pi, 0.002),
        FrameSeries(x, np.inf, 0.02 * PIXEL),
    )
    return np.arange(true.size) / FPS, true, readings


def restored(time: np.ndarray, readings: tuple[FrameSeries, ...]) -> tuple[Restored, list[str]]:
    found = restored_times(time, readings)
    return found, [flag.name for flag in found.flags]


@pytest.mark.parametrize(
    ("lost", "burst", "stray"), [(1, 1, 0.0), (7, 1, 0.0), (21, 1, 0.0), (15, 15, 0.0), (7, 1, 0.03)]
)
def test_lost_frames_are_counted_and_put_where_they_were(lost: int, burst: int, stray: float) -> None:
    for seed in range(2):
        time, true, readings = film(lost, seed, burst=burst, stray=stray)
        found, names = restored(time, readings)
        assert names == ["lost-frames"]
        assert f"{lost} frame" in found.flags[0].sentence
        assert abs(found.time[-1] - true[-1] - found.time[0] + true[0]) < 1e-9
        assert np.mean(np.abs(found.time - true) > 0.5 / FPS) < 0.05  # a loss is placed to a few frames
        assert found.relative_error < 0.01


@pytest.mark.parametrize(("stray", "noise"), [(0.0, 1.0), (0.03, 1.0), (0.0, 3.0)])
def test_whole_films_keep_their_times(stray: float, noise: float) -> None:
    time, _, readings = film(0, 5, stray=stray, noise=noise)
    found, names = restored(time, readings)
    assert names == []
    assert found.time is time


def repeating(steps: list[int]) -> tuple[np.ndarray, np.ndarray, tuple[FrameSeries, ...]]:
    """Even and true times, and readings, of a film that goes on by so many pictures on each frame."""
    rng = np.random.default_rng(11)
    true = np.cumsum([0, *steps]) / FPS
    x = 1e-3 * true + 0.05 * PIXEL * rng.normal(size=true.size)
    body = -2 * np.pi * 0.12 * true + 0.006 * rng.normal(size=true.size)
    tail = 2 * np.pi * 1.2 * true + 0.03 * rng.normal(size=true.size)
    readings = (
        FrameSeries(tail % (2 * np.pi), 2 * np.pi, 0.009),
        FrameSeries(body % np.pi, np.pi, 0.002),
        FrameSeries(x, np.inf, 0.02 * PIXEL),
    )
    return np.arange(true.size) / FPS, true, readings


@pytest.mark.parametrize("every", [150, 40, 10])
def test_repeated_frames_leave_the_length_of_the_film_open(every: int) -> None:
    """Stored twice, or converted from a lower frame rate: both are inside twice the stated error."""
    time, true, readings = repeating([0 if k % every == 3 else 1 for k in range(300)])
    found, names = restored(time, readings)
    assert names == ["repeated-frames"]
    assert found.time is time
    too_long = (time[-1] - true[-1]) / true[-1]
    assert 0.5 * too_long < found.relative_error < too_long


def test_a_repeated_frame_that_makes_up_for_a_lost_one_and_a_robot_that_stands_are_none() -> None:
    made_up = [1] * 300
    for place in (40, 90, 200, 270):
        made_up[place : place + 2] = [0, 2]
    assert "repeated-frames" not in restored(*repeating(made_up)[::2])[1]
    stands = [0 if 120 <= k < 150 else 1 for k in range(300)]
    assert "repeated-frames" not in restored(*repeating(stands)[::2])[1]


@pytest.mark.parametrize(
    ("first", "last", "advice"),
    [(0, 90, "with --start 3.0"), (60, 90, r"with --end 2.0\ds or --start 3.0"), (150, 240, "with --end 5.0")],
)
def test_a_robot_that_stands_for_a_while_is_said_to(first: int, last: int, advice: str) -> None:
    time, _, readings = repeating([0 if first <= k < last else 1 for k in range(240)])
    found, names = restored(time, readings)
    assert names == ["stands-for-a-while"]
    assert f"stands from {first / FPS:.1f}" in found.flags[0].sentence
    assert re.search(advice, found.flags[0].sentence)
    assert found.time is time


def test_a_body_that_compression_holds_does_not_stand_where_no_tail_shows_it() -> None:
    time, _, (tail, *others) = repeating([0 if 60 <= k < 90 else 1 for k in range(240)])
    unread = tail._replace(values=np.full(time.size, np.nan))
    assert "stands-for-a-while" not in restored(time, (unread, *others))[1]


def test_of_several_rests_the_longest_is_said() -> None:
    time, _, readings = repeating([0 if k < 40 or k >= 180 else 1 for k in range(240)])
    found, _ = restored(time, readings)
    assert "stands from 6.0" in found.flags[0].sentence


@pytest.mark.parametrize("there", [30, 60, 120])
def test_a_robot_that_reverses_is_said_to(there: int) -> None:
    """The same pictures back again: all three series change their sign."""
    time, _, readings = repeating([1 if k < there else -1 for k in range(180)])
    found, names = restored(time, readings)
    assert names == ["reverses"]
    assert f"reverses at about {there / FPS:.1f}" in found.flags[0].sentence
    assert found.time is time


@pytest.mark.parametrize(("noise", "seed"), [(1.0, 1), (3.0, 2), (10.0, 3), (30.0, 4)])
def test_noise_is_no_change_of_motion(noise: float, seed: int) -> None:
    time, _, readings = film(0, seed, noise=noise)
    assert not {"stands-for-a-while", "reverses"} & set(restored(time, readings)[1])


def test_a_clear_tail_says_that_a_slow_body_only_scatters() -> None:
    """Steps of the body are lost in the errors of readings, and may look like multiples of anything."""
    for seed in range(40):
        rng = np.random.default_rng(seed)
        time = np.arange(76) / 25.0
        tail = 2 * np.pi * 4.0 * time + 0.03 * rng.normal(size=76)
        body = -2 * np.pi * 0.1 * time + 0.02 * rng.integers(-1, 2, size=76)
        readings = FrameSeries(tail % (2 * np.pi), 2 * np.pi, 0.009), FrameSeries(body % np.pi, np.pi, 0.002)
        assert "uneven-steps" not in restored(time, readings)[1]


def test_copies_of_a_picture_do_not_move_while_a_codec_settles() -> None:
    """It copies most pictures to the last digit; the changes of the others are below the error of any reading."""
    time, _, readings = film(0, 5)
    wave = np.where((np.arange(time.size) < 60) | (np.arange(time.size) > 240), np.arange(time.size) // 7, 8)
    still = tuple(one._replace(values=one.values[0] + 0.05 * one.least * wave) for one in readings)
    assert restored(time, still)[1] == []


def test_true_gaps_are_no_loss() -> None:
    _, true, readings = film(21, 3)
    assert restored(true, readings)[1] == []


def test_a_tail_that_steps_alone_is_not_believed() -> None:
    time, _, readings = film(0, 4)
    tail = readings[0].values + 2 * np.pi * 1.2 / FPS * np.searchsorted([60, 110, 150, 190, 240], np.arange(time.size))
    found, names = restored(time, (FrameSeries(tail % (2 * np.pi), 2 * np.pi, 0.009), *readings[1:]))
    assert names != ["lost-frames"] or found.relative_error > 0
    assert names


def many(kind: str) -> list[int]:
    rng = np.random.default_rng(7)
    if kind == "doubled":
        return [k % 2 for k in range(600)]
    if kind == "tripled":
        return [int(k % 3 == 0) for k in range(600)]
    if kind == "half repeated at random":
        return list(rng.integers(0, 2, 400))
    return list(np.diff(np.flatnonzero(rng.random(600) < 0.5)))  # half of the pictures of a camera


@pytest.mark.parametrize("kind", ["doubled", "tripled", "half repeated at random", "half lost at random"])
def test_where_most_steps_are_of_several_frames_or_none_nothing_is_given(kind: str) -> None:
    """There is no usual step to hold them against, and rates are wrong by a factor."""
    found, names = restored(*repeating(many(kind))[::2])
    assert names == ["uneven-steps"]
    assert found.flags[0].spoils


@pytest.mark.parametrize("noise", [0.3, 1.0, 3.0, 10.0])
def test_motors_that_stutter_make_no_multiples(noise: float) -> None:
    """Rates that change by a third, evenly or at random, and films that are noisy or begin with a rest."""
    time, _, readings = film(0, 6, noise=noise)
    rng = np.random.default_rng(8)
    for off in (0.05 * np.sin(2 * np.pi * time), np.cumsum(0.08 * rng.normal(size=time.size))):
        tail = readings[0].values + off
        assert multiples_of(time, tail % (2 * np.pi), 2 * np.pi, 1.0 / FPS) is None
    for rate in (0.5, 2.0):  # a remote that halves or doubles the rate for a while
        steps = 2 * np.pi * 1.2 / FPS * np.where((time > 3.0) & (time < 7.0), rate, 1.0)
        tail = np.cumsum(steps) + 0.03 * noise * rng.normal(size=time.size)
        assert multiples_of(time, tail % (2 * np.pi), 2 * np.pi, 1.0 / FPS) is None
    resting = np.where(time < 3.0, readings[0].values[0], readings[0].values)
    found = multiples_of(time, resting, 2 * np.pi, 1.0 / FPS)
    assert found is None or found.repeated < 0.1 * found.steps


def test_a_single_misread_frame_widens_intervals_by_one_frame():
    """Of a faint robot whose tail is not read, one reading of the body alone goes on by a step more, and comes back."""
    rng = np.random.default_rng(3)
    time = np.arange(46) / 15.0
    body = -0.055 * np.arange(46) + 0.004 * rng.normal(size=46)
    body[21:26] -= [0.06, 0.055, 0.045, 0.03, 0.01]
    unseen = np.full(46, np.nan)
    readings = (
        FrameSeries(unseen, 2 * np.pi, 0.01),
        FrameSeries(body, np.pi, 0.002),
        FrameSeries(unseen, np.inf, 5e-6),
    )
    found = restored_times(time, readings)
    assert [(flag.name, flag.spoils) for flag in found.flags] == [("uneven-steps", ())]
    assert found.relative_error == pytest.approx(1.0 / 45.0)
    assert found.time is time
