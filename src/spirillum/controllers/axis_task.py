"""The task `keep-axis`: a magnetic robot swims along the axis of its tube, and does not orbit it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from pydantic import BeforeValidator

from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun, run_loop
from spirillum.controllers.sensors import FlowPulse
from spirillum.controllers.signals import Controller
from spirillum.controllers.steering import MOST_TILT, Law, Replay, Steer, Steering, pushed_for
from spirillum.controllers.task import FEEDBACK, Brief, Task
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.dynamics.turning_field import Field
from spirillum.errors import InputError
from spirillum.robot.arguments import one_of
from spirillum.robot.fields import Length, Rate
from spirillum.units import show

__all__ = ["KeepAxisTask"]

_DURATION = 60.0
"""Of a run, s."""
_SHARE = 0.9
"""Largest rate of the field over the step-out rate."""
_SETTLED = 2
"""Turns of the field before orbit and gain are looked for."""


@dataclass(frozen=True)
class SteeringBrief(Brief):
    """What is known of a magnetic robot beforehand."""

    steering: Steering
    tilts: tuple[tuple[float, complex], ...]
    """Of the open loop: times, s, and tilts, rad."""


class KeepAxisTask(Task):
    """Swim along the tube's axis, steered by the axis of the field."""

    kind: ClassVar[str] = "keep-axis"
    error_name: ClassVar[str] = "mean distance from the axis over the second half"
    error_unit: ClassVar[str] = "m"
    across: ClassVar[bool] = True

    law: Annotated[Law, BeforeValidator(one_of("position", "aim"))] = "position"
    """`position`: feedback of the place, with the orbit as predicted; `aim`: at a point of the axis ahead."""
    rate: Rate | None = None
    """Of the field, at most 0.9 of the step-out rate; None: the robot's own."""
    tolerance: Length = 5e-4
    """How far from the axis is good."""

    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> SteeringBrief:
        """Check the rate of the field, find orbit and gain, and the tilts for the robot as its file says."""
        field, step_out = plant.state.field, float(plant.steady.step_out_rate)
        if field is None:
            raise InputError(f"task 'keep-axis' with {plant.robot.name}; allowed: a robot with drive.kind 'magnetic'")
        rate = field.rotation_rate if self.rate is None else self.rate
        if not 0.0 < abs(rate) <= _SHARE * step_out:
            raise InputError(
                f"task.rate = {show(rate, 'Hz')}; allowed: up to {show(_SHARE * step_out, 'Hz')}, {_SHARE:g} of its "
                "step-out rate"
            )
        steering = _identified(plant, rate)
        duration = _DURATION if self.duration is None else self.duration
        exact = Lab.exact()
        ahead = run_loop(plant.copy(), Steer(exact, steering, self.law), exact, duration, progress=progress)
        if ahead.interrupted:
            raise KeyboardInterrupt
        return SteeringBrief(
            lab=lab,
            duration=duration,
            speed=float(plant.steady.forward_velocity),
            duty=1.0,
            schedule=(duration, 1.0),
            carried=0.0,
            steering=steering,
            tilts=tuple(
                (one.time, complex(one.estimate["field_yaw"], one.estimate["field_pitch"])) for one in ahead.decisions
            ),
        )

    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:  # noqa: ARG002 - one interface
        """A new controller; doing nothing leaves the field's axis along the tube."""
        assert isinstance(brief, SteeringBrief)  # noqa: S101 - this task's own
        if name in (FEEDBACK, "knowing"):
            return Steer(brief.lab, brief.steering, self.law, knowing=name == "knowing")
        return Replay(brief.steering.rate, brief.tilts if name == "open-loop" else ())

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:  # noqa: ARG002 - one interface
        """The axis, throughout."""
        return np.zeros_like(time), self.tolerance

    def _error(self, run: LoopRun, brief: Brief) -> float:
        time = np.array([moment.time for moment in run.moments])
        distance = np.array([np.hypot(*moment.pose.position[1:]) for moment in run.moments])
        even = np.linspace(0.5 * brief.duration, brief.duration, 400)
        return float(np.mean(np.interp(even, time, distance)))

    def _is_good(self, error: float) -> bool:
        return error <= self.tolerance


def _identified(plant: Plant, rate: float) -> Steering:
    """Orbit and gain of a robot where it starts, from a look ahead with a tilt and without one.

    Raises:
        InputError: if its run ends before.
    """
    turn = 2.0 * np.pi / abs(rate)

    def place(of: Plant, tilt: float, time: float) -> complex:
        field = Field.of({"rotation_rate": rate, "yaw": tilt})
        moment = uninterrupted(of.step(time, field=field, duty=1.0))
        if moment.ended:
            why = f"{moment.ended} after {moment.time:.4g} s"
            raise InputError(f"{of.robot.name} cannot be steered there: {why}; allowed: another place or rate")
        return complex(*moment.pose.position[1:])

    ahead = plant.copy()
    before = place(ahead, 0.0, _SETTLED * turn)
    straight, aside = place(ahead.copy(), 0.0, turn), place(ahead.copy(), MOST_TILT, turn)
    orbit = complex(np.log(straight / before)) / turn if abs(before) > 0.0 and abs(straight) > 0.0 else 0j
    gain = (aside - straight) / (MOST_TILT * pushed_for(orbit, turn))
    return Steering(orbit, complex(gain), rate, plant.robot.body.length)
