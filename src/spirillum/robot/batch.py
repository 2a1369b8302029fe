"""Many robots as a struct of arrays: what the models compute on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, cast, get_type_hints

import numpy as np

from spirillum.argument_validation import number_array, validate_arguments, whole_array
from spirillum.arrays import Flags, PerRobot, Values
from spirillum.errors import InputError, clipped
from spirillum.robot.geometry import End, ProfilePoints, Shape, body_volume
from spirillum.robot.model_options import ModelOptions
from spirillum.robot.outline import profile_outline
from spirillum.robot.placement import Placement
from spirillum.robot.shape_input import source_of
from spirillum.robot.tables import DriveKind, FrictionModel, RobotTables, TorqueCurve
from spirillum.robot.tail_form import TailForm, arc_fraction


class Column(NamedTuple):
    """Source of a column of a batch, and its allowed values."""

    path: str  #: Dotted field of the robot file.
    unset: float = np.nan  #: Value where the field is not set.
    optional: bool = False  #: Whether a robot swims without it.
    zero: bool = False
    signed: bool = False
    infinite: bool = False


@cache
def _columns(name: str) -> dict[str, Column]:
    """Columns of a struct of arrays by attribute."""
    hints = get_type_hints(globals()[name], include_extras=True)
    marks = {name: getattr(hint, "__metadata__", ()) for name, hint in hints.items()}
    return {name: mark for name, found in marks.items() for mark in found if isinstance(mark, Column)}


@dataclass(frozen=True)
class Electrics:
    """Motor, gear and battery of every robot (Table II), SI; `polarity` is the sign of the driven rate about +x.

    The constants are those of the motor's shaft, which turns `gear_ratio` times as fast as the joint; a balance at the
    joint takes `joint_...`.
    """

    torque_constant: Annotated[PerRobot, Column("motor.torque_constant")]
    back_emf_constant: Annotated[PerRobot, Column("motor.back_emf_constant")]
    inductance: Annotated[PerRobot, Column("motor.inductance")]
    rotor_friction: Annotated[PerRobot, Column("motor.rotor_friction")]
    constant: Annotated[PerRobot, Column("motor.resistance.constant")]
    decay: Annotated[PerRobot, Column("motor.resistance.decay", unset=0.0)]
    decay_rate: Annotated[PerRobot, Column("motor.resistance.decay_rate", unset=0.0)]
    growth: Annotated[PerRobot, Column("motor.resistance.growth", unset=0.0)]
    growth_rate: Annotated[PerRobot, Column("motor.resistance.growth_rate", unset=0.0)]
    slope: Annotated[PerRobot, Column("motor.resistance.slope", unset=0.0)]
    voltage: Annotated[PerRobot, Column("battery.voltage")]
    internal_resistance: Annotated[PerRobot, Column("battery.internal_resistance")]
    capacity: Annotated[PerRobot, Column("battery.capacity")]
    duty: Annotated[PerRobot, Column("drive.duty", unset=1.0)]
    gear_ratio: Annotated[PerRobot, Column("motor.gear_ratio", unset=1.0)]
    polarity: PerRobot

    @property
    def columns(self) -> tuple[Values, ...]:
        """The numbers of a motor in the order of the compiled equations, torques and rates at the joint."""
        return (
            self.joint_torque_constant,
            self.joint_back_emf_constant,
            self.inductance,
            self.constant,
            self.decay,
            self.decay_rate,
            self.growth,
            self.growth_rate,
            self.slope,
            self.voltage,
            self.internal_resistance,
            self.polarity,
        )

    @property
    def joint_torque_constant(self) -> Values:
        """K_m G: torque in the joint per current, N m/A."""
        return self.torque_constant * self.gear_ratio

    @property
    def joint_back_emf_constant(self) -> Values:
        """K_b G: back-emf per rate of the joint, V s/rad."""
        return self.back_emf_constant * self.gear_ratio

    @property
    def joint_rotor_friction(self) -> Values:
        """B_m G^2: friction of the motor's rotor referred to the joint, N m s/rad."""
        return self.rotor_friction * self.gear_ratio**2


