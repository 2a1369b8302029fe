"""From a video to a track: following the robot, then lengths, continuous angles, true times, and all flags."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.robot import Robot
from spirillum.robust import least_squares_line
from spirillum.vision.camera.anchor import Steadied, steadied, sways
from spirillum.vision.camera.camera import opened, samples_of, scale_of
from spirillum.vision.camera.optics import BodyPose, Optics, placed, positions_seen_by
from spirillum.vision.camera.scale import CalibratedCamera
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.body import BodyFinder
from spirillum.vision.track.constants import IDENTITY, LOST_FRAMES, STRIPES
from spirillum.vision.track.contour import EDGE_CUES
from spirillum.vision.track.cuts import Hops, clock_of, cuts_in, hops_in, no_motion_flag, one_picture, standstill_flag
from spirillum.vision.track.identity import Identified
from spirillum.vision.track.learning import InitialDetection, learnt_from
from spirillum.vision.track.lone_outline import OutlineCheck, check_outline
from spirillum.vision.track.lost_frames import FrameSeries, restored_times
from spirillum.vision.track.size import AlignedTrack, align_with_path, checked_scale
from spirillum.vision.track.steadiness import PictureSteps, camera_flags, picture_steps
from spirillum.vision.track.steps import FrameDetection, FrameTracker, Record
from spirillum.vision.track.track import CUES, Agreement, RobotMotion, Track, agreement_of
from spirillum.vision.track.unwrapping import contradictions, no_stripe_passes, static_object_flag, unwrapped
from spirillum.vision.track.visibility import (
    cut_off,
    false_detection_flag,
    false_detections,
    far_apart,
    gaps_of,
    marks_lost_flag,
    sight_flags,
)
from spirillum.vision.track.widths import evened
from spirillum.vision.video.frames import Frame, Video

__all__ = ["FrameDetection", "Watcher", "follow", "scale_of"]


@dataclass(frozen=True)
class SwayConstants:
    """A camera that swayed."""

    window: int = 7  #: Frames before and after a moment whose medians are compared.
    jump: float = 1.5
    """Step of the robot against the background from which on pictures were not moved back well, pixels.

    A ruler's lines are at least three pixels apart, by which a wrong registration is off."""


SWAY = SwayConstants()


class Swayed(NamedTuple):
    """Uncertainty and flags by a camera that swayed."""

    drift: float  #: Standard uncertainty of the velocity, m/s.
    flags: tuple[Flag, ...]


def swayed_by(still: Steadied, motion: RobotMotion, setup: Setup, sight: CalibratedCamera) -> Swayed:
    """How much a camera that swayed makes the velocity uncertain, and whether it may be given."""
    # A camera that turns moves all of its picture alike. One that is carried along the channel moves the robot, which
    # is nearer than the background, by more: what is not known is the difference, for as much as the camera has
    # drifted.
    optics, right, down = sight.optics, still.poses[:, 0], still.poses[:, 1]
    behind = 0.0 if setup.markers.height is None else setup.markers.height
    pixel = optics.length_per_pixel
    parallax = optics.moved({"axis_height": behind}).length_per_pixel / pixel - 1.0
    speed = math.hypot(*(float(least_squares_line(still.times, part).slope) for part in (right, down)))
    reach = max(float(np.ptp(right)), float(np.ptp(down)))
    jump = _largest_jump(motion.time, motion.x) / pixel
    flags = [Flag.named("camera-swayed", reach=reach)]
    if jump > SWAY.jump:
        flags.append(Flag.named("pictures-not-moved-back", jump=jump))
    return Swayed(abs(parallax) * speed * pixel, tuple(flags))


def _largest_jump(time: Samples, x: Samples) -> float:
    """Largest lasting step of a position against the lines through some frames on either side, m."""
    known = np.isfinite(x)
    t, v, wide = time[known], x[known], SWAY.window
    if t.size < 2 * wide:
        return 0.0
    line = np.polynomial.polynomial.polyfit(t - t.mean(), v, 1)
    rest = v - np.polynomial.polynomial.polyval(t - t.mean(), line)
    windows = np.lib.stride_tricks.sliding_window_view(rest, wide)
    middle = np.median(windows, axis=1)
    return float(np.abs(middle[wide:] - middle[:-wide]).max())


