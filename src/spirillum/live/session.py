"""From a source to observations: reads pictures, tracks, sends observations."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import closing, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from threading import Condition, Event, Thread
from typing import Any

from spirillum.envelope import quantity, with_notes_last
from spirillum.errors import InputError, check_choice
from spirillum.live.observation import Observation, Tracked
from spirillum.live.streams import Arrived, Datagrams, Source, line_of, source_of
from spirillum.live.tracker import LiveTracker, seconds
from spirillum.notes import Note
from spirillum.robot.load import load
from spirillum.vision.setup import load_setup

_WAITING = 2  # pictures that may wait: more would only make them old


def at_own_pace(frames: Iterator[Arrived]) -> Generator[Arrived, None, None]:
    """A video's pictures, each when it is due."""
    start = None
    for frame in frames:
        start = time.perf_counter() - frame.time if start is None else start
        due = start + frame.time
        if (wait := due - time.perf_counter()) > 0.0:
            time.sleep(wait)
        yield frame._replace(clock=due)


def newest(frames: Iterator[Arrived]) -> Generator[Arrived, None, None]:
    """Pictures as they come, taken by a thread of their own; the oldest are dropped where they come too fast."""
    waiting: deque[Arrived] = deque(maxlen=_WAITING)
    ready, stopped, ended = Condition(), Event(), list[BaseException | None]()

    def take() -> None:
        error: BaseException | None = None
        try:
            for frame in frames:
                with ready:
                    waiting.append(frame)
                    ready.notify()
                if stopped.is_set():
                    return
        except BaseException as raised:  # handed over to the thread that takes the pictures
            error = raised
        with ready:
            ended.append(error)
            ready.notify()

    Thread(target=take, name="pictures", daemon=True).start()
    try:
        while True:
            with ready:
                ready.wait_for(lambda: waiting or ended)
                if not waiting:
                    if ended[0] is not None:
                        raise ended[0]
                    return
                frame = waiting.popleft()
            yield frame
    finally:
        stopped.set()


PACES = ("real", "fast")
_CLOCK_ERROR, _CLOCK_JITTER = 0.02, 0.3
"""Relative difference of the source's clock from this computer's, and time (s), that are allowed."""

OnObservation = Callable[[Observation, float | None], None]
"""Called with every observation and its latency, s (None with the pace `fast`)."""


def track(
    source: str | Path,
    setup: str | Path,
    *,
    pace: str = "real",
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    learn: str | float = 3.0,
    window: str | float = 2.0,
    learn_from: str | Path | None = None,
    udp: str | None = None,
    duration: str | float | None = None,
    overrides: Mapping[str, Any] | None = None,
    on_observation: OnObservation | None = None,
) -> Tracked:
    """Track a robot live: in front of a camera, in a stream, or in a video at its own pace.

    Args:
        source: a video or folder of images, `camera:0`, or the address of a stream.
        setup: the setup file.
        pace: `real`: pictures that come while the tracker is busy are dropped; `fast`: all pictures of a video.
        size: width and height requested of a camera, pixels.
        fps: frames a second requested of a camera.
        learn: time from which the robot's appearance is learnt, with its unit or a float in s.
        window: time over which each frame's rates are taken, with its unit or a float in s.
        learn_from: a video of the same robot before the same camera, instead of the first seconds.
        udp: `PORT` or `HOST:PORT` to which each observation is sent as a JSON datagram; without a host, this computer.
        duration: time after which it ends, with its unit or a float in s; None: with the source, or an interrupt.
        overrides: dotted fields of the robot, as for `spirillum.load`.
        on_observation: called with every observation and its latency, s (None with the pace `fast`).

    Returns:
        How it went, and speed and rates over all of it; if the source stopped on its way, `stopped` says why.

    Raises:
        InputError: for wrong input, or a source that is not there.
    """
    check_choice("pace", pace, PACES)
    length = None if duration is None else seconds("duration", duration, most=1e7)
    chosen, _ = load_setup(setup)
    between = chosen.start, chosen.end
    pictures = source_of(str(source), size=size, fps=fps, camera=chosen.camera, between=between)
    if pace == "fast" and pictures.kind != "film":
        raise InputError(f"pace = 'fast' with {pictures.name}; allowed: 'real', as a {pictures.kind} has its own pace")
    tracker = LiveTracker(
        setup, _robot(setup, chosen.robot.file, overrides), learn=learn, window=window, learn_from=learn_from,
        name=pictures.name, words=pictures.words,
    )  # fmt: skip
    log = _Log(pictures, pace, tracker, length)
    with nullcontext() if udp is None else closing(Datagrams(udp)) as out:

        def report(observation: Observation, latency: float | None) -> None:
            if out is not None:
                out.send(line_of(observation_line(observation, latency)))
            if on_observation is not None:
                on_observation(observation, latency)

        log.run(report)
        sent = () if out is None else out.notes
    return log.answer(sent)


