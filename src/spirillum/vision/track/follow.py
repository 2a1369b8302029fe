"""From a video and its setup to a track: calibrate the scale, learn the robot's appearance, then follow it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from spirillum.robot.robot import Robot
from spirillum.vision.camera.anchor import steadied, sways
from spirillum.vision.camera.camera import opened, samples_of, scale_of
from spirillum.vision.setup import Setup
from spirillum.vision.track.assembly import track_of
from spirillum.vision.track.learning import InitialDetection, learnt_from
from spirillum.vision.track.lone_outline import OutlineCheck, check_outline
from spirillum.vision.track.steadiness import camera_flags
from spirillum.vision.track.steps import FrameDetection, FrameTracker, Record
from spirillum.vision.track.track import Track
from spirillum.vision.video.frames import Frame, Video

__all__ = ["FrameDetection", "Watcher", "follow", "scale_of"]


Watcher = Callable[[int, np.ndarray, FrameDetection], None]
"""Called with a frame's number, its picture (8-bit RGB) and its observation."""


def follow(
    video: str | Path | Video,
    setup: Setup,
    robot: Robot,
    *,
    folder: Path | None = None,
    progress: Callable[[int, int | None], None] | None = None,
    on_frame: Watcher | None = None,
) -> Track:
    """Follow a robot through a video.

    Args:
        video: the video, or a folder of images.
        setup: camera, tank, markers and robot of the experiment.
        robot: the robot in front of the camera.
        folder: folder of the setup file, to which the checkerboard's folder is relative; unset: the working directory.
        progress: called with the number of frames done and of all frames, None where unknown.
        on_frame: called with each frame's number, its picture (8-bit RGB) and its observation.
    """
    video = opened(video, setup)
    frames = samples_of(video, setup.start, setup.end)
    still = steadied(video.frames(setup.start, setup.end)) if sways(frames) else None
    if still is not None:
        frames = [still.frame(frame) for frame in frames]
    learnt = learnt_from(video, frames, setup, robot, folder)
    frames = [frame.small(learnt.sight.reduction) for frame in frames]  # large pictures have done their duty
    follower = FrameTracker(learnt.known, learnt.still)
    aside = ThreadPoolExecutor(1)  # runs while the frames are followed
    moved = aside.submit(camera_flags, frames, learnt.known.start, ruled=setup.markers.spacing is not None)
    aside.shutdown(wait=False)
    total = video.count
    for count, taken in enumerate(video.frames(setup.start, setup.end), 1):
        frame = taken if still is None else still.frame(taken)
        seen = follower.step(frame)
        if on_frame is not None:
            on_frame(frame.index, frame.image, seen)
        if progress is not None:
            progress(count, total)
    flags = (*video.flags, *learnt.sight.flags, *moved.result(), *learnt.flags)
    outline = _outline_check(frames, learnt, follower.record, setup)
    return track_of(video, setup, learnt, follower.record, flags, still, outline)


_SAME_TIME = 1e-3
"""Largest difference between two times of one frame, s."""


def _outline_check(frames: Sequence[Frame], learnt: InitialDetection, record: Record, setup: Setup) -> OutlineCheck:
    """What cover and background leave open of the outline; nothing of what is not the robot."""
    start, times = learnt.known.start, np.array(record.time)
    if not learnt.known.robot:
        return OutlineCheck()
    nearest = [int(np.argmin(np.abs(times - frame.time))) for frame in frames]
    seen = [
        (Frame(at, frame.time, frame.image), record.placed[at].pose)
        for frame, at in zip(frames, nearest, strict=True)
        if record.placed[at].known and abs(times[at] - frame.time) < _SAME_TIME
    ]
    some, poses = [frame for frame, _ in seen], [pose for _, pose in seen]
    return check_outline(some, poses, start.body, setup.robot.appearance, alone=start.search is None)
