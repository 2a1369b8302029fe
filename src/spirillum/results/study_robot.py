"""The robot of a study's first page, rebuilt from the settings that the dataset carries."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.robot.actuation import Drive, Motor
from spirillum.robot.parts import Body, Channel, Coupling, Fluid, Tail
from spirillum.robot.robot import Robot
from spirillum.studies.ranking import StudyRanking, robot_dims
from spirillum.view.figures.picture import Picture
from spirillum.view.figures.robot import robot_figure, robot_words

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["robot_picture"]


def robot_picture(dataset: xr.Dataset, ranking: StudyRanking) -> Picture | None:
    """Side view of the study's fastest robot, else of its first; None if the dataset carries no settings of robots.

    Args:
        dataset: a study.
        ranking: of its robots.
    """
    dumps = json.loads(dataset.attrs.get("settings", "{}")).get("robots") or []
    if not dumps:
        return None
    place = ranking.robots[0].place if ranking.robots else 0
    if "channel" in dataset.dims:  # of a grid the settings name a robot for each channel
        grid = robot_dims(dataset)
        channel, *tail = np.unravel_index(place, [dataset.sizes[name] for name in grid])
        table = dict(dumps[int(channel)])
        own = {name: float(dataset[name].values[at]) for name, at in zip(grid[1:], tail, strict=True)}
        table["tail"] = {**table["tail"], **own}
    else:
        table = dumps[place]
    robot = _rebuilt(table)
    words = robot_words(robot)
    first = f"the first of the ranking: {ranking.robots[0].name}" if ranking.robots else "the study's first robot"
    return Picture("The robot", f"{words} Drawn is {first}.", words, lambda: robot_figure(robot))


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
