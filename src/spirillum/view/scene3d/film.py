"""Video of a run in three dimensions, by a fixed camera or one that follows the robot."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.argument_validation import as_pixels
from spirillum.arrays import Samples
from spirillum.display import DisplayMixin, percent
from spirillum.dynamics.run_file import Poses, RobotPose, open_run, poses_of, robot_of
from spirillum.errors import InputError, check_choice, check_range
from spirillum.files import MARK, atomic_write, output_target
from spirillum.notes import Note
from spirillum.progress import Progress, tell
from spirillum.robot.robot import Robot
from spirillum.swimming.motions import ASSUMPTION
from spirillum.units import display_unit, show
from spirillum.view.figures.scene import FAINT, INK, round_length
from spirillum.view.figures.style import COLOURS, with_micro
from spirillum.view.figures.trajectory import mean_velocity_in_words, silhouette
from spirillum.view.scene3d.rendering import FILMS, video_writer
from spirillum.view.scene3d.scenery import VIEWS, SceneCamera, fitted
from spirillum.view.scene3d.show import SIZES, glass_around, scene_points

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.view.scene3d.scene import DrawnRobot


_SIDE, _LEFT, _FOOT = 0.24, 0.125, 0.035  # of the square: side over a frame's height, left over its width, room below
_FINE = 3  # rendered pixels per displayed pixel, along each side (supersampling)
_RIM, _ROOM = 0.93, 0.90  # radius of the tube, outside and inside, over half of the square
_GLASS, _WATER, _BODY = "#5d7486", "#eef3f6", "#c9ced2"
_MOST = 600  # number of plotted points of the path


class CrossSection:
    """Inset with the cross-section, in all frames of a video: seen from the front, y to the right and z up."""

    def __init__(self, size: tuple[int, int], robot: Robot, poses: Poses) -> None:
        from matplotlib import font_manager
        from PIL import ImageFont

        assert robot.channel is not None  # noqa: S101 - the caller's promise
        self._robot, self._poses = robot, poses
        self._side = max(int(_SIDE * min(size[1], 0.5625 * size[0])), 16)
        left = int(_LEFT * size[0])
        foot = size[1] - int(_FOOT * size[1])
        self._box = np.s_[foot - self._side : foot, left : left + self._side]
        self._scale = _ROOM * 0.5 * self._side * _FINE / (0.5 * robot.channel.diameter)
        self._font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), max(int(0.085 * self._side), 6) * _FINE)

    def write(self, image: np.ndarray, time: float, pose: RobotPose) -> None:
        """Draw into a frame."""
        from PIL import Image, ImageDraw

        square = Image.fromarray(image[self._box]).resize((self._side * _FINE,) * 2)
        draw = ImageDraw.Draw(square)
        middle, rim = 0.5 * self._side * _FINE, _RIM * 0.5 * self._side * _FINE
        draw.ellipse([middle - rim, middle - rim, middle + rim, middle + rim], fill=_WATER, outline=_GLASS, width=6)
        body = self._pixels(silhouette(self._robot, pose.position, pose.attitude))
        draw.polygon(body, fill=_BODY, outline=INK, width=3)
        way = self._poses.position[self._poses.time <= time, 1:]
        way = np.concatenate([way[:: max(way.shape[0] // _MOST, 1)], pose.position[None, 1:]])
        draw.line(self._pixels(way), fill=COLOURS["blue"], width=5, joint="curve")
        x, y = self._pixels(pose.position[None, 1:])[0]
        draw.ellipse([x - 7, y - 7, x + 7, y + 7], fill=COLOURS["blue"])
        draw.text((middle, 0.25 * middle), "front", anchor="mm", font=self._font, fill=FAINT)
        image[self._box] = np.asarray(square.resize((self._side,) * 2, Image.Resampling.BOX))

    def _pixels(self, points: Samples) -> list[tuple[float, float]]:
        """Pixels of the fine square for y and z, m, (n, 2)."""
        middle = 0.5 * self._side * _FINE
        return [(middle + self._scale * float(y), middle - self._scale * float(z)) for y, z in points]


CAMERAS = ("auto", "fixed", "follow")  #: Motion of the camera; `auto`: it follows a robot that swims far enough.
_ALONG = ("front", "rear")  # views that show the cross-section themselves
_MOST_FRAMES = 20_000
_SLOWEST, _FASTEST = 1e-6, 1e4
_SLOW = 3e-3  # share of its length that a robot swims in a second of film, below which an audience sees no motion
_LARGEST_TURN = 0.25  # largest part of a tail's turn between two frames at which its sense can be seen (aliasing)


@dataclass(frozen=True, repr=False)
class Film(DisplayMixin):
    """Video file and its facts."""

    path: Path
    robot: Robot
    model: str
    frames: int
    size: tuple[int, int]
    fps: int
    speed: float  #: Time of the run over time of the video.
    follows: bool  #: Whether the camera follows the robot.
    turn_per_frame: float  #: Largest part of a turn of the tail between two frames.
    travelled: float  #: How far the robot swims in the run, m.
    warnings: tuple[Note, ...]
    assumption: str = ""  #: What the motion rests on, of a robot released in its tube.

    @property
    def duration(self) -> float:
        """Length of the video, s."""
        return self.frames / self.fps

    def to_dict(self) -> dict[str, Any]:
        """Content of ``film --json``."""
        camera = "follow" if self.follows else "fixed"
        return answer_of(self, camera=camera, tail_turn_per_frame=2.0 * np.pi * self.turn_per_frame)


def film(
    dataset: xr.Dataset | str | Path,
    path: str | Path,
    *,
    view: str = "perspective",
    size: str | tuple[int, int] = (1280, 720),
    fps: int = 30,
    speed: float | None = None,
    camera: str = "auto",
    progress: Progress | None = None,
) -> Film:
    """Render a video of a run; in a tube with the cross-section in a corner.

    Args:
        dataset: what `spirillum.simulate` returns, or the file with it.
        path: file to write, `.mp4` or `.gif`.
        view: `perspective`, or to scale `side`, `top`, `front`, `rear`.
        size: width and height in pixels, even numbers, or ``"1280x720"``.
        fps: frames a second, 1 to 120 (a GIF: to 50).
        speed: time of the run over time of the film: 0.5 is slow motion. None: 1, or as slow as it takes to see how
            the tail turns.
        camera: `fixed`, `follow`, or `auto`: it follows a robot that swims further than half of its length.
        progress: called with stage, number done, and total.

    Returns:
        What was written, with a warning where the frames are too few to see the sense of the tail's rotation.

    Raises:
        InputError: for wrong input, a run that cannot be shown, or a machine that cannot draw.
    """
    target = output_target(path, FILMS, "run.mp4")
    check_choice("view", view, VIEWS)
    pixels = _even(as_pixels(size, *SIZES))
    _check_pace(fps, 1.0 if speed is None else speed, target.suffix.lower())
    check_choice("camera", camera, CAMERAS)
    if isinstance(dataset, (str, Path)):
        dataset = open_run(dataset)
    robot = robot_of(dataset)
    from spirillum.view.scene3d.scene import DrawnRobot, level_height

    solids = DrawnRobot.of(robot)
    poses = poses_of(dataset, level_height(solids))
    # Real time, or a slower speed at which the tail's turning is seen.
    speed = min(_fastest(poses, fps), 1.0) if speed is None else float(speed)
    times = _frame_times(poses, fps, speed)
    follows = camera == "follow" or (camera == "auto" and poses.travelled > 0.5 * solids.length)
    turn, warnings = _aliasing(poses, times, speed)
    warnings += _slowness(poses, fps, speed, solids.length)
    released = "azimuth" in dataset and robot.channel is not None
    model = str(dataset.attrs.get("model", ""))[:60]
    words = {"title": robot.name, "comment": f"computed motion and geometry, {MARK}"}
    inset = None
    if released and view not in _ALONG:
        inset = CrossSection(pixels, robot, poses)
    shots = _Shots(solids, poses, view, pixels, follows, _channel_centre(dataset), inset)
    with atomic_write(target) as temporary, video_writer(temporary, pixels, fps, words) as writer:
        about = ", ".join(filter(None, (_about(dataset, model), ASSUMPTION if released else "")))
        with closing(shots.images(times, about, speed)) as images:
            for number, image in enumerate(images):
                tell(progress, "film", number, times.size)
                writer.add(image)
        tell(progress, "film: writing", times.size, times.size)
    return Film(
        target, robot, model, times.size, pixels, fps, speed, follows, turn, poses.travelled, warnings,
        assumption=ASSUMPTION if released else "",
    )  # fmt: skip


def _about(dataset: xr.Dataset, model: str) -> str:
    """Line below the title: the model, and how fast the robot swims."""
    return ", ".join([*([f"model {model}"] if model else []), *map(with_micro, mean_velocity_in_words(dataset))])


@dataclass
class _Shots:
    """Frames of a video: scene and view."""

    solids: DrawnRobot
    poses: Poses
    view: str
    size: tuple[int, int]
    follows: bool
    middle: float | None  # of the channel, m
    inset: CrossSection | None

    def __post_init__(self) -> None:
        in_glass = self.solids.robot.channel is not None
        self._free = np.array([1.0, 0.0, 0.0]) if in_glass else np.ones(3)
        """Directions in which the camera follows: in a channel along its axis."""
        x, beyond = self.poses.position[:, 0], 1.5 * self.solids.length if self.follows else 0.0
        self._glass = glass_around(self.solids, float(x.min()) - beyond, float(x.max()) + beyond, self.middle)
        self._camera, self._rows = self._framed()

    def _framed(self) -> tuple[SceneCamera, int | None]:
        """Camera of the first frame, and the rows about the middle that contain the content of all frames."""
        several = [self.poses.at(float(time)) for time in np.linspace(self.poses.time[0], self.poses.time[-1], 60)]
        glass = self._glass
        if self.follows:
            start = several[0].position
            several = [pose._replace(position=pose.position - self._free * (pose.position - start)) for pose in several]
            glass = glass_around(self.solids, float(start[0]), float(start[0]))
        points = np.concatenate([scene_points(self.solids, pose, glass) for pose in several])
        camera = fitted(self.view, points, self.size)
        if self.follows and self._glass is not None:
            points = np.concatenate([points, scene_points(self.solids, several[0], self._glass)])
        height = camera.pixels(points, self.size)[:, 1] - 0.5 * self.size[1]
        rows = 2 * int(np.ceil(np.abs(height).max()) + 4)
        return camera, rows if self._glass is not None and rows < self.size[1] else None

    def images(self, times: Samples, line: str, speed: float) -> Generator[np.ndarray]:
        """The frames at times of the run."""
        from spirillum.view.scene3d.overlay import Stamp, blended_into, scale_bar, words_on
        from spirillum.view.scene3d.scene import Scene

        first = self.poses.at(float(times[0]))
        bar = scale_bar(self._camera, self.size, first.position)
        lines = [text for text in (line, "computed motion and geometry") if text]
        words = blended_into(words_on(self.size, self._camera, bar, self.solids.robot.name, lines))
        stamp = Stamp(self.size, times, speed)
        with Scene(self.solids, self.size, glass=self._glass, rows=self._rows, quick=True) as scene:
            if self._glass is None:
                corners = self.solids.corners(self.poses.at(float(self.poses.time[0]))) - self.poses.position[0]
                path = self.poses.position
                low, high = path.min(axis=0) + corners.min(axis=0), path.max(axis=0) + corners.max(axis=0)
                scene.add_grid(self.view, low, high)
            for time in times:
                pose = self.poses.at(float(time))
                scene.place(pose)
                shift = (pose.position - first.position) * self._free
                scene.look(self._camera.moved(shift) if self.follows else self._camera)
                image = words(scene.image())
                stamp.write(image, float(time))
                if self.inset is not None:
                    self.inset.write(image, float(time), pose)
                yield image


def _channel_centre(dataset: xr.Dataset) -> float | None:
    """Position of the channel's middle in the run, m."""
    try:
        middle = float(dataset.attrs.get("channel_middle", np.nan))
    except (TypeError, ValueError):
        return None  # it decides only how far the glass is drawn
    return middle if np.isfinite(middle) else None


