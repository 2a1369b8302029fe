"""Pictures of a camera in a hand are moved to where the first one lies, by what stands still in them."""

from types import SimpleNamespace

import numpy as np
import pytest

from spirillum.vision.camera import anchor
from spirillum.vision.camera.anchor import steadied, sways
from spirillum.vision.setup import load_setup
from spirillum.vision.track.assembly import follow
from spirillum.vision.video.frames import Frame

cv2 = pytest.importorskip("cv2")


def shaken(flat, sway: float, speed: float = 2e-3):
    """Frames of a flat drawing before a camera that sways, rolls and jitters, and how it did: right, down, roll."""
    rng = np.random.default_rng(2)
    time = flat.times
    waves = np.stack([np.sin(2 * np.pi * rate * time + phase) for rate, phase in ((0.5, 0.0), (0.7, 1.0), (0.4, 2.0))])
    true = sway * (waves + 0.3 * rng.normal(size=waves.shape)) * np.array([[1.0], [1.0], [2e-4]])
    marks = cv2.GaussianBlur(rng.normal(0.0, 60.0, (*flat.size[::-1], 1)).astype(np.float32), (0, 0), 5.0)
    frames = []
    for index, ((moment, picture), (right, down, roll)) in enumerate(zip(flat.pictures(), true.T, strict=True)):
        matrix = cv2.getRotationMatrix2D((159.5, 119.5), -np.degrees(roll), 1.0)
        matrix[:, 2] += right, down
        dusty = np.clip(picture + marks[..., None], 0, 255).astype(np.float32)  # a tank is never quite clean
        moved = cv2.warpAffine(dusty, matrix, flat.size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        frames.append(Frame(index, moment, np.clip(np.rint(moved), 0, 255).astype(np.uint8)))
    return frames, true.T


@pytest.fixture(scope="module")
def swimmer(flat_pictures):
    """A robot whose pictures are drawn once."""
    flat = flat_pictures.Flat(frames=20, fps=10.0, velocity=4e-3, noise=3.0)
    pictures = list(flat.pictures())
    return SimpleNamespace(size=flat.size, times=flat.times, pictures=lambda: pictures)


@pytest.mark.parametrize("sway", [1.0, 3.0])
def test_shift_and_roll_of_every_frame_are_found(swimmer, sway):
    frames, true = shaken(swimmer, sway)
    assert sways(frames[::4])
    off = steadied(iter(frames)).poses - (true - true[0])
    assert np.abs(off[:, :2] - off[:, :2].mean(axis=0)).max() < 0.15  # pixels
    assert np.abs(off[:, 2] - off[:, 2].mean()).max() * 160 < 0.15


def test_a_camera_on_a_stand_does_not_sway(flat_pictures):
    frames, _ = shaken(flat_pictures.Flat(frames=6, fps=2.0, velocity=4e-3, noise=6.0), 0.0)
    assert not sways(frames)


def test_rates_from_a_hand_are_those_of_the_robot(flat_pictures, tmp_path):
    flat = flat_pictures.Flat(frames=18, fps=6.0, velocity=4e-3, noise=2.0, body_rate=-1.5, tail_rate=9.0)
    (tmp_path / "film").mkdir()
    for frame in shaken(flat, 3.0)[0]:
        cv2.imwrite(str(tmp_path / "film" / f"{frame.index:03d}.png"), frame.image[..., ::-1])
    (tmp_path / "film.setup.toml").write_text(flat.setup_text())
    setup, robot = load_setup(tmp_path / "film.setup.toml")
    found = follow(tmp_path / "film", setup, robot)
    assert {"camera-swayed"} <= {flag.name for flag in found.flags}
    assert not [flag for flag in found.flags if flag.spoils]
    wanted = {"x": 4e-3, "body_angle": -1.5, "tail_phase": 9.0}
    series = {"x": found.position[:, 0], "body_angle": found.body_angle, "tail_phase": found.tail_phase}
    for name, values in series.items():
        seen = np.isfinite(values)
        assert np.polyfit(found.time[seen], values[seen], 1)[0] == pytest.approx(wanted[name], rel=0.01), name
    assert found.drift > 0.0  # how far the camera was carried is not known


def test_a_wide_blur_on_a_reduced_picture_is_that_of_the_whole():
    size = (2603, 90)
    v, u = np.mgrid[: size[1], : size[0]].astype(np.float32)
    picture = np.clip(120.0 + 60.0 * np.sin(u / 300.0) + 40.0 * np.sin(u / 7.0) + 0.3 * v, 0, 255)
    ground = cv2.GaussianBlur(picture, (0, 0), size[0] / 20.0)
    whole = cv2.GaussianBlur(np.clip(picture / ground - 1.0, -0.6, 0.6), (0, 0), 1.0)
    found = anchor._flat(np.repeat(picture[..., None], 3, axis=2))
    assert np.abs(found - whole).max() < 0.005


@pytest.mark.parametrize("shade", [0, 255])
def test_pictures_without_any_edge_do_not_sway(shade):
    """A film with its lid on: what is wrong with it is told by who looks for ruler and robot."""
    frames = [Frame(index, 0.1 * index, np.full((240, 320, 3), shade, dtype=np.uint8)) for index in range(4)]
    assert not sways(frames)
