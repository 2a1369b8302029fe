"""A study as a picture that one can point into: speeds of its tails, and each tail as a robot that swims."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.dynamics.run_file import robot_of_settings
from spirillum.envelope import finite
from spirillum.errors import InputError
from spirillum.files import loaded_netcdf
from spirillum.pages.video_store import read_upload
from spirillum.robot.robot import Robot

if TYPE_CHECKING:
    import xarray as xr

LARGEST_STUDY_SENT = 64 << 20  #: Bytes of a study that is dropped on the page.
_MOST_TAILS = 400
_WHAT = "a study's dataset.nc over wavelength and amplitude, by `spirillum study`"
_READINGS = ("rotor", "none")


class StudyPicture:
    """Tails of a study with their speeds."""

    def __init__(self, dataset: xr.Dataset) -> None:
        needed = ("wavelength", "amplitude", "model", "channel")
        if "forward_velocity" not in dataset or any(name not in dataset.dims for name in needed):
            raise InputError(f"this dataset has not the dimensions {', '.join(needed)}; allowed: {_WHAT}")
        speed = dataset["forward_velocity"]
        if "friction" in speed.dims:
            readings = [str(name) for name in speed["friction"].values]
            reading = next((name for name in _READINGS if name in readings), readings[0])
            speed = speed.sel(friction=reading)
        if set(speed.dims) != set(needed):
            raise InputError(f"this study varies {', '.join(map(str, speed.dims))}; allowed: {_WHAT}")
        self._speed = speed.transpose(*needed)
        numbers = [self._speed, *(self._speed[name] for name in ("wavelength", "amplitude"))]
        if any(item.dtype.kind not in "fiu" for item in numbers) or not all(
            np.isfinite(item).all() for item in numbers[1:]
        ):
            raise InputError(f"speeds, wavelengths or amplitudes of this dataset are no numbers; allowed: {_WHAT}")
        if self._speed.sizes["wavelength"] * self._speed.sizes["amplitude"] > _MOST_TAILS:
            raise InputError(f"this study has more than {_MOST_TAILS} tails; allowed: fewer, to point at one")
        self._robots = _robots(dataset)
        if len(self._robots) != self._speed.sizes["channel"]:
            raise InputError(f"this study does not name a robot for each channel; allowed: {_WHAT}")
        self.title = str(dataset.attrs.get("title", "A study"))[:200]

    def describe(self) -> dict[str, Any]:
        """The picture's numbers: speeds by channel, model, amplitude and wavelength, m/s, None where there is none."""
        values = self._speed.transpose("channel", "model", "amplitude", "wavelength").values
        return {
            "title": self.title,
            "channels": [robot.name for robot in self._robots],
            "models": [str(name) for name in self._speed["model"].values],
            "wavelengths": [float(value) for value in self._speed["wavelength"].values],
            "amplitudes": [float(value) for value in self._speed["amplitude"].values],
            "speeds": finite(values.astype(float)),
        }

    def tail(self, command: Mapping[str, Any]) -> tuple[Robot, dict[str, str]]:
        """The robot that was pointed at, and the fields of its tail."""
        places = []
        for name in ("channel", "wavelength", "amplitude"):
            place, size = command.get(name), self._speed.sizes[name]
            if isinstance(place, bool) or not isinstance(place, int) or not 0 <= place < size:
                raise InputError(f"{name} = {str(place)[:20]}; allowed: 0 to {size - 1}")
            places.append(place)
        names = ("wavelength", "amplitude")
        fields = {f"tail.{name}": float(self._speed[name][k]) for name, k in zip(names, places[1:], strict=True)}
        return self._robots[places[0]], {name: f"{1e3 * value:.9g} mm" for name, value in fields.items()}


def sent_study(content: bytes) -> StudyPicture:
    """A study from the bytes of its file."""
    return read_upload(content, "dataset.nc", lambda path: StudyPicture(loaded_netcdf(path, _WHAT, LARGEST_STUDY_SENT)))


def _robots(dataset: xr.Dataset) -> list[Robot]:
    try:
        settings = json.loads(str(dataset.attrs.get("settings", "")))
        tables = list(settings["robots"])
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        raise InputError(f"this dataset has no attribute 'settings' with its robots; allowed: {_WHAT}") from error
    return [robot_of_settings(table, "the study's") for table in tables]
