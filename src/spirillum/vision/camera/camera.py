"""Calibration of a video's camera: region of interest, sample frames and scale."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.vision.camera.optics import DIRECTIONS
from spirillum.vision.camera.ruler import Lines, resolved, ruler_in, still_picture
from spirillum.vision.camera.scale import CalibratedCamera, camera_of_setup, fitted_camera, lens_of
from spirillum.vision.setup import Setup
from spirillum.vision.video.frames import Frame, Video, open_video
from spirillum.vision.video.pictures import reduction

_SAMPLES, _FEWEST_SAMPLES, _SAMPLES_BYTES = 24, 12, 480_000_000
"""Most and fewest frames from which scale and appearance are learnt, and the bytes that they may take between."""
_GOLDEN = 0.618034  # step of the low-discrepancy sequence that spreads them
_UNKNOWN = 10.0  # duration from which is learnt where that of the video is unknown, s


def scale_of(video: str | Path | Video, setup: Setup, *, folder: Path | None = None) -> tuple[CalibratedCamera, Video]:
    """Calibrate the camera and the scale of a video without following the robot."""
    video = opened(video, setup)
    frames = samples_of(video, setup.start, setup.end)
    return sight_of(video, setup, background(frames, reduction(video.size)), folder, frames), video


def opened(video: str | Path | Video, setup: Setup) -> Video:
    """Open a video; one that is open is returned unchanged."""
    camera = setup.camera
    if isinstance(video, Video):
        return video
    return open_video(video, camera.frames_per_second, camera.pixel_aspect_ratio)


def samples_of(video: Video, start: float, end: float | None) -> list[Frame]:
    """Frames at uneven intervals over the measured part, so that they do not alias with the rotation."""
    if video.duration:
        if start >= video.duration:
            raise InputError(
                f"start = {start:g} s, but {video.name} ends at {video.duration:.4g} s; allowed: a start before its end"
            )
        end = video.duration if end is None else min(end, video.duration)
    elif end is None:
        end = start + _UNKNOWN
    count = np.arange(video.frames_within(_SAMPLES_BYTES, _FEWEST_SAMPLES, _SAMPLES))
    shares = (count + (_GOLDEN * count) % 1.0) / count.size
    return video.samples((start + (end - start) * shares).tolist())


def bounds_of(setup: Setup, video: Video) -> tuple[int, int, int, int]:
    """Region of interest in the picture: left, top, right, bottom, pixels."""
    width, height = video.size
    region = setup.region
    if region is None:
        return 0, 0, width, height
    right, bottom = region.left + region.width, region.top + region.height
    if right > width or bottom > height:
        raise InputError(
            f"region reaches to column {right} and row {bottom}; allowed: inside the picture of {width} x {height} "
            "pixels"
        )
    return region.left, region.top, right, bottom


def background(frames: Sequence[Frame], factor: int) -> Samples:
    """The static background of some frames, reduced by a factor, (h, w, 3)."""
    return still_picture([frame.reduced(factor) for frame in frames])


def ruler_of(
    still: Samples, bounds: tuple[int, int, int, int], turn: float, factor: int, frames: Sequence[Frame] = ()
) -> tuple[Lines | None, int]:
    """The ruler, in pixels of the full picture, and the factor by which pictures may be reduced that show it."""
    left, top, right, bottom = (at // factor for at in bounds)
    found = ruler_in(still, (left, top, right, bottom), turn)
    if factor == 1 or not frames:
        return found, factor
    if found is not None and resolved(found.enlarged(factor), frames[0].image, factor):
        return found.enlarged(factor), factor
    found = ruler_in(background(frames, 1), bounds, turn)
    return found, factor if found is None else 1


def sight_of(
    video: Video, setup: Setup, still: Samples, folder: Path | None, frames: Sequence[Frame] = ()
) -> CalibratedCamera:
    """The calibrated camera of a video."""
    factor = video.size[0] // still.shape[1]
    board = setup.camera.checkerboard
    lens = None if board is None else lens_of(board, Path() if folder is None else folder, video.size, video.display)
    if setup.markers.spacing is None:
        return camera_of_setup(setup, video.size, lens)._replace(reduction=factor)
    bounds = bounds_of(setup, video)
    lines, factor = ruler_of(still, bounds, -DIRECTIONS[setup.robot.direction], factor, frames)
    if lines is None:
        side = setup.robot.direction
        if ruler_of(still, bounds, 0.5 * np.pi - DIRECTIONS[side], factor, frames)[0] is not None:
            across, other = ("columns", ("up", "down")) if side in ("right", "left") else ("rows", ("right", "left"))
            raise InputError(
                f"robot.direction = '{side}', but {video.name} shows its ruler along the {across} of the picture; "
                f"allowed: '{other[0]}' or '{other[1]}', where the nose points"
            )
        raise InputError(
            f"{video.name} shows no ruler: no equally spaced lines across the direction of swimming were found, where "
            f"the nose points {side} within 45 degrees; allowed: a ruler, robot.direction as it is in the picture, or "
            "markers.length_per_pixel"
        )
    return fitted_camera(setup, video.size, lines, lens)._replace(reduction=factor)
