"""The tracker frame by frame: it learns the robot from the first seconds, then returns an observation of each frame."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.argument_validation import as_number, validate_arguments
from spirillum.errors import InputError, clipped
from spirillum.files.limits import SMALLEST_SIDE
from spirillum.live.following import Following
from spirillum.live.observation import Observation
from spirillum.measurement.trials import Trial
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option
from spirillum.vision.camera.camera import opened, samples_of
from spirillum.vision.flag import EVERYTHING
from spirillum.vision.setup import Setup, load_setup
from spirillum.vision.track.constants import SEAL
from spirillum.vision.track.learning import learnt_from
from spirillum.vision.track.lone_outline import check_outline
from spirillum.vision.video.frames import Frame, Video

_SAMPLES = 24  # frames from which the robot is learnt, as for a video
_GOLDEN = 0.618034  # step of the low-discrepancy sequence that spreads them


class LiveTracker:
    """Follows one robot through pictures that are handed over one by one; not thread-safe.

    Nothing looks ahead: what is said of a frame follows from it and those before it.
    """

    @validate_arguments
    def __init__(
        self,
        setup: str | Path | Setup,
        robot: str | Path | Robot | None = None,
        *,
        learn: str | float = 3.0,
        window: str | float = 2.0,
        learn_from: str | Path | None = None,
        name: str = "live",
        words: str = "",
    ) -> None:
        """Get ready.

        Args:
            setup: the setup file, or what `load_setup` has read.
            robot: the robot in front of the camera; None: that of the setup.
            learn: time from which the robot's appearance is learnt, with its unit or a float in s.
            window: time over which rates are taken, with its unit or a float in s.
            learn_from: a video of the same robot before the same camera; the tracker then begins with the first frame.
            name: of the source, for sentences.
            words: what the source says of itself, such as that it is synthetic.

        Raises:
            InputError: for wrong input, or a video in which neither ruler nor robot is found.
        """
        if isinstance(setup, Setup):
            self.setup, self._folder = setup, Path()
            self.robot = load(setup.robot.file if robot is None else robot)
        else:
            self.setup, self.robot = load_setup(setup)
            self._folder = Path(setup).parent
            if robot is not None:
                self.robot = load(robot)
        self.name, self._words = name, words
        self._learn, self._window = seconds("learn", learn), seconds("window", window)
        self._samples: list[Frame] = []
        self._wanted: list[float] = []
        self._size: tuple[int, int] | None = None
        self._count, self._last = 0, -math.inf
        self._reason = f"the robot is learnt from the first {self._learn:g} s"
        self._following: Following | None = None
        if learn_from is not None:
            film = opened(learn_from, self.setup)
            self._size = film.size
            self._begin(film, samples_of(film, self.setup.start, self.setup.end))

    @property
    def learning(self) -> float:
        """Time from which the robot's appearance is learnt, s."""
        return self._learn

    @property
    def learnt(self) -> bool:
        """Whether the robot is known."""
        return self._following is not None

    def update(self, frame: np.ndarray, time: float) -> Observation:
        """Look at the next frame.

        The last frame of the learning takes a second or so; if the robot was not found, learning begins anew.

        Args:
            frame: 8-bit RGB, (height, width, 3), as large as the first one.
            time: when it was taken, s; later than the one before.

        Raises:
            InputError: for another kind of array, another size, or a time that does not rise; nothing has changed then.
        """
        self._check(frame, time)
        now = Frame(self._count, float(time), frame)
        self._count, self._last = self._count + 1, now.time
        if self._following is not None:
            return self._following.observed(now)
        self._collect(now)
        return Observation(now.index, now.time, "learning", self._reason)

    @validate_arguments
    def left_out(self, frames: int) -> None:
        """Count frames that were not handed over, as the tracker was busy.

        Args:
            frames: how many, from 0.

        Raises:
            InputError: for a number that is none.
        """
        if frames < 0:
            raise InputError(f"frames = {frames}; allowed: a whole number from 0")
        self._count += frames

    def summary(self) -> Trial:
        """Speed and rates over all frames so far (of 36,000 at most), as `measure` takes them from a video.

        Raises:
            InputError: if the robot was never found.
        """
        if self._following is None:
            reason = self._reason if self._reason.startswith(self.name) else f"{self.name}: {self._reason}"
            joined = ", and" if "; allowed: " in reason else "; allowed:"
            raise InputError(f"{reason}{joined} a robot in view for longer than {self._learn:g} s")
        return self._following.trial(self.name)

    def _check(self, frame: Any, time: Any) -> None:
        kind = getattr(frame, "dtype", None), getattr(frame, "ndim", 0)
        if kind != (np.uint8, 3) or frame.shape[2] != 3:
            raise InputError("frame is no picture; allowed: 8-bit RGB, an array of (height, width, 3)")
        size = frame.shape[1], frame.shape[0]
        if min(size) < SMALLEST_SIDE:
            raise InputError(f"a frame has {size[0]} x {size[1]} pixels; allowed: sides of at least {SMALLEST_SIDE}")
        if self._size is not None and size != self._size:
            width, height = self._size
            raise InputError(f"a frame has {size[0]} x {size[1]} pixels; allowed: {width} x {height}, as those before")
        number = as_number(time)
        if not number > self._last or number == math.inf:
            raise InputError(f"time = {clipped(time)} s; allowed: later than the frame before, {self._last:g} s")
        self._size = size

    def _collect(self, frame: Frame) -> None:
        """Keep frames at uneven intervals, so that they do not alias with the rotation; then learn."""
        if not self._wanted:
            count = np.arange(_SAMPLES)
            shares = (count + (_GOLDEN * count) % 1.0) / _SAMPLES
            self._wanted = [frame.time, *(frame.time + self._learn * shares[1:]).tolist()]
        if frame.time < self._wanted[len(self._samples)]:
            return
        self._samples.append(Frame(frame.index, frame.time, frame.image.copy()))
        if len(self._samples) < _SAMPLES:
            return
        samples, self._samples, self._wanted = self._samples, [], []
        assert self._size is not None  # noqa: S101 - set by the first frame
        try:
            self._begin(Video(Path(self.name), self._size, None, None, words=self._words), samples)
        except InputError as error:
            self._reason = str(error)

    def _begin(self, video: Video, samples: list[Frame]) -> None:
        """Learn by the cues of `measure`; by the outline where the robot hardly moved and nothing else is in view."""
        learnt = learnt_from(video, samples, self.setup, self.robot, self._folder)
        start = learnt.known.start
        frames, poses = (
            [one.small(learnt.sight.reduction) for one in samples],
            [start.expected(one.time) for one in samples],
        )
        appearance, alone = self.setup.robot.appearance, start.search is None
        outline = check_outline(frames, poses, start.body, appearance, alone=alone)
        moved = float(np.ptp([pose.x for _, pose in start.path])) / start.body.optics.length_per_pixel
        if start.body.seal is not None and moved < SEAL.far_enough and not outline.suspect:
            learnt = learnt_from(video, samples, self.setup, self.robot, self._folder, by_seal=False)
        useless = [flag for flag in learnt.flags if set(EVERYTHING) <= set(flag.spoils)]
        if useless:
            raise InputError(useless[0].sentence)
        self._following = Following(video, self.setup, self.robot, learnt, outline, self._window)


def seconds(name: str, value: str | float, most: float = 600.0) -> float:
    """A time from a user."""
    found = parse_option(name, value, KINDS["time"])
    if not 0.1 <= found <= most:
        raise InputError(f"{name} = {found:g} s; allowed: 0.1 s to {most:g} s")
    return float(found)
