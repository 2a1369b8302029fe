"""A virtual trial: a video of a swimming robot as the experiment's camera sees it, with its setup and the truth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.display import DisplayMixin, percent
from spirillum.envelope import quantity
from spirillum.errors import InputError
from spirillum.files import (
    MARK,
    atomic_folder,
    atomic_write,
    atomic_write_all,
    guard_inputs,
    holds_only_own_files,
    output_target,
    writable_target,
    write_dataset,
)
from spirillum.formats.h264 import H264Writer, h264_writer
from spirillum.notes import Note
from spirillum.progress import Progress, tell
from spirillum.robot.fields import field_values
from spirillum.robot.load import is_preset, load
from spirillum.robot.robot import Robot, robot_text
from spirillum.swimming.motions import HELD, RELEASED
from spirillum.swimming.preparation import AUTO
from spirillum.units import display_unit, show
from spirillum.version import versions
from spirillum.virtual.artifacts import (
    Degradation,
    Troubles,
    ViewArtifacts,
    counted_frames,
    stripe_edges,
    with_troubles,
)
from spirillum.virtual.disturbances import Disturbances, tilt_of
from spirillum.virtual.motion import TrialMotion, motion_of, motion_of_run, motion_of_trial
from spirillum.virtual.optics import VirtualLens, check_size, framed, lens_of, out_of_picture, tank_of
from spirillum.virtual.pictures import FrameEncoder, Painter
from spirillum.virtual.trajectory import TrialTrajectory
from spirillum.virtual.trial_options import CameraOptions, MotionOptions, Seeded, SetupErrors, TrialOptions
from spirillum.virtual.truth import SYNTHETIC, companion_paths, setup_text, truth_dataset, truth_text

if TYPE_CHECKING:
    import xarray as xr


_QUALITY = {"preset": "veryfast", "x264-params": "mbtree=0"}
"""With `mbtree`, small pictures now and then gave different bytes from equal frames."""
_THREADS = 2  # threads of the encoder, a fixed number, so that a seed determines the bytes


def video_target(path: str | Path) -> Path:
    """The video to write, or the folder for its frames."""
    path = Path(path)
    if path.suffix:
        return output_target(path, {".mp4": "a video, or a folder without an ending"}, "trial.mp4")
    if not path.is_dir():
        writable_target(path)
    if path.exists() and not (path.is_dir() and holds_only_own_files(path)):
        raise InputError(f"{path} is there and not empty; allowed: a new folder for the frames, or a .mp4")
    return path


@contextmanager
def video_writer(
    target: Path, size: tuple[int, int], fps: float, crf: int, tags: Mapping[str, str]
) -> Iterator[H264Writer | _Pngs]:
    """A writer of a video; it appears, complete, when the block ends."""
    if target.suffix.lower() != ".mp4":
        with atomic_folder(target) as part:
            yield _Pngs(part, tags)
        return
    with (
        atomic_write(target) as temporary,
        h264_writer(
            temporary,
            size,
            Fraction(fps).limit_denominator(1001),
            tags,
            quality=_QUALITY | {"crf": str(crf)},
            threads=_THREADS,
            encoders=("libx264",),  # others have no constant rate factor
            instead="a folder of PNG files",
            extra="video",
        ) as writer,
    ):
        yield writer


class _Pngs:
    """Writes frames as PNG files into a folder."""

    def __init__(self, folder: Path, tags: Mapping[str, str]) -> None:
        self._folder, self._tags = folder, tags

    def add(self, image: np.ndarray, number: int) -> None:
        """Write a frame under its number."""
        from PIL import Image, PngImagePlugin

        info = PngImagePlugin.PngInfo()
        info.add_text("Software", MARK)
        for name, text in self._tags.items():
            info.add_itxt(name.capitalize(), text)
        Image.fromarray(image).save(self._folder / f"{number:05d}.png", compress_level=1, pnginfo=info)


_MOST_FRAMES = 200_000
_SLOW = 3e-3  # share of its length that a robot swims in a second, below which an audience sees no motion
_LEAST_DEPTH = 1e-6  # least distance of the stated axis from the floor and from the oil's surface, m


@dataclass(frozen=True, repr=False)
class VirtualTrial(DisplayMixin):
    """A virtual trial that was written."""

    path: Path  #: The video, or the folder of frames.
    setup: Path  #: The setup file.
    truth: Path  #: The truth, JSON; beside it the truth on every frame (NetCDF).
    robot: Robot
    rates: Mapping[str, float]
    """True `forward_velocity`, `body_rotation_rate`, `tail_rotation_rate`, `motor_rotation_rate`, SI."""
    model: str  #: Model, `prescribed`, or `run`: the source of the motion.
    frames: int  #: Number of frames in the video.
    dropped: int  #: Number of frames that were lost.
    size: tuple[int, int]  #: Width and height, pixels.
    fps: float  #: Frames a second.
    seed: int  #: Of all random numbers.
    warnings: tuple[Note, ...] = ()
    model_reason: str = ""  #: Why the model was taken; empty where it was named.
    motion: str = HELD  #: `held`, `trial`, `run`, or `prescribed`.
    assumption: str = ""  #: What the motion rests on, of a robot released in its tube.


def _check_not_of_run(*given: MotionOptions | TrialOptions) -> None:
    """Refuse options that a run determines: all of a motion, and of a trial all but its length and start position."""
    for options in given:
        usual = type(options)()
        for item in field_values(options):
            if item.path not in ("duration", "start") and item.value not in (getattr(usual, item.path), AUTO):
                named = f"{item.path} = {item.text}"
                raise InputError(f"{named} with a run, which has its own; allowed: duration and start alone")


def _shown(
    robot: str | Path | Mapping[str, Any] | Robot | None,
    run: xr.Dataset | str | Path | None,
    motion: MotionOptions,
    trial: TrialOptions,
    camera: CameraOptions,
    progress: Progress | None,
) -> tuple[Robot, TrialMotion]:
    from spirillum.dynamics.run_file import open_run, robot_of

    if run is None or (isinstance(run, str | Path) and str(run) == RELEASED):
        if robot is None:
            raise InputError("no robot; allowed: a preset's name or a robot file, or a run, which has its own")
        own = load(robot)
        if run is None:
            return own, motion_of(own, motion, trial, camera)
        return own, motion_of_trial(own, motion, trial, camera, progress)
    dataset = open_run(run) if isinstance(run, str | Path) else run
    _check_not_of_run(motion, trial)
    own = robot_of(dataset) if robot is None else load(robot)
    return own, motion_of_run(own, dataset, trial, camera)


def render(
    robot: str | Path | Mapping[str, Any] | Robot | None,
    path: str | Path,
    *,
    motion: MotionOptions | Mapping[str, Any] | None = None,
    run: xr.Dataset | str | Path | None = None,
    trial: TrialOptions | Mapping[str, Any] | None = None,
    camera: CameraOptions | Mapping[str, Any] | None = None,
    degradation: str | Degradation | Mapping[str, Any] | None = None,
    setup_errors: SetupErrors | Mapping[str, Any] | None = None,
    troubles: str | Troubles | Mapping[str, Any] | None = None,
    setup: str | Path | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> VirtualTrial:
    """Render a video of a swimming robot as an experiment's camera sees it; all of it is synthetic.

    Beside `trial.mp4` lie `trial.setup.toml` (what an experimenter knows), `trial.truth.json` and `trial.truth.nc`.
    Options are given by name, ``camera={"view": "side", "exposure": "5 ms"}``, or as models; quantities have their
    unit or are floats in SI.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot; None: that of the run.
        path: the video (`.mp4`), or a new folder of PNG files (without an ending).
        motion: `MotionOptions`: the model of steady swimming, and prescribed rates.
        run: instead of steady swimming at a held pose, a run of `spirillum.simulate` or its file; or `trial`: that of
            the robot's trial in its tube.
        trial: `TrialOptions`: duration, and the robot's pose at the first frame.
        camera: `CameraOptions`: view, direction, frame rate, size of the picture, exposure, field of view, distortion.
        degradation: `clean`, `degraded`, or `Degradation`: noise, compression, lost frames, ...
        setup_errors: `SetupErrors`: by how much the setup's height of the robot's axis is wrong on purpose.
        troubles: of a real bench: `Troubles`, or names such as ``"lost-frames,handheld,noise"``.
        setup: the setup file; None: beside the video.
        seed: of all random numbers.
        progress: called with stage, number done, and total.

    Returns:
        What was written.

    Raises:
        InputError: for wrong input, or a target that cannot be written.
    """
    inputs = [item for item in (robot, run) if isinstance(item, (str, Path)) and item != RELEASED]
    with guard_inputs(*inputs):
        target = video_target(path)
        names = companion_paths(target) if setup is None else companion_paths(target, Path(setup))
        for name in ("setup", "json", "nc"):
            writable_target(names[name])
    motion, trial, camera = MotionOptions.of(motion), TrialOptions.of(trial), CameraOptions.of(camera)
    troubles, degradation = with_troubles(troubles, degradation)
    degradation = degradation if target.suffix.lower() == ".mp4" else degradation.uncompressed()
    seed, setup_errors = Seeded.of({"seed": seed}).seed, SetupErrors.of(setup_errors)
    robot, shown = _shown(robot, run, motion, trial, camera, progress)
    tank = tank_of(robot, camera.view, camera.shrunk, grid=troubles.grid_paper)
    lens = lens_of(camera, tilt_of(degradation, seed))
    check_size(robot, tank, lens)
    trajectory = framed(shown.trajectory, robot, lens, trial.start)
    count = math.floor(trajectory.duration * camera.fps * (1.0 + 1e-12)) + 1
    if not 2 <= count <= _MOST_FRAMES:
        length = f"duration = {trajectory.duration:g} s makes {count} frames"
        raise InputError(f"{length}; allowed: 2 to {_MOST_FRAMES} frames")
    disturbances = Disturbances.of_robot(degradation, seed, lens, trajectory.duration, robot, tank)
    kept, counted = counted_frames(troubles, np.flatnonzero(disturbances.retained_frames(count)), camera.fps, seed)
    robot_file = robot.name if is_preset(robot) else names["robot"].name
    height = _stated_height(float(trajectory.position[:, 2].mean()), setup_errors.depth_error, lens.surface)
    axis = height, setup_errors.depth_uncertainty
    idle_seed = seed and degradation == Degradation(crf=degradation.crf) and not troubles.uses_seed
    written = VirtualTrial(
        path=target,
        setup=names["setup"],
        truth=names["json"],
        robot=robot,
        rates=trajectory.rates(),
        model=shown.model,
        frames=len(kept),
        dropped=count - len(kept),
        size=camera.size,
        fps=camera.fps,
        seed=seed,
        model_reason=shown.reason,
        motion=shown.motion,
        assumption=shown.assumption,
        warnings=(
            *shown.warnings,
            *_slowness(trajectory, robot),
            *out_of_picture(trajectory, robot, lens),
            *([Note.named("idle-seed", seed=seed)] if idle_seed else []),
        ),
    )
    tags = {"title": f"{robot.name}, synthetic", "comment": SYNTHETIC}
    attributes = {"title": tags["title"], "synthetic": "yes", "robot": robot.name}
    truth = truth_dataset(trajectory, kept / camera.fps, kept, attributes)
    timed, glass = target.suffix.lower() == ".mp4", troubles.glass_cover
    texts = {
        "setup": setup_text(robot_file, camera, lens, tank.spacing, axis, timed=timed, glass=glass),
        "json": truth_text(written.rates, _facts(written, camera, degradation, troubles, lens)),
    }
    if robot_file != robot.name:
        texts["robot"] = robot_text(robot)
    stripes = len(robot.seal.stripes) if robot.seal is not None else 0
    edges = stripe_edges(troubles, stripes, seed) if troubles.uneven_stripes and stripes else None
    painter = Painter(robot, tank, lens, edges, covered=troubles.glass_cover)
    frames = FrameEncoder(
        painter, disturbances, trajectory, camera.exposure, ViewArtifacts(troubles, seed, camera.size)
    )
    beside = {names[name]: text for name, text in texts.items()}
    with (
        guard_inputs(*inputs),
        atomic_write_all([*beside, names["nc"]]) as parts,  # all of them appear together, or none
        video_writer(target, camera.size, camera.fps, degradation.crf, tags) as writer,
    ):
        for file, text in beside.items():
            parts[file].write_text(text, encoding="utf-8")
        write_dataset(truth, parts[names["nc"]])
        _write_frames(writer, frames, (kept, counted), camera.fps, progress)
        tell(progress, "render: writing", len(kept), len(kept))
    return written


def _slowness(trajectory: TrialTrajectory, robot: Robot) -> list[Note]:
    """A note on a video in which a robot hardly moves: it is none for an audience."""
    way, length = float(np.ptp(trajectory.position[:, 0])), robot.derived()["robot_length"].value
    if way > _SLOW * length * trajectory.duration:
        return []
    shown = show(way, display_unit(way, "m"))
    seconds = f"{trajectory.duration:.3g} s"
    return [Note.named("slow-video", way=shown, share=percent(way / length), seconds=seconds)]


def _stated_height(height: float, error: float, surface: float) -> float:
    """Height of the robot's axis as the setup states it, m: wrong by an error, but between floor and surface."""
    if not _LEAST_DEPTH <= height + error <= surface - _LEAST_DEPTH:
        low, high = -1e3 * height, 1e3 * (surface - height)
        raise InputError(
            f"depth_error = {1e3 * error:.4g} mm; allowed: between {low:.4g} and {high:.4g} mm, "
            "an axis above the floor and below the oil's surface"
        )
    return height + error


