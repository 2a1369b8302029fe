"""Files beside a virtual trial: its setup, as an experimenter would know it, and the truth."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.envelope import as_json, envelope
from spirillum.files import MARK
from spirillum.formats.templates import rendered
from spirillum.quantities import in_units
from spirillum.virtual.optics import VirtualLens
from spirillum.virtual.trajectory import TrialTrajectory
from spirillum.virtual.trial_options import CameraOptions

if TYPE_CHECKING:
    import xarray as xr

SYNTHETIC = "synthetic: a computed robot seen by a virtual camera, not a measurement"


def setup_text(
    robot_file: str,
    camera: CameraOptions,
    lens: VirtualLens,
    spacing: float,
    axis: tuple[float, float],
    *,
    timed: bool,
    glass: bool = False,
) -> str:
    """A setup file."""
    return rendered(
        "virtual/setup.toml.jinja",
        filters={"mm": lambda value: f'"{1e3 * value:.9g} mm"'},
        synthetic=SYNTHETIC,
        mark=MARK,
        robot_file=json.dumps(robot_file, ensure_ascii=False),  # a string of JSON is one of TOML
        camera=camera,
        lens=lens,
        spacing=spacing,
        axis=axis,
        timed=timed,
        glass=glass,
    )


def truth_text(rates: Mapping[str, float], content: Mapping[str, Any]) -> str:
    """The truth of a trial, JSON."""
    return as_json(envelope("truth", {"synthetic": True, **in_units(rates), **content}, (SYNTHETIC,))) + "\n"


def truth_dataset(
    trajectory: TrialTrajectory, times: Samples, numbers: np.ndarray, attributes: Mapping[str, str]
) -> xr.Dataset:
    """The truth on every frame of the video."""
    import xarray as xr

    series = trajectory.series(times)
    about = {
        "x": ("m", "the body's mid-length along the channel, from below the lens"),
        "y": ("m", "the body's mid-length across, y = z x x with z towards the camera"),
        "z": ("m", "height of the body's mid-length above the reference plane"),
        "heading": ("rad", "angle of the motor axis to x in the picture's plane, about +z"),
        "body_angle": ("rad", "angle of the body about +x, unwrapped; the first stripe is on +z at 0"),
        "tail_phase": ("rad", "phase of the tail about +x, unwrapped"),
    }
    variables = {
        name: ("frame", series[name], {"units": unit, "long_name": text}) for name, (unit, text) in about.items()
    }
    time = ("frame", times, {"units": "s", "long_name": "time in the video, at the middle of the exposure"})
    dataset = xr.Dataset(variables, {"frame": numbers, "time": time}, dict(attributes))
    if not all(math.isfinite(float(dataset[name].sum())) for name in about):
        raise ValueError("the truth is not finite")
    return dataset


def companion_paths(path: Path, setup: Path | None = None) -> dict[str, Path]:
    """Paths of the files beside a video or a folder of frames: `setup`, `json`, `nc`, `robot`."""
    stem = path.stem if path.suffix else path.name
    ends = {"setup": "setup.toml", "json": "truth.json", "nc": "truth.nc", "robot": "robot.toml"}
    found = {name: path.parent / f"{stem}.{end}" for name, end in ends.items()}
    if setup is not None:
        found |= {"setup": setup, "robot": setup.parent / "robot.toml"}
    return found
