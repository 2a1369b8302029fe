"""What goes between the robot, its sensors and its controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from typing import Protocol

from spirillum.dynamics.plant import Snapshot
from spirillum.dynamics.turning_field import Field


@dataclass(frozen=True)
class Detection:
    """What the camera has seen on one frame; SI."""

    time: float
    """When the frame was taken, s."""
    position: float
    """x of the body's mid-length, m."""
    heading: float
    """Yaw, rad."""
    body_angle: float
    """Unwrapped, rad."""
    tail_phase: float
    """Of the tail against the body, unwrapped, rad."""
    side: float = nan
    """y of the body's mid-length, m."""
    height: float = nan
    """z of the body's mid-length, m; by a second camera, that looks from the side."""


@dataclass(frozen=True)
class Command:
    """What is sent to a robot."""

    duty: float
    """Of its drive, 0 (off) to 1; a field is on at any duty but 0."""
    field: Field | None = None
    """What changes of the field of a magnetic robot."""


@dataclass(frozen=True)
class MeterReading:
    """What the meter has read; SI."""

    time: float
    """When it was read, s."""
    current: float
    """A."""
    voltage: float
    """V."""


@dataclass(frozen=True)
class Message:
    """What a controller knows when it decides."""

    time: float
    """Now, s."""
    sights: tuple[Detection, ...] = ()
    """Those that have arrived since the last decision, in the order of their frames."""
    readings: tuple[MeterReading, ...] = ()
    """Readings of the meter that have arrived since the last decision, in the order of their times."""
    truth: Snapshot | None = field(default=None, compare=False)
    """The robot itself, for a controller that knows everything; else None."""


class Controller(Protocol):
    """Decides once in a period of the remote; new for each run."""

    blind: bool = False
    """Whether it continues without a camera; else the drive is switched off when the camera is silent."""
    knowing: bool = False
    """Whether it is given the truth."""

    def decide(self, news: Message) -> float | Command:
        """Duty from now on, 0 (off) to 1; for a magnetic robot a command with its field."""
        ...

    def estimate(self) -> Mapping[str, float]:
        """What it estimates of the robot, by name, SI; the same names every time."""
        return {}
