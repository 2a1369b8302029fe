"""One frame after the other: pose of the body, angles of stripes and tail; causal."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot
from statistics import median
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.vision.camera.optics import BodyPose, Optics
from spirillum.vision.track.body import PoseFit
from spirillum.vision.track.constants import DETECTION
from spirillum.vision.track.identity import Identified
from spirillum.vision.track.initial_detection import close_place, pose_on_path
from spirillum.vision.track.search import PoseCandidate, candidates
from spirillum.vision.track.steadiness import PictureChange
from spirillum.vision.video.frames import Frame


@dataclass(frozen=True)
class FollowingConstants:
    """From frame to frame."""

    search_interval: int = 15  #: Frames between two searches of the whole picture for a robot that was lost.
    memory: int = 12  #: Frames from which the next place is predicted.
    largest_jump: float = 4.0  #: Largest accepted distance from the predicted position, pixels.
    lateral_deviation: float = 1.5
    """Distance across the channel from where it should be from which on that place is compared, pixels: the sides of
    stripes look like those of the body, and cross it as it turns."""
    gap: float = 3.0  #: Time between frames over the usual one from which the robot may have left its predicted path.
    sure_step: float = 1.0
    """Largest predicted step over such a gap to which the fit converges wherever the robot has gone, pixels."""
    usual_edges: int = 200  #: Frames with the body in view whose median is the usual share of the edges that fit.
    few_edges: float = 0.75
    """Share of the edges that fit, over the usual one, below which the detection may be false: a shadow takes some."""
    more_edges: float = 1.2
    """Share of the edges that fit at another place, over that where it was followed, from which on it is there."""


FOLLOWING = FollowingConstants()


_UNREAD = (np.nan, np.nan)


class FrameDetection(NamedTuple):
    """The observation on one frame, for drawing."""

    time: float  #: Time of the frame, s.
    pose: BodyPose | None  #: Pose of the body in the camera's frame; None where it was not detected.
    body_angle: float  #: Rotation angle of the body, rad, modulo the stripes' period; NaN where unreadable.
    tail_phase: float  #: Phase of the tail, rad, modulo 2 pi; NaN where unreadable.
    optics: Optics  #: The camera.


@dataclass
class Record:
    """Observations on all frames so far."""

    time: list[float] = field(default_factory=list)  #: Time of each frame, s.
    index: list[int] = field(default_factory=list)  #: Number of each frame.
    placed: list[PoseFit] = field(default_factory=list)  #: The body on each frame.
    roll: list[tuple[float, float]] = field(default_factory=list)
    """Angle of the body modulo the stripes' period, and its standard error, rad; NaN where unreadable."""
    edges: list[np.ndarray] = field(default_factory=list)
    """How far the edges between stripes lie off an even pattern, rad, (stripes,): see `edge_shifts`."""
    tail: list[tuple[float, float]] = field(default_factory=list)
    """Phase of the tail modulo 2 pi, and its standard error, rad; NaN where unreadable."""
    change: list[tuple[float, float]] = field(default_factory=list)
    """Change of the picture against the last one and the one before, of 255; NaN where there is none."""


