"""Sensors and disturbances of one run, and the signals between robot, sensors and controller.

Each part has a stream of random numbers of its own, of which every frame, reading and command takes its share whether
it arrives or not. Runs of the same seed under two controllers can so be compared in pairs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from typing import Any, Protocol

import numpy as np

from spirillum.controllers.lab import Lab, Pulse, Unknown
from spirillum.dynamics.plant import Plant, Snapshot
from spirillum.dynamics.rotating_field import Field
from spirillum.errors import InputError
from spirillum.progress import Progress
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot, with_numbers
from spirillum.robot.tube_pose import gap_of


@dataclass(frozen=True)
class Detection:
    """A detection of the robot on one frame of the camera; SI."""

    time: float  #: When the frame was taken, s.
    position: float  #: x of the body's mid-length, m.
    heading: float  #: Yaw, rad.
    body_angle: float  #: Unwrapped, rad.
    tail_phase: float  #: Of the tail against the body, unwrapped, rad.
    side: float = nan  #: y of the body's mid-length, m.
    height: float = nan  #: z of the body's mid-length, m; by a second camera, that looks from the side.


@dataclass(frozen=True)
class Command:
    """A command to a robot."""

    duty: float  #: Of its drive, 0 (off) to 1; a field is on at any duty but 0.
    field: Field | None = None  #: Changes of the field of a magnetic robot.


@dataclass(frozen=True)
class MeterReading:
    """A reading of the meter; SI."""

    time: float  #: When it was read, s.
    current: float  #: A.
    voltage: float  #: V.


@dataclass(frozen=True)
class Message:
    """Information that a controller has when it decides."""

    time: float  #: Now, s.
    sights: tuple[Detection, ...] = ()  #: Those that have arrived since the last decision, in the order of their frames
    readings: tuple[MeterReading, ...] = ()
    """Readings of the meter that have arrived since the last decision, in the order of their times."""
    truth: Snapshot | None = field(default=None, compare=False)
    """The robot itself, for a controller that knows everything; else None."""


class Controller(Protocol):
    """Decides once in a period of the remote; new for each run."""

    blind: bool = False  #: Whether it goes on without a camera; else the drive is off when the camera is silent.
    knowing: bool = False  #: Whether it is given the truth.

    def decide(self, news: Message) -> float | Command:
        """Duty from now on, 0 (off) to 1; for a magnetic robot a command with its field."""
        ...

    def estimate(self) -> Mapping[str, float]:
        """What it estimates of the robot, by name, SI; the same names every time."""
        return {}


_STREAMS = ("unknown", "pulse", "camera", "meter", "remote", "across")
_SEEN = ("position", "heading", "body_angle", "tail_phase")
_LATEST = 0.9  # share of a run in which a pulse may begin
_FARTHEST = 4.0  # standard deviations at which samples are truncated


@dataclass(frozen=True)
class FlowPulse:
    """A pulse of flow at its time in the run; SI."""

    start: float  #: s.
    end: float  #: s.
    velocity: float  #: Mean flow, m/s.

    def passed_after(self, time: float) -> float:
        """Distance by which the mean flow still moves after a time, m."""
        return self.velocity * max(0.0, self.end - max(time, self.start))


@dataclass(frozen=True)
class SampledErrors:
    """Sampled parameters of a run that the controller does not know."""

    friction: float  #: Factor of the friction.
    gap: float  #: Factor of the gap at the start.
    pulse: FlowPulse | None = None  #: Flow; None: none.
    voltage: float = 1.0  #: Factor of the battery's voltage.
    viscosity: float = 1.0  #: Factor of the viscosity.


def draw(unknown: Unknown, pulse: Pulse, seed: int, duration: float) -> SampledErrors:
    """Draw the robot and the flow of a run."""
    stream = _stream(seed, "unknown")
    factors = np.exp(np.log([unknown.friction_factor, unknown.gap_factor]) * stream.uniform(-1.0, 1.0, 2))
    sizes = np.array([unknown.voltage_error, unknown.viscosity_error])
    voltage, viscosity = 1.0 + np.clip(stream.standard_normal(2), -_FARTHEST, _FARTHEST) * sizes
    place, side = _stream(seed, "pulse").uniform(size=2)
    flow = None
    if pulse.velocity and pulse.duration > 0.0:
        start, velocity = pulse.start, pulse.velocity
        if start is None:
            start, velocity = _LATEST * duration * place, velocity if side < 0.5 else -velocity
        flow = FlowPulse(float(start), float(start) + pulse.duration, float(velocity))
    return SampledErrors(float(factors[0]), float(factors[1]), flow, float(voltage), float(viscosity))


class Senses:
    """Camera, meter and remote of one run."""

    def __init__(self, lab: Lab, seed: int) -> None:
        self._lab = lab
        self.pictured = 0.0  #: Time of the last frame that was not lost, whether or not the robot is seen on it, s.
        self._camera, self._meter, self._remote = (_stream(seed, name) for name in ("camera", "meter", "remote"))
        self._scale = 1.0 + lab.camera.scale_error * float(self._camera.standard_normal())
        self._sizes = np.array(
            [[getattr(lab.camera, f"{name}_{kind}") for name in _SEEN] for kind in ("noise", "wander")]
        )
        self._wander, self._last = self._camera.standard_normal(4), 0.0
        self._across = _stream(seed, "across")
        self._wander_across = self._across.standard_normal(2)
        self._gains = 1.0 + lab.meter.gain_error * self._meter.standard_normal(2)

    def sight(self, moment: Snapshot) -> Detection | None:
        """The next frame; None where it is lost."""
        camera = self._lab.camera
        lost = self._camera.uniform() < camera.dropped
        noise = self._camera.standard_normal((2, 4))
        kept = np.exp(-(moment.time - self._last) / camera.memory)
        self._wander, self._last = kept * self._wander + np.sqrt(1.0 - kept**2) * noise[1], moment.time
        noise_across = self._across.standard_normal((2, 2))
        self._wander_across = kept * self._wander_across + np.sqrt(1.0 - kept**2) * noise_across[1]
        if lost or (camera.fails_at is not None and moment.time >= camera.fails_at):
            return None
        self.pictured = moment.time
        errors = (self._sizes[0] * noise[0] + self._sizes[1] * self._wander).tolist()
        across = self._scale * moment.pose.position[1:] + self._sizes[:, 0] @ [noise_across[0], self._wander_across]
        return Detection(
            moment.time,
            self._scale * float(moment.pose.position[0]) + errors[0],
            moment.values["yaw"] + errors[1],
            moment.values["body_angle"] + errors[2],
            moment.pose.tail_phase + errors[3],
            *across.tolist(),
        )

    def reading(self, moment: Snapshot) -> MeterReading:
        """The next reading of current and voltage; NaN where the robot has no motor."""
        meter = self._lab.meter
        current, voltage = self._meter.standard_normal(2).tolist()
        true = moment.values.get("motor_current", np.nan), moment.values.get("battery_voltage", np.nan)
        return MeterReading(
            moment.time,
            float(self._gains[0]) * true[0] + meter.current_noise * current,
            float(self._gains[1]) * true[1] * (1.0 + meter.voltage_noise * voltage),
        )

    def not_ready(self, time: float) -> str:  # noqa: ARG002 - modelled ones are ready at once
        """Why nothing can be seen yet at a time, s, in half a sentence; empty once it can."""
        return ""

    def deliver(self, command: Command) -> Command:
        """The command as the robot takes it."""
        return command

    def close(self) -> None:
        """Put away what the run needed."""

    def command_arrives(self) -> bool:
        """Whether the next command reaches the robot."""
        return bool(self._remote.uniform() >= self._lab.remote.lost)


def _stream(seed: int, name: str) -> np.random.Generator:
    return np.random.default_rng([seed, _STREAMS.index(name)])


def plant_of(
    robot: Robot, arguments: Mapping[str, Any], drawn: SampledErrors, progress: Progress | None = None
) -> Plant:
    """The sampled robot of a run, at rest at its start."""
    arguments = dict(arguments)
    if drawn.gap != 1.0:
        if robot.channel is None:
            raise InputError("unknown.gap_factor is given for a robot without a channel; allowed: 1")
        placed = Placement.of(arguments.get("placement"))
        if placed.eccentricity is not None:
            raise InputError(
                "unknown.gap_factor is given together with an eccentricity; allowed: a gap, or a factor of 1"
            )
        gap = gap_of(placed, robot.body.diameter, 0.5 * robot.channel.diameter)
        arguments["placement"] = placed.model_copy(update={"gap": gap * drawn.gap})
    effective = robot.friction.effective
    if effective is None and robot.motor is not None:
        effective = robot.motor.joint_rotor_friction
    changes: dict[str, float] = {}
    if drawn.friction != 1.0 and effective:
        changes["friction.effective"] = drawn.friction * effective
    if drawn.viscosity != 1.0:
        changes["fluid.viscosity"] = robot.fluid.viscosity * drawn.viscosity
    if drawn.voltage != 1.0 and robot.battery is not None:
        changes["battery.voltage"] = robot.battery.voltage * drawn.voltage
    return Plant(with_numbers(robot, changes), **arguments, progress=progress)
