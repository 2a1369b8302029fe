"""The apparent outline against closed forms, and the body's place on drawn frames."""

import numpy as np
import pytest

from spirillum.robot.load import load
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.flag import Flag
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.contour import GROUPS, contour_of
from spirillum.vision.track.search import PoseCandidate, candidates, most_likely
from spirillum.vision.track.visibility import gaps_of

pytest.importorskip("cv2")

AIR = Optics((320, 240), 350.0, 0.2, 0.015)
DEEP = 0.2 - 0.015


def test_the_silhouette_of_a_sphere_against_its_tangent_cone():
    """Tangent lines of sight make the angle asin(R/d) with the line to the centre."""
    radius = 9e-3
    body = {"shape": "sphere", "length": "18 mm", "front": "none", "rear": "none"}
    contour = contour_of(load("biorob2012-wide", body=body, seal="none", coupling={"diameter": "0 mm"}), AIR)
    for x in (-0.06, 0.0, 0.035):
        points = contour.points(BodyPose(x, 0.0, 0.0))
        centre, half = np.arctan(x / DEEP), np.arcsin(radius / np.hypot(x, DEEP))
        front = points[contour.group == GROUPS.index("front")]
        assert front[:, 0].max() == pytest.approx(DEEP * np.tan(centre + half) - x, abs=1e-5)
        side = points[contour.group == GROUPS.index("left")]
        wide = DEEP * np.tan(np.arcsin(radius / DEEP))  # below the lens a circle
        if x == 0.0:
            assert np.hypot(*side.T) == pytest.approx(wide, abs=1e-5)
            assert np.hypot(*front.T) == pytest.approx(wide, abs=1e-5)


def test_the_seals_edge_is_where_its_circle_is_seen():
    robot = load("biorob2012-wide")
    contour = contour_of(robot, AIR)
    assert robot.seal is not None
    x, radius = robot.seal.length - 0.5 * robot.body.length, 0.5 * robot.body.diameter
    pose = BodyPose(0.03, 0.004, 0.05)
    points = contour.points(pose)[contour.group == GROUPS.index("seal")]
    angle = -1.0 + np.arange(len(points)) * max(1.2 * AIR.length_per_pixel, 1.8 * radius / 80) / radius
    circle = np.stack([np.full(angle.size, x), radius * np.sin(angle), radius * np.cos(angle)], axis=1)
    cos, sin = np.cos(pose.heading), np.sin(pose.heading)
    lens = np.array([-(cos * pose.x + sin * pose.y), sin * pose.x - cos * pose.y])
    on_plane = lens + (circle[:, :2] - lens) * (DEEP / (DEEP - circle[:, 2]))[:, None]
    assert points == pytest.approx(on_plane, abs=2e-6)


@pytest.fixture(scope="module")
def frames(flat_pictures):
    """A robot that moves by 0.3 pixels from frame to frame and turns."""
    step = 0.3 * AIR.length_per_pixel
    film = flat_pictures.Flat(velocity=step, fps=1.0, frames=14, body_rate=0.3, noise=2.0, start=(0.01, 0.003), fine=8)
    return film, [picture for _, picture in film.pictures()]


def test_places_follow_the_truth(frames):
    film, pictures = frames
    body = BodyFinder(film.robot, AIR, (0, 0, 320, 240))
    truth = film.truth(film.times)
    off = np.random.default_rng(3).normal(0.0, 1.0, (len(pictures), 3)) * np.array([2e-4, 2e-4, 0.01])
    starts = [BodyPose(float(x), float(y), 0.0) for x, y in zip(truth["x"], truth["y"], strict=True)]
    starts = [BodyPose(*(np.array(pose) + change).tolist()) for pose, change in zip(starts, off, strict=True)]
    found = body.learn(pictures, starts, film.times)
    assert all(one.known for one in found)
    again = [body.place(picture, start) for picture, start in zip(pictures, starts, strict=True)]
    gap = (np.array([one.pose.x for one in again]) - truth["x"]) / AIR.length_per_pixel
    assert gap.std() < 0.05
    assert abs(gap.mean()) < 0.5
    slope = np.polyfit(np.arange(gap.size), gap, 1)[0] * gap.size
    assert abs(slope) < 0.08  # of 4 pixels
    assert np.std([one.pose.heading for one in again]) < 5e-3


def test_the_robot_is_found_without_a_hint_and_its_place_is_no_place_without_it(frames):
    film, pictures = frames
    body = BodyFinder(film.robot, AIR, (0, 0, 320, 240))
    still = np.full((240, 320, 3), 0.0)
    best, *others = candidates(pictures[0], still, body.shape())
    assert (best.pose.x, best.pose.y) == pytest.approx((0.01, 0.003), abs=2.5e-3)
    assert best.score > 1.5 * others[0].score
    truth = film.truth(film.times)
    starts = [BodyPose(float(x), float(y), 0.0) for x, y in zip(truth["x"], truth["y"], strict=True)]
    body.learn(pictures, starts, film.times)
    assert not body.place(np.full((240, 320, 3), 150, dtype=np.uint8), starts[0]).known
    assert not body.place(pictures[0], BodyPose(starts[0].x, 0.04, 0.0)).known


def test_frames_on_which_every_candidate_vanishes_show_no_robot():
    gone, here = PoseCandidate(BodyPose(0.0, 0.0, 0.0), 0.0), PoseCandidate(BodyPose(0.01, 0.0, 0.0), 2.0)
    assert most_likely([[gone], [here, gone], [], [gone, gone]], 0.04) == [None, here, None, None]
    assert most_likely([[gone], []], 0.04) == [None, None]


def test_frames_that_are_missing_are_counted():
    time = np.array([0.0, 1.0, 2.0, 5.0, 6.0, 7.0, 9.0]) / 30.0
    frame, flags = gaps_of(time, np.arange(7.0))
    assert frame.tolist() == [0.0, 1.0, 2.0, 5.0, 6.0, 7.0, 9.0]
    assert isinstance(flags[0], Flag)
    assert flags[0].sentence.startswith("3 frames (30.0 %) are missing")
    assert gaps_of(np.arange(5.0), np.arange(5.0))[1] == ()
