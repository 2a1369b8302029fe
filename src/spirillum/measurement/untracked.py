"""What readings by hand and other programs' tracks need of a video: its scale, and when its frames were taken."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.measurement.marks import Ruled
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.video.frames import Video, open_video


@dataclass(frozen=True)
class Untracked:
    """Scale and times of a video without tracking."""

    ruled: Ruled | None
    """Turns pixels into lengths; None where nothing gives a scale."""
    time_of: Callable[[Samples], Samples] | None = field(repr=False)
    """Maps frame numbers to times, s; None where no times are known."""
    words: str = ""
    """Metadata of the video."""
    duration: float | None = None
    """Length of the video, s; None where it is not known."""
    seen: bool = True
    """Whether there was a video to open."""
    frame_of: Callable[[Samples], Samples] | None = field(default=None, repr=False)
    """Takes times, s, to numbers of frames; NaN where none was taken."""
    flags: Sequence[Flag] = ()
    """What was odd about the video while it was read."""


def untracked(path: Path, setup: Setup, folder: Path, *, needed: bool = True) -> Untracked:
    """Scale and times of a video.

    Args:
        path: the video or folder.
        setup: the setup.
        folder: folder of the setup file.
        needed: whether pixels are to be turned into lengths.
    """
    from spirillum.vision.track.follow import scale_of

    rate = setup.camera.frames_per_second
    try:
        video = open_video(path, rate, setup.camera.pixel_aspect_ratio)
    except InputError:
        if needed:
            raise
        return Untracked(None, None if rate is None else _Stamps(None, rate).time_of, seen=False)
    stamps = _Stamps(video, rate)
    if not needed:
        return Untracked(None, stamps.time_of, video.words, video.duration)
    found, video = scale_of(video, setup, folder=folder)
    optics = found.optics

    def points(pixels: Samples) -> Samples:
        return np.asarray((optics.points(pixels, optics.axis_height) - optics.origin)[:, :2])

    ruled = Ruled(found.scale, video.size, points, video.stretch)
    return Untracked(ruled, stamps.time_of, video.words, video.duration, frame_of=stamps.frame_of, flags=video.flags)


class _Stamps:
    """Times of frames by their numbers: at a given rate, else the video's own, read once on first use."""

    def __init__(self, video: Video | None, rate: float | None) -> None:
        self._video, self._rate = video, rate
        self._read: tuple[Samples, Samples] | None = None

    def time_of(self, frames: Samples) -> Samples:
        """Times of frames, s."""
        if self._rate is not None:
            return np.asarray(frames / self._rate)
        numbers, times = self._all()
        place = np.minimum(np.searchsorted(numbers, frames), numbers.size - 1)
        for frame in frames[numbers[place] != frames]:
            assert self._video is not None  # noqa: S101 - its stamps were read
            raise InputError(f"{self._video.name} has no frame {frame:g}; allowed: 0 to {numbers[-1]:g}")
        return np.asarray(times[place])

    def frame_of(self, times: Samples) -> Samples:
        """Numbers of the frames nearest to some times; NaN for a time that is half a step from all."""
        if self._rate is not None:
            return np.asarray(np.round(times * self._rate))
        numbers, stamps = self._all()
        place = np.clip(np.searchsorted(stamps, times), 1, max(1, stamps.size - 1))
        place = np.minimum(place, stamps.size - 1)
        before = np.maximum(place - 1, 0)
        nearest = np.where(times - stamps[before] < stamps[place] - times, before, place)
        step = float(np.median(np.diff(stamps))) if stamps.size > 1 else 1.0
        return np.where(np.abs(stamps[nearest] - times) < 0.5 * step, numbers[nearest], np.nan)

    def _all(self) -> tuple[Samples, Samples]:
        if self._read is None:
            assert self._video is not None  # noqa: S101 - without a video the rate is given
            found = [(frame.index, frame.time) for frame in self._video.frames()]
            self._read = np.array([index for index, _ in found], float), np.array([time for _, time in found])
        return self._read