def _even(size: tuple[int, int]) -> tuple[int, int]:
    if size[0] % 2 or size[1] % 2:
        raise InputError(f"size = {size[0]}x{size[1]}; allowed: even numbers, which the video encoder requires")
    return size


def _check_pace(fps: int, speed: float, suffix: str) -> None:
    most = 50 if suffix == ".gif" else 120
    if isinstance(fps, bool) or int(fps) != fps or not 1 <= fps <= most:
        raise InputError(f"fps = {fps}; allowed: a whole number of frames a second from 1 to {most} for {suffix}")
    check_range("speed", speed, _SLOWEST, _FASTEST, " seconds of the run per second of video")


def _frame_times(poses: Poses, fps: int, speed: float) -> Samples:
    """Times of the run at the frames, from its start to its end."""
    count = int(np.floor(poses.duration / speed * fps * (1.0 + 1e-12))) + 1
    if count > _MOST_FRAMES:
        exact = poses.duration * fps / _MOST_FRAMES
        least = next(step for factor in (1.0, 2.0, 2.5, 5.0) if (step := round_length(exact) * factor) >= exact)
        raise InputError(
            f"speed = {speed:g} makes {count} frames of {poses.duration:.4g} s; allowed: at most {_MOST_FRAMES}, "
            f"here a speed of {least:g} or more"
        )
    if count < 2:
        raise InputError(
            f"speed = {speed:g} makes one frame of {poses.duration:.4g} s; allowed: a speed of "
            f"{round_length(poses.duration * fps / 30):g} or less"
        )
    return np.asarray(poses.time[0] + np.arange(count) * (speed / fps), dtype=float)


