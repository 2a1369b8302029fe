"""Observed rates and speeds, assigned to the robots of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.arrays import PerRobot
from spirillum.errors import InputError
from spirillum.measurement.observations import (
    ObservationRow,
    RobotObservations,
    check_driven,
    read_observations,
    summarised,
)
from spirillum.robot.robot import Robot
from spirillum.studies.study_loader import LoadedStudy

_NAMES = ("forward_velocity", "tail_rate", "body_rate", "motor_rate")


@dataclass(frozen=True)
class ObservedArrays:
    """Means and half widths of 95 % intervals in the flat order of a study, SI; NaN where not observed."""

    forward_velocity: PerRobot
    tail_rate: PerRobot
    body_rate: PerRobot
    motor_rate: PerRobot
    intervals: Mapping[str, PerRobot]
    trials: PerRobot
    source: str

    def question(self) -> dict[str, Any]:
        """What of the observations decides the answer."""
        columns = {name: getattr(self, name).tolist() for name in _NAMES}
        return {name: [repr(value) for value in values] for name, values in columns.items()}


def observed_at(observed: ObservedArrays, indices: np.ndarray) -> ObservedArrays:
    """What was observed of some robots, by their indices in the flat order of the study."""
    columns = {name: getattr(observed, name)[indices] for name in (*_NAMES, "trials")}
    return replace(
        observed, **columns, intervals={name: column[indices] for name, column in observed.intervals.items()}
    )


def observed_arrays(path: str | Path, loaded: LoadedStudy) -> ObservedArrays:
    """Read observations and match them with the study's robots by channel, wavelength and amplitude."""
    observations = read_observations(path)
    tails = _tails(loaded)
    for item in observations:
        if item.tail not in tails:
            raise InputError(
                f"{path}, row {item.row}: no robot of the study has channel {item.channel_diameter * 1e3:g} mm, "
                f"wavelength {item.wavelength * 1e3:g} mm and amplitude {item.amplitude * 1e3:g} mm; "
                "allowed: tails of the study"
            )
    for robot, items in _by_robot(observations, tails):
        check_driven(path, items, robot)
    means = summarised(observations)
    rows = [means.get(tail) for tail in tails]
    columns = {name: _column(rows, name, 0) for name in _NAMES}
    return ObservedArrays(
        **columns,
        intervals={name: _column(rows, name, 1) for name in _NAMES},
        trials=np.array([0 if row is None else max(getattr(row, name).trials for name in _NAMES) for row in rows])
        * 1.0,
        source=Path(path).name,
    )


def _tails(loaded: LoadedStudy) -> dict[tuple[float, float, float], Robot]:
    """(channel diameter, wavelength, amplitude) of every robot, in the flat order of the study."""
    grid = loaded.study.grid
    listed = []
    for robot in loaded.robots:
        channel = robot.channel.diameter if robot.channel else float("inf")
        wavelengths = grid.wavelengths if grid else [robot.tail.wavelength]
        amplitudes = grid.amplitudes if grid else [robot.tail.amplitude]
        listed += [((channel, w, a), robot) for w in wavelengths for a in amplitudes]
    found = {(round(c, 9), round(w, 9), round(a, 9)): robot for (c, w, a), robot in listed}
    if len(found) != len(listed):
        raise InputError(
            "two robots of the study share channel diameter, wavelength and amplitude, so that observations cannot "
            "distinguish them; allowed: robots that differ in one of them"
        )
    return found


def _by_robot(
    observations: Sequence[ObservationRow], tails: Mapping[tuple[float, float, float], Robot]
) -> list[tuple[Robot, list[ObservationRow]]]:
    found: dict[int, tuple[Robot, list[ObservationRow]]] = {}
    for item in observations:
        robot = tails[item.tail]
        found.setdefault(id(robot), (robot, []))[1].append(item)
    return list(found.values())


def _column(rows: Sequence[RobotObservations | None], name: str, item: int) -> PerRobot:
    return np.array([np.nan if row is None else getattr(row, name)[item] for row in rows])
