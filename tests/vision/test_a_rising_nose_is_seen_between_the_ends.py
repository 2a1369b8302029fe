"""A nose that rises moves the body's upper side back by the radius times the angle, and its round nose not at all."""

import numpy as np
import pytest

from spirillum.robot.load import load
from spirillum.virtual.artifacts import Degradation
from spirillum.virtual.disturbances import Disturbances
from spirillum.virtual.optics import lens_of, tank_of
from spirillum.virtual.pictures import FrameEncoder, Painter
from spirillum.virtual.trajectory import TrialTrajectory
from spirillum.virtual.trial_options import CameraOptions
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.track.body import BodyFinder

pytest.importorskip("cv2")

FRAMES, SIZE, HEIGHT, WAY = 10, (320, 240), 0.0125, 2e-3


def elongation_of_a_film(rise: float) -> np.ndarray:
    """By how much nose and rear are seen to drift apart in a drawn film whose nose rises evenly, m, (n,)."""
    robot = load("biorob2012-wide")
    time, share = np.arange(FRAMES) / 10.0, np.linspace(-0.5, 0.5, FRAMES)
    position = np.stack([0.02 + WAY * share, np.zeros(FRAMES), np.full(FRAMES, HEIGHT)], axis=1)
    level = np.zeros(FRAMES)
    path = TrialTrajectory(time, position, level, rise * (share + 0.5), -0.8 * time, 5.0 * time)
    camera = CameraOptions.of({"size": SIZE, "distortion": 0.0})
    tank, lens = tank_of(robot, "top"), lens_of(camera, (0.0, 0.0))
    clean = Disturbances.of_robot(Degradation(), 0, lens, float(time[-1]), robot, tank)
    frames = FrameEncoder(Painter(robot, tank, lens), clean, path, camera.exposure)
    pictures = [frames.image(float(moment)) for moment in time]
    optics = Optics(SIZE, lens.focal, lens.eye, HEIGHT, lens.surface, lens.index)
    body = BodyFinder(robot, optics, (0, 0, *SIZE))
    poses = [BodyPose(float(x), 0.0, 0.0) for x in position[:, 0]]
    body.learn(pictures, poses, time)
    return np.array([body.place(picture, pose).elongation for picture, pose in zip(pictures, poses, strict=True)])


@pytest.mark.parametrize("degrees", [0.0, 1.2, -1.2])
def test_ends_drift_apart_by_the_radius_times_the_rise(degrees: float) -> None:
    elongation = elongation_of_a_film(np.deg2rad(degrees))
    radius, pixel = 9e-3, 0.5e-3
    change = np.polyfit(np.linspace(0.0, 1.0, FRAMES), elongation, 1)[0]
    assert change == pytest.approx(radius * np.deg2rad(degrees), abs=0.15 * pixel)
