"""The state in which a released run in a tube ends, in a word."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from spirillum.dynamics.integration import END_OF_CHANNEL
from spirillum.kernels.tube_motion import RANGE_LEFT
from spirillum.notes import Note
from spirillum.swimming.steady_state import SteadyState

if TYPE_CHECKING:
    import xarray as xr


def end_state(run: xr.Dataset, notes: Iterable[Note], slow: float) -> str:
    """Return the key of `END_STATES` for a run in a tube.

    Args:
        run: the run.
        notes: its notes.
        slow: sliding speed below which dry friction is not resolved, m/s.
    """
    events = str(run.attrs["events"])
    if END_OF_CHANNEL in events:
        return "reaches-end"
    if RANGE_LEFT in events:
        return "left-table"
    late = run.isel(time=slice(run.sizes["time"] // 3, None))
    moved = np.abs(late["position"].values[-1] - late["position"].values[0]).max()
    is_slow = moved < slow * float(late["time"][-1] - late["time"][0]) and not float(run["duty"][-1]) > 0.0
    if is_slow or is_held(notes):
        return "standing"
    if np.ptp(late["azimuth"].values) > 2.0 * np.pi:
        return "orbit"
    if np.cos(late["azimuth"].values).mean() < 0.0:
        return "ceiling"
    return "steady" if float(run["time_steady"]) > 0.0 else "changing"


def state_of(lying: SteadyState, notes: Iterable[Note]) -> str:
    """Return the key of `END_STATES` for a motion that was followed to its steady state."""
    if is_held(notes):
        return "standing"
    if RANGE_LEFT in lying.ended:
        return "left-table"
    if lying.state == "steady" and np.cos(lying.azimuth) < 0.0:
        return "ceiling"
    return {"orbits": "orbit", "goes around": "orbit"}.get(lying.state, lying.state)


def is_held(notes: Iterable[Note]) -> bool:
    """Whether dry friction holds the robot."""
    return any(note.code == "held-by-friction" for note in notes)
