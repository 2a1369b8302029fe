"""Progress as plain lines: what is done, of how much, and the time that is left by the pace of the steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Lock, Thread, Timer
from time import monotonic

_PERIOD = 15.0  # least time between two lines, s
FIRST = 5.0  #: Time after which the first line is printed, s; shorter work prints none.
_SHARE = 0.05  # least time between two lines over the time since the start, so that a long log stays readable
_AT_ONCE = 1.0  # work that is done within this time from the start of a stage was cached and does not enter the pace, s
_FEWEST = 2  # steps from which on a time left is stated
_LOOK = 1.0  # time between two looks whether a line is due, s: a step may take minutes


@contextmanager
def progress_lines(write: Callable[[str], object], announcements: tuple[str, ...]) -> Iterator[ProgressLines]:
    """Print progress from time to time, also while a step takes long."""
    lines, ended = ProgressLines(write, announcements), Event()

    def look() -> None:
        while not ended.wait(_LOOK):
            lines.look()

    thread = Thread(target=look, name="progress", daemon=True)
    thread.start()
    try:
        yield lines
    finally:
        ended.set()
        thread.join()


@contextmanager
def line_after(write: Callable[[str], object], what: str) -> Iterator[None]:
    """Print a line once where the block takes long."""
    timer = Timer(FIRST, write, (f"{what}, {FIRST:.0f} s elapsed",))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


class StagePace:
    """How far the present stage of some work is, and the time that the rest takes at the pace of its steps."""

    def __init__(self, clock: Callable[[], float] = monotonic) -> None:
        """No work yet."""
        self.what, self.done = "", 0
        self.total: int | None = None
        self._clock, self._first = clock, 0
        self._start = self._last = clock()

    def step(self, what: str, done: int, total: int | None) -> None:
        """Take note of progress; what is done within `_AT_ONCE` was cached, and does not enter the pace."""
        now = self._clock()
        if (what, total) != (self.what, self.total) or done < self.done:
            self.what, self.total, self.done, self._first = what, total, done, done
            self._start = self._last = now
        if now - self._start < _AT_ONCE:
            self._first = done
        if done > self.done:
            self._last = now
        self.done = done

    @property
    def time_left(self) -> float | None:
        """Time until the stage is done, s; None then, and before a second step, for the first ones start together."""
        steps = self.done - self._first
        if not self.total or self.done >= self.total or steps < min(_FEWEST, self.total - self._first):
            return None
        since = self._clock() - self._last
        each = max((self._last - self._start) / steps, since)
        return max(each * (self.total - self.done) - since, 0.0)


class ProgressLines:
    """A progress callback that prints a line from time to time: what is done, of how much, and the time left."""

    def __init__(
        self, write: Callable[[str], object], announcements: tuple[str, ...], clock: Callable[[], float] = monotonic
    ) -> None:
        """No work yet."""
        self._write, self._announcements, self._clock, self._lock = write, announcements, clock, Lock()
        self._begin = clock()
        self._printed = self._begin + FIRST - _PERIOD
        self._pace = StagePace(clock)

    def __call__(self, what: str, done: int, total: int | None) -> None:
        """Take note of progress."""
        if what.startswith(self._announcements):
            self._printed = self._clock()
            self._write(what)
            return
        with self._lock:
            self._pace.step(what, done, total)
        self.look()

    def look(self) -> None:
        """Print a line if one is due."""
        with self._lock:
            now = self._clock()
            if now - self._printed >= max(_PERIOD, _SHARE * (now - self._begin)):
                self._printed = now
                self._write(self._line(now))

    def _line(self, now: float) -> str:
        pace = self._pace
        of = f" of {pace.total}" if pace.total else ""
        left = "" if pace.time_left is None else f", about {duration(pace.time_left)} left"
        if not pace.what:
            return f"at work, {duration(now - self._begin)} elapsed"
        return f"{pace.what}: {pace.done}{of}, {duration(now - self._begin)} elapsed{left}"


_FINE = 10.0  # minutes below which a duration is printed with its seconds


def duration(seconds: float) -> str:
    """Return a duration in words."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes = seconds / 60.0
    if minutes < _FINE:
        return "{} min {:02} s".format(*divmod(round(seconds), 60))
    return f"{minutes:.0f} min" if minutes < 120.0 else f"{minutes / 60.0:.1f} h"
