"""From the thread that takes pictures to the one that tracks: the newest first; what comes too fast is dropped."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Generator, Iterator
from threading import Condition, Event, Thread

from spirillum.live.sources import Arrived

__all__ = ["at_own_pace", "newest"]

_WAITING = 2
"""Pictures that may wait: more would only make them old."""


def at_own_pace(frames: Iterator[Arrived]) -> Generator[Arrived, None, None]:
    """A film's pictures, each when it is due."""
    start = None
    for frame in frames:
        start = time.perf_counter() - frame.time if start is None else start
        due = start + frame.time
        if (wait := due - time.perf_counter()) > 0.0:
            time.sleep(wait)
        yield frame._replace(clock=due)


def newest(frames: Iterator[Arrived]) -> Generator[Arrived, None, None]:
    """Pictures as they come, taken by a thread of their own; the oldest are dropped where they come too fast.

    Args:
        frames: where they come from; what it raises is raised here once all pictures before it are handed over.
    """
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
