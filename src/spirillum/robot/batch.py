"""Many robots as a struct of arrays: what the models compute on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast

import numpy as np

from spirillum.arrays import Flags, PerRobot
from spirillum.errors import InputError
from spirillum.robot import geometry
from spirillum.robot.actuation import DriveKind, FrictionReading
from spirillum.robot.options import ModelOptions
from spirillum.robot.parts import End, Shape
from spirillum.robot.placement import Placement

if TYPE_CHECKING:
    from spirillum.robot.robot import Robot

__all__ = ["CalibrationFactors", "Electrics", "RobotBatch", "batches"]

# Attribute of the batch -> dotted field of the robot file, and the value of an unset field.
_COLUMNS: dict[str, tuple[str, float]] = {
    "viscosity": ("fluid.viscosity", np.nan),
    "density": ("fluid.density", np.nan),
    "body_diameter": ("body.diameter", np.nan),
    "body_length": ("body.length", np.nan),
    "fillet": ("body.fillet", 0.0),
    "coupling_diameter": ("coupling.diameter", 0.0),
    "coupling_length": ("coupling.length", 0.0),
    "coupling_clearance": ("coupling.clearance", 0.0),
    "wavelength": ("tail.wavelength", np.nan),
    "amplitude": ("tail.amplitude", np.nan),
    "tail_length": ("tail.length", np.nan),
    "wire_diameter": ("tail.wire_diameter", np.nan),
    "taper": ("tail.taper", np.inf),
    "channel_diameter": ("channel.diameter", np.inf),
    "channel_length": ("channel.length", np.inf),
    "axis_height": ("model.rft.axis_height", np.nan),
    "effective_friction": ("friction.effective", np.nan),
    "drive_rate": ("drive.rate", np.nan),
    "drive_torque": ("drive.torque", np.nan),
    "magnetic_moment": ("magnetic.moment", np.nan),
    "moment_angle": ("magnetic.moment_angle", np.nan),
    "magnetic_field": ("magnetic.field", np.nan),
    "field_rate": ("magnetic.rotation_rate", np.nan),
    "body_mass": ("body.mass", np.nan),
    "tail_density": ("tail.density", np.nan),
}
_ELECTRIC_COLUMNS: dict[str, tuple[str, float]] = {
    "torque_constant": ("motor.torque_constant", np.nan),
    "back_emf_constant": ("motor.back_emf_constant", np.nan),
    "inductance": ("motor.inductance", np.nan),
    "rotor_friction": ("motor.rotor_friction", np.nan),
    "constant": ("motor.resistance.constant", np.nan),
    "decay": ("motor.resistance.decay", 0.0),
    "decay_rate": ("motor.resistance.decay_rate", 0.0),
    "growth": ("motor.resistance.growth", 0.0),
    "growth_rate": ("motor.resistance.growth_rate", 0.0),
    "slope": ("motor.resistance.slope", 0.0),
    "voltage": ("battery.voltage", np.nan),
    "internal_resistance": ("battery.internal_resistance", np.nan),
    "capacity": ("battery.capacity", np.nan),
    "duty": ("drive.duty", 1.0),
}


@dataclass(frozen=True)
class Electrics:
    """Motor and battery of every robot (Table II), SI; `polarity` is the sign of the driven rate about +x."""

    torque_constant: PerRobot
    back_emf_constant: PerRobot
    inductance: PerRobot
    rotor_friction: PerRobot
    constant: PerRobot
    decay: PerRobot
    decay_rate: PerRobot
    growth: PerRobot
    growth_rate: PerRobot
    slope: PerRobot
    voltage: PerRobot
    internal_resistance: PerRobot
    capacity: PerRobot
    duty: PerRobot
    polarity: PerRobot


@dataclass(frozen=True)
class CalibrationFactors:
    """Table III's factors for one model, and the geometry that they were fitted to."""

    body_drag: PerRobot
    body_rotation: PerRobot
    channel_diameter: PerRobot
    body_diameter: PerRobot
    body_length: PerRobot