@dataclass(frozen=True)
class CalibrationFactors:
    """Table III's factors for one model, and the geometry that they were fitted to."""

    body_drag: Annotated[PerRobot, Column("body_drag")]
    body_rotation: Annotated[PerRobot, Column("body_rotation")]
    channel_diameter: Annotated[PerRobot, Column("fitted_to.channel_diameter")]
    body_diameter: Annotated[PerRobot, Column("fitted_to.body_diameter")]
    body_length: Annotated[PerRobot, Column("fitted_to.body_length")]


@dataclass(frozen=True)
class RobotBatch:
    """Robots as a struct of arrays, SI units.

    Every array has one axis: as long as there are robots, or of length 1 where all robots share the value.
    What is not a number (outline of the body, model options, drive, friction model) is shared by the batch, and so
    is the placement.
    An unset number is NaN, an absent channel has infinite size, a tail without taper an infinite `taper`.
    """

    viscosity: Annotated[PerRobot, Column("fluid.viscosity")]
    density: Annotated[PerRobot, Column("fluid.density")]
    body_diameter: Annotated[PerRobot, Column("body.diameter")]
    body_length: Annotated[PerRobot, Column("body.length")]
    fillet: Annotated[PerRobot, Column("body.fillet", unset=0.0, zero=True)]
    coupling_diameter: Annotated[PerRobot, Column("coupling.diameter", unset=0.0, zero=True)]
    coupling_length: Annotated[PerRobot, Column("coupling.length", unset=0.0, zero=True)]
    coupling_clearance: Annotated[PerRobot, Column("coupling.clearance", unset=0.0, zero=True)]
    wavelength: Annotated[PerRobot, Column("tail.wavelength")]
    amplitude: Annotated[PerRobot, Column("tail.amplitude")]
    tail_length: Annotated[PerRobot, Column("tail.length")]
    wire_diameter: Annotated[PerRobot, Column("tail.wire_diameter")]
    taper: Annotated[PerRobot, Column("tail.taper", unset=np.inf, infinite=True)]
    channel_diameter: Annotated[PerRobot, Column("channel.diameter", unset=np.inf, infinite=True)]
    channel_length: Annotated[PerRobot, Column("channel.length", unset=np.inf, infinite=True)]
    axis_height: Annotated[PerRobot, Column("model.rft.axis_height", optional=True)]
    effective_friction: Annotated[PerRobot, Column("friction.effective", optional=True, zero=True)]
    drive_rate: Annotated[PerRobot, Column("drive.rate", optional=True, signed=True)]
    drive_torque: Annotated[PerRobot, Column("drive.torque", optional=True, signed=True)]
    magnetic_moment: Annotated[PerRobot, Column("magnetic.moment", optional=True)]
    moment_angle: Annotated[PerRobot, Column("magnetic.moment_angle", optional=True, zero=True)]
    magnetic_field: Annotated[PerRobot, Column("magnetic.field", optional=True)]
    field_rate: Annotated[PerRobot, Column("magnetic.rotation_rate", optional=True, signed=True)]
    body_mass: Annotated[PerRobot, Column("body.mass", optional=True)]
    tail_density: Annotated[PerRobot, Column("tail.density", optional=True)]
    hand: PerRobot
    electrics: Electrics | None
    curve: TorqueCurve | None
    calibration: Mapping[str, CalibrationFactors]
    shape: Shape
    front: End | None
    rear: End | None
    profile: ProfilePoints
    form: TailForm
    options: ModelOptions
    drive: DriveKind | None
    joint: Literal["revolute", "fixed"]
    friction: FrictionModel
    placement: Placement

    @classmethod
    @validate_arguments
    def of(cls, robots: RobotTables | Sequence[RobotTables], placement: Placement | None = None) -> RobotBatch:
        """Stack robots that differ in numbers only."""
        items = [robots] if isinstance(robots, RobotTables) else list(robots)
        if not items:
            raise InputError("robots = []; allowed: one robot, or several")
        if len({_shared(robot) for robot in items}) != 1:
            raise InputError(
                "robots of one batch have to share body shape, model options, drive and friction model; "
                "use spirillum.robot.batch.batches for a mixed list"
            )
        first = items[0]
        hand = np.array([robot.hand for robot in items])
        return cls(
            **_stacked("RobotBatch", items),
            hand=hand,
            electrics=_electrics(items, hand),
            curve=first.drive.curve if first.drive else None,
            calibration={
                model: CalibrationFactors(**_stacked("CalibrationFactors", [item.calibration[model] for item in items]))
                for model in first.calibration
            },
            shape=first.body.shape,
            front=first.body.front_end,
            rear=first.body.rear_end,
            profile=first.body.points,
            form=first.tail.form,
            options=first.model,
            drive=first.drive.kind if first.drive else None,
            joint=first.drive.joint if first.drive else "revolute" if first.has_body else "fixed",
            friction=first.friction.reading,
            placement=placement or Placement(),
        )

    @staticmethod
    def numbers() -> tuple[str, ...]:
        """Dotted fields of the robot file that are columns of a batch."""
        return tuple(source.path for source in _columns("RobotBatch").values())

    def taken(self, rows: Sequence[int] | np.ndarray) -> RobotBatch:
        """Robots by their numbers, in that order, each as often as it is named."""
        allowed = f"whole numbers from 0 to {self.size - 1}, one after the other"
        chosen = whole_array("rows", rows, allowed)
        if chosen.ndim != 1 or not chosen.size:
            raise InputError(f"rows has shape {chosen.shape}; allowed: {allowed}")
        outside = (chosen < 0) | (chosen >= self.size)
        if np.any(outside):
            place = int(np.argmax(outside))
            raise InputError(f"rows[{place}] = {chosen[place]}; allowed: {allowed}")
        return _cut(self, chosen) if self.size > 1 else replace(self, hand=self.hand[chosen])

    @validate_arguments
    def placed(self, placement: Placement) -> RobotBatch:
        """Return the same robots with other placements."""
        return replace(self, placement=placement)

    @validate_arguments
    def with_values(self, values: Mapping[str, np.ndarray | Sequence[float] | float]) -> RobotBatch:
        """Return the batch with columns of dotted fields replaced, SI, by one value or one each; NaN: not known."""
        known = {source.path: (name, source) for name, source in _columns("RobotBatch").items()}
        unknown = [path for path in values if path not in known]
        if unknown:
            raise InputError(f"{unknown[0]} cannot vary in a batch; allowed: {', '.join(known)}")
        for path in values:
            if (source := source_of(path, curve=bool(self.form.curve), profile=bool(self.profile))) is not None:
                raise InputError(f"{path} follows from {source}; allowed: fields that it leaves open")
        arrays = {known[path][0]: _checked_column(known[path][1], value) for path, value in values.items()}
        batch = replace(self, **cast("dict[str, Any]", arrays))
        batch.size  # noqa: B018 - raises where lengths do not match
        return batch

    @validate_arguments
    def blocks(self, size: int) -> Iterator[tuple[slice, RobotBatch]]:
        """Cut the batch into blocks of at most `size` robots, each with its position in the batch."""
        if size < 1:
            raise InputError(f"size = {clipped(size)}; allowed: a whole number from 1")
        return self._blocks(size)

    def _blocks(self, size: int) -> Iterator[tuple[slice, RobotBatch]]:
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
        for name, source in _columns("RobotBatch").items():
            if not source.optional:
                result = result & ~np.isnan(getattr(self, name))
        return result

    @cached_property
    def arc_fraction(self) -> PerRobot:
        """alpha, axial over arc length of the helix without its root, or of the centre line."""
        if self.form.is_helix:
            return arc_fraction(self.wavelength, self.amplitude)
        return self.tail_length / self.form.arc_length(self.amplitude, self.wavelength, self.tail_length)

    @cached_property
    def arc_length(self) -> PerRobot:
        """L = L_t/alpha, m."""
        return self.tail_length / self.arc_fraction

    @cached_property
    def root(self) -> PerRobot:
        """x_r = L_b/2 + L_c: distance of the tail's root behind the origin, m."""
        return 0.5 * self.body_length + self.coupling_length

    @property
    def pose(self) -> Placement:
        """The placement; a bare tail, which no body lays on the floor, is on the tube's axis where no gap is given."""
        given = self.placement
        if self.shape != "none" or given.gap is not None or given.eccentricity is not None:
            return given
        return given.model_copy(update={"eccentricity": 0.0})

    @cached_property
    def body_volume(self) -> PerRobot:
        """Volume of the body, m^3."""
        if self.profile:
            _, square, dx = profile_outline(self.profile).sections()
            return np.full(1, np.pi * np.sum(square * dx))
        return body_volume(self.shape, self.body_diameter, self.body_length, self.fillet, self.front, self.rear)


