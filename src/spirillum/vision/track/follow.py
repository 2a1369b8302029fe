"""From a video and its setup to a track: calibrate the scale, learn the robot's appearance, then follow it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.robot import Robot
from spirillum.vision.camera.camera import bounds_of, opened, samples_of, scale_of, sight_of
from spirillum.vision.camera.optics import BodyPose, Optics, placed, places_seen_by
from spirillum.vision.camera.ruler import still_picture
from spirillum.vision.camera.scale import Sight
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.body import BodyFinder, Placed
from spirillum.vision.track.constants import FOLLOWING, LOST_FRAMES
from spirillum.vision.track.cuts import cuts_in, jumps_of_time
from spirillum.vision.track.direction import Along, along_its_way
from spirillum.vision.track.first_look import Start, on_the_way
from spirillum.vision.track.identity import Identified, identify
from spirillum.vision.track.lost_frames import Reading, restored_times
from spirillum.vision.track.motion import Motion
from spirillum.vision.track.search import candidates, refined
from spirillum.vision.track.size import checked_scale
from spirillum.vision.track.steadiness import camera_flags
from spirillum.vision.track.track import Track
from spirillum.vision.track.unwrapping import contradictions, no_stripe_passes, nothing_moves, unwrapped
from spirillum.vision.track.warnings import cut_off, gaps_of, sight_flags
from spirillum.vision.video.frames import Frame, Video

__all__ = ["Seen", "Watcher", "follow", "scale_of"]


class Seen(NamedTuple):
    """The observation on one frame, for drawing."""

    time: float
    """Time of the frame, s."""
    pose: BodyPose | None
    """Pose of the body in the camera's frame; None where it was not detected."""
    body_angle: float
    """Rotation angle of the body, rad, modulo the stripes' period; NaN where unreadable."""
    tail_phase: float
    """Phase of the tail, rad, modulo 2 pi; NaN where unreadable."""
    optics: Optics
    """The camera."""


@dataclass
class _Record:
    """Observations on all frames so far."""

    time: list[float] = field(default_factory=list)
    index: list[int] = field(default_factory=list)
    placed: list[Placed] = field(default_factory=list)
    roll: list[tuple[float, float]] = field(default_factory=list)
    tail: list[tuple[float, float]] = field(default_factory=list)


