"""A film has the frames, length and size that were asked for, and its robot moves as the run says."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.dynamics.run_file import poses_of
from spirillum.view.scene3d.film import _about
from spirillum.view.scene3d.scene import DrawnRobot
from spirillum.view.scene3d.scenery import fitted

SIZE = (320, 180)
SMALL: dict[str, Any] = {"size": SIZE, "fps": 10, "view": "side"}


def frames_of(path: Path) -> list[np.ndarray]:
    import av

    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0)]


def coloured(image: np.ndarray) -> np.ndarray:
    """Columns in which wire, stripes and shaded sides are seen: darker than the grid, between the words."""
    return np.flatnonzero((image[50:135].min(axis=2) < 140).any(axis=0))


def test_frames_length_and_size_are_those_asked_for(
    free_robot: Any, run_of: Callable[..., Any], tmp_path: Path
) -> None:
    import av

    path = tmp_path / "run.mp4"
    found = sp.film(run_of(free_robot, duration=0.8), path, speed=0.5, **SMALL)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert (stream.codec_context.width, stream.codec_context.height, stream.pix_fmt) == (*SIZE, "yuv420p")
        assert stream.average_rate == 10
        assert container.metadata["title"] == "biorob2012-wide"
        frames = list(container.decode(video=0))
    assert len(frames) == found.frames == 17  # 0.8 s at half speed, both ends included
    assert [float(frame.time) for frame in frames] == pytest.approx(0.1 * np.arange(17))
    assert found.duration == pytest.approx(1.7)
    content = path.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")  # it plays before all of it has arrived
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.mp4"]


def test_robot_moves_by_what_the_run_says(free_robot: Any, run_of: Callable[..., Any], tmp_path: Path) -> None:
    run, path = run_of(free_robot, duration=0.5, speed=0.06), tmp_path / "run.mp4"
    sp.film(run, path, camera="fixed", **SMALL)
    first, *_, last = frames_of(path)
    solids, poses = DrawnRobot.of(free_robot), poses_of(run)
    camera = fitted("side", np.concatenate([solids.corners(poses.at(time)) for time in (0.0, 0.5)]), SIZE)
    tip = np.array([[-0.5 * 0.035 - 0.010 - 0.060, 0.0, 0.0]])
    for frame, moved in ((first, 0.0), (last, 0.03)):
        assert coloured(frame).min() == pytest.approx(camera.pixels(tip + np.array([moved, 0, 0]), SIZE)[0, 0], abs=2)


def test_camera_goes_along_with_a_robot_that_swims_far(
    free_robot: Any, run_of: Callable[..., Any], tmp_path: Path
) -> None:
    run, path = run_of(free_robot, duration=0.5, speed=0.4), tmp_path / "run.mp4"
    found = sp.film(run, path, **SMALL)
    first, *_, last = frames_of(path)
    assert found.follows
    assert coloured(last).min() == pytest.approx(coloured(first).min(), abs=2)
    assert np.abs(first - last).max(axis=2)[60:].max() > 40  # the body has turned
    assert not sp.film(run_of(free_robot, duration=0.2, speed=0.02), path, **SMALL).follows


def test_time_stamp_and_nothing_else_changes_while_nothing_moves(
    free_robot: Any, run_of: Callable[..., Any], tmp_path: Path
) -> None:
    path = tmp_path / "run.mp4"
    sp.film(run_of(free_robot, tail=0.0, body=0.0), path, **SMALL)
    first, *_, last = frames_of(path)
    changed = np.abs(first - last).max(axis=2) > 24
    assert changed[:24, 200:].any()
    changed[:24, 200:] = False
    assert not changed.any()


def test_gif_has_the_same_frames_and_length(free_robot: Any, run_of: Callable[..., Any], tmp_path: Path) -> None:
    from PIL import Image

    path = tmp_path / "run.gif"
    found = sp.film(run_of(free_robot, duration=0.5), path, size=SIZE, fps=15)
    with Image.open(path) as image:
        assert (image.n_frames, image.size) == (found.frames, SIZE)
        times = []
        for number in range(image.n_frames):
            image.seek(number)
            times.append(image.info["duration"])
    assert sum(times) / 1000 == pytest.approx(found.duration, abs=0.005)
    assert set(times) <= {60, 70}


def test_too_few_frames_for_the_tail_are_warned_of(free_robot: Any, run_of: Callable[..., Any], tmp_path: Path) -> None:
    run, path = run_of(free_robot, duration=0.2, tail=2 * np.pi * 4.0), tmp_path / "run.mp4"
    found = sp.film(run, path, speed=1.0, **SMALL)
    assert found.turn_per_frame == pytest.approx(0.4)
    assert "turns by up to 0.4 turns a frame" in found.warnings[0]
    assert "use a speed of 0.5" in found.warnings[0]
    slower = sp.film(run, path, speed=0.5, **SMALL)
    assert slower.turn_per_frame == pytest.approx(0.2)
    assert slower.warnings == ()


def test_speed_that_is_left_open_shows_how_the_tail_turns(
    free_robot: Any, run_of: Callable[..., Any], tmp_path: Path
) -> None:
    path = tmp_path / "run.mp4"
    assert sp.film(run_of(free_robot, duration=0.4), path, **SMALL).speed == 1.0
    fast = sp.film(run_of(free_robot, duration=0.02, tail=2 * np.pi * 100.0), path, **SMALL)
    assert (fast.speed, fast.warnings) == (0.02, ())


def test_a_film_in_which_the_robot_hardly_moves_names_a_speed(
    free_robot: Any, run_of: Callable[..., Any], tmp_path: Path
) -> None:
    """The largest one that shows how the tail turns, and none that does not."""
    path, length = tmp_path / "run.mp4", free_robot.derived()["robot_length"].value
    slow = run_of(free_robot, speed=2e-3 * length, tail=2 * np.pi * 0.4)  # a quarter of a turn a frame: at 6.25 times
    (said,) = sp.film(slow, path, **SMALL).warnings
    assert said.code == "slow-film"
    assert "0.2 % of its length, in 1 s of film; `spirillum film` with a speed of 5 shortens it" in said
    assert sp.film(slow, path, speed=5.0, fps=100, **{k: v for k, v in SMALL.items() if k != "fps"}).warnings == ()
    assert sp.film(run_of(free_robot, speed=4e-3 * length, tail=2 * np.pi * 0.4), path, **SMALL).warnings == ()


def test_interrupted_film_leaves_nothing_behind(free_robot: Any, run_of: Callable[..., Any], tmp_path: Path) -> None:
    def stop(_what: str, done: int, _total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    for name in ("run.mp4", "run.gif"):
        with pytest.raises(KeyboardInterrupt):
            sp.film(run_of(free_robot), tmp_path / name, progress=stop, **SMALL)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"size": "321x180"}, "size = 321x180; allowed: even numbers"),
        ({"size": "10x10"}, "size = 10x10; allowed: WIDTHxHEIGHT"),
        ({"size": "wide"}, "size = 'wide'; allowed: WIDTHxHEIGHT"),
        ({"fps": 0}, "fps = 0; allowed"),
        ({"fps": 500}, "fps = 500; allowed: a whole number of frames a second from 1 to 120"),
        ({"speed": 0.0}, "speed = 0.0; allowed"),
        ({"speed": float("nan")}, "speed = nan; allowed"),
        ({"speed": 1e-5}, "makes 3000001 frames of 1 s; allowed: at most 20000, here a speed of 0.002 or more"),
        ({"speed": 100.0}, "makes one frame of 1 s; allowed: a speed of 1 or less"),
        ({"camera": "crane"}, "camera = 'crane'; allowed: auto, fixed, follow"),
        ({"view": "inside"}, "view = 'inside'"),
    ],
)
def test_wrong_option_is_named(
    free_robot: Any, run_of: Callable[..., Any], tmp_path: Path, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(sp.InputError) as error:
        sp.film(run_of(free_robot), tmp_path / "run.mp4", **options)
    assert words in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_a_film_says_how_fast_the_robot_swims() -> None:
    run = xr.Dataset({"mean_forward_velocity_on": 1.53456e-4})
    assert _about(run, "tube") == "model tube, mean velocity 0.1535 mm/s with the drive on"
    assert _about(run / 10.0, "") == "mean velocity 15.35 µm/s with the drive on"
    slow = run.assign(mean_tail_rotation_rate_on=2.0) / 10.0
    assert _about(slow, "") == "mean velocity 0.01535 mm/s with the drive on"  # as the answer of `simulate` gives it
    assert _about(xr.Dataset(), "tube") == "model tube"
