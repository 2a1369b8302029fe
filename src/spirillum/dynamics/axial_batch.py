"""Batches of robots in axial motion that step together, and how they are sampled around one robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.argument_validation import as_number, as_step, check_kind, validate_arguments
from spirillum.arrays import Samples
from spirillum.dynamics.axial_robot import PARAMETERS, STATES, AxialRobot, axial_robot, motion, responses
from spirillum.errors import InputError, check_names, clipped
from spirillum.fitted.posterior_file import read_posterior
from spirillum.kernels import core
from spirillum.notes import Note
from spirillum.robot.batch import batches
from spirillum.robot.fields import kind_of
from spirillum.robot.limits import body_reynolds, check_stokes_flow, flow_limit, reynolds_limits, tail_reynolds
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot, motor_current_problem
from spirillum.scalars import is_whole
from spirillum.swimming.preparation import AUTO
from spirillum.units import parse_option

FACTORS = ("friction", "viscosity")  #: Ranges that are factors of the robot's own value, sampled log-uniformly.
_NAMES = tuple(item.name for item in PARAMETERS)
_FIRST_RESPONSE = _NAMES.index("forward_velocity_per_torque")
_FIXED = ("polarity", *_NAMES[_FIRST_RESPONSE:])  # Numbers that follow from others and cannot be sampled alone.
_LARGEST_FACTOR = 1e3  # Of friction and viscosity.


def checked_ranges(axial: AxialRobot, ranges: Mapping[str, Any] | None) -> dict[str, tuple[float, float]]:
    """Ranges by name, each low and high: `friction` and `viscosity` as factors, others of `PARAMETERS` in SI."""
    robot = axial.robot
    allowed = [*FACTORS, *(item.name for item in axial.parameters if item.name not in _FIXED)]
    found = {}
    check_names("ranges", ranges or {}, allowed, "a number that can be sampled")
    for name, given in (ranges or {}).items():
        pair = list(given) if isinstance(given, (tuple, list)) else []
        numbers = len(pair) == 2 and all(np.isfinite(as_number(item)) for item in pair)
        if not numbers or pair[0] > pair[1]:
            raise InputError(f"ranges.{name} = {str(given)[:60]}; allowed: low and high, numbers, low first")
        found[name] = (float(pair[0]), float(pair[1]))
        for value in found[name]:
            if name in FACTORS:
                if not 1.0 / _LARGEST_FACTOR <= value <= _LARGEST_FACTOR:
                    raise InputError(
                        f"ranges.{name} = {value:g}; allowed: factors above 0, from {1.0 / _LARGEST_FACTOR:g} to "
                        f"{_LARGEST_FACTOR:g}"
                    )
            elif (kind := kind_of(robot, name)) is not None:
                parse_option(f"ranges.{name}", value, kind)
    _check_corners(robot, found)
    return found


def _check_corners(robot: Robot, ranges: Mapping[str, tuple[float, float]]) -> None:
    """Refuse ranges between which there are motors without a steady current."""
    motor, battery = robot.motor, robot.battery
    names = [name for name in ranges if name.startswith(("motor.resistance.", "battery."))]
    if motor is None or battery is None or not names:
        return
    for corner in product(*(ranges[name] for name in names)):
        ends = {name.rpartition("."): value for name, value in zip(names, corner, strict=True)}
        resistance = {entry: value for (table, _, entry), value in ends.items() if table == "motor.resistance"}
        of_battery = {entry: value for (table, _, entry), value in ends.items() if table == "battery"}
        changed = motor.model_copy(update={"resistance": motor.resistance.model_copy(update=resistance)})
        problem = motor_current_problem(changed, battery.model_copy(update=of_battery))
        if problem:
            stated = ", ".join(f"{name} = {value:g}" for name, value in zip(names, corner, strict=True))
            raise InputError(f"ranges with {stated}: {problem}")


def sampled_numbers(
    axial: AxialRobot, count: int, rng: np.random.Generator, ranges: Mapping[str, tuple[float, float]]
) -> tuple[Samples, Samples]:
    """Numbers of robots sampled from ranges, (count, len(PARAMETERS)), and their factors of the viscosity, (count,)."""
    numbers = np.tile(np.array(axial.values), (count, 1))
    factors = {name: np.ones(count) for name in FACTORS}
    for name, (low, high) in ranges.items():
        if name in FACTORS:
            factors[name] = np.exp(rng.uniform(np.log(low), np.log(high), count))
        else:
            numbers[:, _NAMES.index(name)] = rng.uniform(low, high, count)
    if any(name in ranges for name in FACTORS):
        friction = axial.prediction.effective_friction * factors["friction"]
        batch = axial.prediction.batch
        numbers[:, _FIRST_RESPONSE:] = responses(axial.prediction, batch, friction, factors["viscosity"])
    return numbers, factors["viscosity"]


def posterior_numbers(axial: AxialRobot, posterior: str | Path, count: int) -> Samples:
    """Numbers of robots with the values of a posterior's draws, (count, len(PARAMETERS)), evenly among the draws."""
    steady = axial.prediction
    known = read_posterior(posterior, steady.model.name)
    if known.places_robots:
        raise InputError(
            f"{posterior} was fitted to poses in the tube, each of which is a flow of its own; allowed: one of drag "
            "factors and friction, or ranges"
        )
    drawn = known.sampled_robots(axial.robot, count, np.random.default_rng(1))
    numbers = np.tile(np.array(axial.values), (len(drawn), 1))
    for rows, batch in batches(drawn):
        own = np.full(batch.size, steady.effective_friction)
        effective = np.where(np.isnan(batch.effective_friction), own, batch.effective_friction)
        numbers[rows, _FIRST_RESPONSE:] = responses(steady, batch, effective)
    return numbers


