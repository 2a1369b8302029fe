"""A trial beside the simulated robot: what was tracked in its film, and a run of the same robot, on one time axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.run_file import robot_of
from spirillum.errors import InputError
from spirillum.pages.recording import finite, thinned
from spirillum.pages.replay import replay_of_run

if TYPE_CHECKING:
    import xarray as xr

_MOST = 3_000
"""Samples of a curve."""
_LONGEST = 120.0
"""Length of a run that is simulated beside a trial, s."""
_TURN = 2.0 * np.pi
_FROM_START = (("distance", "mm", 1e3), ("tail turns", "", 1.0 / _TURN), ("body turns", "", 1.0 / _TURN))
"""What is compared, counted from the first frame: label, unit, and factor from SI."""


def trial_beside_its_run(trial: xr.Dataset, film: str) -> dict[str, Any]:
    """A replay of the trial's robot as it is simulated, with the trial's film and curves.

    The simulated robot starts from rest with the first measured frame, with the tail as its file says.
    """
    from spirillum.dynamics.simulation import simulate
    from spirillum.swimming.model_choice import choose_model

    robot = robot_of(trial)
    times = np.asarray(trial["time"].values, dtype=float)
    if times.size < 2:
        raise InputError("the trial has fewer than two frames; allowed: one in which the robot was tracked")
    length = min(float(times[-1] - times[0]), _LONGEST)
    chosen = choose_model("auto", robot, tables_only=True)
    run = simulate(robot, model=chosen.model, timing={"duration": length})
    return replay_of_run(run) | {
        "film": {"name": film, "start": float(times[0])},
        "compared": compared_series(trial, run),
    }


def compared_series(trial: xr.Dataset, run: xr.Dataset) -> list[dict[str, Any]]:
    """Way and turns of the simulated and of the tracked robot, both counted from their first sample; SI."""
    first = float(trial["time"][0])
    sources = zip(_FROM_START, _progress(run, "tail_angle"), _progress(trial, "tail_phase"), strict=True)
    found = []
    for (label, unit, factor), simulated, tracked in sources:
        curves = [_curve(run["time"].values, simulated), _curve(trial["time"].values - first, tracked)]
        found.append({"label": label, "unit": unit, "factor": factor, "run": curves[0], "tracked": curves[1]})
    return found


def _progress(dataset: xr.Dataset, tail: str) -> list[Samples]:
    """Distance along the channel, m, and angles of tail and body in the lab, rad, from the first known sample."""
    columns = [dataset["position"].values[:, 0], dataset[tail].values, dataset["body_angle"].values]
    return [column - next(iter(column[np.isfinite(column)]), np.nan) for column in columns]


def _curve(time: Samples, values: Samples) -> dict[str, list[float | None]]:
    chosen = thinned(len(time), _MOST)
    return {"time": [float(t) for t in time[chosen]], "values": [finite(float(value)) for value in values[chosen]]}
