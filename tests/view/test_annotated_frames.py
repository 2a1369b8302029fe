"""Annotated frames: a large one is reduced, and what is drawn on it lies where it lay."""

from types import SimpleNamespace

import numpy as np
import pytest

import spirillum as sp
from spirillum.view import annotate
from spirillum.vision.camera.optics import BodyPose, Optics

pytest.importorskip("cv2")
SIZE = (801, 600)  # a width that is no multiple of two


def drawn(largest: int, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    """A grey frame with the tracking result of a robot in its middle."""
    monkeypatch.setattr(annotate, "_LARGEST", largest)
    optics = Optics(SIZE, 900.0, 0.21, 0.0115)
    seen = SimpleNamespace(time=0.0, pose=BodyPose(0.02, -0.01, 0.2), body_angle=0.3, tail_phase=1.0, optics=optics)
    image = np.full((SIZE[1], SIZE[0], 3), 128, dtype=np.uint8)
    return annotate.Annotator(sp.load("biorob2012-wide")).draw(image, seen)


def outline(picture: np.ndarray) -> np.ndarray:
    """Middle and reach of the body's green outline, pixels."""
    red, green, blue = (picture[..., channel].astype(int) for channel in range(3))
    rows, columns = np.nonzero((green > red + 40) & (green > blue + 40))
    return np.array([columns.min(), columns.max(), rows.min(), rows.max()])


def test_a_large_frame_is_reduced_with_what_is_drawn_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, half = drawn(2000, monkeypatch), drawn(500, monkeypatch)
    assert whole.shape == (600, 801, 3)
    assert half.shape == (300, 400, 3)
    assert np.abs(outline(half) - (outline(whole) + 0.5) / 2.0 + 0.5).max() <= 1.0
