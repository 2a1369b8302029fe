"""Rates of a free robot, and steps in time by the linearly implicit method Rodas5P: csrc/stiff_steps.c.

A robot is packed by `tube_motion`, with its table, or by `two_links`, with an empty table.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float64, native

DONE, PAUSED, CROSSED, STUCK = 0, 1, 2, 3
"""The time was reached; the steps are used up; something watched has changed its sign in the last step; no step is
small enough."""

# What a run is watched for, behind the gaps less the roughness: room to the tube's end, charge left, the table's range.
ROOM, CHARGE_LEFT, INSIDE = 0, 1, 2
WATCHED = 3

# Where the tube and the battery end.
CHANNEL, MIDDLE, NOSE, TIP, MOST_CHARGE = 0, 1, 2, 3, 4
LIMITS = 5

ACTING = (1, 2, 3, 4, 5, 6, 7, 9)
"""Components of the state on which the rates depend: position across the tube, attitude, tail phase, current."""

# Memory between calls: time, length of the next step; time and length of the last step taken; samples answered.
TIME, STEP, LAST_TIME, LAST_STEP, ANSWERED = 0, 1, 2, 3, 4
MEMORY = 5


@native("dy", "data")
def rates(
    dy: Float64[Array, "19"],  # derivative of the state, the result
    time: float,  # s
    y: Float64[Array, "19"],  # the state, see the constants of `rigid_links`
    # from `packed` of `tube_motion` or `two_links`; its rates are where the solution begins
    data: Float64[Array, "size"],
    table: Float64[Array, "table_size"],  # the robot's table, (0,) for one without a tube
) -> None:
    """Write the time derivative of a state into `dy`, and what is observed to the begin of `data`."""


@native("data", "out")
def observe(
    time: Float64[Array, "count"],
    states: Float64[Array, "count 19"],
    data: Float64[Array, "size"],
    table: Float64[Array, "table_size"],
    out: Float64[Array, "count columns"],
) -> None:
    """Write what is observed in samples of one stretch between switchings into the rows of `out`, its first columns."""


@native("data", "gaps")
def gaps_of(
    y: Float64[Array, "19"],
    data: Float64[Array, "size"],
    table: Float64[Array, "table_size"],
    gaps: Float64[Array, "gaps"],
) -> None:
    """Fill the gap at every site, and last the smallest of the wire (infinite far from the wall), m.

    Without a tube: the thinnest film, from the tips of the roughness; infinite without a wall.
    """


@native("data", "gaps")
def watched(
    y: Float64[Array, "19"],
    outside: float,
    data: Float64[Array, "size"],
    table: Float64[Array, "table_size"],
    limits: Float64[Array, "5"],
    rough: float,
    gaps: Float64[Array, "watched"],
) -> float:
    """Write what a run is watched for into `gaps`; return the smallest gap."""


@native("out")
def interpolate(
    share: float,
    y: Float64[Array, "19"],
    new: Float64[Array, "19"],
    increments: Float64[Array, "8 19"],
    out: Float64[Array, "19"],
) -> None:
    """Fill the state inside a step, of order 4, at a share of it from 0 to 1."""


@native("memory", "y", "before", "increments", "jacobian", "gaps", "states", "data")
def advance(
    stop: float,  # where to stop, s
    clip: bool,  # noqa: FBT001 -- whether a step ends there; else the last one may go beyond
    steps: int,  # number of steps at most
    tolerance: float,  # error of a step over the sizes
    memory: Float64[Array, "5"],  # time and step length, see the constants; changed
    y: Float64[Array, "19"],  # the state, (19,); changed
    before: Float64[Array, "19"],  # result, the state at the beginning of the last step
    increments: Float64[Array, "8 19"],  # result, those of the last step
    # result, derivatives of the rates of what acts (`ACTING`) at the beginning of the last step, 1/s
    jacobian: Float64[Array, "8 8"],
    gaps: Float64[Array, "watched"],  # what is watched, at `y`; changed
    samples: Float64[Array, "samples"],  # increasing times, s: those in the steps taken are answered
    states: Float64[Array, "samples 19"],  # result, the states at the samples
    # sizes of the state's components below which nothing matters, (19,); a small change of time, s (0: nothing depends
    # on it); a time of the order of the run's, s
    sizes: Float64[Array, "21"],
    limits: Float64[Array, "5"],  # where tube and battery end
    rough: float,  # height of the asperities, m
    data: Float64[Array, "size"],  # from `packed` of `tube_motion` or `two_links`
    table: Float64[Array, "table_size"],  # the robot's table, (0,) for one without walls
) -> int:
    """Step on until a time, an event, or the number of steps is reached.

    Returns:
        One of `DONE`, `PAUSED`, `CROSSED`, `STUCK`.
    """
