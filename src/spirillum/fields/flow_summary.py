"""Summary of the flow on planes and boxes: extremes with their positions, flow rates, grids."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.envelope import quantity, with_notes_last
from spirillum.fields.flow import Flow
from spirillum.quantities import unit_of

if TYPE_CHECKING:
    import xarray as xr


def flow_answer(flow: Flow, written: Mapping[Path, xr.Dataset]) -> dict[str, Any]:
    """The flow around a robot and what was computed of it, as `spirillum flow` prints them."""
    return with_notes_last(flow.to_dict(), files=[_file(path, dataset) for path, dataset in written.items()])


def _file(path: Path, dataset: xr.Dataset) -> dict[str, Any]:
    axes = [str(name) for name in dataset["inside"].dims]
    across = [axis for axis in "xyz" if axis not in axes]
    step = float(dataset[axes[0]][1] - dataset[axes[0]][0])
    found = {
        "file": str(path),
        "grid": {
            "points": {axis: int(dataset.sizes[axis]) for axis in axes},
            "spacing": quantity(step, "m"),
            **{axis: quantity(np.array([dataset[axis].min(), dataset[axis].max()]), "m") for axis in axes},
            **{axis: quantity(float(dataset[axis]), "m") for axis in across},
        },
        "points_inside": int(dataset["inside"].sum()),
        **dict(extremes(dataset)),
    }
    if across:
        through = quantity(flow_rate(dataset), unit_of("flow_rate_through_plane"), direction=f"+{across[0]}")
        found["flow_rate_through_plane"] = through
    return found


def flow_rate(plane: xr.Dataset) -> float:
    """Flow rate through a plane, m^3/s, along the axis across it; solids count as at rest."""
    axes = [str(name) for name in plane["inside"].dims]
    (across,) = (axis for axis in "xyz" if axis not in axes)
    return float(plane[f"velocity_{across}"].fillna(0.0).integrate(axes))


def extremes(dataset: xr.Dataset) -> Iterator[tuple[str, Any]]:
    """Largest speed, lowest and highest pressure on a grid, with their positions; empty if all of it is solid."""
    parts = [dataset[f"velocity_{axis}"] ** 2 for axis in "xyz"]
    speed = (parts[0] + parts[1] + parts[2]) ** 0.5
    if not bool(np.isfinite(speed).any()):
        return  # every point lies inside a solid
    for name, values, place in (
        ("largest_speed", speed, speed.argmax(...)),
        ("lowest_pressure", dataset["pressure"], dataset["pressure"].argmin(...)),
        ("highest_pressure", dataset["pressure"], dataset["pressure"].argmax(...)),
    ):
        there = values.isel(place)
        yield name, quantity(float(there), unit_of(name), at=quantity([float(there[axis]) for axis in "xyz"], "m"))
