"""A robot on grid paper, its body of clear glass: its seal says where it is, and what stands still does not."""

from dataclasses import replace

import numpy as np
import pytest

from remembered import remembered
from spirillum.live.tracker import LiveTracker
from spirillum.measurement.trials import trial_of
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.setup import load_setup
from spirillum.vision.track import initial_detection
from spirillum.vision.track.assembly import follow
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.contour import EDGE_CUES
from spirillum.vision.track.initial_detection import SealSearch, detect_robot
from spirillum.vision.track.size import OutlineFit
from spirillum.vision.track.track import agreement_of, cue_shifts
from spirillum.vision.video.frames import Frame

cv2 = pytest.importorskip("cv2")
pytestmark = pytest.mark.usefixtures("learning_shared")

CAMERA = Optics((320, 240), 350.0, 0.2, 0.015)


@remembered
def layers(away):
    """A floor without its robot, and with lines every 2 mm both ways."""
    empty = away.draw(0.0).astype(float)
    paper, lines = empty.copy(), np.arange(-0.1, 0.1, away.spacing)
    for axis in (0, 1):
        ends = np.zeros((lines.size, 3))
        ends[:, axis] = lines
        for at in away.pixels(ends)[:, axis]:
            there = np.clip(1.0 - np.abs(np.arange(paper.shape[1 - axis]) - at), 0.0, 1.0) * 0.5
            shade = there[None, :, None] if axis == 0 else there[:, None, None]
            paper += shade * (np.array([40.0, 60.0, 140.0]) - paper)
    return empty, paper


def layers_of(film):
    """The layers of a film: the same wherever its robot is."""
    return layers(away=replace(film, start=(1.0, 0.0)))


@remembered
def with_body(film, level):
    """The film of a body of one shade of grey."""
    return replace(film, body=(level,) * 3)


@remembered
def drawn_robot(flat, time):
    """A frame with a black body; the share of each pixel that the body fills, and that the robot does."""
    dark, bright = (with_body(film=flat, level=level).draw(time).astype(float) for level in (0, 255))
    body = ((bright - dark) / 255.0).mean(axis=2, keepdims=True)
    return dark, body, np.clip(np.abs(dark - layers_of(flat)[0]).sum(axis=2, keepdims=True) / 24.0, 0.0, 1.0)


