"""A run as the page replays it: from a file of `spirillum simulate`, or from what was just seen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.dynamics.poses import poses_of
from spirillum.dynamics.run_file import open_run, robot_of
from spirillum.errors import InputError
from spirillum.files import scratch_folder
from spirillum.pages.numbers import SERIES
from spirillum.pages.page_robot import PageRobot
from spirillum.pages.recording import finite, thinned
from spirillum.pages.shapes import shape_of

if TYPE_CHECKING:
    import xarray as xr

LARGEST_RUN = 64 << 20
"""Bytes of a run that is dropped on the page."""
_MOST = 6_000
"""Samples of a replay; of a longer run some are left out, which the replay says."""


def replay_of_run(dataset: xr.Dataset) -> dict[str, Any]:
    """A run to replay; the samples are the file's own."""
    robot = robot_of(dataset)
    shape = shape_of(robot)
    level = 0.0 if shape["tube_radius"] is None else shape["radius"] - shape["tube_radius"]
    poses = poses_of(dataset, level)
    chosen = thinned(poses.time.size, _MOST)
    roughness = dataset.attrs.get("roughness")
    return {
        "robot": robot.name,
        "model": str(dataset.attrs.get("model", "")),
        "shape": shape,
        "roughness": float(roughness) if roughness is not None else None,
        "samples": int(poses.time.size),
        "run": {
            "time": poses.time[chosen].tolist(),
            "position": poses.position[chosen].tolist(),
            "attitude": poses.attitude[chosen].tolist(),
            "tail_phase": poses.tail_phase[chosen].tolist(),
            "duty": _series(dataset, "duty", chosen),
            "values": {name: _series(dataset, name, chosen) for name in SERIES if _is_series(dataset, name)},
        },
    }


def replay_of_upload(content: bytes) -> dict[str, Any]:
    """A run to replay from the bytes of its file."""
    if len(content) > LARGEST_RUN:
        raise InputError(f"the file has {len(content) >> 20} MB; allowed: at most {LARGEST_RUN >> 20} MB")
    with scratch_folder() as folder:
        path = folder / "run.nc"
        path.write_bytes(content)
        try:
            return replay_of_run(open_run(path))
        except InputError as error:
            raise InputError(str(error).replace(str(path), "the file")) from error


def replay_of_lane(lane: PageRobot, run: dict[str, Any]) -> dict[str, Any]:
    """What a robot of the page has done so far, to replay.

    Args:
        lane: the robot.
        run: its recording's data.
    """
    return {
        "robot": lane.robot.name,
        "model": lane.built.model if lane.built else "",
        "shape": shape_of(lane.robot),
        "roughness": lane.built.plant.roughness if lane.built else None,
        "samples": len(run["time"]),
        "run": run,
    }


def _is_series(dataset: xr.Dataset, name: str) -> bool:
    return name in dataset.variables and dataset[name].dims == ("time",)


def _series(dataset: xr.Dataset, name: str, chosen: np.ndarray[tuple[int], np.dtype[np.int64]]) -> list[float | None]:
    if not _is_series(dataset, name):
        return []
    return [finite(float(value)) for value in np.asarray(dataset[name].values, dtype=float)[chosen]]
