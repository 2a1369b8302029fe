"""Annotated frames: words large enough to be read and no surer than the stripes are; large frames are reduced."""

import numpy as np
import pytest

from spirillum.robot.load import load
from spirillum.view import annotate
from spirillum.view.annotate import Annotator, _degrees, _lines_of
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.track.steps import FrameDetection

pytest.importorskip("cv2")


def annotated(width: int, height: int, period: float = np.pi) -> tuple[np.ndarray, np.ndarray]:
    """A grey picture and what was drawn on it."""
    optics = Optics((width, height), 1.1 * width, 0.2, 0.015)
    seen = FrameDetection(1.0, BodyPose(0.0, 0.0, 0.0), body_angle=0.7, tail_phase=2.0, optics=optics)
    picture = np.full((height, width, 3), 200, dtype=np.uint8)
    return picture, Annotator(load("biorob2012-wide"), period).draw(picture, seen)


@pytest.mark.parametrize("size", [(640, 480), (320, 240), (200, 150)])
def test_words_stand_beside_the_dials_and_leave_the_robot_free(size: tuple[int, int]) -> None:
    picture, drawn = annotated(*size)
    dark = np.flatnonzero((drawn[2] == picture[2] // 3).all(axis=1))  # the ground behind the words, above all letters
    assert dark.size > 0
    assert dark.max() < size[0] - 5.0 * 16.0 * max(size[1] / 480.0, 0.8)
    rows = np.flatnonzero((drawn[:, 1] == picture[:, 1] // 3).all(axis=1))
    assert rows.max() < 0.3 * size[1]


def test_pictures_too_small_for_words_have_none() -> None:
    picture, drawn = annotated(96, 64)
    assert not (drawn == picture // 3).all(axis=2).any()


def test_words_fill_lines_and_what_does_not_fit_is_left_out() -> None:
    words = ("one", "two", "a very long word", "three")
    assert _lines_of(words, len, 8) == ["one  two", "three"]
    assert _lines_of(words, len, 100) == ["one  two  a very long word  three"]
    assert _lines_of(words, len, 2) == []


def test_an_angle_that_stripes_leave_open_says_by_how_much() -> None:
    """Two times four colours look alike after half a turn."""
    assert _degrees(np.deg2rad(190.0), np.pi) == "10.0 deg + k 180"
    assert _degrees(np.deg2rad(190.0)) == "190.0 deg"
    assert _degrees(np.nan, np.pi) == "not read"


def test_a_dial_has_a_hand_for_each_stripe_that_may_be_the_first() -> None:
    """Two hands draw twice the pixels of one inside the dial."""
    counts = []
    for period in (np.pi, 2.0 * np.pi):
        picture, drawn = annotated(640, 480, period)
        row, column = round(1.3 * 16), round(640 - 3.4 * 16)
        inside = (slice(row - 9, row + 10), slice(column - 9, column + 10))
        counts.append(np.count_nonzero((drawn[inside] != picture[inside]).any(axis=2)))
    assert 1.5 < counts[0] / counts[1] < 2.5


def outline(picture: np.ndarray) -> np.ndarray:
    """Where the body's green outline ends to the left, to the right, above and below, pixels."""
    red, green, blue = (picture[..., channel].astype(int) for channel in range(3))
    rows, columns = np.nonzero((green > red + 40) & (green > blue + 40))
    return np.array([columns.min(), columns.max(), rows.min(), rows.max()])


def test_a_large_frame_is_reduced_with_what_is_drawn_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where its width is no multiple of the reduction."""
    _, whole = annotated(801, 600)
    monkeypatch.setattr(annotate, "_LARGEST", 500)
    _, half = annotated(801, 600)
    assert whole.shape == (600, 801, 3)
    assert half.shape == (300, 400, 3)
    assert np.abs(outline(half) - ((outline(whole) + 0.5) / 2.0 - 0.5)).max() <= 1.0