def track_of(
    video: Video,
    setup: Setup,
    learnt: InitialDetection,
    record: Record,
    flags: tuple[Flag, ...],
    still: Steadied | None = None,
    outline: OutlineCheck = OutlineCheck(),  # noqa: B008 - a constant
) -> Track:
    """The track of a video, with all flags."""
    sight, known = learnt.sight, learnt.known
    body, time = known.start.body, np.array(record.time)
    seen = np.array([one.known for one in record.placed])
    pose = np.where(seen[:, None], np.array([one.pose for one in record.placed]), np.nan)
    errors = np.array([one.error for one in record.placed])
    pose[:, :2] += known.start.off
    roll, tail = np.array(record.roll), np.array(record.tail)
    optics = body.optics  # fitted to the apparent size; lengths are converted to the stated scale below
    seen_flags = sight_flags(time, pose, errors, record.placed, optics, setup)
    cut = cut_off(record.placed)
    told = seen & ~cut & (body.seal is None)  # a nose of glass shows what lies under it; against the seal, cues decide
    elongation = np.where(told, [one.elongation for one in record.placed], np.nan)
    pose[cut] = errors[cut] = roll[cut] = tail[cut] = np.nan
    other = false_detections(time, pose, (roll, tail), body.robot.body.length, optics.length_per_pixel)
    pose[other] = errors[other] = elongation[other] = np.nan
    position = positions_seen_by(sight.optics, optics, pose[:, :2]) - sight.optics.origin[:2]
    along = AlignedTrack(position, pose[:, 2], ())
    if setup.markers.spacing is None:  # no ruler shows how the camera is rolled
        along = align_with_path(time, *along[:2])
    position = along.position
    frame, gap_flags = gaps_of(time, np.array(record.index, dtype=float))
    picture = picture_steps(np.array(record.change))
    restored = restored_times(time, _readings(roll[:, 0], tail[:, 0], position[:, 0], known, optics), picture)
    time = restored.time
    stripes = known.stripes
    body_angle, roll_flags = unwrapped(time, roll[:, 0], roll[:, 1], stripes.period, readable=stripes.readable)
    even = evened(body_angle, roll[:, 0], roll[:, 1], np.array(record.edges), known.stripes.period)
    body_angle, roll_flags = even.angle, (*roll_flags, *even.flags, *_under_glare(known, even.angle))
    tail_phase, tail_flags = unwrapped(time, tail[:, 0], tail[:, 1], 2.0 * np.pi, "tail")
    tail_size = _tail_size(known, sight.optics, roll[:, 0], tail[:, 0], np.isfinite(pose[:, 0]))
    scale, size_flags, roll_error = checked_scale(sight.scale, body, known.size, setup.markers.spacing, tail_size)
    if even.flags and any(flag.spoils for flag in size_flags):
        roll_flags = (*roll_flags, Flag.named("stripes-doubtful"))
    elif size_flags and any(flag.spoils for flag in even.flags):
        roll_flags = (*roll_flags, Flag.named("outline-and-stripes-off" if roll_error else "scale-does-not-fit"))
    motion, pixel = RobotMotion(time, position[:, 0], body_angle, tail_phase), optics.length_per_pixel
    lost = marks_lost_flag(pose[:, 0], roll[:, 0], tail[:, 0], learnt=known.robot and known.wire.readable)
    seen_flags = (*seen_flags, *false_detection_flag(other), *lost)
    swayed = Swayed(0.0, ()) if still is None else swayed_by(still, motion, setup, sight)
    agreement = _agreement(time, record, cut | other, pixel, outline.suspect)
    lag = math.hypot(agreement.drift, _colour_lag(position[:, 0], body), outline.drift * pixel)
    cuts, hops, motion = _jumps_of(motion, pixel, picture, body.robot.body.length)
    glare, odd = learnt.glare.drift * pixel, contradictions(motion, body.robot, known.wire.handedness())
    odd += no_stripe_passes(motion, body.robot, readable=stripes.readable)
    clock = clock_of(motion, pixel, known.stripes.period, np.array(record.time))
    if any(flag.spoils for flag in clock.flags):
        gap_flags = ()  # by times that are wrong
    early = (*size_flags, *flags, *seen_flags, *along.flags, *gap_flags, *restored.flags)
    cuts += (
        *hops.flags,
        *clock.flags,
        *one_picture(motion),
        *standstill_flag(motion, pixel),
        *(() if known.stands else static_object_flag(motion, body.robot) or no_motion_flag(motion, pixel)),
    )
    return Track(
        time=time,
        frame=frame,
        position=position,
        heading=along.heading,
        body_angle=body_angle,
        tail_phase=tail_phase,
        position_error=errors[:, 0] * optics.focal / sight.optics.focal,
        body_angle_error=np.where(np.isfinite(body_angle), even.error, np.nan),
        tail_phase_error=np.where(np.isfinite(tail_phase), tail[:, 1], np.nan),
        picture=_end_pixels(pose, body.robot, optics),
        size=video.size,
        scale=scale,
        setup=setup,
        video=video.name,
        words=video.words,
        time_uncertainty=math.hypot(restored.relative_error, clock.relative_error),
        drift=math.hypot(swayed.drift, math.hypot(glare, hops.distance) / max(float(np.ptp(time)), 1e-9)),
        elongation=elongation * optics.focal / sight.optics.focal,
        body_angle_drift=math.hypot(
            even.drift, roll_error, hops.angle, STRIPES.under_glare if known.stripes.under_glare else 0.0
        ),
        tail_phase_drift=math.hypot(hops.phase, 2.0 * np.pi * math.hypot(lag, glare) / body.robot.tail.wavelength),
        cues=agreement.cues,
        cue_drift=lag,
        sideways=np.where(cut | other, np.nan, [one.sideways for one in record.placed]),
        flags=(*swayed.flags, *early, *agreement.flags, *outline.flags, *cuts, *roll_flags, *tail_flags, *odd),
    )