@dataclass(frozen=True)
class RobotBatch:
    """Robots as a struct of arrays, SI units.

    Every array has one axis: as long as there are robots, or of length 1 where all robots share the value.
    What is not a number (outline of the body, model options, drive, friction reading) is shared by the batch, and so
    is the placement.
    An unset number is NaN, an absent channel has infinite size, a tail without taper an infinite `taper`.
    """

    viscosity: PerRobot
    density: PerRobot
    body_diameter: PerRobot
    body_length: PerRobot
    fillet: PerRobot
    coupling_diameter: PerRobot
    coupling_length: PerRobot
    coupling_clearance: PerRobot
    wavelength: PerRobot
    amplitude: PerRobot
    tail_length: PerRobot
    wire_diameter: PerRobot
    taper: PerRobot
    channel_diameter: PerRobot
    channel_length: PerRobot
    axis_height: PerRobot
    effective_friction: PerRobot
    drive_rate: PerRobot
    drive_torque: PerRobot
    magnetic_moment: PerRobot
    moment_angle: PerRobot
    magnetic_field: PerRobot
    field_rate: PerRobot
    body_mass: PerRobot
    tail_density: PerRobot
    hand: PerRobot
    electrics: Electrics | None
    calibration: Mapping[str, CalibrationFactors]
    shape: Shape
    front: End | None
    rear: End | None
    options: ModelOptions
    drive: DriveKind | None
    joint: Literal["revolute", "fixed"]
    friction: FrictionReading
    placement: Placement

    @classmethod
    def of(cls, robots: Robot | Sequence[Robot], placement: Placement | None = None) -> RobotBatch:
        """Stack robots that differ in numbers only.

        Args:
            robots: one robot, or several.
            placement: where in their channels they lie, all in the same way; None: nothing is known.

        Raises:
            InputError: if they differ in anything that a batch shares; use `batches` for mixed lists.
        """
        items = [robots] if not isinstance(robots, Sequence) else list(robots)
        if len({_shared(robot) for robot in items}) != 1:
            raise InputError(
                "robots of one batch have to share body shape, model options, drive and friction reading; "
                "use spirillum.robot.batches for a mixed list"
            )
        first = items[0]
        hand = np.array([robot.hand for robot in items])
        return cls(
            **{name: _column(items, *source) for name, source in _COLUMNS.items()},
            hand=hand,
            electrics=_electrics(items, hand),
            calibration={name: _factors(items, name) for name in first.calibration},
            shape=first.body.shape,
            front=first.body.front_end,
            rear=first.body.rear_end,
            options=first.model,
            drive=first.drive.kind if first.drive else None,
            joint=first.drive.joint if first.drive else "revolute",
            friction=first.friction.reading,
            placement=placement or Placement(),
        )

    def placed(self, placement: Placement) -> RobotBatch:
        """Return the same robots placed otherwise."""
        return replace(self, placement=placement)

    def with_values(self, values: Mapping[str, np.ndarray | Sequence[float] | float]) -> RobotBatch:
        """Return the batch with columns replaced, SI.

        Args:
            values: dotted robot-file field (``tail.wavelength``) to one value, or one for each robot.

        Raises:
            InputError: for a field that is not a number of the batch, or lengths that do not match.
        """
        attribute = {path: name for name, (path, _) in _COLUMNS.items()}
        unknown = [path for path in values if path not in attribute]
        if unknown:
            raise InputError(f"{unknown[0]} is not a number that a batch can vary; allowed: {', '.join(attribute)}")
        arrays = {attribute[path]: _checked_column(path, value) for path, value in values.items()}
        batch = replace(self, **cast("dict[str, Any]", arrays))
        batch.size  # noqa: B018 - raises where lengths do not match
        return batch

    def blocks(self, size: int) -> Iterator[tuple[slice, RobotBatch]]:
        """Cut the batch into blocks of at most `size` robots; each comes with its place in the batch."""
        if self.size <= size:
            yield slice(0, self.size), self
            return
        for start in range(0, self.size, size):
            cut = slice(start, min(start + size, self.size))
            yield cut, _cut(self, cut)

    @cached_property
    def size(self) -> int:
        """Number of robots."""
        lengths = {getattr(self, f.name).size for f in fields(self) if isinstance(getattr(self, f.name), np.ndarray)}
        if len(lengths - {1}) > 1:
            raise InputError(f"columns of a batch have lengths {sorted(lengths)}; allowed: one length, or 1")
        return int(max(lengths))

    @cached_property
    def known(self) -> Flags:
        """Whether every number that a robot needs is one."""
        result: Flags = np.ones(1, dtype=bool)
        for name, (path, _) in _COLUMNS.items():
            if path not in _MAY_BE_UNSET:
                result = result & ~np.isnan(getattr(self, name))
        return result

    @cached_property
    def arc_fraction(self) -> PerRobot:
        """alpha, axial over arc length of the plain helix."""
        return geometry.arc_fraction(self.wavelength, self.amplitude)

    @cached_property
    def arc_length(self) -> PerRobot:
        """L = L_t/alpha, m."""
        return self.tail_length / self.arc_fraction

    @cached_property
    def root(self) -> PerRobot:
        """x_r = L_b/2 + L_c: distance of the tail's root behind the origin, m."""
        return 0.5 * self.body_length + self.coupling_length

    @cached_property
    def body_volume(self) -> PerRobot:
        """Volume of the body, m^3."""
        return geometry.body_volume(
            self.shape, self.body_diameter, self.body_length, self.fillet, self.front, self.rear
        )