def on_paper(flat, time, *, clear):
    """A drawn frame on the paper; of the body a share is seen that the paper leaves."""
    _, paper = layers_of(flat)
    dark, body, robot = drawn_robot(flat=flat, time=time)
    under = robot * dark + (1.0 - robot) * paper
    return np.clip(under + body * (clear * paper + (1.0 - clear) * np.array(flat.body)), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def film(flat_pictures):
    return flat_pictures.Flat(velocity=2e-3, fps=8.0, frames=24, start=(0.012, 0.001), ruler=False, fine=4)


def written(film, folder, *, clear):
    """The setup, without errors of the scale, beside the frames on paper."""
    (folder / "film").mkdir()
    for index, time in enumerate(film.times):
        cv2.imwrite(str(folder / "film" / f"{index:02d}.png"), on_paper(film, time, clear=clear)[:, :, ::-1])
    path = folder / "setup.toml"
    path.write_text(replace(film, ruler=False).setup_text())
    return path


def measured(film, folder, *, clear):
    """The track of the frames on paper."""
    return follow(folder / "film", *load_setup(written(film, folder, clear=clear)))


@pytest.mark.parametrize("clear", [0.0, 0.9])
def test_the_speed_over_a_grid_is_the_robots(film, tmp_path, clear):
    track = measured(film, tmp_path, clear=clear)
    true = film.truth(track.time)
    pixel = track.scale.length_per_pixel
    assert not [flag for flag in track.flags if "forward_velocity" in flag.spoils]
    along = np.polyfit(track.time, track.position[:, 0] - true["x"], 1)[0] * np.ptp(track.time)
    assert abs(along) < 0.3 * pixel  # of eleven that it moves
    turned = np.polyfit(track.time, track.body_angle - true["body_angle"], 1)[0] * np.ptp(track.time)
    assert abs(turned) < 0.1  # of two; a pixel across the seal is 0.06
    assert track.cues["seal"].share == 1.0
    assert track.cues["tail"].share > 0.9


@pytest.mark.parametrize("hand", [True, False])
def test_a_robot_that_a_hand_hides_or_takes_away_keeps_its_speed(film, tmp_path, hand):
    """Behind a hand nothing looks like a seal; on bare paper the outline may stick to lines."""
    setup = written(film, tmp_path, clear=0.0)
    _, paper = layers_of(film)
    covered = np.full(paper.shape, (120, 140, 190)) if hand else paper[:, :, ::-1]
    for index in range(8, 14) if hand else range(14, len(film.times)):
        cv2.imwrite(str(tmp_path / "film" / f"{index:02d}.png"), covered.astype(np.uint8))
    trial = trial_of(follow(tmp_path / "film", *load_setup(setup)), load_setup(setup)[1])
    speed = trial.quantities["forward_velocity"]
    assert speed.low < film.velocity < speed.high
    assert speed.high - speed.low < 0.2 * film.velocity
    lost = {"robot-lost"} if hand else {"robot-left-the-view", "something-else-followed"}
    assert lost & {flag.name for flag in trial.flags}


def test_a_swing_across_the_lines_is_the_robots(film, tmp_path):
    swing = 1e-3 * np.cos(2.0 * np.pi * 1.7 * film.times)
    setup = written(film, tmp_path, clear=0.9)
    for index, (time, off) in enumerate(zip(film.times, swing, strict=True)):
        moved = replace(film, start=(film.start[0], film.start[1] + float(off)))
        cv2.imwrite(str(tmp_path / "film" / f"{index:02d}.png"), on_paper(moved, time, clear=0.9)[:, :, ::-1])
    track = follow(tmp_path / "film", *load_setup(setup))
    seen = np.polyfit(swing, track.position[:, 1], 1)[0]
    assert seen == pytest.approx(1.0, abs=0.15)  # the lines would hold it
    assert np.std(track.body_angle - film.truth(track.time)["body_angle"]) < 0.06  # a pixel across the seal


def test_a_live_robot_of_glass_over_a_grid_is_followed_by_its_seal(film, tmp_path):
    setup = written(film, tmp_path, clear=0.9)
    tracker = LiveTracker(setup, learn_from=tmp_path / "film")
    seen = [tracker.update(on_paper(film, time, clear=0.9), time) for time in film.times]
    assert all(one.seen for one in seen)
    time, x = np.array([(one.time, one.x) for one in seen]).T
    along = np.polyfit(time, x - film.truth(time)["x"], 1)[0] * np.ptp(time)
    trial = tracker.summary()
    assert abs(along) < 0.3 * trial.track.scale.length_per_pixel
    assert trial.track.cues["seal"].share == 1.0
    speed = trial.quantities["forward_velocity"]
    assert speed.low < film.velocity < speed.high


def test_a_seal_is_found_and_placed_whatever_lies_under_the_body(film, tmp_path):
    path = tmp_path / "setup.toml"
    path.write_text(film.setup_text())
    _, robot = load_setup(path)
    bounds = (0, 0, *film.size)
    search, body = SealSearch(robot, CAMERA, bounds), BodyFinder(robot, CAMERA, bounds, colours=4)
    for time in (0.0, 2.5):
        image, true = on_paper(film, time, clear=1.0), film.truth(time)
        best, *others = search.places(image)
        assert best.score > 3.0 * max((one.score for one in others), default=0.0)
        placed = body.place_by_seal(image, best.pose)
        pixel = CAMERA.length_per_pixel
        assert placed.known
        assert placed.pose.x == pytest.approx(float(true["x"]), abs=0.5 * pixel)
        assert placed.pose.y == pytest.approx(float(true["y"]), abs=1.5 * pixel)
        assert body.size_by_seal([image], [placed.pose]) == pytest.approx(1.0, abs=0.04)


def test_an_empty_grid_shows_no_seal(film, tmp_path):
    path = tmp_path / "setup.toml"
    path.write_text(film.setup_text())
    _, robot = load_setup(path)
    paper = on_paper(replace(film, start=(1.0, 0.0)), 0.0, clear=1.0)
    places = SealSearch(robot, CAMERA, (0, 0, *film.size)).places(paper)
    assert max((one.score for one in places), default=0.0) < 12.0


def test_what_a_cue_alone_says_against_closed_forms():
    """Edges with weights 1 that all lie off by 0.3 pixels of 4 per mm: 0.075 mm, and 1/(4 sqrt(n)) mm of error."""
    count, slope = 25, 4e3
    slopes = np.column_stack([np.full(count, slope), np.zeros(count), np.zeros(count)])
    cue = np.full(count, EDGE_CUES.index("seal"))
    found = cue_shifts(np.full(count, 0.3), slopes, np.ones(count), cue, 2.0)
    assert found[EDGE_CUES.index("seal")] == pytest.approx([0.3 / slope, 2.0 / (slope * 5.0)])
    assert np.isnan(found[EDGE_CUES.index("outline")]).all()


def test_cues_that_move_apart_widen_the_speed_by_their_mixture():
    time, pixel = np.linspace(0.0, 3.0, 31), 2.5e-4
    shifts = []
    for at in time / 3.0:
        one = np.full((len(EDGE_CUES), 2), np.nan)
        one[0], one[1] = (-0.5 * at * 2.0 * pixel, pixel), (0.5 * at * 2.0 * pixel, pixel)
        shifts.append(one)
    agreement = agreement_of(time, shifts, np.zeros(31), pixel)
    assert agreement.drift == pytest.approx(pixel)  # half of 2 pixels, with equal weights
    assert [flag.name for flag in agreement.flags] == ["cues-disagree"]
    assert agreement.cues["coupling"].share == 0.0
    assert agreement.cues["tail"].share == 1.0
    alike = [one * np.array([0.0, 1.0]) for one in shifts]
    assert agreement_of(time, alike, np.zeros(31), pixel).flags == ()


@pytest.mark.parametrize("off", [0.0, 2.0])
def test_an_outline_that_does_not_settle_gives_way_to_the_seal(film, monkeypatch, off):
    """Between both rims of a glass cover over a dark liner it moves to and fro."""
    frames = [Frame(k, time, film.draw(time)) for k, time in enumerate(film.times.tolist())]
    body = BodyFinder(film.robot, CAMERA, (0, 0, *film.size), colours=4)
    move = BodyPose(0.0, off * CAMERA.length_per_pixel, 0.0)
    monkeypatch.setattr(initial_detection, "apparent_outline", lambda *_: OutlineFit(1.0, move))
    start = detect_robot("film", body, frames, np.zeros((*film.size[::-1], 3)), colours=4)
    assert bool(start.body.colours) == (off > 0.0)
