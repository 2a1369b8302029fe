"""Troubles of a real bench: each is as large as its data say, and changes nothing else."""

import json

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.robot.load import load
from spirillum.virtual.artifacts import (
    NAMES,
    Degradation,
    Shake,
    Troubles,
    ViewArtifacts,
    counted_frames,
    repainted,
    stripe_edges,
    with_troubles,
)
from spirillum.virtual.solids import solids_of


def named(words: str) -> Troubles:
    return with_troubles(words, Degradation())[0]


def test_lost_frames_leave_counted_frames():
    kept = np.arange(241)
    left, counted = counted_frames(named("lost-frames"), kept, 30.0, 3)
    assert left.size == 241 - 7
    assert counted.tolist() == list(range(234))
    assert left[[0, -1]].tolist() == [0, 240]
    assert counted_frames(Troubles(), kept, 30.0, 3)[0] is kept


def test_the_clock_jumps_in_the_middle_and_nothing_is_missing():
    kept = np.arange(241)
    left, counted = counted_frames(named("clock-jump"), kept, 30.0, 3)
    assert left is kept
    assert np.flatnonzero(np.diff(counted) != 1).tolist() == [120]
    assert counted[-1] == 240 + 60
    assert counted_frames(Troubles(lost_frames=0.5), kept[:2], 30.0, 3)[0].tolist() == [0, 1]


def test_uneven_stripes_go_round_once_and_keep_the_body():
    edges = stripe_edges(named("uneven-stripes"), 8, 1)
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


def test_names_give_usual_sizes_and_leave_what_was_given():
    troubles, degradation = with_troubles("blurred, noise,hand,bubbles", Degradation.of({"noise": 3.0}))
    assert (troubles.blurred, troubles.cables) == (1.0, 0)
    assert (degradation.noise, degradation.hand, degradation.bubbles, degradation.glare) == (3.0, True, 8, 0.0)
    _, degraded = with_troubles("missing-frames", {"preset": "degraded", "noise": 3.0, "crf": None})
    assert (degraded.dropped, degraded.noise, degraded.crf) == (0.1, 3.0, 33)
    every, disturbed = with_troubles(",".join(NAMES), Degradation())
    assert all(every.model_dump().values())
    assert not disturbed.glare_moves
    with pytest.raises(InputError, match="trouble ''; allowed"):
        named(",")
    with pytest.raises(InputError, match=r"trouble 'shaken'.*allowed: lost-frames, clock-jump, handheld, rolled"):
        named("shaken")
    with pytest.raises(InputError, match="handheld"):
        Troubles.of({"handheld": 99.0})


def test_a_blurred_point_has_the_stated_spread_and_cables_cover_their_share():
    pytest.importorskip("cv2")
    light = np.zeros((61, 81, 3), dtype=np.float32)
    light[30, 40] = 1.0
    seen = ViewArtifacts(Troubles(blurred=2.0), 0, (81, 61)).camera_picture(light, 0.0)[..., 0]
    v, u = np.mgrid[:61, :81]
    assert seen.sum() == pytest.approx(1.0, rel=1e-5)
    assert (seen * (u - 40.0) ** 2).sum() == pytest.approx(4.0, rel=0.02)
    assert (seen * (v - 30.0) ** 2).sum() == pytest.approx(4.0, rel=0.02)
    white = np.ones((480, 640, 3), dtype=np.float32)
    dark = ViewArtifacts(Troubles(cables=2), 4, (640, 480)).camera_picture(white, 0.0)[..., 0]
    assert dark.min() == pytest.approx(0.02, abs=1e-3)
    across = (dark < 0.5).sum(axis=1)  # each an eightieth of the width, more where it leans
    assert across.min() >= 2 * 8
    assert across.max() <= 1.5 * 2 * 8
