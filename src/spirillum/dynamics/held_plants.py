"""Thousands of held robots that step together: the same equations as a run of `simulate` with motion `held`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.argument_kinds import as_number, check_kind, checked
from spirillum.arrays import Samples
from spirillum.dynamics.held_draws import checked_ranges, drawn_numbers, posterior_numbers
from spirillum.dynamics.held_model import PARAMETERS, STATES, HeldModel, held_model
from spirillum.errors import InputError, clipped
from spirillum.kernels import held_motor as kernel
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.scalars import is_whole
from spirillum.swimming.model_choice import AUTO
from spirillum.swimming.reynolds import body_reynolds, check_stokes_flow, flow_limit, reynolds_limits, tail_reynolds

__all__ = ["HeldPlants"]

_MOST = 10_000_000
_LONGEST = 1e6
_LAST_SEED = 2**31 - 1
_POOL = 500
"""Draws of a posterior that robots are taken from."""


class HeldPlants:
    """Robots that are held to their channel's axis, all of them one step at a time; for one thread.

    All are the same robot, or are drawn around it. Arrays have one value for each robot, SI, signed about +x.
    """

    @checked
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
            robot: a preset's name, a robot file, its tables, or a loaded robot, with a `dc-motor` drive.
            count: how many.
            model: a hydrodynamic model, or `auto`.
            friction: reading of the friction; None: the robot's own.
            calibration: calibration file whose factors replace the robot's.
            placement: where they are held, for `tube`; with a `flow`, also 0, the imposed flow is an input.
            ranges: what they are drawn from: `friction` and `viscosity`, low and high factor of the robot's own,
                evenly in the logarithm; other numbers of `held_model.PARAMETERS`, such as `battery.voltage`, in SI.
            posterior: file of a calibration's posterior, from whose draws they are taken, before the ranges.
            seed: of the draws.

        Raises:
            InputError: for wrong input.
        """
        _check_whole("count", count, 1, _MOST)
        _check_whole("seed", seed, 0, _LAST_SEED)
        self.held: HeldModel = held_model(
            robot, model=model, friction=friction, calibration=calibration, placement=placement
        )
        """The robot that they are drawn around."""
        self._ranges: dict[str, tuple[float, float]] = checked_ranges(self.held.robot, ranges)
        self._pool: Samples | None = None if posterior is None else posterior_numbers(self.held, posterior, _POOL)
        self._rng = np.random.default_rng(seed)
        self.time: Samples = np.zeros(count)
        """Time since each was reset, s."""
        self.states: Samples = np.zeros((count, kernel.STATES))
        """States in the order of `held_model.STATES`."""
        self.numbers: Samples = np.tile(np.array(self.held.values), (count, 1))
        """Numbers of each robot in the order of `held_model.PARAMETERS`."""
        self.warnings: tuple[str, ...] = self.held.prediction.warnings
        """What to be careful about, a sentence each; a step that leaves Stokes flow adds to them."""
        self._inertia: tuple[str, ...] = ()
        self._viscosity: Samples = np.ones(count)
        self._duty: Samples = np.full(count, self.held.duty)
        self._flow: Samples = np.full(count, self.held.flow or 0.0)
        self.redraw()

    @property
    def count(self) -> int:
        """Number of robots."""
        return len(self.time)

    def redraw(self, which: np.ndarray | None = None, rng: np.random.Generator | None = None) -> None:
        """Take new robots from the ranges or the posterior; their motion goes on.

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
        numbers, viscosity = drawn_numbers(self.held, len(chosen), rng, self._ranges)
        if self._pool is not None:
            rows = self._pool[rng.integers(len(self._pool), size=len(chosen))]
            own = [place for place, item in enumerate(PARAMETERS) if item.name in self._ranges]
            rows[:, own] = numbers[:, own]
            numbers = rows
        self.numbers[chosen], self._viscosity[chosen] = numbers, viscosity

    def reset(self, which: np.ndarray | None = None) -> None:
        """Back to rest at place 0, with the drive on at the robot's own duty.

        Args:
            which: truth value of each robot; None: all.

        Raises:
            InputError: for wrong input.
        """
        rows = slice(None) if which is None else self._chosen("which", which)
        self.time[rows] = 0.0
        self.states[rows] = 0.0
        self._duty[rows] = self.held.duty
        self._flow[rows] = self.held.flow or 0.0

    def step(
        self,
        dt: float,
        *,
        duty: Samples | float | None = None,
        remote: np.ndarray | bool | None = None,
        flow: Samples | float | None = None,
    ) -> None:
        """All go on for a time; what is not given stays as it was.

        Args:
            dt: s, positive.
            duty: of each drive, 0 (off) to 1; or one for all.
            remote: instead, on (at the robot's own duty) or off.
            flow: mean flow that is imposed, m/s, where the placement has one.

        Raises:
            InputError: for wrong input, or a motion far outside Stokes flow; nothing has then moved.
        """
        number = _time(dt)
        if remote is not None:
            if duty is not None:
                raise InputError("remote and duty are given together; allowed: one of them")
            duty = np.where(self._chosen("remote", remote), self.held.duty, 0.0)
        if flow is not None and self.held.flow is None:
            raise InputError("flow without one in the placement; allowed: placement with flow, also 0")
        asked = self._duty if duty is None else self._one_each("duty", duty, 0.0, 1.0)
        carried = self._flow if flow is None else self._one_each("flow", flow, -1e3, 1e3)
        states = self.states.copy()
        kernel.advance(self.numbers, states, number, asked, carried, 1.0)
        self._check_stokes(self._rates(states, carried), carried)
        self.states, self._duty, self._flow = states, asked, carried
        self.time += number

    def observe(self) -> dict[str, Samples]:
        """True values by name: the states, rates and speed."""
        found = {name: self.states[:, place].copy() for place, name in enumerate(STATES)}
        found |= self._rates(self.states, self._flow)
        found["battery_voltage"] = self.numbers[:, kernel.VOLTAGE] - self.numbers[:, kernel.INTERNAL] * np.abs(
            self.states[:, kernel.CURRENT]
        )
        return found

    def _rates(self, states: Samples, flow: Samples) -> dict[str, Samples]:
        """Speed and rates in some states, by name."""
        torque = self.numbers[:, kernel.TORQUE] * states[:, kernel.CURRENT]
        return {
            name: self.numbers[:, per_torque] * torque + self.numbers[:, per_flow] * flow
            for name, per_torque, per_flow in (
                ("forward_velocity", kernel.SPEED, kernel.SPEED_FLOW),
                ("body_rotation_rate", kernel.BODY, kernel.BODY_FLOW),
                ("tail_rotation_rate", kernel.TAIL, kernel.TAIL_FLOW),
            )
        }

    def _check_stokes(self, rates: Mapping[str, Samples], flow: Samples) -> None:
        """Add what the robots break of Stokes flow to the warnings, once for each limit.

        Raises:
            InputError: if one of them moves far outside Stokes flow.
        """
        batch, thinner = self.held.prediction.batch, 1.0 / self._viscosity
        limits = reynolds_limits(
            batch,
            body_reynolds(batch, rates["forward_velocity"] * thinner),
            tail_reynolds(batch, rates["tail_rotation_rate"] * thinner),
        )
        limits.append(flow_limit(batch, float(np.abs(flow * thinner).max())))
        new = {flag: said for flag, said in check_stokes_flow(batch, limits).items() if flag not in self._inertia}
        self._inertia += tuple(new)
        self.warnings += tuple(new.values())

    def _chosen(self, name: str, given: Any) -> np.ndarray:
        """A truth value for each robot.

        Raises:
            InputError: for anything else.
        """
        try:
            values = np.asarray(given)
            if values.dtype == bool or np.isin(values, (0, 1)).all():
                return np.broadcast_to(values.astype(bool), (self.count,))
        except (TypeError, ValueError):
            pass
        raise InputError(
            f"{name} = {clipped(given)}; allowed: True or False, one for all or one for each of {self.count} robots"
        )

    def _one_each(self, name: str, given: Samples | float, low: float, high: float) -> Samples:
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


def _time(dt: Any) -> float:
    number = as_number(dt)
    if not 0.0 < number <= _LONGEST:
        raise InputError(f"dt = {clipped(dt)}; allowed: above 0, at most {_LONGEST:g} s")
    return number
