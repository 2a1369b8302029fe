"""A detected robot, followed frame by frame, and the observation of each frame."""

from __future__ import annotations

import math
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.live.observation import Observation
from spirillum.live.windows import CausalAngle, Window, periodic_error
from spirillum.measurement.flags import SYNTHETIC, says_synthetic
from spirillum.measurement.statistics import (
    DRIFT_ANGLE,
    DRIFT_BARE,
    DRIFT_PIXELS,
    NORMAL,
    PHASE_ERROR,
    PIXEL_ERROR,
    STRIPE_ERROR,
)
from spirillum.measurement.trials import LEVEL, RATE_NAMES, Measured, Trial, trial_of
from spirillum.robot.robot import Robot
from spirillum.vision.camera.optics import BodyPose, positions_seen_by
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup
from spirillum.vision.track.assembly import track_of
from spirillum.vision.track.constants import VISIBILITY
from spirillum.vision.track.initial_detection import Start
from spirillum.vision.track.learning import InitialDetection
from spirillum.vision.track.lone_outline import OutlineCheck
from spirillum.vision.track.size import align_with_path, checked_scale
from spirillum.vision.track.steadiness import StillPicture, shift_of, view_of
from spirillum.vision.track.steps import FrameTracker
from spirillum.vision.track.track import CUES, RobotMotion
from spirillum.vision.track.unwrapping import contradictions, no_stripe_passes, static_object_flag, unwrapped
from spirillum.vision.track.widths import evened
from spirillum.vision.video.frames import Frame, Video

_BETWEEN = 1.0  # time between two pictures that are kept, s
_TOGETHER = 5  # pictures from which a background is made


@dataclass
class RecentDetections:
    """What was read in the last seconds: on each frame time, x, continuous angles, and both angles as read."""

    length: float  #: Time that is kept, s.
    rows: deque[tuple[float, ...]] = field(default_factory=deque)
    """Time, x, body angle, tail phase; body angle modulo its period with its error, tail phase modulo 2 pi with its."""

    def add(self, row: tuple[float, ...]) -> None:
        """Take a frame; those that are older leave."""
        self.rows.append(row)
        while self.rows[0][0] < row[0] - self.length:
            self.rows.popleft()

    def columns(self) -> Samples:
        """The rows as columns, (8, n)."""
        return np.array(self.rows).T


def motion_flags(
    readings: RecentDetections, robot: Robot, period: float, hand: int, readable: float
) -> tuple[Flag, ...]:
    """Flags on the motion in the last seconds."""
    if len(readings.rows) < 4:
        return ()
    time, x, body, tail, roll, roll_error, phase, phase_error = readings.columns()
    of_body = unwrapped(time, roll, roll_error, period, readable=readable)[1]
    of_tail = unwrapped(time, phase, phase_error, 2.0 * np.pi, "tail")[1]
    motion = RobotMotion(time, x, body, tail)
    odd = (*static_object_flag(motion, robot), *contradictions(motion, robot, hand))
    return (*of_body, *of_tail, *odd, *no_stripe_passes(motion, robot, readable=readable))


class CameraWatch:
    """Compares what stands still in the last pictures with what stood still when the robot was learnt."""

    def __init__(self, start: Start, *, ruled: bool) -> None:
        self._start, self._ruled = start, ruled
        self._first: StillPicture | None = None
        self._pictures: list[np.ndarray] = []
        self._next = -np.inf
        self._aside = ThreadPoolExecutor(1)  # a picture's rows take longer than a frame
        self._coming: Future[tuple[Flag, ...]] | None = None

    def look(self, frame: Frame) -> tuple[Flag, ...]:
        """Flags on the pictures until a second ago; empty where nothing moved, and on most frames."""
        if frame.time < self._next:
            return ()
        self._next = frame.time + _BETWEEN
        flags = () if self._coming is None else self._coming.result()
        self._coming = None
        self._pictures.append(frame.image.copy())
        if len(self._pictures) == _TOGETHER:
            self._coming = self._aside.submit(self._compared, self._pictures)
            self._pictures = []
        return flags

    def _compared(self, pictures: list[np.ndarray]) -> tuple[Flag, ...]:
        now = view_of(pictures, self._start, ruled=self._ruled)
        if self._first is None:
            self._first = now
            return ()
        shift, moved = shift_of(self._first, now)
        return (Flag.named("camera-moved-live", shift=abs(shift)),) if moved else ()


_CHECKED = 1.0  # time between two looks at the last seconds for what is odd, s
_LOOKED_BACK = 10.0  # time over which that looks back, s
_MOST_FRAMES = 36_000  # frames that the summary keeps: twenty minutes at 30 a second
_VELOCITY, _BODY, _TAIL, _MOTOR = RATE_NAMES
_NOT_SEEN = "the robot is not seen where it should be"
_NOT_WHOLE = "the robot is partly out of view"


