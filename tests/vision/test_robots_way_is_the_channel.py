"""Without a ruler lengths are measured along the robot's way, whatever the camera's roll."""

import numpy as np
import pytest

from spirillum.vision.track.size import align_with_path

FPS, PIXEL = 30.0, 2.5e-4


def track(roll: float, speed: float, noise: float = 0.05) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, places and headings on the rows and columns of a rolled picture; the robot is yawed by 3 degrees."""
    rng = np.random.default_rng(4)
    time = np.arange(200) / FPS
    x = speed * time * np.array([[np.cos(roll)], [np.sin(roll)]])
    position = x.T + noise * PIXEL * rng.normal(size=(200, 2)) + 0.01
    position[40:50] = np.nan
    position[::23] += 20 * PIXEL  # outliers
    return time, position, np.full(200, roll + np.radians(3.0))


@pytest.mark.parametrize("speed", [3e-3, -3e-3])
@pytest.mark.parametrize("roll", [-20.0, -3.0, 8.0, 85.0])
def test_length_is_that_of_the_way(roll: float, speed: float) -> None:
    time, position, heading = track(np.radians(roll), speed)
    along = align_with_path(time, position, heading)
    good = np.isfinite(position[:, 0])
    good[::23] = False
    slope = np.polyfit(time[good], along.position[good], 1)[0]
    assert slope == pytest.approx([speed, 0.0], abs=1e-3 * abs(speed))
    assert np.degrees(along.heading) == pytest.approx(3.0, abs=0.1)
    assert [flag.name for flag in along.flags] == ["camera-rolled"]
    assert f"moves at {roll:.1f} deg" in along.flags[0].sentence


@pytest.mark.parametrize(("roll", "speed"), [(0.0, 3e-3), (1.2, 3e-3)])
def test_level_cameras_stay_as_they_are(roll: float, speed: float) -> None:
    time, position, heading = track(np.radians(roll), speed)
    along = align_with_path(time, position, heading)
    np.testing.assert_array_equal(along.position, position)
    assert not along.flags


def test_a_robot_that_hardly_moves_lies_along_the_channel() -> None:
    time, position, heading = track(np.radians(8.0), 0.0, noise=0.5)
    along = align_with_path(time, position, heading)
    assert "lies at 11.0 deg" in along.flags[0].sentence
    assert np.degrees(along.heading) == pytest.approx(0.0, abs=1e-9)


def test_too_few_frames_tell_no_direction() -> None:
    time, position, heading = track(np.radians(8.0), 3e-3)
    assert not align_with_path(time[:8], position[:8], heading[:8]).flags
