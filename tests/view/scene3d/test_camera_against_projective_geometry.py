"""The camera shows what it should: margins are kept, parallel views are to scale, pixels and points are inverse."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.view.scene3d.overlay import scale_bar
from spirillum.view.scene3d.scenery import VIEWS, fitted

SIZE = (1600, 900)
POINTS = np.random.default_rng(4).normal(size=(50, 3)) * [0.05, 0.01, 0.02] + [0.3, 0.1, -0.2]


@pytest.mark.parametrize("view", VIEWS)
def test_points_fill_the_frame_and_keep_its_margins(view: str) -> None:
    margins = (0.05, 0.14, 0.14)
    pixels = fitted(view, POINTS, SIZE, margins).pixels(POINTS, SIZE)
    shares = np.stack([pixels.min(axis=0), pixels.max(axis=0)]) / SIZE
    low, high = np.array([0.05, 0.14]), np.array([0.95, 0.86])
    assert np.all(shares[0] >= low - 1e-6)
    assert np.all(shares[1] <= high + 1e-6)
    assert np.min(np.abs(shares[1] - shares[0] - (high - low))) < 1e-6


@pytest.mark.parametrize("view", VIEWS)
def test_axes_of_the_picture_are_a_right_handed_frame(view: str) -> None:
    camera = fitted(view, POINTS, SIZE)
    frame = np.stack([camera.right, camera.up, -camera.sight])
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


@pytest.mark.parametrize("view", VIEWS)
def test_a_pixel_on_a_plane_is_seen_at_that_pixel(view: str) -> None:
    camera = fitted(view, POINTS, SIZE)
    point = camera.on_plane((1100.0, 250.0), SIZE, POINTS[0], camera.sight)
    assert camera.pixels(point[None], SIZE)[0] == pytest.approx([1100.0, 250.0], abs=1e-6)
    assert (point - POINTS[0]) @ camera.sight == pytest.approx(0.0, abs=1e-12)


def test_side_view_has_the_nose_on_the_right_and_z_upwards() -> None:
    camera = fitted("side", POINTS, SIZE)
    middle, nose, top = camera.pixels(POINTS[0] + np.array([[0, 0, 0], [0.01, 0, 0], [0, 0, 0.01]]), SIZE)
    assert nose[0] > middle[0]
    assert nose[1] == pytest.approx(middle[1])
    assert top[1] < middle[1]
    assert top[0] == pytest.approx(middle[0])


@pytest.mark.parametrize("view", ["side", "top", "front", "rear"])
def test_bar_has_its_length_wherever_it_stands(view: str) -> None:
    camera = fitted(view, POINTS, SIZE)
    bar = scale_bar(camera, SIZE, POINTS[0])
    drawn = np.hypot(*np.subtract(bar.end, bar.start))
    assert drawn * 2.0 * camera.half_height / SIZE[1] == pytest.approx(bar.length)
    assert float(f"{bar.length:.0e}"[0]) in (1.0, 2.0, 5.0)


def test_bar_with_perspective_is_true_at_the_robots_axis() -> None:
    camera = fitted("perspective", POINTS, SIZE)
    bar = scale_bar(camera, SIZE, POINTS[0])
    plane = np.cross([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    ends = [camera.on_plane(end, SIZE, POINTS[0], plane) for end in (bar.start, bar.end)]
    assert ends[1] - ends[0] == pytest.approx([bar.length, 0.0, 0.0], abs=1e-9 * bar.length)


def test_unknown_view_is_named() -> None:
    with pytest.raises(sp.InputError, match=r"view = 'sied' \(did you mean side\?\); allowed: perspective, side"):
        sp.show("biorob2012-wide", view="sied")
