"""A virtual trial: a video of a swimming robot as the experiment's camera sees it, with its setup and the truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.answer import envelope, quantity
from spirillum.errors import InputError
from spirillum.files import whole_file, write_dataset
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option
from spirillum.version import versions
from spirillum.virtual.degradation import Degradation, degradation_of
from spirillum.virtual.disturbances import Disturbances, tilt_of
from spirillum.virtual.film import FrameWriter, mp4_writer, png_writer
from spirillum.virtual.frames import Frames
from spirillum.virtual.lens import Lens
from spirillum.virtual.motion import Motion, motion_of, reach_of
from spirillum.virtual.options import (
    DIRECTIONS,
    VIEWS,
    checked_axis,
    checked_distortion,
    checked_fps,
    checked_heading,
    checked_seed,
    checked_size,
    one_of,
    signed_length,
    video_target,
)
from spirillum.virtual.painter import Painter
from spirillum.virtual.robot_file import is_preset, robot_text
from spirillum.virtual.tank import Tank, tank_of
from spirillum.virtual.trajectory import Way
from spirillum.virtual.truth import SYNTHETIC, names_beside, rate_quantities, setup_text, truth_dataset, truth_text

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["EYE", "FOCAL", "INDEX", "SURFACE", "VirtualTrial", "render", "room"]

SURFACE = 60e-3
"""Height of the oil's surface above the reference plane, m; assumed."""
EYE = SURFACE + 150e-3
"""Height of the lens: 150 mm above the oil, as the paper has its camera above the tank."""
INDEX = 1.40
"""Refractive index of silicone oil."""
FOCAL = 740.0 / 640.0
"""Focal length over the picture's width; assumed."""
_SPACING = 2e-3
_SIDE_AXIS = 30e-3
_MOST_FRAMES = 200_000
_SMALLEST, _LONGEST = 24, 2.0
"""Shortest robot in pixels, longest in widths of the picture."""


@dataclass(frozen=True)
class VirtualTrial:
    """A virtual trial that was written."""

    path: Path
    """The video, or the folder of frames."""
    setup: Path
    """The setup file."""
    truth: Path
    """The truth, JSON; beside it the truth on every frame (NetCDF)."""
    robot: Robot
    rates: Mapping[str, float]
    """True `forward_velocity`, `body_rotation_rate`, `tail_rotation_rate`, `motor_rotation_rate`, SI."""
    model: str
    """Whose motion it is."""
    frames: int
    """Number of frames in the video."""
    dropped: int
    """Number of frames that were lost."""
    size: tuple[int, int]
    """Width and height, pixels."""
    fps: float
    """Frames a second."""
    seed: int
    """Of all random numbers."""
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The trial's facts, as ``render --json`` prints them."""
        content = {
            "robot": self.robot.name,
            "synthetic": True,
            "model": self.model,
            "video": str(self.path),
            "setup": str(self.setup),
            "truth": str(self.truth),
            **rate_quantities(self.rates),
            "frames": self.frames,
            "dropped": self.dropped,
            "width": self.size[0],
            "height": self.size[1],
            "frames_per_second": self.fps,
            "seed": self.seed,
        }
        return envelope("virtual-trial", content, self.warnings)


