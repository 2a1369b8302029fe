"""Progress as plain lines, for standard error that is a file or a pipe."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Lock, Thread
from time import monotonic

_PERIOD = 15.0
"""Least time between two lines, s; shorter work prints none."""
_SHARE = 0.05
"""Least time between two lines over the time since the start, so that a long log stays readable."""
_AT_ONCE = 1.0
"""Work that is done within this time from the start of a stage was cached and does not enter the pace, s."""
_LOOK = 1.0
"""Time between two looks whether a line is due, s: a step may take minutes."""


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


class ProgressLines:
    """A progress callback that prints a line from time to time: what is done, of how much, and the time left."""

    def __init__(
        self, write: Callable[[str], object], announcements: tuple[str, ...], clock: Callable[[], float] = monotonic
    ) -> None:
        """No work yet."""
        self._write, self._announcements, self._clock, self._lock = write, announcements, clock, Lock()
        self._begin = self._printed = self._start = clock()
        self._stage: tuple[str, int | None] = ("", None)
        self._first = self._done = 0

    def __call__(self, what: str, done: int, total: int | None) -> None:
        """Take note of progress.

        Args:
            what: the stage.
            done: steps of it that are done.
            total: of how many; None or 0: not known.
        """
        if what.startswith(self._announcements):
            self._write(what)
            return
        with self._lock:
            now = self._clock()
            if (what, total) != self._stage or done < self._done:
                self._stage, self._start, self._first = (what, total), now, done
            if now - self._start < _AT_ONCE:
                self._first = done
            self._done = done
        self.look()

    def look(self) -> None:
        """Print a line if there is work and one is due."""
        with self._lock:
            now = self._clock()
            if self._stage[0] and now - self._printed >= max(_PERIOD, _SHARE * (now - self._begin)):
                self._printed = now
                self._write(self._line(now))

    def _line(self, now: float) -> str:
        (what, total), steps = self._stage, self._done - self._first
        of = f" of {total}" if total else ""
        left = ""
        if total and steps > 0:
            left = f", about {_duration((now - self._start) / steps * (total - self._done))} left"
        return f"{what}: {self._done}{of}, {_duration(now - self._begin)} elapsed{left}"


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    minutes = seconds / 60.0
    return f"{minutes:.0f} min" if minutes < 120.0 else f"{minutes / 60.0:.1f} h"