def observation_line(observation: Observation, latency: float | None) -> dict[str, Any]:
    """An observation as JSON, with its latency before its warnings."""
    more = {} if latency is None else {"latency": quantity(latency, "s")}
    return with_notes_last(observation.to_dict(), **more)


def _robot(setup: str | Path, file: str, overrides: Mapping[str, Any] | None) -> Any:
    """The robot with changed fields; None: as it is."""
    if not overrides:
        return None
    beside = Path(setup).parent / file
    return load(beside if beside.is_file() else file, **overrides)


@dataclass
class _Log:
    """The frames of a run so far: counts, latencies, and why it ended."""

    source: Source
    pace: str
    tracker: LiveTracker
    length: float | None
    frames: int = 0
    tracked: int = 0
    dropped: int = 0
    learnt: float = math.nan
    start: float = 0.0
    span: float = 0.0
    stopped: str = ""
    interrupted: bool = False
    latencies: list[float] = field(default_factory=list)
    _next: int = 0
    _first: tuple[float, float] | None = None
    _clocks: Note | None = None

    def run(self, report: OnObservation) -> None:
        """Track all frames; an interrupt is noted if any frame was tracked."""
        try:
            pictures = self.source.frames()
            if self.pace != "fast":
                pictures = newest(at_own_pace(pictures) if self.source.kind == "film" else pictures)
            with closing(pictures) as frames:
                for frame in frames:
                    report(*self.take(frame))
                    if self.length is not None and frame.time - self.start >= self.length:
                        return
        except (InputError, KeyboardInterrupt) as error:
            if not self.frames:
                raise
            self.interrupted = isinstance(error, KeyboardInterrupt)
            self.stopped = "" if self.interrupted else str(error)

    def take(self, frame: Arrived) -> tuple[Observation, float | None]:
        """The tracker's observation of a frame, and its latency, s."""
        missed = frame.number - self._next
        self._next = frame.number + 1
        self.dropped += missed
        self.tracker.left_out(missed)
        known = self.tracker.learnt
        if self._first is None:
            self._first, self.start = (frame.time, frame.clock), frame.time
        self.span = frame.time - self.start
        observation = self.tracker.update(frame.image, frame.time)
        latency = None if self.pace == "fast" else time.perf_counter() - frame.clock
        self.frames += 1
        if known and math.isnan(self.learnt):
            self.learnt = frame.time
        if known and latency is not None:
            self.latencies.append(latency)
        self.tracked += observation.seen
        self._compare_clocks(frame)
        return observation, latency

    def _compare_clocks(self, frame: Arrived) -> None:
        """Warn if the source's clock and this computer's differ, as they do where frames are lost."""
        assert self._first is not None  # noqa: S101 - the first frame has set it
        if self.source.kind == "film":
            return
        theirs, ours = frame.time - self._first[0], frame.clock - self._first[1]
        self._clocks = None
        if abs(theirs - ours) > _CLOCK_JITTER + _CLOCK_ERROR * ours and ours > 1.0:
            self._clocks = Note.named("clocks-differ", source=self.source.name, theirs=theirs, ours=ours)

    def _hint(self) -> str:
        """What helps a video that has ended while the robot was still learnt."""
        if self.source.kind != "film" or self.length is not None:
            return ""
        if self.pace == "fast" or self.span <= self.tracker.learning:
            return "; a shorter --learn needs less of it, and `spirillum measure` looks at a film as a whole"
        return "; a film this short is tracked with --pace fast, which waits for the learning"

    def answer(self, more: tuple[Note, ...] = ()) -> Tracked:
        """The answer, with further notes."""
        trial = None
        try:
            trial = self.tracker.summary()
        except InputError as error:
            said = "; ".join([*self.source.notes, f"{error}{self._hint()}"])
            self.stopped = f"{self.stopped}; {said}" if self.stopped else said
        return Tracked(
            source=self.source.name,
            pace=self.pace,
            frames=self.frames,
            tracked=self.tracked,
            dropped=self.dropped,
            learnt=self.learnt,
            latencies=tuple(self.latencies),
            trial=trial,
            source_notes=(*self.source.notes, *more, *([self._clocks] if self._clocks else [])),
            stopped=self.stopped,
            interrupted=self.interrupted,
        )
