"""Rates of a free robot, and steps in time by the linearly implicit method Rodas5P: csrc/stiff_steps.c.

A robot is packed by `tube_motion`, with its table, or by `two_links`, with an empty table.
"""

from __future__ import annotations

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
