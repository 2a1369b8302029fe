"""Progress messages of computations that take minutes and start implicitly."""

from __future__ import annotations

ANNOUNCED = "no table of this tube yet"
"""Prefix of a progress message that a command prints as a line of its own."""
TABLE_TAKES = "12 to 28 minutes of one core"
"""Time to compute the table of one robot, measured on a fast and on a slow machine."""
TILTED = "a pitched or yawed pose without a table: solving for the flow takes minutes of one core"
OF_A_RUN = "the flow at a moment of a run: solved for in one to three minutes of one core"
"""Progress messages that are to be read, too."""
_SECONDS = (10.0, 17.0)
"""Time of one process per node on a fast and on a slow machine, s; three times as long near the wall."""


def progress_message(places: int, workers: int, kept: int) -> str:
    """Announce the computation of tables: number of nodes and estimated duration."""
    remaining = places - kept
    least, most = (max(round(remaining * seconds / max(workers, 1) / 60.0), 1) for seconds in _SECONDS)
    minutes = f"about {least} min" if least == most else f"{least} to {most} min"
    before = f", {kept} of them saved before, {remaining} remaining" if kept else ""
    return (
        f"{ANNOUNCED}: it is computed once from {places} nodes{before}, in {minutes} with "
        f"{'1 process' if workers == 1 else f'{workers} processes'}"
    )


def kept_after(places: int, kept: int) -> str:
    """Describe the saved state of an interrupted preparation, and how to resume it."""
    return f"{kept} of {places} nodes are saved; the same command resumes the computation"
