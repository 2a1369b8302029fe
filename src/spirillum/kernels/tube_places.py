"""Mean resistance of a robot at many places of its tube, compiled: for fits and draws that ask for thousands."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.compiled import compiled
from spirillum.kernels.film_table import smallest_gap
from spirillum.kernels.tube_table import INSIDE, MOTIONS, film_start, mean_resistance_at

PHASES = 9
"""Phases that a mean is taken over: what they leave of a table's four harmonics is below 1e-6, five up to 5e-4."""
_STEPS = 30
_ACCURACY = 1e-12  # of the gap, over the radius of the tube


@compiled
def offset_at_gap(film: Samples, start: float, gap: float, pitch: float, yaw: float) -> float:
    """Offset e of the body's mid-length at which its smallest distance to the wall is `gap`, m; NaN where none is.

    Args:
        film: packed film of the body in its tube.
        start: offset near which it is looked for, towards the wall, m.
        gap: smallest distance between body and wall, m.
        pitch: nose up, rad.
        yaw: nose to the side, rad.
    """
    radius = film[0]
    e, spare = start, smallest_gap(film, start, pitch, yaw) - gap
    before, spare_before = e + spare, smallest_gap(film, e + spare, pitch, yaw) - gap
    for _ in range(_STEPS):
        if abs(spare) <= _ACCURACY * radius:
            return e
        slope = (spare - spare_before) / (e - before) if e != before else -1.0
        if not -1.5 < slope < -0.05:  # towards the wall the distance falls by nearly as much as the body sinks
            slope = -1.0
        before, spare_before = e, spare
        e = e - spare / slope
        spare = smallest_gap(film, e, pitch, yaw) - gap
    return np.nan


@compiled
def mean_resistances(
    tables: Samples, which: np.ndarray, gap: Samples, pitch: Samples, yaw: Samples, out: Samples
) -> None:
    """Fill the 8x8 at each place, averaged over the tail's phase, viscosity 1; NaN outside the table.

    Args:
        tables: packed tables, one in each row, see `tube_table.packed`.
        which: row of each place's table, (n,).
        gap: smallest distances between body and wall, m, (n,).
        pitch: nose up, rad, (n,).
        yaw: nose to the side, rad, (n,).
        out: to be filled, (n, 8, 8).
    """
    for n in range(gap.shape[0]):
        table = tables[which[n]]
        film = table[film_start(table) :]
        e = offset_at_gap(film, film[0] - film[1] - gap[n], gap[n], pitch[n], yaw[n])
        left = INSIDE + 1
        if e >= 0.0:
            left = mean_resistance_at(table, e, pitch[n], yaw[n], PHASES, out[n])
        if left != INSIDE:
            for i in range(MOTIONS):
                for j in range(MOTIONS):
                    out[n, i, j] = np.nan
