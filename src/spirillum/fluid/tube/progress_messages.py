"""Progress messages of computations that take minutes and start implicitly."""

from __future__ import annotations

ANNOUNCED = "no table of this tube yet"
"""How a progress message begins that is to be read, not passed over: a command prints it as a line of its own."""
TABLE_TAKES = "half a minute to two minutes on two cores"
"""What the table of one robot takes without yaw, measured on a fast and on a slow machine."""
TILTED = "a pitched or yawed place without a table: the flow is solved for in minutes of one core"
LEVEL = "no table of this tube: the flow is solved for in some half a minute"
"""How a message begins that is to be read where the answer is not there at once."""
OF_A_RUN = "the flow at a moment of a run: solved for in one to three minutes of one core"
"""Progress messages that are to be read, too."""


def progress_message(places: int, workers: int, kept: int, seconds: tuple[float, float] = (10.0, 17.0)) -> str:
    """Return the announcement of a table that is made: from how many places, and about how long it takes."""
    remaining = places - kept
    least, most = (max(round(remaining * each / max(workers, 1) / 60.0), 1) for each in seconds)
    minutes = f"about {least} min" if least == most else f"{least} to {most} min"
    before = f", {kept} of them saved before, {remaining} remaining" if kept else ""
    return (
        f"{ANNOUNCED}: it is computed once from {places} nodes{before}, in {minutes} with "
        f"{'1 process' if workers == 1 else f'{workers} processes'}"
    )


def kept_after(places: int, kept: int) -> str:
    """Describe the saved state of an interrupted preparation, and how to resume it."""
    return f"{kept} of {places} nodes are saved; the same command resumes the computation"