Watcher = Callable[[int, np.ndarray, Seen], None]
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
        video: the film, or a folder of images.
        setup: camera, tank, markers and robot of the experiment.
        robot: the robot in front of the camera.
        folder: folder of the setup file, to which the checkerboard's folder is relative; unset: the working directory.
        progress: called with the number of frames done and of all frames, None where unknown.
        on_frame: called with each frame's number, its picture (8-bit RGB) and its observation.

    Raises:
        InputError: if the video cannot be read, or neither ruler nor robot is found in it.
    """
    video = opened(video, setup)
    frames = samples_of(video, setup)
    images = [frame.image for frame in frames]
    still = still_picture(images)
    sight = sight_of(video, setup, still, folder)
    bounds = bounds_of(setup, video)
    known = identify(video.name, setup, BodyFinder(robot, sight.optics, bounds), frames, still)
    start, stripes, wire = known.start, known.stripes, known.wire
    body, record = start.body, _Record()
    aside = ThreadPoolExecutor(1)  # runs while the frames are followed
    moved = aside.submit(camera_flags, frames, start, ruled=setup.markers.spacing is not None)
    aside.shutdown(wait=False)
    total = video.count
    for frame in video.frames(setup.start, setup.end):
        found = _placed(body, frame, _guess(record, frame.time), start)
        if not found.known and len(record.time) % FOLLOWING.search_interval == 0:
            found = _found_again(body, frame.image, still, start, found)
        read = (np.nan, np.nan), (np.nan, np.nan)
        if found.known:
            read = stripes.read(frame.image, found.pose), wire.read(frame.image, found.pose)
        record.time.append(frame.time)
        record.index.append(frame.index)
        record.placed.append(found)
        record.roll.append(read[0])
        record.tail.append(read[1])
        if on_frame is not None:
            pose = found.pose if found.known else None
            on_frame(frame.index, frame.image, Seen(frame.time, pose, read[0][0], read[1][0], body.optics))
        if progress is not None:
            progress(len(record.time), total)
    every = (*video.flags, *sight.flags, *moved.result(), *known.flags, *start.flags, *stripes.flags, *wire.flags)
    return _track(video, setup, sight, known, record, every)


def _guess(record: _Record, time: float) -> BodyPose | None:
    """Pose predicted from the last frames; None where the body was not detected on the last one."""
    last = [
        (at, one.pose)
        for at, one in zip(record.time[-FOLLOWING.memory :], record.placed[-FOLLOWING.memory :], strict=True)
        if one.known
    ]
    if len(last) < 2 or not record.placed[-1].known:
        return None
    return on_the_way(last, time)


def _placed(body: BodyFinder, frame: Frame, guess: BodyPose | None, start: Start) -> Placed:
    """Place the body near a predicted pose, else on the initial path; a jump counts as not detected."""
    found, far = None, FOLLOWING.largest_jump * body.optics.length_per_pixel
    if guess is not None:
        found = body.place(frame.image, guess)
        if found.known and np.hypot(found.pose.x - guess.x, found.pose.y - guess.y) <= far:
            return found
    expected = start.expected(frame.time)
    again = body.place(frame.image, expected)
    if again.known and np.hypot(again.pose.x - expected.x, again.pose.y - expected.y) <= far:
        return again
    return (again if found is None else found)._replace(error=BodyPose(np.nan, np.nan, np.nan))


def _found_again(body: BodyFinder, image: np.ndarray, still: Samples, start: Start, lost: Placed) -> Placed:
    """Search the whole picture for the body; `lost` if it is not found."""
    for candidate in candidates(image, still, body)[:2]:
        better = refined(image, still, body, candidate)
        if start.as_clear(better.score):
            found = body.place(image, better.pose)
            if found.known:
                return found
    return lost


def _track(
    video: Video, setup: Setup, sight: Sight, known: Identified, record: _Record, flags: tuple[Flag, ...]
) -> Track:
    body, time = known.start.body, np.array(record.time)
    seen = np.array([one.known for one in record.placed])
    pose = np.where(seen[:, None], np.array([one.pose for one in record.placed]), np.nan)
    errors = np.array([one.error for one in record.placed])
    roll, tail = np.array(record.roll), np.array(record.tail)
    optics = body.optics  # fitted to the apparent size; lengths are converted to the stated scale below
    seen_flags = sight_flags(time, pose, errors, record.placed, optics, setup)
    cut = cut_off(record.placed)
    pose[cut] = errors[cut] = roll[cut] = tail[cut] = np.nan
    position = places_seen_by(sight.optics, optics, pose[:, :2]) - sight.optics.origin[:2]
    along = Along(position, pose[:, 2], ())
    if setup.markers.spacing is None:  # no ruler says how the camera is rolled
        along = along_its_way(time, *along[:2])
    position = along.position
    frame, gap_flags = gaps_of(time, np.array(record.index, dtype=float))
    restored = restored_times(time, _readings(roll[:, 0], tail[:, 0], position[:, 0], known, optics))
    time = restored.time
    body_angle, roll_flags = unwrapped(time, roll[:, 0], roll[:, 1], known.stripes.period)
    tail_phase, tail_flags = unwrapped(time, tail[:, 0], tail[:, 1], 2.0 * np.pi, "tail")
    scale, size_flags = checked_scale(sight.scale, body, known.size)
    hand = known.wire.handedness()
    motion, pixel = Motion(time, position[:, 0], body_angle, tail_phase), optics.length_per_pixel
    odd = (*nothing_moves(motion, body.robot), *contradictions(motion, body.robot, hand))
    odd += no_stripe_passes(motion, body.robot)
    early = (*size_flags, *flags, *seen_flags, *along.flags, *gap_flags, *restored.flags)
    cuts = (*cuts_in(motion, pixel), *jumps_of_time(motion, pixel, known.stripes.period))
    return Track(
        time=time,
        frame=frame,
        position=position,
        heading=along.heading,
        body_angle=body_angle,
        tail_phase=tail_phase,
        position_error=errors[:, 0] * optics.focal / sight.optics.focal,
        body_angle_error=np.where(np.isfinite(body_angle), roll[:, 1], np.nan),
        tail_phase_error=np.where(np.isfinite(tail_phase), tail[:, 1], np.nan),
        picture=_drawn(pose, body.robot, optics),
        size=video.size,
        scale=scale,
        setup=setup,
        video=video.name,
        words=video.words,
        time_uncertainty=restored.relative_error,
        flags=(*early, *cuts, *roll_flags, *tail_flags, *odd),
    )


def _readings(
    body: Samples, tail: Samples, x: Samples, known: Identified, optics: Optics
) -> tuple[Reading, Reading, Reading]:
    """The series whose steps tell lost frames, with the least standard errors of a step."""
    return (
        Reading(tail, 2.0 * np.pi, LOST_FRAMES.tail_error),
        Reading(body, known.stripes.period, LOST_FRAMES.body_error),
        Reading(x, np.inf, LOST_FRAMES.place_error * optics.length_per_pixel),
    )


def _drawn(pose: Samples, robot: Robot, optics: Optics) -> Samples:
    """Pixels of the body's mid-length and of its nose on every frame, (n, 4)."""
    axis = np.array([[0.0, 0.0, 0.0], [0.5 * robot.body.length, 0.0, 0.0]])
    out = np.full((len(pose), 4), np.nan)
    for k in np.flatnonzero(np.isfinite(pose[:, 0])):
        out[k] = optics.pixels(placed(axis, BodyPose(*pose[k].tolist()), optics.axis_height)).ravel()
    return out
