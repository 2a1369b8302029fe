"""A bank of robots that differ in what is unknown and get the commands of the real one: the model of the learner.

The unknown factors of friction and gap are u, v in [-1, 1] as powers of their largest factors. The members stand at
Chebyshev's points of both; between them a polynomial in u and v interpolates what they do (Trefethen 2013). Two more
members at each friction, of the robot file's gap, tell how all of it changes with the battery's voltage and the fluid's
viscosity: viscosity counts for more where friction is small.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.lab import Unknown
from spirillum.controllers.sensors import SampledErrors, plant_of
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant, Snapshot, uninterrupted
from spirillum.errors import InputError
from spirillum.robot.robot import Robot

_POINTS = 5
_STEP = 0.1
"""Between two moments that are kept, s."""
_CHANGE = 0.02
"""Relative change of voltage and of viscosity of the two more members."""


def points(factor: float) -> Samples:
    """Powers of a factor at which members stand: Chebyshev's points of [-1, 1], or 0 where nothing is unknown."""
    return -np.cos(np.pi * np.arange(_POINTS) / (_POINTS - 1)) if factor > 1.0 else np.zeros(1)


def interpolation(nodes: Samples, at: Samples) -> Samples:
    """Weights of the values at nodes for the polynomial through them, (at, nodes)."""
    weights = np.ones((at.size, nodes.size))
    for number, node in enumerate(nodes):
        for other in np.delete(nodes, number):
            weights[:, number] *= (at - other) / (node - other)
    return weights


@dataclass(frozen=True)
class Paths:
    """What the members did; SI."""

    time: Samples
    """s, (n,)."""
    members: Samples
    """Tail's phase and body's angle, rad, current, A, and voltage, V, (friction, gap, 4, n)."""
    sensitivity: Samples
    """Relative change of each quantity per relative one of voltage and viscosity, (friction, 2, 4, n)."""


class Bank:
    """The members, and their motion since release."""

    def __init__(
        self,
        robot: Robot,
        unknown: Unknown,
        arguments: Mapping[str, Any] | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Lay the members down."""
        if robot.drive is None or robot.drive.kind != "dc-motor":
            raise InputError(f"learn is given with {robot.name}; allowed: a robot with drive.kind 'dc-motor'")
        self.friction, self.gap = points(unknown.friction_factor), points(unknown.gap_factor)
        factors = [float(unknown.friction_factor**u) for u in self.friction]
        members = [SampledErrors(factor, float(unknown.gap_factor**v)) for factor in factors for v in self.gap]
        for factor in factors:
            members += [
                SampledErrors(factor, 1.0, None, 1.0 + _CHANGE),
                SampledErrors(factor, 1.0, None, 1.0, 1.0 + _CHANGE),
            ]
        self._plants: list[Plant] = []
        for member in members:
            self._plants.append(plant_of(robot, arguments or {}, member))
            if progress is not None:
                progress("bank of robots", len(self._plants), len(members))
        self._time = [0.0]
        self._rows = [[_quantities(plant.observe()) for plant in self._plants]]

    @property
    def time(self) -> float:
        """Up to when the members are simulated, s."""
        return self._time[-1]

    @property
    def duty(self) -> float:
        """The robot's own."""
        return float(self._plants[0].state.command)

    @property
    def current(self) -> float:
        """Predicted while the drive is on, A."""
        return float(abs(self._plants[0].steady.motor_current))

    def follow(self, time: float, duty: float) -> None:
        """Simulate all members up to a time at a duty."""
        while time - self.time > 1e-9:
            dt = min(_STEP, time - self.time)
            moments = [uninterrupted(plant.step(dt, duty=duty)) for plant in self._plants]
            self._time.append(moments[0].time)
            self._rows.append([_quantities(moment) for moment in moments])

    def paths(self) -> Paths:
        """What the members have done so far."""
        rows = np.moveaxis(np.array(self._rows), 0, -1)
        count = self.friction.size * self.gap.size
        members = rows[:count].reshape(self.friction.size, self.gap.size, *rows.shape[1:])
        changed = rows[count:].reshape(self.friction.size, 2, *rows.shape[1:])
        unchanged = members[:, self.gap.size // 2, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            sensitivity = np.nan_to_num((changed / unchanged - 1.0) / _CHANGE, posinf=0.0, neginf=0.0)
        return Paths(np.array(self._time), members, sensitivity)


def _quantities(moment: Snapshot) -> list[float]:
    values = moment.values
    return [moment.pose.tail_phase, values["body_angle"], values["motor_current"], values["battery_voltage"]]
