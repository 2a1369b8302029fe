"""The angle that stripes are drawn at is the angle that is read."""

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from flat_pictures import drawn
from spirillum.vision.camera.optics import BodyPose, Optics, optics_of
from spirillum.vision.setup import load_setup
from spirillum.vision.track.colours import pattern_period, runs_of
from spirillum.vision.track.stripes import Stripes

PRESET = ("red", "yellow", "green", "blue") * 2


def learnt(film: Any, folder: Path, **changes: str) -> tuple[Stripes, list[tuple[np.ndarray, BodyPose]], np.ndarray]:
    path = folder / "setup.toml"
    path.write_text(film.setup_text(**changes))
    setup, robot = load_setup(path)
    optics = optics_of(setup, film.size, film.focal)
    true = film.truth(film.times)
    pictures = [
        (picture, BodyPose(float(x), float(y), film.heading))
        for picture, x, y in zip(drawn(film), true["x"], true["y"], strict=True)
    ]
    stripes = Stripes(robot, setup, optics)
    stripes.learn(pictures)
    return stripes, pictures, true["body_angle"]


def errors(
    stripes: Stripes, pictures: list[tuple[np.ndarray, BodyPose]], angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    read = np.array([stripes.read(*picture) for picture in pictures])
    half = 0.5 * stripes.period
    return (read[:, 0] - angle + half) % stripes.period - half, read[:, 1]


def film(flat_pictures: ModuleType, **changes: Any) -> Any:
    """Frames spread over half a turn."""
    known = {"frames": 8, "fps": 4.0, "body_rate": -np.pi / 2, "size": (480, 200), "focal": 560.0, "fine": 5}
    return flat_pictures.flat(**(known | changes))


@pytest.mark.parametrize("look", [{}, {"direction": "left", "view": "side", "heading": 0.03, "start": (0.02, 0.006)}])
def test_angles_have_no_bias_beyond_a_third_of_a_degree(flat_pictures: ModuleType, tmp_path: Path, look: Any) -> None:
    stripes, pictures, angle = learnt(film(flat_pictures, **look), tmp_path)
    missed, error = errors(stripes, pictures, angle)
    assert stripes.flags == ()
    assert np.degrees(np.max(np.abs(missed))) < 0.3
    assert np.all(error < np.deg2rad(0.3))


@pytest.mark.parametrize(
    "order",
    [
        ("black", "white") * 4,
        ("red", "yellow", "green", "blue", "white", "black", "orange", "cyan"),
    ],
)
def test_other_patterns_read_as_well(flat_pictures: ModuleType, tmp_path: Path, order: tuple[str, ...]) -> None:
    said = str(list(order)).replace("'", '"')
    stripes, pictures, angle = learnt(film(flat_pictures, stripes=order, body_rate=-1.1), tmp_path, robot_stripes=said)
    missed, _ = errors(stripes, pictures, angle)
    assert stripes.flags == ()
    assert stripes.period == pytest.approx(pattern_period(order))
    assert np.degrees(np.max(np.abs(missed))) < 0.5


def test_noise_and_a_drifting_lamp_leave_errors_as_large_as_said(flat_pictures: ModuleType, tmp_path: Path) -> None:
    stripes, pictures, angle = learnt(film(flat_pictures, noise=8.0, lamp=0.2, frames=16, fine=3), tmp_path)
    missed, error = errors(stripes, pictures, angle)
    assert np.degrees(np.abs(missed.mean())) < 0.3
    assert 0.3 < np.sqrt(np.mean((missed / error) ** 2)) < 3.0


def test_glare_on_a_part_of_the_seal_does_not_mislead(flat_pictures: ModuleType, tmp_path: Path) -> None:
    flat = film(flat_pictures)
    stripes, pictures, angle = learnt(flat, tmp_path)
    bright = []
    for picture, pose in pictures:
        shown = picture.copy()
        centre = flat.pixels(np.array([pose.x - 0.012, pose.y + 0.003, flat.axis_height]))
        v, u = np.mgrid[: shown.shape[0], : shown.shape[1]]
        shown[(u - centre[0]) ** 2 + (v - centre[1]) ** 2 < 8**2] = 255
        bright.append((shown, pose))
    missed, _ = errors(stripes, bright, angle)
    assert np.degrees(np.max(np.abs(missed))) < 1.0


def test_wide_glare_that_was_there_all_the_time_does_not_hold_the_angle(
    flat_pictures: ModuleType, tmp_path: Path
) -> None:
    flat = film(flat_pictures, frames=16, body_rate=-np.pi / 4, noise=3.0)
    stripes, pictures, angle = learnt(flat, tmp_path)
    bright = []
    for picture, pose in pictures:
        centre = flat.pixels(np.array([pose.x - 0.018, pose.y + 0.003, flat.axis_height]))
        v, u = np.mgrid[: picture.shape[0], : picture.shape[1]]
        far = np.hypot((u - centre[0]) / 40.0, (v - centre[1]) / 13.0)
        shine = 400.0 * np.exp(-0.5 * np.maximum(far - 0.5, 0.0) ** 2 / 0.25)
        bright.append((np.clip(picture + shine[..., None], 0, 255).astype(np.uint8), pose))
    stripes.learn(bright)
    missed, _ = errors(stripes, bright, angle)
    read = np.isfinite(missed)
    assert read.mean() > 0.5
    assert np.degrees(np.max(np.abs(missed[read]))) < 4.0
    assert abs(np.polyfit(angle[read], missed[read], 1)[0]) < 0.03  # it does not lag behind


LINE = ("white", *("black",) * 23)
BARS = ("black", "white", "white", *("black", "white") * 2, "black", "black", *("white",) * 3)


def shining(flat: Any, pictures: list[tuple[np.ndarray, BodyPose]]) -> list[tuple[np.ndarray, BodyPose]]:
    """A highlight that stays on the seal, as of a lamp on dark paint."""
    found = []
    for picture, pose in pictures:
        centre = flat.pixels(np.array([pose.x - 0.012, pose.y - 0.003, flat.axis_height]))
        v, u = np.mgrid[: picture.shape[0], : picture.shape[1]]
        shine = 60.0 * np.exp(-0.5 * ((v - centre[1]) / 6.0) ** 2) * (np.abs(u - centre[0]) < 60.0)
        found.append((np.clip(picture + shine[..., None], 0, 255).astype(np.uint8), pose))
    return found


@pytest.mark.parametrize("shines", [False, True])
def test_one_painted_line_is_read_where_it_faces_the_camera(
    flat_pictures: ModuleType, tmp_path: Path, *, shines: bool
) -> None:
    """A turn and a quarter. Where black alone is in view, or what the lamp makes of it, nothing is read."""
    said = str(list(LINE)).replace("'", '"')
    flat = film(flat_pictures, stripes=LINE, frames=40, body_rate=-np.pi / 4, noise=2.0)
    stripes, pictures, angle = learnt(flat, tmp_path, robot_stripes=said)
    if shines:
        pictures = shining(flat, pictures)
        stripes.learn(pictures)
    missed, _ = errors(stripes, pictures, angle)
    assert stripes.flags == ()
    away = np.abs((angle + np.pi) % (2.0 * np.pi) - np.pi)  # of the line from the direction towards the camera
    read = np.isfinite(missed)
    assert read[away < np.radians(45.0)].mean() > 0.7
    assert not read[away > np.radians(75.0)].any()
    assert np.degrees(np.max(np.abs(missed[read]))) < 2.5
    assert np.degrees(np.median(np.abs(missed[read]))) < 1.0
    assert 0.3 < stripes.readable < 0.5


def test_a_line_that_never_passes_is_not_read(flat_pictures: ModuleType, tmp_path: Path) -> None:
    """Turned away all along; the lamp's highlight is no line."""
    said = str(list(LINE)).replace("'", '"')
    flat = film(flat_pictures, stripes=LINE, frames=20, body_rate=-np.pi / 20, body_angle=2.6, noise=2.0)
    stripes, pictures, _ = learnt(flat, tmp_path, robot_stripes=said)
    stripes.learn(shining(flat, pictures))
    (flag,) = stripes.flags
    assert flag.name == "stripes-do-not-pass"
    assert flag.spoils == ("body_rotation_rate",)
    assert not stripes.fits


def test_bars_of_several_widths_are_read(flat_pictures: ModuleType, tmp_path: Path) -> None:
    said = str(list(BARS)).replace("'", '"')
    flat = film(flat_pictures, stripes=BARS, frames=12)
    stripes, pictures, angle = learnt(flat, tmp_path, robot_stripes=said)
    missed, _ = errors(stripes, pictures, angle)
    assert stripes.flags == ()
    assert np.degrees(np.max(np.abs(missed))) < 0.6


@pytest.mark.parametrize(("order", "runs"), [(BARS, [1, 2, 1, 1, 1, 1, 2, 3]), (LINE, [1, 23]), (PRESET, [1] * 8)])
def test_runs_of_one_colour_add_up_to_a_turn(order: tuple[str, ...], runs: list[int]) -> None:
    assert runs_of(order) == runs
    assert sum(runs) == len(order)


@pytest.mark.parametrize(
    ("order", "word"), [(PRESET[::-1], "reversed"), (("red", "green", "yellow", "blue") * 2, "another")]
)
def test_a_wrong_order_is_said_and_spoils_the_rate(
    flat_pictures: ModuleType, tmp_path: Path, order: tuple[str, ...], word: str
) -> None:
    said = str(list(order)).replace("'", '"')
    stripes, _, _ = learnt(film(flat_pictures), tmp_path, robot_stripes=said)
    (flag,) = stripes.flags
    assert flag.name == "stripe-order"
    assert flag.spoils == ("body_rotation_rate",)
    assert word in flag.sentence


@pytest.mark.parametrize("order", [PRESET[:4], PRESET[:4] * 3, PRESET[:3]], ids=["half", "more", "three"])
def test_a_wrong_number_of_stripes_is_said_and_spoils_the_rate(
    flat_pictures: ModuleType, tmp_path: Path, order: tuple[str, ...]
) -> None:
    said = str(list(order)).replace("'", '"')
    stripes, _, _ = learnt(film(flat_pictures), tmp_path, robot_stripes=said)
    (flag,) = stripes.flags
    assert flag.name in ("stripes-do-not-fit", "stripe-order")
    assert flag.spoils == ("body_rotation_rate",)
    assert not stripes.fits


def test_an_even_picture_is_not_read(flat_pictures: ModuleType, tmp_path: Path) -> None:
    stripes, pictures, _ = learnt(film(flat_pictures), tmp_path)
    rng = np.random.default_rng(3)
    for level in (np.full(pictures[0][0].shape, 120.0), rng.uniform(0, 255, pictures[0][0].shape)):
        assert np.isnan(stripes.read(level.astype(np.uint8), pictures[0][1])).all()


def test_stripes_out_of_the_picture_are_not_read(flat_pictures: ModuleType, tmp_path: Path) -> None:
    stripes, pictures, _ = learnt(film(flat_pictures), tmp_path)
    assert np.isnan(stripes.read(pictures[0][0], BodyPose(-0.5, 0.0, 0.0))).all()


def test_periods_of_patterns() -> None:
    assert pattern_period(PRESET) == pytest.approx(np.pi)
    assert pattern_period(("black", "white") * 3) == pytest.approx(2 * np.pi / 3)
    assert pattern_period(("red", "white", "white")) == pytest.approx(2 * np.pi)


def test_a_robot_without_stripes_says_so(flat_pictures: ModuleType) -> None:
    from spirillum.robot.load import load
    from spirillum.vision.setup import CameraSetup, Markers, RobotSetup, Setup

    setup = Setup(
        camera=CameraSetup(height="200 mm"),
        markers=Markers(length_per_pixel="0.3 mm"),
        robot=RobotSetup(file="biorob2012-wide", axis_height="10 mm"),
    )
    robot = load("biorob2012-wide", seal="none")
    stripes = Stripes(robot, setup, Optics(size=(64, 64), focal=100.0, height=0.2, axis_height=0.01))
    stripes.learn([(np.zeros((64, 64, 3), dtype=np.uint8), BodyPose(0.0, 0.0, 0.0))])
    assert [flag.name for flag in stripes.flags] == ["no-stripes"]
