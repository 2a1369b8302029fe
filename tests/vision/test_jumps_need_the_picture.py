"""Frames are lost, repeated or cut out only where the picture jumps or rests too; an outline may hop by itself."""

import numpy as np
import pytest

from spirillum.vision.track.cuts import cuts_in, hops_in
from spirillum.vision.track.lost_frames import FrameSeries, restored_times
from spirillum.vision.track.steadiness import PictureChange, PictureSteps, picture_steps
from spirillum.vision.track.track import RobotMotion

pytest.importorskip("cv2")
PIXEL = 2.5e-4


@pytest.fixture(scope="module")
def changes(flat_pictures):
    """Changes of the pictures of a flat film of which only some frames are taken."""
    flat = flat_pictures.Flat(frames=44, fps=15.0, velocity=1.5e-3, noise=3.0, fine=3)
    pictures = [picture for _, picture in flat.pictures()]

    def of(kept):
        change = PictureChange((0, 0, *flat.size))
        return np.array([change.of(pictures[k]) for k in kept])

    return of


@pytest.mark.parametrize("missing", [[], [20], [12, 13, 30], list(range(15, 25))])
def test_the_picture_jumps_where_frames_are_missing_and_nowhere_else(changes, missing):
    kept = [k for k in range(44) if k not in missing]
    steps = picture_steps(changes(kept))
    assert steps is not None
    assert np.flatnonzero(steps.jumps).tolist() == np.flatnonzero(np.diff(kept) > 1).tolist()
    assert not steps.rests.any()


def test_the_picture_rests_where_a_frame_is_stored_twice(changes):
    steps = picture_steps(changes(sorted([*range(44), 21])))
    assert steps is not None
    assert np.flatnonzero(steps.rests).tolist() == [21]


def test_where_nothing_moves_the_picture_says_nothing():
    rng = np.random.default_rng(2)
    change = PictureChange((0, 0, 160, 120))
    noise = [np.clip(rng.normal(120, 4, (120, 160, 3)), 0, 255).astype(np.uint8) for _ in range(30)]
    assert picture_steps(np.array([change.of(one) for one in noise])) is None


def moving(hop=0.0, at=150, lost=0, frames=300):
    """Time as stated and the motion of a robot of 1 mm/s whose place hops, or of which frames are lost."""
    rng = np.random.default_rng(3)
    time = np.arange(frames) / 30.0
    true = time + np.where(np.arange(frames) >= at, lost / 30.0, 0.0)
    after = np.arange(frames) >= at
    x = 1e-3 * true + 0.05 * PIXEL * rng.normal(size=frames) + hop * PIXEL * after
    body = -2 * np.pi * 0.12 * true + 0.01 * rng.normal(size=frames) + 0.1 * hop * after
    tail = 2 * np.pi * 1.2 * true + 0.02 * rng.normal(size=frames)
    return RobotMotion(time, x, body, tail)


def steps_with(jump_at, frames=300):
    jumps = np.zeros(frames - 1, dtype=bool)
    jumps[jump_at] = True
    return PictureSteps(jumps, np.zeros(frames - 1, dtype=bool))


def test_an_outline_that_hops_is_no_cut_and_widens_the_interval_by_its_hop():
    motion, even = moving(hop=3.0), steps_with([])
    assert [flag.name for flag in cuts_in(motion, PIXEL)] == ["video-is-cut"]  # where nothing is known of the picture
    assert cuts_in(motion, PIXEL, even) == ()
    hops = hops_in(motion, PIXEL, even)
    assert hops.distance == pytest.approx(3.0 * PIXEL, rel=0.1)
    assert hops.angle == pytest.approx(0.3, rel=0.1)
    assert hops.phase == 0.0
    assert [flag.name for flag in hops.flags] == ["outline-hops"]
    assert "(frame 150)" in hops.flags[0].sentence
    assert hops_in(moving(), PIXEL, even) == (0.0, 0.0, 0.0, ())


def test_angles_misread_under_a_highlight_are_no_hop():
    motion = moving()
    misread = motion.body_angle.copy()
    misread[140:150] += np.linspace(0.0, 0.3, 10)
    assert hops_in(motion._replace(body_angle=misread), PIXEL, steps_with([])) == (0.0, 0.0, 0.0, ())


def test_a_cut_that_the_picture_shows_is_told():
    motion = moving(lost=40)
    assert [flag.name for flag in cuts_in(motion, PIXEL, steps_with([149]))] == ["video-is-cut"]
    assert hops_in(motion, PIXEL, steps_with([149])) == (0.0, 0.0, 0.0, ())


@pytest.mark.parametrize(("shown", "names"), [([149], ["lost-frames"]), ([], [])])
def test_lost_frames_are_put_back_where_the_picture_jumps(shown, names):
    motion = moving(lost=2)
    readings = (
        FrameSeries(motion.tail_phase, 2 * np.pi, 0.01),
        FrameSeries(motion.body_angle, np.pi, 0.002),
        FrameSeries(motion.x, np.inf, 0.02 * PIXEL),
    )
    found = restored_times(motion.time, readings, steps_with(shown))
    assert [flag.name for flag in found.flags] == names
    assert found.time[-1] - motion.time[-1] == pytest.approx(2 / 30.0 if shown else 0.0)
