"""The robot of a study's first page, rebuilt from the settings that the dataset carries."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.robot.actuation import Drive, Motor
from spirillum.robot.parts import Body, Channel, Coupling, Fluid, Tail
from spirillum.robot.robot import Robot
from spirillum.view.figures.picture import Picture
from spirillum.view.figures.robot import robot_figure, robot_words

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["robot_picture"]


def robot_picture(dataset: xr.Dataset) -> Picture | None:
    """Side view of the study's first robot; None if the dataset carries no settings of robots."""
    dumps = json.loads(dataset.attrs.get("settings", "{}")).get("robots") or []
    if not dumps:
        return None
    table = dict(dumps[0])
    table["tail"] = {**table["tail"], **_tail_of_the_grid(dataset, table["tail"])}
    robot = _rebuilt(table)
    words = robot_words(robot)
    grid, count = "channel" in dataset.dims, len(dumps)
    drawn = "Drawn is one of the study's tails" if grid else "Drawn is the study's robot"
    if count > 1:
        drawn = f"{drawn} in the first of {count} channels" if grid else f"Drawn is the first of {count} robots"
    return Picture("The robot", f"{words} {drawn}.", words, lambda: robot_figure(robot))


def _tail_of_the_grid(dataset: xr.Dataset, tail: Mapping[str, Any]) -> dict[str, float]:
    """The robot's own tail if the grid has it, else one from the grid's middle; SI."""
    if "channel" not in dataset.dims:
        return {}
    grid = {name: np.asarray(dataset[name].values, dtype=float) for name in ("wavelength", "amplitude")}
    if all(bool(np.any(np.isclose(values, tail[name]))) for name, values in grid.items()):
        return {}
    return {name: float(np.sort(values)[values.size // 2]) for name, values in grid.items()}


def _rebuilt(table: Mapping[str, Any]) -> Robot:
    """A robot from its SI settings, which were checked when the study was loaded."""
    channel, drive, motor = table.get("channel"), table.get("drive"), table.get("motor")
    return Robot.model_construct(
        name=str(table["name"]),
        body=Body.model_construct(**table["body"]),
        coupling=Coupling.model_construct(**table["coupling"]),
        tail=Tail.model_construct(**table["tail"]),
        fluid=Fluid.model_construct(**table["fluid"]),
        channel=Channel.model_construct(**channel) if channel else None,
        drive=Drive.model_construct(**drive) if drive else None,
        motor=Motor.model_construct(**motor) if motor else None,
    )
