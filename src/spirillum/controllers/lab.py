"""Sensors, remote and disturbances of a controlled run as data: the same in files, Python and on the command line."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BeforeValidator

from spirillum.errors import InputError, check_names, led_by
from spirillum.files import read_toml
from spirillum.robot.arguments import Options, in_range, refusal, within
from spirillum.robot.fields import Angle, Current, LengthOrZero, Section, Time, Velocity

_WHAT = "a lab file (TOML with the tables [camera], [meter], [remote], [pulse], [unknown])"
_LONGEST_DELAY = 60.0


def _not_negative(value: float) -> float:
    if value < 0.0:
        raise refusal(f"= {value:g} rad; allowed: at least 0")
    return value


_Delay = Annotated[Time, within(0.0, _LONGEST_DELAY, "s")]
_Period = Annotated[Time, within(1e-3, _LONGEST_DELAY, "s")]
_AngleNoise = Annotated[Angle, AfterValidator(_not_negative)]
_Share = Annotated[float, BeforeValidator(in_range(0.0, 0.95))]


class CameraModel(Options, argument="camera", prefixed=True):
    """The camera: when it sees, and how it errs: normal errors of each frame, and slow ones with a memory.

    The sizes are those of the tracker on degraded films of the virtual camera, see `docs/control-background.md`.
    """

    fps: Annotated[float, BeforeValidator(in_range(0.1, 1000.0, " frames a second"))] = 30.0  #: Frames a second.
    latency: _Delay = 0.1  #: From a frame's exposure until the controller has its numbers.
    dropped: _Share = 0.02  #: Share of frames that never arrive, each by itself.
    fails_at: Time | None = None  #: From when on nothing arrives any more; None: never.
    scale_error: Annotated[float, BeforeValidator(in_range(0.0, 0.2))] = 0.002
    """Relative standard deviation of the scale, one value for a whole run."""
    position_noise: LengthOrZero = 1e-5
    """Standard deviation of the position along the channel, independent from frame to frame."""
    heading_noise: _AngleNoise = 7e-4
    """Standard deviation of the heading (yaw, as seen from above), of each frame by itself."""
    body_angle_noise: _AngleNoise = 3e-3  #: Standard deviation of the body's angle, of each frame by itself.
    tail_phase_noise: _AngleNoise = 1e-2  #: Standard deviation of the tail's phase, of each frame by itself.
    position_wander: LengthOrZero = 3e-5  #: Standard deviation of the slow error of the position along the channel.
    heading_wander: _AngleNoise = 2.5e-3  #: Standard deviation of the slow error of the heading.
    body_angle_wander: _AngleNoise = 7e-3  #: Standard deviation of the slow error of the body's angle.
    tail_phase_wander: _AngleNoise = 1.8e-2  #: Standard deviation of the slow error of the tail's phase.
    memory: _Period = 1.0  #: Correlation time of the slow errors.


class Meter(Options, argument="meter", prefixed=True):
    """Motor current and battery voltage, as a circuit on board would send them; the paper's robot has none."""

    rate: Annotated[float, BeforeValidator(in_range(0.0, 1000.0, " readings a second"))] = 10.0
    """Readings a second; 0: no meter."""
    latency: _Delay = 0.05  #: From a reading until the controller has it.
    current_noise: Current = 1e-3  #: Standard deviation of the current of one reading.
    voltage_noise: Annotated[float, BeforeValidator(in_range(0.0, 0.2))] = 1e-3
    """Relative standard deviation of the voltage of one reading."""
    gain_error: Annotated[float, BeforeValidator(in_range(0.0, 0.2))] = 0.005
    """Relative standard deviation of the gain of current and of voltage, one value each for a whole run."""


class Remote(Options, argument="remote", prefixed=True):
    """What carries commands to the robot: unidirectional, repeated, and some are lost.

    The defaults are those of common infrared remotes: a message lasts 68 ms and is repeated every 108 ms (NEC code).
    """

    period: _Period = 0.108  #: Between two commands; a controller decides once in a period.
    delay: _Delay = 0.068  #: From the decision until the drive follows.
    lost: _Share = 0.05  #: Share of commands that never arrive, each by itself; the drive then keeps the last one.


