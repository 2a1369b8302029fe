"""Plant, picture, tracker: the loop without hardware; what is seen is where the plant is."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError

pytest.importorskip("av")
pytest.importorskip("cv2")
FPS = 12.0


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    plant = sp.Plant("biorob2012-wide")
    moment = plant.observe()
    camera = sp.VirtualCamera(plant.robot, moment.pose, camera={"fps": FPS, "size": (320, 240)})
    tracker = sp.LiveTracker(camera.setup(tmp_path_factory.mktemp("loop") / "setup.toml"), learn="2 s", window="1 s")
    rows = []
    for _ in range(50):
        moment = plant.step(1.0 / FPS, remote=True)
        shot = camera.take(moment.time, moment.pose)
        seen = tracker.update(shot.image, shot.time)
        if seen.seen:
            rotor = moment.pose.rotor
            phase = float(np.arctan2(rotor[2, 1], rotor[1, 1]))
            rows.append(
                (moment.time, seen.time, seen.x, camera.x_of(moment.pose), seen.tail_phase, phase, seen.heading)
            )
    return camera, moment, np.array(rows).T


def test_the_tracker_sees_where_the_plant_is(loop):
    now, time, x, true, tail, phase = loop[2][:6]
    assert now.size > 20
    assert time == pytest.approx(now - 0.5 / 120.0)  # the middle of the exposure
    assert x == pytest.approx(true, abs=2e-4)
    assert np.polyfit(time, x, 1)[0] == pytest.approx(np.polyfit(now, true, 1)[0], rel=0.03)
    assert np.polyfit(time, tail, 1)[0] == pytest.approx(np.polyfit(now, np.unwrap(phase), 1)[0], rel=2e-3)


def test_pictures_are_taken_in_order(loop):
    camera, moment, _ = loop
    with pytest.raises(InputError, match="allowed: later than the picture before"):
        camera.take(moment.time, moment.pose)
    for wrong in (np.nan, None, 10**400):
        with pytest.raises(InputError, match=r"time = .*; allowed: later than the picture before"):
            camera.take(wrong, moment.pose)
    with pytest.raises(InputError, match="pose = None; allowed: a RobotPose"):
        camera.take(moment.time + 1.0, None)
    with pytest.raises(InputError, match="degradation = 'dirty'"):
        sp.VirtualCamera("biorob2012-wide", moment.pose, degradation="dirty")