def render(
    robot: str | Path | Mapping[str, Any] | Robot,
    path: str | Path,
    *,
    model: str = "sbt",
    tail_rate: str | float | None = None,
    friction: str | None = None,
    forward_velocity: str | float | None = None,
    body_rate: str | float | None = None,
    run: xr.Dataset | str | Path | None = None,
    duration: str | float = 20.0,
    start: str | float | None = None,
    lateral: str | float = 0.0,
    heading: str | float = 0.0,
    wobble: str | float = 0.0,
    body_angle: str | float = 0.0,
    tail_phase: str | float = 0.0,
    gap: str | float = 0.5e-3,
    view: str = "top",
    direction: str = "right",
    fps: float = 30.0,
    size: str | tuple[int, int] = (640, 480),
    exposure: str | float = 1.0 / 120.0,
    distortion: float = -0.02,
    degradation: str | Degradation = "clean",
    seed: int = 0,
    depth_error: str | float = 0.0,
    depth_uncertainty: str | float = 0.0,
    setup: str | Path | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> VirtualTrial:
    """Render a video of a swimming robot as an experiment's camera sees it; all of it is synthetic.

    Beside `trial.mp4` lie `trial.setup.toml` (what an experimenter knows), `trial.truth.json` and `trial.truth.nc`.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        path: the video (`.mp4`), or a new folder of PNG files (without an ending).
        model: whose steady motion it is, `sbt`, `rft`, `slender` or `tube`.
        tail_rate: lab rotation rate of the tail, with its unit or a float in rad/s; else the robot's drive.
        friction: reading of the friction; None: the robot's own.
        forward_velocity: instead of the model's, with its unit or a float in m/s.
        body_rate: lab rotation rate of the body instead of the model's, with its unit or a float in rad/s.
        run: a run of `spirillum.simulate` instead, or its file.
        duration: of the video, with its unit or a float in s.
        start: x of the body's mid-length at the first frame, from below the lens; None: its way is in mid-picture.
        lateral: horizontal offset across the channel (y of the lab, forward x and upward z), with its unit or in m.
        heading: angle of the robot's axis to the channel in the picture's plane, at most 45 degrees, with its unit or
            in rad.
        wobble: amplitude of a motion across the channel at the tail's rate, in the picture's plane, with its unit or
            in m.
        body_angle: of the body at the first frame.
        tail_phase: of the tail at the first frame.
        gap: between body and tube, with its unit or in m; a run has its own.
        view: `top` or `side`.
        direction: where the nose points in the picture, `right` or `left`.
        fps: frames a second.
        size: width and height in pixels, even numbers, or ``"640x480"``.
        exposure: of each frame, with its unit or a float in s.
        distortion: coefficient k1 of the lens's radial distortion, -0.5 to 0.5.
        degradation: `clean`, `degraded`, or a `Degradation`.
        seed: of all random numbers.
        depth_error: by which the setup's height of the robot's axis is wrong on purpose; it stays in the oil.
        depth_uncertainty: standard uncertainty of that height that the setup states.
        setup: the setup file; None: beside the video.
        progress: told what is done, how many frames are done, and how many there are.

    Returns:
        What was written.

    Raises:
        InputError: for wrong input, or a target that cannot be written.
    """
    target, pixels, rate = video_target(path), checked_size(size), checked_fps(fps)
    seen_from = one_of("view", view, VIEWS)
    leftwards = one_of("direction", direction, DIRECTIONS) == "left"
    what, seed = degradation_of(degradation), checked_seed(seed)
    bend, turned = checked_distortion(distortion), checked_heading(heading)
    open_for = parse_option("exposure", exposure, KINDS["time"])
    if open_for > 1.0 / rate:
        raise InputError(f"exposure = {open_for:.4g} s; allowed: at most the {1.0 / rate:.4g} s of a frame")
    motion = motion_of(
        robot,
        run=run,
        model=model,
        tail_rate=tail_rate,
        friction=friction,
        forward_velocity=forward_velocity,
        body_rate=body_rate,
        duration=duration,
        view=seen_from,
        leftwards=leftwards,
        placement={
            "gap": parse_option("gap", gap, KINDS["length or zero"]),
            "lateral": signed_length("lateral", lateral),
            "heading": turned,
            "wobble": parse_option("wobble", wobble, KINDS["length or zero"]),
            "body_angle": parse_option("body_angle", body_angle, KINDS["angle"]),
            "tail_phase": parse_option("tail_phase", tail_phase, KINDS["angle"]),
        },
        side_axis=_SIDE_AXIS,
    )
    loaded = motion.robot
    tank = tank_of(loaded, seen_from, _SPACING, _SIDE_AXIS)
    lens = Lens(
        EYE,
        SURFACE,
        INDEX,
        FOCAL * pixels[0],
        pixels,
        leftwards=leftwards,
        tilt=tilt_of(what, seed),
        distortion=(bend, 0.0),
    )
    _check_fits(loaded, tank, lens)
    way = _placed(motion, lens, None if start is None else signed_length("start", start))
    count = math.floor(way.duration * rate * (1.0 + 1e-12)) + 1
    if not 2 <= count <= _MOST_FRAMES:
        raise InputError(f"duration = {way.duration:g} s makes {count} frames; allowed: 2 to {_MOST_FRAMES} frames")
    body = (loaded.body.length, loaded.body.diameter)
    top = min(tank.tube_height + 0.8 * (tank.tube or 1.5 * body[1]), 0.95 * SURFACE)
    troubles = Disturbances(what, seed, lens, way.duration, body, top)
    kept = np.flatnonzero(troubles.kept(count))
    names = names_beside(target) if setup is None else names_beside(target, Path(setup))
    robot_file = loaded.name if is_preset(loaded) else names["robot"].name
    known = setup_text(
        robot_file,
        view=seen_from,
        direction=direction,
        eye=EYE,
        surface=SURFACE,
        index=INDEX,
        spacing=_SPACING,
        axis=checked_axis(float(way.position[:, 2].mean()), depth_error, SURFACE),
        axis_uncertainty=parse_option("depth_uncertainty", depth_uncertainty, KINDS["length or zero"]),
        fps=None if target.suffix == ".mp4" else rate,
    )
    rates = way.rates()
    facts = {
        "robot": loaded.name,
        "model": motion.model,
        "seed": seed,
        "degradation": what.to_dict(),
        "frames": len(kept),
        "dropped": count - len(kept),
        "frames_per_second": rate,
        "exposure": quantity(open_for, "s"),
        "view": seen_from,
        "direction": direction,
        "camera": {
            "height": quantity(EYE, "m"),
            "surface": quantity(SURFACE, "m"),
            "index": INDEX,
            "focal_length_pixels": lens.focal,
            "tilt": quantity(list(lens.tilt), "rad"),
            "distortion": list(lens.distortion),
        },
        "made_with": versions(),
    }
    words = {"title": f"{loaded.name}, synthetic", "comment": SYNTHETIC}
    truth = truth_dataset(way, kept / rate, kept, {"title": words["title"], "synthetic": "yes", "robot": loaded.name})
    texts = {"setup": known, "json": truth_text(rates, facts)}
    if robot_file != loaded.name:
        texts["robot"] = robot_text(loaded)
    tell = progress or (lambda _what, _done, _total: None)
    frames = Frames(Painter(loaded, tank, lens), troubles, way, open_for, what.noise)
    with ExitStack() as files:  # all of them appear together, or none
        for name, text in texts.items():
            files.enter_context(whole_file(names[name])).write_text(text, encoding="utf-8")
        write_dataset(truth, files.enter_context(whole_file(names["nc"])))
        writer = files.enter_context(_writer(target, pixels, rate, what.crf, words))
        _write_frames(writer, frames, kept, rate, tell)
        tell("render: writing", len(kept), len(kept))
    return VirtualTrial(
        path=target,
        setup=names["setup"],
        truth=names["json"],
        robot=loaded,
        rates=rates,
        model=motion.model,
        frames=len(kept),
        dropped=count - len(kept),
        size=pixels,
        fps=rate,
        seed=seed,
        warnings=motion.warnings,
    )


def _write_frames(
    writer: FrameWriter, frames: Frames, kept: np.ndarray, fps: float, tell: Callable[[str, int, int], None]
) -> None:
    """Draw a frame while the one before it is encoded."""
    with ThreadPoolExecutor(1) as encoder:
        before: Future[None] | None = None
        for done, number in enumerate(kept):
            tell("render", done, len(kept))
            image = frames.image(number / fps)
            if before is not None:
                before.result()
            before = encoder.submit(writer.add, image, int(number))
        if before is not None:
            before.result()


def _check_fits(robot: Robot, tank: Tank, lens: Lens) -> None:
    """The robot is large enough for this camera, and its tube small enough for the tank.

    Raises:
        InputError: if not.
    """
    if tank.tube is not None and tank.tube_height + tank.outside >= lens.surface:
        most = 1e3 * (lens.surface - 2.0 * (tank.outside - tank.tube))
        raise InputError(
            f"channel.diameter = {2e3 * tank.tube:.4g} mm; allowed: less than {most:.4g} mm, a tube under the oil"
        )
    ends, (rear, nose) = _seen_ends(lens, tank.tube_height), reach_of(robot)
    width, length = ends[1] - ends[0], nose - rear
    low, high = _SMALLEST / lens.size[0] * width, _LONGEST * width
    if not low <= length <= high:
        allowed = f"{1e3 * low:.3g} to {1e3 * high:.4g} mm, which this camera can show"
        raise InputError(f"{robot.name} is {1e3 * length:.4g} mm long; allowed: {allowed}")


def room(robot: Robot, view: str, size: tuple[int, int], *, leftwards: bool) -> tuple[float, float]:
    """Smallest and largest x of the body's mid-length at which all of a robot is in the picture, m.

    Args:
        robot: a checked robot.
        view: `top` or `side`.
        size: width and height of the picture, pixels.
        leftwards: whether the nose points to the left in the picture.
    """
    lens = Lens(EYE, SURFACE, INDEX, FOCAL * size[0], size, leftwards=leftwards)
    ends = _seen_ends(lens, tank_of(robot, view, _SPACING, _SIDE_AXIS).tube_height)
    rear, nose = reach_of(robot)
    return ends[0] - rear, ends[1] - nose


def _seen_ends(lens: Lens, height: float) -> tuple[float, float]:
    """Smallest and largest x in the picture's middle row at a height, m."""
    middle = 0.5 * (lens.size[1] - 1)
    ends = lens.points(np.array([[0.0, middle], [lens.size[0] - 1.0, middle]]), height)[:, 0]
    return float(ends.min()), float(ends.max())


def _placed(motion: Motion, lens: Lens, start: float | None) -> Way:
    """The way with its first x as wanted, or such that all of it is seen as far in mid-picture as can be.

    Raises:
        InputError: if the robot is out of the picture all the time.
    """
    way, x = motion.way, motion.way.position[:, 0]
    ends = _seen_ends(lens, float(way.position[:, 2].mean()))
    rear, nose = reach_of(motion.robot)
    if start is None:
        shift = 0.5 * (ends[0] - rear - float(x.min()) + ends[1] - nose - float(x.max()))
    else:
        shift = start - float(x[0])
    if x.max() + shift + nose < ends[0] or x.min() + shift + rear > ends[1]:
        first = 1e3 * (float(x[0]) + shift)
        raise InputError(f"start = {first:.4g} mm: the robot is never in the picture; allowed: nearer to 0")
    return way.shifted(shift)


@contextmanager
def _writer(target: Path, size: tuple[int, int], fps: float, crf: int, words: dict[str, str]) -> Iterator[FrameWriter]:
    if target.suffix == ".mp4":
        rate = Fraction(fps).limit_denominator(1001)
        with whole_file(target) as temporary, mp4_writer(temporary, size, rate, crf, words) as writer:
            yield writer
    else:
        with png_writer(target, words) as writer:
            yield writer
