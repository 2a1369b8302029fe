"""The phase that a wire is drawn at is the phase that is read."""

import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from flat_pictures import drawn
from spirillum.robot.load import load
from spirillum.vision.camera.optics import BodyPose, optics_of
from spirillum.vision.setup import load_setup
from spirillum.vision.track.tail import TailWave


def learnt(
    film: Any, folder: Path, **robot_changes: Any
) -> tuple[TailWave, list[tuple[np.ndarray, BodyPose]], np.ndarray]:
    path = folder / "setup.toml"
    path.write_text(film.setup_text())
    setup, robot = load_setup(path)
    if robot_changes:
        robot = load("biorob2012-wide", **robot_changes)
    true = film.truth(film.times)
    pictures = [
        (picture, BodyPose(float(x), float(y), film.heading))
        for picture, x, y in zip(drawn(film), true["x"], true["y"], strict=True)
    ]
    wire = TailWave(robot, setup, optics_of(setup, film.size, film.focal))
    wire.learn(pictures[::2])
    return wire, pictures, true["tail_phase"]


def errors(
    wire: TailWave, pictures: list[tuple[np.ndarray, BodyPose]], phase: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    read = np.array([wire.read(*picture) for picture in pictures])
    return (read[:, 0] - phase + np.pi) % (2 * np.pi) - np.pi, read[:, 1]


def film(flat_pictures: ModuleType, **changes: Any) -> Any:
    known = {"frames": 24, "size": (480, 160), "focal": 560.0, "fine": 3, "tail_rate": 2 * np.pi * 1.3}
    return flat_pictures.flat(**(known | changes))


FEW = {"frames": 16}
"""Enough for a tail that does not fit, or is not seen."""

LOOKS: list[dict[str, Any]] = [
    {},
    {"direction": "left", "view": "side", "heading": -0.03, "start": (0.02, 0.005)},
    {"floor": (30, 34, 60), "wire": (190, 150, 90)},
]


@pytest.mark.parametrize("look", LOOKS)
def test_phases_are_read_to_a_hundredth_of_a_radian(flat_pictures: ModuleType, tmp_path: Path, look: Any) -> None:
    wire, pictures, phase = learnt(film(flat_pictures, **look), tmp_path)
    missed, error = errors(wire, pictures, phase)
    assert wire.flags == ()
    assert wire.handedness() == 1
    assert np.max(np.abs(missed)) < 0.01
    assert np.sqrt(np.mean((missed / error) ** 2)) < 2.0


def test_noise_and_bubbles_leave_errors_as_large_as_said(flat_pictures: ModuleType, tmp_path: Path) -> None:
    import cv2

    wire, pictures, phase = learnt(film(flat_pictures, noise=14.0, lamp=0.2), tmp_path)
    pictures, rng = [(picture.copy(), pose) for picture, pose in pictures], np.random.default_rng(5)
    for picture, _ in pictures:
        for u, v in rng.uniform((20, 60), (200, 100), (4, 2)):
            cv2.circle(picture, (int(u), int(v)), 5, (255, 255, 255), 1)
    missed, error = errors(wire, pictures, phase)
    assert np.isfinite(missed).all()
    assert 0.2 < np.sqrt(np.mean((missed / error) ** 2)) < 3.0


def test_perspective_shows_a_wrong_hand(flat_pictures: ModuleType, tmp_path: Path) -> None:
    wire, pictures, phase = learnt(film(flat_pictures), tmp_path, **{"tail.handedness": "left"})
    errors(wire, pictures, phase)
    assert wire.handedness() == -1
    assert [flag.name for flag in wire.flags] == ["handedness"]
    assert wire.flags[0].spoils == ("tail_rotation_rate",)


@pytest.mark.parametrize(
    "change", [{"tail.wavelength": "20 mm"}, pytest.param({"tail.wavelength": "32 mm"}, marks=pytest.mark.slow)]
)
def test_a_tail_of_another_wavelength_does_not_fit(flat_pictures: ModuleType, tmp_path: Path, change: Any) -> None:
    wire, _, _ = learnt(film(flat_pictures, **FEW), tmp_path, **change)
    assert wire.flags[0].name == "tail-does-not-fit"
    assert re.search(r"tail.wavelength looks like 2[456]\.", wire.flags[0].sentence)
    assert "amplitude" not in wire.flags[0].sentence


@pytest.mark.parametrize("amplitude", ["1.6 mm", "4 mm"])
def test_a_tail_of_another_amplitude_does_not_fit_and_its_wavelength_is_not_blamed(
    flat_pictures: ModuleType, tmp_path: Path, amplitude: str
) -> None:
    wire, _, _ = learnt(film(flat_pictures, **FEW), tmp_path, **{"tail.amplitude": amplitude})
    assert wire.flags[0].name == "tail-does-not-fit"
    assert "amplitude looks like 2." in wire.flags[0].sentence  # 2.5 mm
    assert "wavelength" not in wire.flags[0].sentence


def test_no_wire_gives_no_phase(flat_pictures: ModuleType, tmp_path: Path) -> None:
    wire, pictures, phase = learnt(film(flat_pictures, **FEW, wire=(150, 190, 170), noise=3.0), tmp_path)
    missed, _ = errors(wire, pictures, phase)
    assert np.isnan(missed).mean() > 0.9
    assert any("tail_rotation_rate" in flag.spoils for flag in wire.flags)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)])
def test_a_tail_lost_in_noise_is_not_seen_and_is_not_said_to_have_another_shape(
    flat_pictures: ModuleType, tmp_path: Path, seed: int
) -> None:
    wire, _, _ = learnt(film(flat_pictures, **FEW, wire=(150, 190, 170), noise=20.0, seed=seed), tmp_path)
    assert [flag.name for flag in wire.flags] == ["tail-unreadable"]
    assert wire.flags[0].spoils == ("tail_rotation_rate",)
    assert "compress the film less" in wire.flags[0].sentence


def test_a_tail_out_of_view_is_not_read(flat_pictures: ModuleType, tmp_path: Path) -> None:
    wire, pictures, _ = learnt(film(flat_pictures, frames=8), tmp_path)
    assert np.isnan(wire.read(pictures[0][0], BodyPose(-0.1, 0.0, 0.0))).all()
