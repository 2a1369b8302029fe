"""A toy robot with a known truth: it swims at its duty times a speed, and the flow carries it, at once."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.plant import Snapshot
from spirillum.dynamics.run_file import RobotPose


@dataclass(frozen=True)
class ToyState:
    """What the next step follows from."""

    time: float = 0.0
    x: float = 0.0
    flow: float | None = None
    ended: str = ""
    command: float = 1.0


@dataclass
class Toy:
    """x' = duty * speed + carried * flow, like a `spirillum.Plant`."""

    speed: float = 1e-3
    carried: float = 0.8
    end: float = np.inf
    state: ToyState = field(default_factory=ToyState)
    steps: list[tuple[float, float]] = field(default_factory=list)
    duty: float = 0.0

    def step(self, dt: float, *, duty: float, field: None = None) -> Snapshot:
        if self.state.ended:
            raise sp.InputError("the run has ended")
        self.duty = duty
        self.steps.append((self.state.time, duty))
        x = self.state.x + dt * (duty * self.speed + self.carried * (self.state.flow or 0.0))
        ended = "end of the channel" if x > self.end else ""
        self.state = replace(self.state, time=self.state.time + dt, x=x, ended=ended)
        return self.observe()

    def observe(self) -> Snapshot:
        values = dict.fromkeys(("yaw", "body_angle", "electrical_energy", "drive_energy"), 0.0)
        values |= {"duty": self.duty, "forward_velocity": self.duty * self.speed, "motor_current": 0.3 * self.duty}
        pose = RobotPose(np.array([self.state.x, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]), 0.0)
        return Snapshot(self.state.time, pose, {**values, "battery_voltage": 3.7}, self.state.ended)

    def impose_flow(self, velocity: float | None) -> None:
        self.state = replace(self.state, flow=velocity)

    def reset(self, state: ToyState) -> Snapshot:
        self.state = state
        return self.observe()


@pytest.fixture
def toy() -> Any:
    """Makes toys."""
    return Toy
