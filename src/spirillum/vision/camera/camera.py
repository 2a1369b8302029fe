"""Calibration of a video's camera: region of interest, sample frames and scale."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.vision.camera.checkerboard import lens_of
from spirillum.vision.camera.optics import DIRECTIONS
from spirillum.vision.camera.ruler import ruler_in, still_picture
from spirillum.vision.camera.scale import Sight, fitted_camera, given_camera
from spirillum.vision.setup import Setup
from spirillum.vision.video.frames import Frame, Video, open_video

__all__ = ["bounds_of", "opened", "samples_of", "scale_of", "sight_of"]

_SAMPLES = 24
"""Frames from which scale and appearance are learnt."""
_GOLDEN = 0.618034
"""Step of the low-discrepancy sequence that spreads them."""
_UNKNOWN = 10.0
"""Duration from which is learnt where that of the film is unknown, s."""


def scale_of(video: str | Path | Video, setup: Setup, *, folder: Path | None = None) -> tuple[Sight, Video]:
    """Calibrate the camera and the scale of a video without following the robot.

    Args:
        video: the film, or a folder of images.
        setup: its setup.
        folder: folder of the setup file, to which the checkerboard's folder is relative.

    Raises:
        InputError: if the video cannot be read, or no ruler is found in it.
    """
    video = opened(video, setup)
    frames = samples_of(video, setup.start, setup.end)
    return sight_of(video, setup, still_picture([frame.image for frame in frames]), folder), video


def opened(video: str | Path | Video, setup: Setup) -> Video:
    """Open a video; one that is open is returned unchanged."""
    return video if isinstance(video, Video) else open_video(video, setup.camera.frames_per_second)


def samples_of(video: Video, start: float, end: float | None) -> list[Frame]:
    """Frames at uneven intervals over the measured part, so that they do not alias with the rotation.

    Args:
        video: the film, or a folder of images.
        start: beginning of that part, s.
        end: its end, s; None: that of the video.

    Raises:
        InputError: if the start is after the end of the video, or no frame can be decoded.
    """
    if video.duration:
        if start >= video.duration:
            raise InputError(
                f"start = {start:g} s, but {video.name} ends at {video.duration:.4g} s; allowed: a start before its end"
            )
        end = video.duration if end is None else min(end, video.duration)
    elif end is None:
        end = start + _UNKNOWN
    count = np.arange(_SAMPLES)
    shares = (count + (_GOLDEN * count) % 1.0) / _SAMPLES
    return video.samples((start + (end - start) * shares).tolist())


def bounds_of(setup: Setup, video: Video) -> tuple[int, int, int, int]:
    """Region of interest in the picture: left, top, right, bottom, pixels.

    Raises:
        InputError: if it exceeds the picture.
    """
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


def sight_of(video: Video, setup: Setup, still: Samples, folder: Path | None) -> Sight:
    """The calibrated camera of a video, from its static background `still`, (h, w, 3).

    Raises:
        InputError: if the setup has a ruler and none is found.
    """
    board = setup.camera.checkerboard
    lens = None if board is None else lens_of(board, Path() if folder is None else folder, video.size)
    if setup.markers.spacing is None:
        return given_camera(setup, video.size, lens)
    bounds = bounds_of(setup, video)
    lines = ruler_in(still, bounds, -DIRECTIONS[setup.robot.direction])
    if lines is None:
        side = setup.robot.direction
        if ruler_in(still, bounds, 0.5 * np.pi - DIRECTIONS[side]) is not None:
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
    return fitted_camera(setup, video.size, lines, lens)