def _fastest(poses: Poses, fps: int) -> float:
    """The largest speed of 1, 2 or 5 times a power of ten at which the tail's turning is seen."""
    rate = float(np.abs(np.diff(poses.tail_angle) / np.diff(poses.time)).max()) / (2.0 * np.pi)
    return float(np.clip(round_length(_LARGEST_TURN * fps / max(rate, _SLOWEST)), _SLOWEST, _FASTEST))


def _slowness(poses: Poses, fps: int, speed: float, length: float) -> tuple[Note, ...]:
    """A note on a film in which the robot hardly moves, with a speed that shows more of it."""
    fastest = _fastest(poses, fps)
    if poses.travelled > _SLOW * length * poses.duration / speed or fastest < 2.0 * speed:
        return ()
    way, share = show(poses.travelled, display_unit(poses.travelled, "m")), percent(poses.travelled / length)
    seconds = f"{poses.duration / speed:.3g} s"
    return (Note.named("slow-film", way=way, share=share, seconds=seconds, fastest=fastest),)


def _aliasing(poses: Poses, times: Samples, speed: float) -> tuple[float, tuple[Note, ...]]:
    """Largest part of a turn between two frames, and a warning where it is too much."""
    angle = np.interp(times, poses.time, poses.tail_angle)
    turn = float(np.abs(np.diff(angle)).max()) / (2.0 * np.pi)
    if turn <= _LARGEST_TURN:
        return turn, ()
    slower = round_length(speed * _LARGEST_TURN / turn)
    return turn, (Note.named("tail-aliased", turn=turn, slower=slower),)