class Pulse(Options, argument="pulse", prefixed=True):
    """A pulse of flow through the tube: the mean flow is imposed for a while, then the ends are as before."""

    velocity: Velocity = 5e-4  #: Mean flow while it lasts; 0: no pulse.
    duration: Time = 2.0  #: How long it lasts.
    start: Time | None = None
    """When it begins; None: sampled uniformly over the first nine tenths of the run, with a random sign."""


class Unknown(Options, argument="unknown", prefixed=True):
    """Robot parameters unknown to the controller; each run samples them anew."""

    friction_factor: Annotated[float, BeforeValidator(in_range(1.0, 100.0))] = 3.0
    """The true friction is the robot's times a factor from 1/this to this, evenly in its logarithm; 1: known."""
    gap_factor: Annotated[float, BeforeValidator(in_range(1.0, 100.0))] = 1.0
    """The gap at the start is the given one times a factor from 1/this to this, evenly in its logarithm; 1: known."""
    voltage_error: Annotated[float, BeforeValidator(in_range(0.0, 0.2))] = 0.0
    """Relative standard deviation of the battery's voltage."""
    viscosity_error: Annotated[float, BeforeValidator(in_range(0.0, 0.2))] = 0.0
    """Relative standard deviation of the fluid's viscosity; silicone oil changes by some 2 % a kelvin."""


class Lab(Section):
    """Sensors, actuators and disturbances of a controlled run."""

    camera: CameraModel = CameraModel()
    meter: Meter = Meter()
    remote: Remote = Remote()
    pulse: Pulse = Pulse()
    unknown: Unknown = Unknown()

    @classmethod
    def of(cls, value: Self | str | Path | Mapping[str, Any] | None) -> Self:
        """A lab from itself, its tables by name, a TOML file or None; only tables may give numbers, in SI."""
        if isinstance(value, cls):
            return value
        if isinstance(value, str | Path):
            return cls.read(value, {})
        return cls._from(value or {}, written=False)

    @classmethod
    def _from(cls, table: Any, *, written: bool) -> Self:
        """A lab from its tables; `written` where every quantity needs its unit."""
        if not isinstance(table, Mapping):
            raise InputError(f"lab = {str(table)[:60]!r}; allowed: {_WHAT}, or its tables by name")
        sections: dict[str, type[Options]] = {
            name: info.annotation
            for name, info in cls.model_fields.items()
            if isinstance(info.annotation, type) and issubclass(info.annotation, Options)
        }
        check_names("lab", table, sections, "a known table")
        read = {name: section.as_written if written else section.of for name, section in sections.items()}
        return cls(**{name: reader(table.get(name)) for name, reader in read.items()})

    @classmethod
    def read(cls, path: str | Path | None, changes: Mapping[str, Any]) -> Self:
        """A lab from its file, with fields changed by dotted name, as ``{"camera.latency": "50 ms"}``."""
        tables: dict[str, Any] = {} if path is None else read_toml(Path(path), _WHAT)
        with led_by(str(path)):
            whole = cls._from(tables, written=True)
        for name, value in changes.items():
            table, dot, entry = name.partition(".")
            if not dot or not isinstance(tables.get(table, {}), dict):
                raise InputError(f"lab: {name[:60]!r} is no field; allowed: TABLE.FIELD, such as camera.latency")
            tables[table] = {**tables.get(table, {}), entry: value}
        return cls._from(tables, written=True) if changes else whole

    @classmethod
    def exact(cls) -> Self:
        """Sensors without errors, drops and latency, a remote without delay and losses, no pulse, nothing unknown."""
        names = (name for name in CameraModel.model_fields if name.endswith(("_noise", "_wander", "_error")))
        camera = CameraModel.of({**dict.fromkeys(names, 0.0), "latency": 0.0, "dropped": 0.0})
        meter = Meter.of({"current_noise": 0.0, "voltage_noise": 0.0, "gain_error": 0.0, "latency": 0.0})
        return cls(
            camera=camera,
            meter=meter,
            remote=Remote.of({"delay": 0.0, "lost": 0.0}),
            pulse=Pulse.of({"velocity": 0.0}),
            unknown=Unknown.of({"friction_factor": 1.0}),
        )