class FrameTracker:
    """Follows a robot that is known from frame to frame."""

    def __init__(self, known: Identified, still: Samples, *, ahead: bool = True) -> None:
        """Begin with learnt readers; `ahead` if the initial detection covers the frames that come."""
        self.known, self.still, self.record = known, still, Record()
        self._ahead = ahead
        self._change = PictureChange(known.start.body.bounds)
        self._last: BodyPose | None = None
        self._shares: deque[float] = deque(maxlen=FOLLOWING.usual_edges)

    def step(self, frame: Frame) -> FrameDetection:
        """Place the robot on the next frame, and read its stripes and tail."""
        start, record = self.known.start, self.record
        found = self._placed(frame, self._guess(frame.time))
        if self._needs_full_search(found):
            found = self._search_whole_picture(frame, found)
        stripes = self.known.stripes
        roll, edges = _UNREAD, np.asarray(np.full(len(stripes.stripes), np.nan))
        if found.known:
            roll, edges = stripes.read_with_edges(frame.image, found.pose)
        tail = self.known.wire.read(frame.image, found.pose) if found.known else _UNREAD
        record.time.append(frame.time)
        record.index.append(frame.index)
        record.placed.append(found)
        record.roll.append(roll)
        record.edges.append(edges)
        record.tail.append(tail)
        record.change.append(self._change.of(frame.image))
        if found.known:
            self._last = found.pose
            self._shares.append(found.share)
        return FrameDetection(frame.time, found.pose if found.known else None, roll[0], tail[0], start.body.optics)

    def _guess(self, time: float) -> BodyPose | None:
        """Pose predicted from the last frames; None where the body was not detected on the last one."""
        record = self.record
        if not record.placed or not record.placed[-1].known:
            return None
        times, places = record.time[-FOLLOWING.memory :], record.placed[-FOLLOWING.memory :]
        last = [(at, one.pose) for at, one in zip(times, places, strict=True) if one.known]
        return last[0][1] if len(last) == 1 else pose_on_path(last, time)

    def _expected(self, time: float) -> BodyPose:
        """Where it should be by the first look; in frames that are new, where it was last."""
        if self._ahead or self._last is None:
            return self.known.start.expected(time)
        return self._last

    def _placed(self, frame: Frame, guess: BodyPose | None) -> PoseFit:
        """Place the body near a predicted pose, else where it should be; a jump counts as not detected."""
        found, expected = None, self._expected(frame.time)
        if guess is not None:
            found = self._after_a_gap(frame, guess) if self._is_after_a_gap(frame.time, guess) else None
            found = found or self._near(frame, guess)
            far = FOLLOWING.lateral_deviation * self.known.start.body.optics.length_per_pixel
            if found.known and abs(found.pose.y - expected.y) <= far:
                return found
        again = self._near(frame, expected)
        if found is not None and found.known and again.known:
            return max(found, again, key=lambda one: one.share)
        return again if found is None or again.known else found

    def _near(self, frame: Frame, guess: BodyPose) -> PoseFit:
        """Place the body near a pose; further away it counts as not detected."""
        body = self.known.start.body
        found, far = body.place(frame.image, guess), FOLLOWING.largest_jump * body.optics.length_per_pixel
        if hypot(found.pose.x - guess.x, found.pose.y - guess.y) <= far:
            return found
        return found._replace(error=BodyPose(np.nan, np.nan, np.nan))

    def _is_after_a_gap(self, time: float, guess: BodyPose) -> bool:
        """Whether no frame was taken for so long that the robot may have left its predicted path."""
        times, last = self.record.time[-FOLLOWING.memory :], self.record.placed[-1].pose
        far = FOLLOWING.sure_step * self.known.start.body.optics.length_per_pixel
        if hypot(guess.x - last.x, guess.y - last.y) <= far:
            return False
        return time - times[-1] > FOLLOWING.gap * median(later - before for before, later in pairwise(times))

    def _after_a_gap(self, frame: Frame, guess: BodyPose) -> PoseFit | None:
        """The body where most of its edges fit: at the predicted pose, near it, or where it was; None if nowhere."""
        near = self.known.start.close(frame, self.still, guess)
        tried = [self._near(frame, pose) for pose in (guess, near, self.record.placed[-1].pose)]
        return max((one for one in tried if one.known), key=lambda one: one.share, default=None)

    def _needs_full_search(self, found: PoseFit) -> bool:
        """Whether to search the whole picture: the body is lost, or far fewer of its edges fit than usually do."""
        # It is searched for at once where they do so on a frame for the first time, then now and then.
        placed = self.record.placed
        now_and_then = len(placed) % FOLLOWING.search_interval == 0
        if not found.known:
            return now_and_then
        if len(self._shares) < FOLLOWING.memory:
            return False
        few = FOLLOWING.few_edges * median(self._shares)
        return found.share < few and (now_and_then or not placed[-1].known or placed[-1].share >= few)

    def _search_whole_picture(self, frame: Frame, lost: PoseFit) -> PoseFit:
        """Search the whole picture for the body; `lost` if it is not found where more of its edges fit."""
        least = FOLLOWING.more_edges * lost.share if lost.known else 0.0
        start = self.known.start
        for candidate in self._candidates(frame):
            if candidate.score > DETECTION.faint * start.score:
                found = start.body.place(frame.image, candidate.pose)
                if found.known and found.share > least:
                    return found
        return lost

    def _candidates(self, frame: Frame) -> list[PoseCandidate]:
        """Where the body may be in the whole picture, to a pixel, best first."""
        start, still = self.known.start, self.still
        if start.search is not None:
            rough = start.search.places(frame.image)[:2]
            return [one._replace(pose=start.close(frame, still, one.pose)) for one in rough]
        factor = frame.image.shape[1] // still.shape[1]
        rough = candidates(frame.reduced(factor), still, start.body.shape(factor))[:2]
        return [close_place(frame, still, start.body, one.pose) for one in rough]