class Following:
    """A robot that is known, and what was seen of it."""

    def __init__(
        self, video: Video, setup: Setup, robot: Robot, learnt: InitialDetection, outline: OutlineCheck, window: float
    ) -> None:
        self.video, self.setup, self.robot, self.learnt, self.outline = video, setup, robot, learnt, outline
        ruled = setup.markers.spacing is not None
        self.follower = FrameTracker(learnt.known, learnt.still, ahead=False)
        self.body, self.tail = CausalAngle(learnt.known.stripes.period), CausalAngle(2.0 * math.pi)
        self.windows = {name: Window(window) for name in RATE_NAMES}
        self.readings = RecentDetections(_LOOKED_BACK)
        self.camera = CameraWatch(learnt.known.start, ruled=ruled)
        known, tail_size = learnt.known, learnt.known.tail_size(learnt.sight.optics)
        self.scale, size_flags, _ = checked_scale(
            learnt.sight.scale, known.start.body, known.size, setup.markers.spacing, tail_size
        )
        self.roll, rolled = (0.0, ()) if ruled else self._roll()
        self.always = (*learnt.sight.flags, *size_flags, *rolled, *outline.flags, *_synthetic(video))
        self.moved: tuple[Flag, ...] = ()
        self.flags: tuple[Flag, ...] = (*self.always, *learnt.flags)
        self.next_check = -math.inf
        self.restarts = (0, 0)

    def _roll(self) -> tuple[float, tuple[Flag, ...]]:
        """Angle of the channel to the rows of the picture from the initial detection, where there is no ruler."""
        path = self.learnt.known.start.path
        time, pose = np.array([at for at, _ in path]), np.array([one for _, one in path])
        along = align_with_path(time, self._places(pose[:, :2]), pose[:, 2])
        return float(np.median(pose[:, 2] - along.heading)), along.flags

    def _places(self, xy: np.ndarray) -> np.ndarray:
        """Positions in the camera's frame at the stated scale, from the middle of the picture, m, (n, 2)."""
        sight = self.learnt.sight.optics
        return positions_seen_by(sight, self.learnt.known.start.body.optics, xy) - sight.origin[:2]

    def observed(self, frame: Frame) -> Observation:
        """What a frame shows."""
        self.follower.step(frame)
        record = self.follower.record
        found, roll, tail = record.placed[-1], record.roll[-1], record.tail[-1]
        whole = found.known and found.inside >= VISIBILITY.full_view
        if not whole:
            roll = tail = (math.nan, math.nan)
        body_angle = self.body.update(frame.time, *roll)
        tail_phase = self.tail.update(frame.time, *tail)
        place, pixel = (math.nan, math.nan), (math.nan, math.nan)
        if whole:
            place, pixel = self._place(found.pose)
        magnified = self.learnt.known.start.body.optics.focal / self.learnt.sight.optics.focal  # to the stated scale
        self._take(frame.time, place[0], body_angle, tail_phase)
        self.readings.add((frame.time, place[0], body_angle, tail_phase, *roll, *tail))
        self._look(frame)
        if len(record.time) > _MOST_FRAMES:
            self._forget(_MOST_FRAMES // 2)
        seen = Observation(
            frame.index,
            frame.time,
            "tracking" if whole else "lost",
            "" if whole else (_NOT_WHOLE if found.known else _NOT_SEEN),
            x=place[0],
            y=place[1],
            heading=found.pose.heading - self.roll if whole else math.nan,
            body_angle=body_angle,
            tail_phase=tail_phase,
            position_error=found.error.x * magnified if whole else math.nan,
            heading_error=found.error.heading if whole else math.nan,
            body_angle_error=roll[1] if math.isfinite(body_angle) else math.nan,
            tail_phase_error=tail[1] if math.isfinite(tail_phase) else math.nan,
            body_period=self.body.period,
            rates=self._rates(roll[1], tail[1]),
            pixel=pixel,
            flags=self.flags,
        )
        return _without_spoiled(seen)

    def _place(self, pose: BodyPose) -> tuple[tuple[float, float], tuple[float, float]]:
        """Along and across the channel, m, and the pixel of the body's mid-length."""
        optics = self.learnt.known.start.body.optics
        off_x, off_y = self.learnt.known.start.off
        pose = pose._replace(x=pose.x + off_x, y=pose.y + off_y)
        x, y = self._places(np.array([[pose.x, pose.y]]))[0]
        c, s = math.cos(self.roll), math.sin(self.roll)
        u, v = optics.pixels(np.array([[pose.x, pose.y, optics.axis_height]]))[0]
        return (float(c * x + s * y), float(c * y - s * x)), (float(u), float(v))

    def _take(self, time: float, x: float, body: float, tail: float) -> None:
        """Readings into the windows; those before a break of an angle do not hang together with those after it."""
        restarts = self.body.restarts, self.tail.restarts
        for name, before, now in zip((_BODY, _TAIL), self.restarts, restarts, strict=True):
            if before != now:
                self.windows[name].clear()
                self.windows[_MOTOR].clear()
        self.restarts = restarts
        for name, value in zip(RATE_NAMES, (x, body, tail, tail - body), strict=True):
            self.windows[name].add(time, value)

    def _look(self, frame: Frame) -> None:
        """Renew the flags once a second."""
        moved = self.camera.look(frame)
        if moved:
            self.moved = moved  # what stood still is not where it was: this stays
        if frame.time < self.next_check and not moved:
            return
        self.next_check = frame.time + _CHECKED
        hand = self.learnt.known.wire.handedness()
        odd = motion_flags(self.readings, self.robot, self.body.period, hand, self.learnt.known.stripes.readable)
        self.flags = (*self.moved, *self.always, *self.learnt.flags, *self._uneven(), *odd)

    def _uneven(self) -> tuple[Flag, ...]:
        """That uneven stripes spoil the rate of a few seconds; over the whole they are learnt."""
        if not self.learnt.known.stripes.stripes:
            return ()
        _, _, body, _, roll, error, _, _ = self.readings.columns()
        edges = np.array(self.follower.record.edges[-body.size :])
        found = evened(body, roll, error, edges, self.body.period)
        if not {flag.name for flag in found.flags} & {"uneven-stripes", "stripes-do-not-fit"}:
            return ()
        return (Flag.named("uneven-stripes-live"),)

    def _rates(self, body_error: float, tail_error: float) -> dict[str, Measured]:
        slopes = {name: window.slope(LEVEL) for name, window in self.windows.items()}
        pixel, scale = self.scale.length_per_pixel, self.scale.relative_uncertainty
        known = {name: slope[0] if math.isfinite(slope[0]) else 0.0 for name, slope in slopes.items()}
        striped = bool(self.learnt.known.stripes.stripes)
        around = len(self.learnt.known.stripes.stripes) * known[_BODY]
        body_size = max(STRIPE_ERROR, body_error if math.isfinite(body_error) else 0.0)
        tail_size = max(PHASE_ERROR, tail_error if math.isfinite(tail_error) else 0.0)
        grid = 2.0 * math.pi * known[_VELOCITY] / pixel
        cue = self.outline.drift if self.learnt.known.start.body.seal is None else CUES.colour_drift
        returning = {
            _VELOCITY: (PIXEL_ERROR * pixel, (grid, known[_TAIL], known[_BODY], around)),
            _BODY: (body_size, (known[_BODY], around)),
            _TAIL: (tail_size, (known[_TAIL], 2.0 * known[_TAIL])),
        }
        drifts = {
            _VELOCITY: pixel * math.hypot(DRIFT_PIXELS if striped else DRIFT_BARE, self.learnt.glare.drift, cue),
            _BODY: max(DRIFT_ANGLE, body_size / 2.0),
            _TAIL: max(DRIFT_ANGLE, tail_size / 2.0),
        }
        found = {}
        for name in RATE_NAMES:
            unit = "m/s" if name == _VELOCITY else "rad/s"
            value, half, span = slopes[name]
            if not math.isfinite(value):
                found[name] = Measured.missing(unit, f"too few readings in the last {self.windows[name].length:g} s")
                continue
            parts = (_BODY, _TAIL) if name == _MOTOR else (name,)
            errors = [periodic_error(*returning[part], span) for part in parts]
            errors += [drifts[part] / span for part in parts]
            errors += [scale * value] if name == _VELOCITY else []
            half = math.hypot(half, NORMAL * math.hypot(*errors))
            found[name] = Measured(value, value - half, value + half, unit)
        return found

    def _forget(self, count: int) -> None:
        record = self.follower.record
        columns = (record.time, record.index, record.placed, record.roll, record.edges, record.tail, record.change)
        for column in columns:
            del column[:count]

    def trial(self, name: str) -> Trial:
        """The measurement of all frames that are kept."""
        flags = (*self.moved, *self.learnt.sight.flags, *self.learnt.flags)
        if not self.follower.record.time:
            raise InputError(f"{name} has no frame after the robot was learnt; allowed: a longer one")
        record, outline = self.follower.record, self.outline
        track = track_of(self.video, self.setup, self.learnt, record, flags, outline=outline)
        return trial_of(track, self.robot, name)


def _synthetic(video: Video) -> tuple[Flag, ...]:
    """Note that the pictures are synthetic, where they state it."""
    sentence = "the pictures say of themselves that they are synthetic: nothing here is measured"
    return (Flag(SYNTHETIC, sentence),) if says_synthetic(video.words) else ()


def _without_spoiled(seen: Observation) -> Observation:
    """An observation without the numbers that a flag spoils; the first such flag is the reason."""
    rates, changes = dict(seen.rates), dict[str, Any]()
    for flag in reversed(seen.flags):
        names = set(flag.spoils)
        if names & {_BODY, _TAIL}:
            names.add(_MOTOR)
        for name in names & set(rates):
            rates[name] = Measured.missing(rates[name].unit, flag.sentence)
        if _VELOCITY in names:
            changes |= {"x": math.nan, "y": math.nan, "position_error": math.nan}
        if _BODY in names:
            changes |= {"body_angle": math.nan, "body_angle_error": math.nan}
        if _TAIL in names:
            changes |= {"tail_phase": math.nan, "tail_phase_error": math.nan}
    return replace(seen, rates=rates, **changes)
