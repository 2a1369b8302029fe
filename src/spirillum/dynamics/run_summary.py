"""Runs and sweeps as answers: averages, final values, and what happened."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from spirillum.envelope import envelope, quantity
from spirillum.notes import notes_in

if TYPE_CHECKING:
    import xarray as xr


_ENDS = (
    "position",
    "tail_angle",
    "body_angle",
    "pitch",
    "yaw",
    "wall_gap",
    "offset",
    "azimuth",
    "wall_pitch",
    "wall_yaw",
    "contact_force",
    "contact_energy",
    "wobble_angle",
    "phase_lag",
    "electrical_energy",
    "battery_charge_used",
)


def run_answer(dataset: xr.Dataset) -> dict[str, Any]:
    """Averages of a run, its final values, and what happened in it."""
    last = dataset.isel(time=-1)
    content: dict[str, Any] = {
        "robot": dataset.attrs["robot"],
        "model": dataset.attrs["model"],
        **({"model_reason": dataset.attrs["model_reason"]} if "model_reason" in dataset.attrs else {}),
        "friction": dataset.attrs["friction"],
        "motion": dataset.attrs["motion"],
        "error_estimate": quantity(
            float(dataset.attrs["error_estimate"]),
            "1",
            **({"against": dataset.attrs["error_against"]} if "error_against" in dataset.attrs else {}),
            statement=dataset.attrs["known_error"],
        ),
        **({"placement": json.loads(dataset.attrs["placement"])} if "placement" in dataset.attrs else {}),
        **_in_the_tube(dataset),
        "events": json.loads(dataset.attrs["events"]),
        **({"state": dataset.attrs["state"]} if "state" in dataset.attrs else {}),
        "steady": dataset.attrs["steady"],
        "duration": quantity(float(last["time"]), "s"),
    }
    if (begins := float(dataset["time"][0])) > 0.0:
        content["begins"] = quantity(begins, "s", meaning="first sample of a continued run; means are over this part")
    scalars = [str(name) for name, variable in dataset.data_vars.items() if variable.ndim == 0]
    content |= {
        name: quantity(float(dataset[name]), str(dataset[name].attrs["units"]), **_interval(dataset, name))
        for name in scalars
        if not name.endswith(("_low", "_high"))
    }
    if "draws" in dataset.attrs:
        content["draws"] = int(dataset.attrs["draws"])
    content |= {
        f"final_{name}": quantity(last[name].values.tolist(), str(last[name].attrs["units"]))
        for name in _ENDS
        if name in dataset
    }
    return envelope("simulation", content, notes_in(dataset.attrs))


def _interval(dataset: xr.Dataset, name: str) -> dict[str, Any]:
    if f"{name}_low" not in dataset:
        return {}
    low, high = float(dataset[f"{name}_low"]), float(dataset[f"{name}_high"])
    return {"low": low, "high": high, "kind": "interval", "level": float(dataset.attrs["level"])}


def sweep_answer(dataset: xr.Dataset) -> dict[str, Any]:
    """Every quantity of a sweep as a list over the rates of the field."""
    content: dict[str, Any] = {
        "robot": dataset.attrs["robot"],
        "model": dataset.attrs["model"],
        "step_out_rate": quantity(float(dataset["step_out_rate"]), "rad/s"),
        "field_rate": quantity(dataset["field_rate"].values, "rad/s"),
    }
    content |= {
        str(name): quantity(variable.values, str(variable.attrs["units"]))
        for name, variable in dataset.data_vars.items()
        if variable.ndim == 1
    }
    return envelope("magnetic-sweep", content, notes_in(dataset.attrs))


def _in_the_tube(dataset: xr.Dataset) -> dict[str, Any]:
    """Under what a run in the tube was made."""
    if "table" not in dataset.attrs:
        return {}
    attrs = dataset.attrs
    return {
        "in_tube": {
            "ends": attrs["ends"],
            "gap": quantity(float(dataset["wall_gap"][0]), "m", meaning="of the body, when the run begins"),
            "roughness": quantity(float(attrs["roughness"]), "m"),
            "friction_coefficient": quantity(float(attrs["friction_coefficient"]), "1"),
            "wait": quantity(float(attrs["wait"]), "s"),
        }
        | _imposed_flow(dataset)
    }


def _imposed_flow(dataset: xr.Dataset) -> dict[str, Any]:
    """The mean velocity that is imposed on the fluid, over the run; nothing where ends are open or closed."""
    if dataset.attrs["ends"] != "imposed flow":
        return {}
    time = dataset["time"].values
    mean = float(dataset["mean_flow"].integrate("time")) / float(time[-1] - time[0])
    return {"mean_flow": quantity(mean, "m/s", meaning="through the tube, over the run")}


_MOST_ALIKE = 4
"""Events of one kind that are listed one by one."""


class Told(NamedTuple):
    """An event, or the first of many that are alike."""

    time: float
    """When, s."""
    what: str
    """What happened."""
    times: int
    """How often."""
    last: float
    """When for the last time, s."""


def told(events: Sequence[tuple[float, str]]) -> list[Told]:
    """Events in the order of time; those that come more than a few times, as where a contact bounces, are one.

    Args:
        events: time, s, and what happened.
    """
    moments_of: dict[str, list[float]] = {}
    for when, what in events:
        moments_of.setdefault(what, []).append(when)
    found = []
    for what, moments in moments_of.items():
        if len(moments) > _MOST_ALIKE:
            found.append(Told(min(moments), what, len(moments), max(moments)))
        else:
            found += [Told(when, what, 1, when) for when in moments]
    return sorted(found)