def _jumps_of(
    motion: RobotMotion, pixel: float, picture: PictureSteps | None, length: float
) -> tuple[tuple[Flag, ...], Hops, RobotMotion]:
    """Flags of a robot that jumps, hops of its outline, and its motion without a place that tells nothing then."""
    cuts = cuts_in(motion, pixel, picture)
    flags = cuts or far_apart(motion.time, motion.x, length)
    told = motion._replace(x=np.full(motion.time.size, np.nan)) if flags else motion
    return flags, hops_in(motion if cuts else told, pixel, picture), told


def _agreement(time: Samples, record: Record, left_out: np.ndarray, pixel: float, suspect: str) -> Agreement:
    """Cues of a video, without the frames that are left out."""
    lost = np.full((len(EDGE_CUES), 2), np.nan)
    placed = zip(record.placed, left_out.tolist(), strict=True)
    shifts = [lost if without or one.cues is None else one.cues for one, without in placed]
    return agreement_of(time, shifts, np.array(record.tail)[:, 0], pixel, suspect)


def _colour_lag(x: Samples, body: BodyFinder) -> float:
    """Standard error of the displacement from end to end where colours locate the edges, m."""
    seen = x[np.isfinite(x)]
    if body.seal is None or not seen.size:
        return 0.0
    return min(CUES.colour_drift * body.optics.length_per_pixel, 0.5 * float(np.ptp(seen)))


def _under_glare(known: Identified, body_angle: Samples) -> tuple[Flag, ...]:
    """Flag stripes that glare hides; a body that turned by less than two of them may seem to stand, or to go twice."""
    if not known.stripes.under_glare:
        return ()
    turned = float(np.ptp(body_angle[seen])) if (seen := np.isfinite(body_angle)).any() else 0.0
    enough = turned > STRIPES.turned_under_glare * 2.0 * np.pi / len(known.stripes.stripes)
    return (Flag.named("stripes-under-glare" if enough else "turns-under-glare", turned=math.degrees(turned)),)


def _tail_size(known: Identified, stated: Optics, roll: Samples, tail: Samples, placed_on: np.ndarray) -> float:
    """Apparent size of the tail at the stated scale; NaN where the body's marks are often off its outline."""
    marks = (roll, tail) if known.stripes.stripes else (tail,)
    read = [np.isfinite(angle[placed_on]).mean() for angle in marks if placed_on.any()]
    if min(read, default=0.0) < IDENTITY.sure_share:
        return math.nan
    return known.tail_size(stated)


def _readings(
    body: Samples, tail: Samples, x: Samples, known: Identified, optics: Optics
) -> tuple[FrameSeries, FrameSeries, FrameSeries]:
    """The series whose steps show lost frames, with the least standard errors of a step."""
    return (
        FrameSeries(tail, 2.0 * np.pi, LOST_FRAMES.tail_error),
        FrameSeries(body, known.stripes.period, LOST_FRAMES.body_error),
        FrameSeries(x, np.inf, LOST_FRAMES.place_error * optics.length_per_pixel),
    )


def _end_pixels(pose: Samples, robot: Robot, optics: Optics) -> Samples:
    """Pixels of the body's mid-length and of its nose on every frame, (n, 4)."""
    axis = np.array([[0.0, 0.0, 0.0], [0.5 * robot.body.length, 0.0, 0.0]])
    out = np.full((len(pose), 4), np.nan)
    for k in np.flatnonzero(np.isfinite(pose[:, 0])):
        out[k] = optics.pixels(placed(axis, BodyPose(*pose[k].tolist()), optics.axis_height)).ravel()
    return out


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
    """Follow a robot through a video."""
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


_SAME_TIME = 1e-3  # largest difference between two times of one frame, s


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
