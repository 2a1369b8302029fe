"""Progress messages of computations that take minutes and start implicitly."""

from __future__ import annotations

from spirillum.worker_pool import BUSY, slowdown

ANNOUNCED = "no table of this tube yet"
"""How a progress message begins that is to be read, not passed over: a command prints it as a line of its own."""
TILTED = "a pitched or yawed pose without a table: the flow is solved for"
LEVEL = "no table of this tube: the flow is solved for"
OF_A_RUN = "the flow at a moment of a run: it is solved for"
"""How messages begin that are to be read, too; the second only where the answer is not there at once."""
SOLUTION = {LEVEL: (3.0, 15.0), TILTED: (10.0, 40.0), OF_A_RUN: (60.0, 180.0)}
"""Time of each on a fast and on a slow core, s."""


def time_span(least: float, most: float) -> str:
    """Return a span of two times given in seconds, in words: "20 to 60 s", "50 s to 2 min"."""
    (low, unit), (high, last) = map(_rounded, (least, most))
    if (low, unit) == (high, last):
        return f"about {low} {unit}"
    return f"{low} to {high} {last}" if unit == last else f"{low} {unit} to {high} {last}"


def _rounded(seconds: float) -> tuple[int, str]:
    return (max(round(seconds / 10.0), 1) * 10, "s") if seconds < 95.0 else (round(seconds / 60.0), "min")


def time_on_free_cores(seconds: tuple[float, float], workers: int = 1) -> str:
    """Return how long work takes on free cores, in words, from what a fast and a slow core need for all of it."""
    cores = f"{workers} free cores" if workers > 1 else "a free core"
    return f"{time_span(seconds[0] / workers, seconds[1] / workers)} on {cores}"


def time_now(seconds: tuple[float, float], workers: int = 1) -> str:
    """Return `time_on_free_cores` and, where other work slows this machine down, how long it takes beside that."""
    free, times = time_on_free_cores(seconds, workers), slowdown(workers)
    if times < BUSY:
        return free
    most, unit = _rounded(seconds[1] * times / workers)
    return f"{free}, up to {most} {unit} beside this machine's other work"


def solution_message(begin: str) -> str:
    """Return one of `SOLUTION` with how long it takes."""
    return f"{begin} in {time_now(SOLUTION[begin])}"


_FURTHER_TAIL = (
    0.42  # time for a further tail at a pose, over that for the first: three tails together, 91 CPU s for 50
)


def progress_message(poses: int, workers: int, kept: int, seconds: tuple[float, float], further: int = 0) -> str:
    """Return the announcement of tables that are made: from how many poses, and about how long it takes.

    `further` tails share the remaining poses with the first ones.
    """
    remaining = poses - kept
    before = f", {kept} of them saved before, {remaining} remaining" if kept else ""
    share = remaining + _FURTHER_TAIL * further
    takes = time_now((share * seconds[0], share * seconds[1]), max(workers, 1))
    return f"{ANNOUNCED}: it is computed once from {poses} poses{before}, in {takes}"


def saved_state_message(poses: int, kept: int) -> str:
    """Describe the saved state of an interrupted preparation, and how to resume it."""
    return f"{kept} of {poses} poses are saved; the same command resumes the computation"