_S = TypeVar("_S", RobotBatch, Electrics, CalibrationFactors)


def _cut(struct: _S, cut: slice) -> _S:
    """Cut every column of a struct of arrays."""

    def part(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value[cut] if value.size > 1 else value
        if isinstance(value, Electrics):
            return _cut(value, cut)
        if isinstance(value, Mapping):
            return {name: _cut(factors, cut) for name, factors in value.items()}
        return value

    return type(struct)(**{f.name: part(getattr(struct, f.name)) for f in fields(struct)})


_MAY_BE_UNSET = (
    "model.rft.axis_height",
    "friction.effective",
    "drive.rate",
    "drive.torque",
    "magnetic.moment",
    "magnetic.moment_angle",
    "magnetic.field",
    "magnetic.rotation_rate",
    "body.mass",
    "tail.density",
)
_MAY_BE_ZERO = (
    "coupling.diameter",
    "coupling.length",
    "coupling.clearance",
    "body.fillet",
    "friction.effective",
    "magnetic.moment_angle",
)
_OF_ANY_SIGN = ("drive.rate", "drive.torque", "magnetic.rotation_rate")
_INFINITE = ("tail.taper", "channel.diameter", "channel.length")


def _checked_column(path: str, value: np.ndarray | Sequence[float] | float) -> PerRobot:
    """One column of a batch.

    Raises:
        InputError: if it is not one axis of numbers that the field may have.
    """
    try:
        column = np.atleast_1d(np.asarray(value, dtype=float))
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path} = {str(value)[:60]}; allowed: numbers in SI units") from error
    if column.ndim != 1 or column.size == 0:
        raise InputError(f"{path} has shape {column.shape}; allowed: one value, or one for each robot")
    finite = np.isfinite(column) & (np.abs(column) < 1e30)
    positive = (column > 0) | ((column == 0) & (path in _MAY_BE_ZERO)) | (path in _OF_ANY_SIGN)
    allowed = (finite & positive) | np.isnan(column)  # an unknown robot gets no answer, the others do
    allowed |= np.isposinf(column) & (path in _INFINITE)
    if not np.all(allowed):
        wrong = int(np.argmin(allowed))
        least = "0 or more" if path in _MAY_BE_ZERO else "any sign" if path in _OF_ANY_SIGN else "above 0"
        raise InputError(f"{path} of robot {wrong} = {column[wrong]:.6g}; allowed: finite SI numbers, {least}")
    return column


def _value(robot: Robot, path: str, unset: float) -> float:
    item: object = robot
    for name in path.split("."):
        item = getattr(item, name, None)
    return float(item) if isinstance(item, (int, float)) else unset


def _column(robots: Iterable[Robot], path: str, unset: float) -> PerRobot:
    return np.array([_value(robot, path, unset) for robot in robots])


def _electrics(robots: Sequence[Robot], hand: PerRobot) -> Electrics | None:
    if robots[0].motor is None or robots[0].battery is None:
        return None
    forward = np.array([1.0 if robot.motor and robot.motor.polarity == "forward" else -1.0 for robot in robots])
    columns = {name: _column(robots, *source) for name, source in _ELECTRIC_COLUMNS.items()}
    return Electrics(**columns, polarity=forward * hand)


def _factors(robots: Sequence[Robot], model: str) -> CalibrationFactors:
    entries = [robot.calibration[model] for robot in robots]
    return CalibrationFactors(
        body_drag=np.array([entry.body_drag for entry in entries]),
        body_rotation=np.array([entry.body_rotation for entry in entries]),
        channel_diameter=np.array([entry.fitted_to.channel_diameter for entry in entries]),
        body_diameter=np.array([entry.fitted_to.body_diameter for entry in entries]),
        body_length=np.array([entry.fitted_to.body_length for entry in entries]),
    )


def _shared(robot: Robot) -> tuple[object, ...]:
    drive = robot.drive
    return (
        robot.body.shape,
        robot.body.front_end,
        robot.body.rear_end,
        robot.model.model_dump_json(exclude={"rft": {"axis_height"}}),
        drive and (drive.kind, drive.joint),
        robot.friction.reading,
        robot.motor is None or robot.battery is None,
        tuple(sorted(robot.calibration)),
    )


def batches(robots: Sequence[Robot], placement: Placement | None = None) -> list[tuple[list[int], RobotBatch]]:
    """Group a mixed list of robots into batches; each comes with the positions of its robots in the list."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for index, robot in enumerate(robots):
        groups.setdefault(_shared(robot), []).append(index)
    return [(indices, RobotBatch.of([robots[i] for i in indices], placement)) for indices in groups.values()]
