"""Runs read from their NetCDF files with all content checked, and the poses of a robot in them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pydantic import BaseModel

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import loaded_netcdf
from spirillum.robot.fields import all_metadata, problems_in, refused_table, section_in
from spirillum.robot.robot import Robot
from spirillum.units import Kind, show

if TYPE_CHECKING:
    import xarray as xr


_WHAT = "a run written by `spirillum simulate`"

_LARGEST = 1e9  # Largest number of a run that is taken: SI, such as m, s, rad or rad/s.


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
        stated = ", ".join(f"{dim}: {size}" for dim, size in variable.sizes.items())
        wanted = ", ".join(["time", *(f"{dim}: {size}" for dim, size in zip(more, shape, strict=True))])
        raise InputError(f"the run's variable {name!r} has the dimensions ({stated}); allowed: ({wanted})")
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
    """Refuse times of a run between which nothing moves."""
    if time.ndim != 1 or time.size < 2 or not np.all(np.diff(time) > 0):
        stated = f"has {time.size} samples of time" if time.size < 2 else "has times that do not increase"
        raise InputError(f"the run {stated}; allowed: at least 2, increasing")


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
    """A robot from its settings in a dataset, SI numbers, checked like a robot file."""
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
        if info is None:
            found[name] = value
        elif value is None:
            found |= {name: "none"} if info.default is not None else {}
        elif isinstance(value, Mapping) and (section := section_in(info.annotation)) is not None:
            tables = value if name in _BY_NAME else {name: value}
            read = {
                key: _with_units(section, item) if isinstance(item, Mapping) else item for key, item in tables.items()
            }
            found[name] = read if name in _BY_NAME else read[name]
        else:
            kinds = [item for item in all_metadata(info) if isinstance(item, Kind)]
            number = bool(kinds) and isinstance(value, float | int) and not isinstance(value, bool)
            found[name] = f"{value!r} {kinds[0].unit}" if number else value
    return found


_BY_NAME = ("calibration",)  # Fields that hold sections by names of the user's.
_REST = np.array([1.0, 0.0, 0.0, 0.0])


class RobotPose(NamedTuple):
    """A robot at one moment."""

    position: Samples  #: (3,) the body's mid-length in the lab, m.
    attitude: Samples  #: (4,) unit quaternion w, x, y, z from the body's axes to the lab's.
    tail_phase: float  #: Angle of the tail against the body, positive about +x, rad.

    @property
    def body(self) -> Samples:
        """4x4 matrix from the body's axes to the lab."""
        matrix = np.eye(4)
        matrix[:3, :3] = rotation_matrix(self.attitude)
        matrix[:3, 3] = self.position
        return matrix

    @property
    def rotor(self) -> Samples:
        """4x4 matrix from the axes of the rotor, its tail at phase 0, to the lab."""
        matrix = self.body
        matrix[:3, :3] = matrix[:3, :3] @ rotation_matrix(rolled(self.tail_phase))
        return matrix


def rolled(angle: float) -> Samples:
    """The quaternion of a turn about +x, rad."""
    return np.array([np.cos(0.5 * angle), np.sin(0.5 * angle), 0.0, 0.0])


def rotation_matrix(quaternion: Samples) -> Samples:
    """Rotation matrices, (..., 3, 3), of unit quaternions w, x, y, z, (..., 4)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternion, scalar_first=True).as_matrix())


@dataclass(frozen=True)
class Poses:
    """A robot's trajectory: increasing times, s, and poses, m and rad."""

    time: Samples
    position: Samples
    attitude: Samples  #: (n, 4) unit quaternions without jumps of sign.
    tail_phase: Samples  #: (n,) not wrapped, rad.
    roll: Samples  #: (n,) angle by which the body has turned about its axis, not wrapped, rad.

    @property
    def duration(self) -> float:
        """From the first sample to the last, s."""
        return float(self.time[-1] - self.time[0])

    @property
    def travelled(self) -> float:
        """Largest distance between positions of the body, along the axis on which it is largest, m."""
        return float(np.ptp(self.position, axis=0).max())

    @property
    def tail_angle(self) -> Samples:
        """(n,) angle by which the tail has turned in the lab about the body's axis, rad."""
        return np.asarray(self.tail_phase + self.roll)

    def at(self, time: float) -> RobotPose:
        """The pose at a time, between samples in straight lines and even turns."""
        from scipy.spatial.transform import Rotation, Slerp

        index = int(np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, self.time.size - 2))
        pair = slice(index, index + 2)
        times, turns = self.time[pair], Rotation.from_quat(self.attitude[pair], scalar_first=True)
        moment = float(np.clip(time, *times))
        position = np.array([np.interp(moment, times, along) for along in self.position[pair].T])
        attitude = Slerp(times, turns)(moment).as_quat(scalar_first=True)
        return RobotPose(position, attitude, float(np.interp(moment, times, self.tail_phase[pair])))


def poses_of(dataset: xr.Dataset, height: float = 0.0) -> Poses:
    """Poses of a run in six degrees of freedom, or of an axial one at z = `height` of the motor axis, m."""
    time = numbers_of(dataset, "time", ())
    check_increasing(time)
    if "attitude" in dataset:
        position = numbers_of(dataset, "position", ("axis",), (3,))
        attitude = attitudes_of(dataset)
        return Poses(time, position, attitude, numbers_of(dataset, "tail_phase", ()), _roll_of(attitude))
    along, tail, body = (numbers_of(dataset, name, ()) for name in ("position", "tail_angle", "body_angle"))
    position = np.stack([along, np.zeros_like(along), np.full_like(along, height)], axis=-1)
    attitude = np.stack([np.cos(0.5 * body), np.sin(0.5 * body), 0.0 * body, 0.0 * body], axis=-1)
    return Poses(time, position, _continued(attitude), tail - body, body)


def attitudes_of(dataset: xr.Dataset) -> Samples:
    """(n, 4) attitudes of a free run as unit quaternions, without jumps of sign."""
    attitude = numbers_of(dataset, "attitude", ("quaternion",), (4,))
    off = np.abs(np.linalg.norm(attitude, axis=1) - 1.0)
    if np.any(off > 1e-2):
        bad = int(np.argmax(off))
        when = show(float(dataset["time"][bad]), "s")
        raise InputError(
            f"the run's attitude at time = {when} has the length {np.linalg.norm(attitude[bad]):.4g}; allowed: 1, "
            "a rotation"
        )
    return _continued(attitude)


def _continued(attitude: Samples) -> Samples:
    """Unit quaternions whose sign does not jump: q and -q are the same attitude."""
    unit = attitude / np.linalg.norm(attitude, axis=1)[:, None]
    sign = np.where(np.sum(unit[1:] * unit[:-1], axis=1) < 0, -1.0, 1.0)
    return np.asarray(unit * np.concatenate([[1.0], np.cumprod(sign)])[:, None])


def _roll_of(attitude: Samples) -> Samples:
    """Angle turned about the body's own axis, summed over the samples, rad."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_quat(attitude, scalar_first=True)
    scalar, along, *_ = (turns[:-1].inv() * turns[1:]).as_quat(scalar_first=True).T
    steps = 2.0 * np.arctan2(along, scalar)
    return np.concatenate([[0.0], np.cumsum((steps + np.pi) % (2.0 * np.pi) - np.pi)])
