"""Where no coloured seal leads, an outline over a grid or of glass is said to be less sure; over a plain floor not."""

from functools import cache

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.robot.load import load
from spirillum.vision.camera.camera import bounds_of, opened, samples_of, scale_of
from spirillum.vision.camera.optics import BodyPose
from spirillum.vision.setup import load_setup
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.lone_outline import LONE_OUTLINE, check_outline
from spirillum.vision.video.frames import Frame

pytest.importorskip("av")
pytest.importorskip("cv2")
SPEED, FPS, FRAMES = 2e-3, 8.0, 17
RATES = {"forward_velocity": "2 mm/s", "body_rate": "-0.12 Hz", "tail_rate": "1.3 Hz"}


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A film of the virtual camera of a robot with stripes without colour, and its setup file."""

    @cache
    def render(troubles):
        path = tmp_path_factory.mktemp("alone") / "a.mp4"
        robot = load("biorob2012-wide", **{"seal.stripes": ["white", "black"]})
        sp.render(
            robot, path, motion=RATES, trial={"duration": f"{(FRAMES - 1) / FPS} s"},
            camera={"size": "320x240", "fps": FPS}, troubles=troubles, seed=1,
        )  # fmt: skip
        return path, path.with_name("a.setup.toml")

    return render


def checked(film, *, stuck=False, appearance=None):
    """What is said of the outline at the robot's true places, or at one of them all the time."""
    path, setup_file = film
    setup, robot = load_setup(setup_file)
    sight, video = scale_of(path, setup)
    frames = samples_of(opened(path, setup), 0.0, None)
    frames = [Frame(number, frame.time, frame.image) for number, frame in enumerate(frames)]
    with xr.open_dataset(path.with_name("a.truth.nc")) as true:
        x = np.interp([0.0 if stuck else frame.time for frame in frames], true["time"], true["x"])
    poses = [BodyPose(float(at), 0.0, 0.0) for at in x]
    body = BodyFinder(robot, sight.optics, bounds_of(setup, video))
    return check_outline(frames, poses, body, appearance or setup.robot.appearance, alone=True)


def test_over_a_plain_floor_nothing_is_in_doubt(film):
    plain = film(None)
    assert checked(plain) == checked(plain, appearance="unknown") == (0.0, (), "")


@pytest.mark.parametrize("troubles", ["grid-paper", "glass-cover", "glass-cover,grid-paper,mirrored-lamps"])
def test_an_outline_that_moves_along_is_less_sure(film, troubles):
    found = checked(film(troubles))
    assert found.drift == LONE_OUTLINE.drift
    assert [(flag.name, flag.spoils) for flag in found.flags] == [("outline-alone", ())]
    assert ("grid" if "grid" in troubles else "glass") in found.flags[0].sentence
    assert found.flags[0].frame is not None


def test_an_outline_that_stands_in_a_grid_gives_no_speed(film):
    found = checked(film("glass-cover,grid-paper"), stuck=True)
    assert [flag.name for flag in found.flags] == ["outline-alone"]
    assert {"forward_velocity", "body_rotation_rate", "tail_rotation_rate"} <= set(found.flags[0].spoils)


def test_the_speed_over_a_grid_without_a_coloured_seal(film):
    trial = sp.measure(*film("grid-paper")).trials[0]
    speed, tail = trial.quantities["forward_velocity"], trial.quantities["tail_rotation_rate"]
    assert speed.low < SPEED < speed.high
    assert tail.low < 1.3 * 2.0 * np.pi < tail.high
    assert [flag.frame is None for flag in trial.flags if flag.name == "outline-alone"] == [False]
