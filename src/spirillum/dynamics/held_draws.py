"""Robots drawn around one that is held to its axis: from stated ranges of its numbers, or from a posterior."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.argument_kinds import as_number
from spirillum.arrays import Samples
from spirillum.dynamics.held_model import PARAMETERS, HeldModel, responses
from spirillum.errors import InputError, did_you_mean
from spirillum.fitted.posterior_file import read_posterior
from spirillum.robot.batch import batches
from spirillum.robot.fields import kind_of
from spirillum.robot.robot import Robot, motor_current_problem
from spirillum.units import parse_option

__all__ = ["FACTORS", "checked_ranges", "drawn_numbers", "posterior_numbers"]

FACTORS = ("friction", "viscosity")
"""Ranges that are factors of the robot's own value, drawn evenly in their logarithm."""
_NAMES = tuple(item.name for item in PARAMETERS)
_FIRST_RESPONSE = _NAMES.index("forward_velocity_per_torque")
_FIXED = ("polarity", *_NAMES[_FIRST_RESPONSE:])
"""Numbers that follow from others and cannot be drawn alone."""
_LARGEST_FACTOR = 1e3
"""Of friction and viscosity."""


def checked_ranges(robot: Robot, ranges: Mapping[str, Any] | None) -> dict[str, tuple[float, float]]:
    """Ranges by name, each low and high: `friction` and `viscosity` as factors, others of `PARAMETERS` in SI.

    Args:
        robot: the robot that is drawn around.
        ranges: by name.

    Raises:
        InputError: for an unknown name, what is no range, or values that a robot file would not take.
    """
    allowed = [*FACTORS, *(name for name in _NAMES if name not in _FIXED)]
    found = {}
    for name, given in (ranges or {}).items():
        if name not in allowed:
            raise InputError(
                f"ranges.{str(name)[:60]} is not a number that can be drawn{did_you_mean(str(name)[:60], allowed)}; "
                f"allowed: {', '.join(allowed)}"
            )
        pair = list(given) if isinstance(given, (tuple, list)) else []
        numbers = len(pair) == 2 and all(np.isfinite(as_number(item)) for item in pair)
        if not numbers or pair[0] > pair[1]:
            raise InputError(f"ranges.{name} = {str(given)[:60]}; allowed: low and high, numbers, low first")
        found[name] = (float(pair[0]), float(pair[1]))
        for value in found[name]:
            _check_value(robot, name, value)
    _check_corners(robot, found)
    return found


def _check_value(robot: Robot, name: str, value: float) -> None:
    """Refuse an end of a range that a robot file would not take.

    Raises:
        InputError: for such a value.
    """
    if name in FACTORS:
        if not 1.0 / _LARGEST_FACTOR <= value <= _LARGEST_FACTOR:
            raise InputError(
                f"ranges.{name} = {value:g}; allowed: factors above 0, from {1.0 / _LARGEST_FACTOR:g} to "
                f"{_LARGEST_FACTOR:g}"
            )
    elif (kind := kind_of(robot, name)) is not None:
        parse_option(f"ranges.{name}", value, kind)


def _check_corners(robot: Robot, ranges: Mapping[str, tuple[float, float]]) -> None:
    """Refuse ranges between which there are motors without a steady current.

    Raises:
        InputError: for such ranges.
    """
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
            said = ", ".join(f"{name} = {value:g}" for name, value in zip(names, corner, strict=True))
            raise InputError(f"ranges with {said}: {problem}")


def drawn_numbers(
    held: HeldModel, count: int, rng: np.random.Generator, ranges: Mapping[str, tuple[float, float]]
) -> tuple[Samples, Samples]:
    """Numbers of robots drawn from ranges, (count, len(PARAMETERS)), and their factors of the viscosity, (count,).

    Args:
        held: the robot.
        count: how many.
        rng: source of chance.
        ranges: as `checked_ranges` gives them.
    """
    numbers = np.tile(np.array(held.values), (count, 1))
    factors = {name: np.ones(count) for name in FACTORS}
    for name, (low, high) in ranges.items():
        if name in FACTORS:
            factors[name] = np.exp(rng.uniform(np.log(low), np.log(high), count))
        else:
            numbers[:, _NAMES.index(name)] = rng.uniform(low, high, count)
    if any(name in ranges for name in FACTORS):
        friction = held.prediction.effective_friction * factors["friction"]
        numbers[:, _FIRST_RESPONSE:] = responses(held.prediction, held.prediction.batch, friction, factors["viscosity"])
    return numbers, factors["viscosity"]


def posterior_numbers(held: HeldModel, posterior: str | Path, count: int) -> Samples:
    """Numbers of robots with the values of a posterior's draws, (count, len(PARAMETERS)), evenly among the draws.

    Args:
        held: the robot, computed by the model that was fitted.
        posterior: file of a calibration's posterior.
        count: how many, at most as many as the posterior has draws.

    Raises:
        InputError: for a wrong file, or one that was fitted with another model or to places in the tube.
    """
    steady = held.prediction
    known = read_posterior(posterior, steady.model.name)
    if known.places_robots:
        raise InputError(
            f"{posterior} was fitted to places in the tube, each of which is a flow of its own; allowed: one of drag "
            "factors and friction, or ranges"
        )
    drawn = known.drawn(held.robot, count, np.random.default_rng(1))
    numbers = np.tile(np.array(held.values), (len(drawn), 1))
    for rows, batch in batches(drawn):
        own = np.full(batch.size, steady.effective_friction)
        effective = np.where(np.isnan(batch.effective_friction), own, batch.effective_friction)
        numbers[rows, _FIRST_RESPONSE:] = responses(steady, batch, effective)
    return numbers
