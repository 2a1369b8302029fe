"""Progress messages of computations that take minutes and start implicitly."""

from __future__ import annotations

import os

ANNOUNCED = "no table of this tube yet"
"""How a progress message begins that is to be read, not passed over: a command prints it as a line of its own."""
TILTED = "a pitched or yawed pose without a table: the flow is solved for in minutes of one core"
LEVEL = "no table of this tube: the flow is solved for in some half a minute"
"""How a message begins that is to be read where the answer is not there at once."""
OF_A_RUN = "the flow at a moment of a run: solved for in one to three minutes of one core"
"""Progress messages that are to be read, too."""


def time_span(least: float, most: float) -> str:
    """Return a span of two times given in seconds, in words: "20 to 60 s", "50 s to 2 min"."""
    (low, unit), (high, last) = map(_rounded, (least, most))
    if (low, unit) == (high, last):
        return f"about {low} {unit}"
    return f"{low} to {high} {last}" if unit == last else f"{low} {unit} to {high} {last}"


def _rounded(seconds: float) -> tuple[int, str]:
    return (max(round(seconds / 10.0), 1) * 10, "s") if seconds < 95.0 else (round(seconds / 60.0), "min")


def progress_message(poses: int, workers: int, kept: int, seconds: tuple[float, float]) -> str:
    """Return the announcement of a table that is made: from how many poses, and about how long it takes."""
    remaining = poses - kept
    before = f", {kept} of them saved before, {remaining} remaining" if kept else ""
    least, most = (remaining * each / max(workers, 1) for each in seconds)
    busy = _slowdown(workers)
    takes = time_span(least, most * busy)
    other = " beside the other work of this machine" if busy > _BUSY else ""
    return (
        f"{ANNOUNCED}: it is computed once from {poses} poses{before}, in {takes} with "
        f"{'1 process' if workers == 1 else f'{workers} processes'}{other}"
    )


_BUSY = 1.5
"""Slowdown by other work from which on it is named."""


def _slowdown(workers: int) -> float:
    """How many times longer work takes beside what runs on this machine; 1 where the system does not report it."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    return max((load + workers) / max(os.cpu_count() or 1, workers), 1.0)


def kept_after(poses: int, kept: int) -> str:
    """Describe the saved state of an interrupted preparation, and how to resume it."""
    return f"{kept} of {poses} poses are saved; the same command resumes the computation"
