"""What is odd about the last seconds: rates too fast for the frames, contradictions, a camera that was moved."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from spirillum.arrays import Samples
from spirillum.robot.robot import Robot
from spirillum.vision.flag import Flag
from spirillum.vision.track.first_look import Start
from spirillum.vision.track.motion import Motion
from spirillum.vision.track.steadiness import View, shift_of, view_of
from spirillum.vision.track.unwrapping import contradictions, no_stripe_passes, nothing_moves, unwrapped
from spirillum.vision.track.warnings import EVERYTHING
from spirillum.vision.video.frames import Frame

__all__ = ["CameraWatch", "Readings", "motion_flags"]

_BETWEEN = 1.0
"""Time between two pictures that are kept, s."""
_TOGETHER = 5
"""Pictures from which a background is made."""


@dataclass
class Readings:
    """What was read in the last seconds: on each frame time, x, continuous angles, and both angles as read."""

    length: float
    """Time that is kept, s."""
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


def motion_flags(readings: Readings, robot: Robot, period: float, hand: int, readable: float) -> tuple[Flag, ...]:
    """Flags on the motion in the last seconds.

    Args:
        readings: of the last seconds.
        robot: the robot.
        period: of the stripes, rad.
        hand: handedness by perspective, as of `TailWave.handedness`.
        readable: share of a turn in which something of the stripes faces the camera.
    """
    if len(readings.rows) < 4:
        return ()
    time, x, body, tail, roll, roll_error, phase, phase_error = readings.columns()
    of_body = unwrapped(time, roll, roll_error, period, readable=readable)[1]
    of_tail = unwrapped(time, phase, phase_error, 2.0 * np.pi, "tail")[1]
    motion = Motion(time, x, body, tail)
    odd = (*nothing_moves(motion, robot), *contradictions(motion, robot, hand))
    return (*of_body, *of_tail, *odd, *no_stripe_passes(motion, robot, readable=readable))


class CameraWatch:
    """Compares what stands still in the last pictures with what stood still when the robot was learnt."""

    def __init__(self, start: Start, *, ruled: bool) -> None:
        """Begin.

        Args:
            start: result of the first look.
            ruled: whether a ruler is in the picture.
        """
        self._start, self._ruled = start, ruled
        self._first: View | None = None
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
        """Flags on some pictures, against the first ones."""
        now = view_of(pictures, self._start, ruled=self._ruled)
        if self._first is None:
            self._first = now
            return ()
        shift, moved = shift_of(self._first, now)
        if not moved:
            return ()
        sentence = (
            f"the camera or the ruler was moved: the picture lies {abs(shift):.1f} pixels along the channel from where "
            "it lay when the robot was learnt; nothing is given: begin anew"
        )
        return (Flag("camera-moved", sentence, EVERYTHING),)
