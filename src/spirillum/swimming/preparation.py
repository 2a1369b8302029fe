"""Prepare a robot for motion in its tube: make its table, once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.answer import envelope, quantity
from spirillum.errors import InputError
from spirillum.fluid.tube.domain import tube_radius
from spirillum.fluid.tube.library import prepared_table
from spirillum.fluid.tube.places import Places
from spirillum.fluid.tube.table import RESPONSES, TubeTable
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.robot.batch import RobotBatch
from spirillum.robot.robot import Robot
from spirillum.swimming.prediction import prepared

__all__ = ["Prepared", "prepare"]


@dataclass(frozen=True)
class Prepared:
    """A robot and the table of its tube; SI."""

    robot: Robot
    """The robot."""
    table: TubeTable = field(repr=False)
    """Its table."""

    @property
    def places(self) -> Places:
        """The places at which the flow was solved for."""
        return Places(self.table.geometry, self.table.radius)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to be careful about, a sentence each."""
        worse = [
            f"{name.replace('_', ' ')} is off by up to {100.0 * self.table.error[name]:.2g} % at places that were not "
            f"used, more than the {100.0 * allowed:.2g} % that a table should have"
            for name, allowed in RESPONSES.items()
            if self.table.error[name] > allowed
        ]
        return (*self.robot.warnings, *worse)

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum prepare --json`."""
        places = self.places
        content = {
            "robot": self.robot.name,
            "model": "tube",
            "places": self.table.places,
            "error": {name: quantity(value, "1") for name, value in self.table.error.items()},
            "valid": {
                "gap": quantity(places.level_gaps, "m", meaning="of a level robot, where the next two hold"),
                "pitch_up": quantity(places.most[:, 0], "rad", meaning="largest pitch nose up"),
                "pitch_down": quantity(places.most[:, 1], "rad", meaning="largest pitch nose down"),
                "yaw": quantity(places.largest_yaw, "rad", meaning="largest yaw to either side"),
            },
            "seconds": quantity(self.table.seconds, "s"),
        }
        return envelope("preparation", content, self.warnings)


def prepare(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    workers: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
) -> Prepared:
    """Make the table of a robot in its tube, or read the one that is there.

    With it the model `tube` answers in microseconds, for any viscosity, drive, weight, friction and roughness, and
    `simulate` moves the robot in its tube. Places that were solved for are kept as they come: an interrupted
    preparation goes on where it was.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot, with a channel.
        workers: number of processes; with more than one, a script that calls this guards what it does at its top by
            `if __name__ == "__main__":`.
        progress: told what is being solved, how many places are done, and of how many.

    Raises:
        InputError: for wrong input, or a robot that the model `tube` does not know or that has no table.
    """
    if isinstance(workers, bool) or not 1 <= workers <= _MOST_WORKERS:
        raise InputError(f"workers = {workers}; allowed: 1 to {_MOST_WORKERS}")
    # A table holds for all places: the robot is checked on the axis, where a tail wider than its body is off the glass.
    ready, _, batch = prepared(robot, "tube", placement={"eccentricity": 0.0})
    return Prepared(ready, table_for(batch, workers=workers, progress=progress))


_MOST_WORKERS = 64


def table_for(
    batch: RobotBatch, *, workers: int = 1, progress: Callable[[str, int, int], None] | None = None
) -> TubeTable:
    """The table of the first robot of a batch in its tube; arguments as `prepare`."""
    radius = tube_radius(batch)
    if not np.isfinite(radius):
        raise InputError("there is no [channel]; allowed: a channel.diameter, for a table holds in its tube")
    return prepared_table(RobotGeometry.of(batch), radius, workers=workers, progress=progress)
