"""Rays of the tracker's camera against Snell's law, similar triangles and rigid rotations."""

import numpy as np
import pytest

from spirillum.vision.camera.optics import BodyPose, Optics, placed, project

UPRIGHT = Optics((640, 480), 740.0, 0.21, 0.0115, 0.06, 1.4)


def points(count: int = 200, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(-0.08, 0.08, count), rng.uniform(-0.05, 0.05, count), np.full(count, 0.0115)], axis=1)


@pytest.mark.parametrize(
    "changes", [{}, {"tilt_x": 0.03, "tilt_y": -0.05, "rotation": 0.1}, {"k1": -0.1, "k2": 0.03}, {"direction": "left"}]
)
def test_a_pixel_shows_the_point_that_appears_there(changes):
    optics = UPRIGHT.moved(changes)
    assert optics.points(optics.pixels(points()), 0.0115) == pytest.approx(points(), abs=1e-15)


def test_rays_obey_snells_law_at_the_surface():
    where = points()
    at_surface = UPRIGHT.points(UPRIGHT.pixels(where), 0.06)
    above = np.arctan2(np.hypot(*at_surface[:, :2].T), 0.21 - 0.06)
    below = np.arctan2(np.hypot(*(where - at_surface)[:, :2].T), 0.06 - 0.0115)
    assert np.sin(above) == pytest.approx(1.4 * np.sin(below), rel=1e-12)
    cross = where[:, 0] * at_surface[:, 1] - where[:, 1] * at_surface[:, 0]
    assert cross == pytest.approx(np.zeros(len(where)), abs=1e-16)  # in the plane of the ray


def test_without_refraction_lengths_follow_similar_triangles():
    bare = Optics((640, 480), 740.0, 0.21, 0.0115)
    assert bare.length_per_pixel == pytest.approx((0.21 - 0.0115) / 740.0, rel=1e-6)
    pixels = bare.pixels(points())
    assert pixels[:, 0] == pytest.approx(319.5 + 740.0 * points()[:, 0] / (0.21 - 0.0115), rel=1e-12)
    assert pixels[:, 1] == pytest.approx(239.5 - 740.0 * points()[:, 1] / (0.21 - 0.0115), rel=1e-12)


def test_below_the_lens_depths_shrink_by_the_index():
    """Straight down, a depth b of oil looks like b / n."""
    assert UPRIGHT.length_per_pixel == pytest.approx((0.15 + (0.06 - 0.0115) / 1.4) / 740.0, rel=1e-5)


def test_a_tilt_shifts_the_picture_as_a_rotation_does():
    """The point below the lens appears at tan(tilt) focal lengths from the middle."""
    below = np.array([[0.0, 0.0, 0.0]])
    about_y = UPRIGHT.moved({"tilt_y": 0.05}).pixels(below)[0]
    about_x = UPRIGHT.moved({"tilt_x": 0.05}).pixels(below)[0]
    assert about_y == pytest.approx([319.5 + 740.0 * np.tan(0.05), 239.5], abs=1e-9)
    assert about_x == pytest.approx([319.5, 239.5 + 740.0 * np.tan(0.05)], abs=1e-9)


def test_leftward_is_the_picture_turned_by_half_a_turn():
    turned = UPRIGHT.moved({"direction": "left"}).pixels(points())
    assert turned == pytest.approx(np.array([639.0, 479.0]) - UPRIGHT.pixels(points()), abs=1e-9)


def test_a_pose_moves_and_turns_the_body():
    body = np.array([[0.01, 0.0, 0.0], [0.0, 0.01, 0.002]])
    there = placed(body, BodyPose(0.1, 0.2, np.pi / 2), 0.03)
    assert there == pytest.approx(np.array([[0.1, 0.21, 0.03], [0.09, 0.2, 0.032]]), abs=1e-15)
    pose = BodyPose(0.01, 0.002, 0.1)
    assert project(body, pose, UPRIGHT) == pytest.approx(UPRIGHT.pixels(placed(body, pose, 0.0115)), abs=0.0)
