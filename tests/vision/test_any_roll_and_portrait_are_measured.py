"""A camera may be turned as it likes about its axis: the ruler tells the channel, the setup where the nose points."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.vision.camera.camera import opened, samples_of
from spirillum.vision.camera.ruler import ruler_in
from spirillum.vision.setup import load_setup
from spirillum.vision.track.assembly import follow
from spirillum.vision.track.learning import learnt_from
from spirillum.vision.track.steadiness import camera_flags
from spirillum.vision.video.frames import Frame

cv2 = pytest.importorskip("cv2")

TRUE = {"velocity": 3e-3, "body_rate": -1.4, "tail_rate": 7.0}


def turned(picture: np.ndarray, roll: float) -> np.ndarray:
    """A picture turned against the clock by whole quarters and some degrees."""
    quarters = round(roll / 90.0)
    picture = np.ascontiguousarray(np.rot90(picture, quarters))
    height, width = picture.shape[:2]
    matrix = cv2.getRotationMatrix2D((0.5 * (width - 1), 0.5 * (height - 1)), roll - 90.0 * quarters, 1.0)
    return cv2.warpAffine(picture, matrix, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def film(flat_pictures, folder, roll, stated, frames=14):
    """A folder of turned pictures of a robot whose nose points right before it is turned, and its setup."""
    flat = flat_pictures.Flat(frames=frames, fps=4.2, start=(0.0, 0.0), **TRUE)
    (folder / "film").mkdir()
    for index, (_, picture) in enumerate(flat.pictures()):
        cv2.imwrite(str(folder / "film" / f"{index:03d}.png"), turned(picture, roll)[..., ::-1])
    (folder / "film.setup.toml").write_text(flat.setup_text(robot_direction=f'"{stated}"'))
    return folder / "film", folder / "film.setup.toml"


@pytest.mark.parametrize(
    ("roll", "stated"),
    [
        (-100.0, "down"),
        pytest.param(25.0, "right", marks=pytest.mark.slow),
        pytest.param(160.0, "left", marks=pytest.mark.slow),
        pytest.param(90.0, "up", marks=pytest.mark.slow),
    ],
)
def test_rates_do_not_know_how_the_camera_is_turned(flat_pictures, tmp_path, roll, stated):
    path, setup = film(flat_pictures, tmp_path, roll, stated)
    found = follow(path, *load_setup(setup))
    series = {"velocity": found.position[:, 0], "body_rate": found.body_angle, "tail_rate": found.tail_phase}
    for name, values in series.items():
        seen = np.isfinite(values)
        assert np.polyfit(found.time[seen], values[seen], 1)[0] == pytest.approx(TRUE[name], rel=3e-3), name
    assert np.abs(found.heading).max() < np.radians(1.0)
    assert not [flag for flag in found.flags if flag.spoils]


def test_a_wrong_side_of_the_picture_names_the_direction(flat_pictures, tmp_path):
    path, setup = film(flat_pictures, tmp_path, 90.0, "right", frames=2)
    with pytest.raises(
        sp.InputError, match=r"robot.direction = 'right', .* along the columns .*; allowed: 'up' or 'down'"
    ):
        follow(path, *load_setup(setup))


@pytest.mark.parametrize("roll", [44.0, pytest.param(-38.0, marks=pytest.mark.slow)])
def test_the_roll_of_a_ruler_is_found(flat_pictures, roll):
    picture = flat_pictures.Flat(start=(1.0, 0.0)).draw(0.0)
    lines = ruler_in(turned(picture, roll).astype(float), (0, 0, 320, 240))
    assert lines is not None
    assert np.degrees(lines.roll) == pytest.approx(-roll, abs=0.3)


@pytest.mark.slow
def test_a_portrait_film_says_direction_and_shows_a_camera_that_moved(flat_pictures, tmp_path):
    path, _ = film(flat_pictures, tmp_path, 90.0, "up")
    found = sp.propose_setup(path, "biorob2012-wide", spacing="2 mm", fps=4.2)
    assert found.found("direction").value == "up"
    assert found.found("travel").value == pytest.approx(3e-3 * 350.0 / (0.2 - 0.015), rel=0.05)
    setup, robot = load_setup(path.with_name("film.setup.toml"))
    video = opened(path, setup)
    frames = samples_of(video, 0.0, None)
    start = learnt_from(video, frames, setup, robot, None).known.start
    assert not camera_flags(frames, start, ruled=True)
    half = len(frames) // 2
    bumped = [
        Frame(f.index, f.time, np.roll(f.image, 1, axis=0) if k >= half else f.image) for k, f in enumerate(frames)
    ]
    assert [flag.name for flag in camera_flags(bumped, start, ruled=True)] == ["camera-moved"]
