"""What readings by hand and other programs' tracks need of a video: its scale, and when its frames were taken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.measurement.marks import Ruled
from spirillum.vision.setup import Setup
from spirillum.vision.video.frames import Video, open_video

__all__ = ["Untracked", "untracked"]


@dataclass(frozen=True)
class Untracked:
    """Scale and times of a video without tracking."""

    ruled: Ruled | None
    """Turns pixels into lengths; None where nothing gives a scale."""
    time_of: Callable[[Samples], Samples] | None = field(repr=False)
    """Takes numbers of frames to times, s; None where nothing tells."""
    words: str = ""
    """What the video says of itself."""
    duration: float | None = None
    """Length of the video, s; None where it is not known."""
    seen: bool = True
    """Whether there was a video to open."""


def untracked(path: Path, setup: Setup, folder: Path, *, needed: bool = True) -> Untracked:
    """Scale and times of a video.

    Args:
        path: the film or folder.
        setup: the setup.
        folder: folder of the setup file.
        needed: whether pixels are to be turned into lengths.

    Raises:
        InputError: if the video cannot be read or shows no ruler, and that is needed.
    """
    from spirillum.vision.track.follow import scale_of

    rate = setup.camera.frames_per_second
    try:
        video = open_video(path, rate, setup.camera.pixel_aspect_ratio)
    except InputError:
        if needed:
            raise
        return Untracked(None, None if rate is None else _at(rate), seen=False)
    times = _times(video, rate)
    if not needed:
        return Untracked(None, times, video.words, video.duration)
    found, video = scale_of(video, setup, folder=folder)
    optics = found.optics

    def points(pixels: Samples) -> Samples:
        return np.asarray((optics.points(pixels, optics.axis_height) - optics.origin)[:, :2])

    return Untracked(Ruled(found.scale, video.size, points), times, video.words, video.duration)


def _at(rate: float) -> Callable[[Samples], Samples]:
    """Times of frames at a given rate."""

    def time_of(frames: Samples) -> Samples:
        return np.asarray(frames / rate)

    return time_of


def _times(video: Video, rate: float | None) -> Callable[[Samples], Samples] | None:
    """Times of frames by their numbers: the video's own stamps, read once when they are asked for."""
    if rate is not None:
        return _at(rate)

    def time_of(frames: Samples) -> Samples:
        stamps: dict[int, float] = {frame.index: frame.time for frame in video.frames()}
        for frame in frames:
            if int(frame) not in stamps:
                raise InputError(f"{video.name} has no frame {frame:g}; allowed: 0 to {max(stamps, default=0)}")
        return np.array([stamps[int(frame)] for frame in frames])

    return time_of