def _facts(
    trial: VirtualTrial, camera: CameraOptions, degradation: Degradation, troubles: Troubles, lens: VirtualLens
) -> dict[str, Any]:
    """Facts of the truth file besides rates."""
    return {
        "robot": trial.robot.name,
        "model": trial.model,
        "seed": trial.seed,
        "degradation": degradation.model_dump(),
        "troubles": troubles.model_dump(),
        "frames": trial.frames,
        "dropped": trial.dropped,
        "frames_per_second": camera.fps,
        "exposure": quantity(camera.exposure, "s"),
        "view": camera.view,
        "direction": camera.direction,
        "camera": {
            "height": quantity(lens.eye, "m"),
            "surface": quantity(lens.surface, "m"),
            "index": lens.index,
            "focal_length_pixels": lens.focal,
            "tilt": quantity(list(lens.tilt), "rad"),
            "distortion": list(lens.distortion),
        },
        "made_with": versions(),
    }


def _write_frames(
    writer: H264Writer | _Pngs,
    frames: FrameEncoder,
    numbers: tuple[np.ndarray, np.ndarray],
    fps: float,
    progress: Progress | None,
) -> None:
    """Render frames in parallel with the encoding; `numbers`: as recorded, and as the video counts them."""
    kept, counted = numbers
    with ThreadPoolExecutor(1) as encoder:
        before: Future[None] | None = None
        for done, number in enumerate(kept):
            tell(progress, "render", done, len(kept))
            image = frames.image(number / fps)
            if before is not None:
                before.result()
            before = encoder.submit(writer.add, image, int(counted[done]))
        if before is not None:
            before.result()
