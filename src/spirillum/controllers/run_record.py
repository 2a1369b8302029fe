"""A controlled run as a labelled dataset: the robot as in a run of `simulate`, what was seen, and what was decided."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.controllers.loop import LoopRun
from spirillum.dynamics.attributes import run_attributes
from spirillum.dynamics.plant import Plant
from spirillum.dynamics.start import reach_of
from spirillum.quantities import QUANTITIES, attributes

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["record"]

_SEEN = {"position": "seen_position", "heading": "seen_heading", "body_angle": "seen_body_angle"}
_SEEN |= {"tail_phase": "seen_tail_phase", "side": "seen_side", "height": "seen_height"}
_MEANINGS = {"duty": "duty of the drive up to here; 0 while it is off"}


def record(run: LoopRun, plant: Plant) -> xr.Dataset:
    """A controlled run.

    Args:
        run: what was done.
        plant: the robot that did it.

    Returns:
        Dataset over `time` (the robot after every event), `frame_time` (the camera), `reading_time` (the meter) and
        `decision_time` (the controller), SI.
    """
    import xarray as xr

    moments = run.moments
    data: dict[str, Any] = {
        "position": (("time", "axis"), np.array([m.pose.position for m in moments]), attributes("position")),
        "attitude": (("time", "quaternion"), np.array([m.pose.attitude for m in moments]), attributes("attitude")),
        "imposed_flow": ("time", np.array(run.flows), attributes("imposed_flow")),
    }
    for name in moments[-1].values:
        values = np.array([m.values[name] for m in moments])
        data[name] = ("time", values, attributes(name, meaning=_MEANINGS.get(name)))
    for name, seen in _SEEN.items():
        values = np.array([np.nan if sight is None else getattr(sight, name) for _, sight in run.frames])
        data[seen] = ("frame_time", values, attributes(seen))
    for name in ("current", "voltage"):
        values = np.array([getattr(reading, name) for reading in run.readings], dtype=float)
        data[f"read_{name}"] = ("reading_time", values, attributes(f"read_{name}"))
    data["command"] = ("decision_time", np.array([d.duty for d in run.decisions]), attributes("command"))
    for name in run.decisions[-1].estimate if run.decisions else ():
        values = np.array([d.estimate.get(name, np.nan) for d in run.decisions])
        base, _, end = name.rpartition("_") if name.endswith(("_low", "_high")) else (name, "", "")
        meaning = f"{QUANTITIES[base].meaning}, {end} end of its 95 % interval" if end else None
        data[name] = ("decision_time", values, attributes(base, meaning=meaning))
    coords = {
        "time": ("time", np.array([m.time for m in moments]), attributes("time")),
        "frame_time": ("frame_time", np.array([time for time, _ in run.frames]), attributes("frame_time")),
        "reading_time": ("reading_time", np.array([r.time for r in run.readings]), attributes("reading_time")),
        "decision_time": ("decision_time", np.array([d.time for d in run.decisions]), attributes("decision_time")),
        "axis": ("axis", list("xyz"), {"long_name": "axis of the lab"}),
        "quaternion": ("quaternion", list("wxyz"), {"long_name": "part of the quaternion"}),
    }
    attrs = {
        "title": f"Controlled swimming of {plant.robot.name}",
        **run_attributes(plant.steady),
        "motion": "free",
        "channel_middle": reach_of(plant.robot).middle,
        "events": json.dumps([{"time": moments[-1].time, "what": run.ended}] if run.ended else []),
    }
    return xr.Dataset(data, coords=coords, attrs=attrs)