_MOST = 10_000_000
_LONGEST = 1e6
_LAST_SEED = 2**31 - 1
_POOL = 500  # Draws of a posterior that robots are taken from.


class AxialBatch:
    """Robots in axial motion, all of them one step at a time; not thread-safe.

    All are the same robot, or are sampled around it. Arrays have one value for each robot, SI, signed about +x.
    """

    @validate_arguments
    def __init__(
        self,
        robot: str | Path | Mapping[str, Any] | Robot,
        count: int = 1,
        *,
        model: str = AUTO,
        friction: str | None = None,
        calibration: str | Path | None = None,
        placement: Placement | Mapping[str, Any] | None = None,
        ranges: Mapping[str, Any] | None = None,
        posterior: str | Path | None = None,
        seed: int = 0,
    ) -> None:
        """Put robots at rest.

        Args:
            robot: a preset's name, a robot file, its tables, or a loaded robot, with a `dc-motor` or
                `torque-speed` drive.
            count: how many.
            model: a hydrodynamic model, or `auto`.
            friction: friction model; None: the robot's own.
            calibration: calibration file whose factors replace the robot's.
            placement: where they are held, for `tube`; with a `flow`, also 0, the imposed flow is an input.
            ranges: what they are sampled from: `friction` and `viscosity`, low and high factor of the robot's own,
                evenly in the logarithm; other numbers of `axial_robot.PARAMETERS`, such as `battery.voltage`, in SI.
            posterior: file of a calibration's posterior, from whose draws they are taken, before the ranges.
            seed: of the draws.

        Raises:
            InputError: for wrong input.
        """
        _check_whole("count", count, 1, _MOST)
        _check_whole("seed", seed, 0, _LAST_SEED)
        self.axial: AxialRobot = axial_robot(
            robot, model=model, friction=friction, calibration=calibration, placement=placement
        )
        """The robot that they are sampled around."""
        self._ranges: dict[str, tuple[float, float]] = checked_ranges(self.axial, ranges)
        self._pool: Samples | None = None if posterior is None else posterior_numbers(self.axial, posterior, _POOL)
        self._rng = np.random.default_rng(seed)
        self.time: Samples = np.zeros(count)  #: Time since each was reset, s.
        self.states: Samples = np.zeros((count, core.AXIAL_STATE_SIZE))
        """States in the order of `axial_robot.STATES`, then integrals of I^2, A^2 s, and of R I^2, J; (n, 7).

        Of a motor with a curve the torque, N m, replaces the current."""
        self.numbers: Samples = np.tile(np.array(self.axial.values), (count, 1))
        """Numbers of each robot in the order of `axial_robot.PARAMETERS`."""
        self.warnings: tuple[Note, ...] = self.axial.prediction.warnings
        """What to be careful about, a sentence each; a step that leaves Stokes flow adds to them."""
        self._inertia: tuple[str, ...] = ()
        self._viscosity: Samples = np.ones(count)
        self._duty: Samples = np.full(count, self.axial.duty)
        self._flow: Samples = np.full(count, self.axial.flow or 0.0)
        self.redraw()

    @property
    def held(self) -> AxialRobot:
        """The robot that they are sampled around, by its earlier name."""
        return self.axial

    @property
    def count(self) -> int:
        """Number of robots."""
        return len(self.time)

    def redraw(self, which: np.ndarray | None = None, rng: np.random.Generator | None = None) -> None:
        """Sample new robots from the ranges or the posterior; their motion continues.

        Args:
            which: truth value of each robot; None: all.
            rng: source of chance; None: that of the seed.

        Raises:
            InputError: for wrong input.
        """
        check_kind("rng", rng, "Generator | None")
        rng = rng or self._rng
        chosen = np.arange(self.count) if which is None else np.flatnonzero(self._chosen("which", which))
        if not len(chosen) or not (self._ranges or self._pool is not None):
            return
        numbers, viscosity = sampled_numbers(self.axial, len(chosen), rng, self._ranges)
        if self._pool is not None:
            rows = self._pool[rng.integers(len(self._pool), size=len(chosen))]
            own = [index for index, item in enumerate(PARAMETERS) if item.name in self._ranges]
            rows[:, own] = numbers[:, own]
            numbers = rows
        self.numbers[chosen], self._viscosity[chosen] = numbers, viscosity

    def reset(self, which: np.ndarray | None = None) -> None:
        """Back to rest at position 0, with the drive on at the robot's own duty.

        Args:
            which: truth value of each robot; None: all.

        Raises:
            InputError: for wrong input.
        """
        rows = slice(None) if which is None else self._chosen("which", which)
        self.time[rows] = 0.0
        self.states[rows] = 0.0
        self._duty[rows] = self.axial.duty
        self._flow[rows] = self.axial.flow or 0.0

    def step(
        self,
        dt: float,
        *,
        duty: Samples | Sequence[float] | float | None = None,
        remote: np.ndarray | Sequence[bool] | bool | None = None,
        flow: Samples | Sequence[float] | float | None = None,
    ) -> None:
        """Advance all by a time; what is not given stays as it was.

        Args:
            dt: s, positive.
            duty: of each drive, 0 (off) to 1; or one for all.
            remote: instead, on (at the robot's own duty) or off.
            flow: mean flow that is imposed, m/s, where the placement has one.

        Raises:
            InputError: for wrong input, or a motion far outside Stokes flow; nothing has then moved.
        """
        number = as_step(dt, _LONGEST)
        if remote is not None:
            if duty is not None:
                raise InputError("remote and duty are given together; allowed: one of them")
            duty = np.where(self._chosen("remote", remote), self.axial.duty, 0.0)
        if flow is not None and self.axial.flow is None:
            raise InputError("flow without one in the placement; allowed: placement with flow, also 0")
        requested = self._duty if duty is None else self._one_each("duty", duty, 0.0, 1.0)
        carried = self._flow if flow is None else self._one_each("flow", flow, -1e3, 1e3)
        states = self.states.copy()
        self.axial.advance(self.numbers, states, number, requested, carried)
        self._check_stokes(self._rates(states, carried), carried)
        self.states, self._duty, self._flow = states, requested, carried
        self.time += number

    def observe(self) -> dict[str, Samples]:
        """True values by name: the states, rates and speed."""
        found = {name: self.states[:, STATES.index(name)].copy() for name in self.axial.states}
        found |= self._rates(self.states, self._flow)
        current = self.states[:, core.AXIAL_STATE_CURRENT]
        if self.axial.curve is not None:
            return found | {"drive_torque": current.copy()}
        voltage = self.numbers[:, core.AXIAL_VOLTAGE] - self.numbers[:, core.AXIAL_INTERNAL_RESISTANCE] * np.abs(
            current
        )
        return found | {"battery_voltage": voltage}

    def _rates(self, states: Samples, flow: Samples) -> dict[str, Samples]:
        """Speed and rates in some states, by name."""
        names = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate")
        return dict(zip(names, motion(self.numbers, states[:, core.AXIAL_STATE_CURRENT], flow), strict=True))

    def _check_stokes(self, rates: Mapping[str, Samples], flow: Samples) -> None:
        """Add what the robots break of Stokes flow to the warnings, once for each limit."""
        batch, thinner = self.axial.prediction.batch, 1.0 / self._viscosity
        limits = reynolds_limits(
            batch,
            body_reynolds(batch, rates["forward_velocity"] * thinner),
            tail_reynolds(batch, rates["tail_rotation_rate"] * thinner),
        )
        limits.append(flow_limit(batch, float(np.abs(flow * thinner).max())))
        new = {flag: note for flag, note in check_stokes_flow(batch, limits).items() if flag not in self._inertia}
        self._inertia += tuple(new)
        self.warnings += tuple(new.values())

    def _chosen(self, name: str, given: Any) -> np.ndarray:
        """A truth value for each robot."""
        try:
            values = np.asarray(given)
            if values.dtype == bool or np.isin(values, (0, 1)).all():
                return np.broadcast_to(values.astype(bool), (self.count,))
        except (TypeError, ValueError):
            pass
        raise InputError(
            f"{name} = {clipped(given)}; allowed: True or False, one for all or one for each of {self.count} robots"
        )

    def _one_each(self, name: str, given: Any, low: float, high: float) -> Samples:
        try:
            values = np.array(np.broadcast_to(np.asarray(given, dtype=np.float64), (self.count,)))
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{name} is no array of {self.count} numbers; allowed: one for each robot") from error
        inside = (values >= low) & (values <= high)
        if not inside.all():
            raise InputError(f"{name} = {values[~inside][0]:g}; allowed: numbers from {low:g} to {high:g}")
        return values


def _check_whole(name: str, value: Any, low: int, high: int) -> None:
    if not is_whole(value) or not low <= int(value) <= high:
        raise InputError(f"{name} = {clipped(value)}; allowed: a whole number from {low} to {high}")
