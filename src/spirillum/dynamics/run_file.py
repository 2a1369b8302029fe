"""Runs read from their NetCDF files, with all content checked."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from pydantic import BaseModel

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import loaded_netcdf
from spirillum.robot.problems import problems_in, refused_table
from spirillum.robot.robot import Robot
from spirillum.units import Kind, show

if TYPE_CHECKING:
    import xarray as xr

_WHAT = "a run written by `spirillum simulate`"

_LARGEST = 1e9
"""Largest number of a run that is taken: SI, such as m, s, rad or rad/s."""


def open_run(path: str | Path) -> xr.Dataset:
    """A run from its file, loaded whole."""
    return loaded_netcdf(path, _WHAT)


def numbers_of(dataset: xr.Dataset, name: str, more: tuple[str, ...] = (), shape: tuple[int, ...] = ()) -> Samples:
    """Values, (n, ...), of a run's variable over `time` and further dimensions, finite and not huge."""
    if name not in dataset.variables:
        raise InputError(f"the run has no variable {name!r}; allowed: a run of `spirillum simulate`")
    variable = dataset[name]
    dims = ("time", *more)
    if set(variable.dims) != set(dims) or variable.transpose(*dims).shape[1:] != shape:
        said = ", ".join(f"{dim}: {size}" for dim, size in variable.sizes.items())
        wanted = ", ".join(["time", *(f"{dim}: {size}" for dim, size in zip(more, shape, strict=True))])
        raise InputError(f"the run's variable {name!r} has the dimensions ({said}); allowed: ({wanted})")
    if variable.dtype.kind not in "fiu":
        raise InputError(f"the run's variable {name!r} holds no numbers ({variable.dtype}); allowed: numbers")
    values = np.asarray(variable.transpose(*dims).values, dtype=float)
    if not np.all(np.isfinite(values)):
        bad = int(np.argmin(np.isfinite(values.reshape(len(values), -1)).all(axis=1)))
        where = f"sample {bad}" if name == "time" else f"time = {show(float(dataset['time'][bad]), 's')}"
        raise InputError(f"the run's variable {name!r} is not finite at {where}; allowed: finite numbers")
    if np.abs(values).max(initial=0.0) > _LARGEST:
        raise InputError(f"the run's variable {name!r} holds {np.abs(values).max():.3g}; allowed: at most {_LARGEST:g}")
    return values


def check_increasing(time: Samples) -> None:
    """Refuse times of a run between which nothing moves.

    Args:
        time: times of its samples, s.
    """
    if time.ndim != 1 or time.size < 2 or not np.all(np.diff(time) > 0):
        said = f"has {time.size} samples of time" if time.size < 2 else "has times that do not increase"
        raise InputError(f"the run {said}; allowed: at least 2, increasing")


def robot_of(dataset: xr.Dataset) -> Robot:
    """The robot of a run, from the settings in its attributes, checked like a robot file."""
    settings = dataset.attrs.get("settings")
    if not isinstance(settings, str):
        raise InputError(f"the run has no attribute 'settings' with its robot; allowed: {_WHAT}")
    try:
        table = json.loads(settings)
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"the run's attribute 'settings' is not JSON ({str(error)[:100]}); allowed: {_WHAT}"
        ) from error
    return robot_of_settings(table, "the run's")


def robot_of_settings(table: Any, whose: str) -> Robot:
    """A robot from its settings in a dataset, SI numbers, checked like a robot file.

    Args:
        table: the settings.
        whose: the dataset, for messages: ``the run's``.
    """
    if not isinstance(table, dict):
        raise InputError(f"{whose} attribute 'settings' is no table; allowed: one with a robot")
    robot = problems_in(Robot, _with_units(Robot, table))
    if isinstance(robot, Robot):
        return robot
    raise refused_table(robot, f"{whose} settings")


def _with_units(model: type[BaseModel], table: Mapping[str, Any]) -> dict[str, Any]:
    """SI numbers as quantities, which is what a robot is checked from."""
    found: dict[str, Any] = {}
    for name, value in table.items():
        info = model.model_fields.get(name)
        if value is None and info is not None:
            if info.default is not None:
                found[name] = "none"
            continue
        if info is None:
            found[name] = value
            continue
        unit = _unit(info.annotation, info.metadata)
        section = _section(info.annotation)
        if unit is not None and isinstance(value, float | int) and not isinstance(value, bool):
            found[name] = f"{value!r} {unit}"
        elif section is not None and isinstance(value, Mapping):
            if name in _BY_NAME:
                found[name] = {
                    key: _with_units(section, item) if isinstance(item, Mapping) else item
                    for key, item in value.items()
                }
            else:
                found[name] = _with_units(section, value)
        else:
            found[name] = value
    return found


_BY_NAME = ("calibration",)
"""Fields that hold sections by names of the user's."""


def _unit(annotation: Any, metadata: list[Any]) -> str | None:
    kinds = [item for item in metadata if isinstance(item, Kind)]
    for part in get_args(annotation):
        kinds += [item for item in getattr(part, "__metadata__", ()) if isinstance(item, Kind)]
    return kinds[0].unit if kinds else None


def _section(annotation: Any) -> type[BaseModel] | None:
    """The section class inside an annotation such as ``Motor | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for part in get_args(annotation):
        if (found := _section(part)) is not None:
            return found
    return None