"""Fields that follow from a centre line through points."""


_S = TypeVar("_S", RobotBatch, Electrics, CalibrationFactors)


def _cut(struct: _S, cut: slice | np.ndarray) -> _S:
    """Cut every column of a struct of arrays, by a slice or by rows."""

    def part(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value[cut] if value.size > 1 else value
        if isinstance(value, Electrics):
            return _cut(value, cut)
        if isinstance(value, Mapping):
            return {name: _cut(factors, cut) for name, factors in value.items()}
        return value

    return type(struct)(**{f.name: part(getattr(struct, f.name)) for f in fields(struct)})


def _checked_column(source: Column, value: np.ndarray | Sequence[float] | float) -> PerRobot:
    """One column of a batch."""
    path = source.path
    values = np.atleast_1d(number_array(path, value, "numbers in SI units"))
    if values.ndim != 1 or values.size == 0:
        raise InputError(f"{path} has shape {values.shape}; allowed: one value, or one for each robot")
    finite = np.isfinite(values) & (np.abs(values) < 1e30)
    positive = (values > 0) | ((values == 0) & source.zero) | source.signed
    allowed = (finite & positive) | np.isnan(values)  # an unknown robot gets no answer, the others do
    allowed |= np.isposinf(values) & source.infinite
    if not np.all(allowed):
        wrong = int(np.argmin(allowed))
        least = "0 or more" if source.zero else "any sign" if source.signed else "above 0"
        raise InputError(f"{path} of robot {wrong} = {values[wrong]:.6g}; allowed: finite SI numbers, {least}")
    if not source.optional and np.all(np.isnan(values)):
        raise InputError(f"{path} = nan for all robots; allowed: numbers in SI units, NaN only for unknown values")
    return values


def _value(table: object, source: Column) -> float:
    for name in source.path.split("."):
        table = getattr(table, name, None)
    return float(table) if isinstance(table, (int, float)) else source.unset


def _stacked(struct: str, tables: Sequence[object]) -> dict[str, Any]:
    """Columns of a struct of arrays, from tables that have their fields."""
    return {name: np.array([_value(one, source) for one in tables]) for name, source in _columns(struct).items()}


def _electrics(robots: Sequence[RobotTables], hand: PerRobot) -> Electrics | None:
    if robots[0].motor is None or robots[0].battery is None:
        return None
    forward = np.array([1.0 if robot.motor and robot.motor.polarity == "forward" else -1.0 for robot in robots])
    return Electrics(**_stacked("Electrics", robots), polarity=forward * hand)


def _shared(robot: RobotTables) -> tuple[object, ...]:
    drive = robot.drive
    return (
        robot.body.shape,
        robot.body.front_end,
        robot.body.rear_end,
        robot.body.points,
        robot.tail.form,
        robot.model.model_dump_json(exclude={"rft": {"axis_height"}}),
        drive and (drive.kind, drive.joint, drive.curve),
        robot.friction.reading,
        robot.motor is None or robot.battery is None,
        tuple(sorted(robot.calibration)),
    )


@validate_arguments
def batches(robots: Sequence[RobotTables], placement: Placement | None = None) -> list[tuple[list[int], RobotBatch]]:
    """Group a mixed list of robots into batches, each with the indices of its robots in the list."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for index, robot in enumerate(robots):
        groups.setdefault(_shared(robot), []).append(index)
    return [(indices, RobotBatch.of([robots[i] for i in indices], placement)) for indices in groups.values()]
