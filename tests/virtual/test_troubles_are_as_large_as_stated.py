"""Troubles of a real bench: each is as large as its data say, and changes nothing else."""

import json

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.robot.load import load
from spirillum.virtual.solids import solids_of
from spirillum.virtual.troubles import Shake, Troubles, even_times, repainted, stripe_edges


def test_lost_frames_leave_even_times():
    kept = np.arange(241)
    left, counted = even_times(Troubles.of("lost-frames"), kept, 3)
    assert left.size == 241 - 7
    assert counted.tolist() == list(range(234))
    assert left[[0, -1]].tolist() == [0, 240]
    assert even_times(Troubles(), kept, 3)[0] is kept


def test_uneven_stripes_go_round_once_and_keep_the_body():
    edges = stripe_edges(Troubles.of("uneven-stripes"), 8, 1)
    widths = np.diff(edges)
    assert widths.sum() == pytest.approx(2 * np.pi)
    assert 0.05 < np.ptp(widths) / (np.pi / 4) < 0.5
    assert np.diff(stripe_edges(Troubles(), 8, 1)) == pytest.approx(np.full(8, np.pi / 4))
    robot = load("biorob2012-wide")
    even, uneven = (solids_of(robot, edges=some)[0].vertices for some in (None, edges))
    assert np.hypot(*uneven[:, 1:].T) == pytest.approx(np.hypot(*even[:, 1:].T), abs=2e-5)
    assert uneven[:, 0] == pytest.approx(even[:, 0])
    first = np.array([[0.0, -np.sin(np.pi / 8), np.cos(np.pi / 8)]])  # the edge of the first stripe towards -y
    moved = repainted(robot, first, edges)[0]
    assert np.arctan2(-moved[1], moved[2]) == pytest.approx(edges[1])


def test_a_hand_sways_by_its_standard_deviation_and_a_roll_turns_the_picture():
    shake = Shake(Troubles(handheld=3.0), 5)
    shifts = np.array([shake.at(time) for time in np.arange(0.0, 200.0, 1 / 30)])
    assert shifts[:, :2].std(axis=0) == pytest.approx(3.0 * np.hypot(1.0, 1.0 / 3.0), rel=0.1)
    assert shake.at(1.5) == Shake(Troubles(handheld=3.0), 5).at(1.5)
    pytest.importorskip("cv2")
    light = np.zeros((101, 201, 3))
    light[50, 100], light[50, 150] = 1.0, 2.0  # pixel 50 to the right of the middle
    rolled = Shake(Troubles(rolled="10 deg"), 0).moved(light, 0.0)
    v, u = np.unravel_index(rolled[:, 120:, 0].argmax(), (101, 81))
    assert (u + 120 - 100, 50 - v) == pytest.approx((50 * np.cos(np.radians(10)), 50 * np.sin(np.radians(10))), abs=0.6)
    still = Shake(Troubles(), 0)
    assert still.moved(light, 0.0) is light


def test_a_film_states_its_troubles_in_its_truth(tmp_path):
    av = pytest.importorskip("av")
    film = tmp_path / "a.mp4"
    sp.render(
        "biorob2012-wide", film, trial={"duration": 1.0}, camera={"size": (160, 120)}, troubles={"lost_frames": 0.2}
    )
    truth = json.loads(film.with_suffix(".truth.json").read_text())
    assert truth["troubles"]["lost_frames"] == 0.2
    with av.open(str(film)) as container:
        times = [float(frame.time) for frame in container.decode(video=0)]
    assert len(times) == truth["frames"] == 25
    assert np.diff(times) == pytest.approx(1 / 30, abs=1e-4)
    with pytest.raises(InputError, match="trouble ''; allowed"):
        Troubles.of(",")
    with pytest.raises(InputError, match=r"trouble 'shaken'.*allowed: lost-frames, handheld, rolled, uneven-stripes"):
        Troubles.of("shaken")
    with pytest.raises(InputError, match="handheld"):
        Troubles.of({"handheld": 99.0})
