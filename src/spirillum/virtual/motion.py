"""Whose motion a virtual trial shows: a model's steady one, prescribed rates, or a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option
from spirillum.virtual.tank import tube_height
from spirillum.virtual.trajectory import Way, lab_to_camera, run_way, steady_way

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Motion", "motion_of", "reach_of", "steady_rates"]

_GAP = 0.5e-3
"""Between body and tube in a run that does not say where the robot lies, m; assumed."""


@dataclass(frozen=True)
class Motion:
    """A robot and its way."""

    robot: Robot
    way: Way
    model: str
    """Model, `prescribed`, or both."""
    warnings: tuple[str, ...] = ()


def steady_rates(
    robot: Robot,
    *,
    model: str,
    tail_rate: str | float | None,
    friction: str | None,
    forward_velocity: str | float | None = None,
    body_rate: str | float | None = None,
) -> tuple[dict[str, float], str, tuple[str, ...]]:
    """Forward velocity and rates, SI; a model's where they are not given.

    Args:
        robot: a checked robot.
        model: the hydrodynamic model.
        tail_rate: lab rotation rate of the tail; None: the robot's drive.
        friction: reading of the friction; None: the robot's own.
        forward_velocity: instead of the model's.
        body_rate: instead of the model's.

    Returns:
        The rates by name, what they are from, and warnings.

    Raises:
        InputError: for wrong input.
    """
    options = {
        "forward_velocity": ("forward_velocity", forward_velocity, "velocity"),
        "body_rotation_rate": ("body_rate", body_rate, "rate"),
        "tail_rotation_rate": ("tail_rate", tail_rate, "rate"),
    }
    given = {
        name: None if value is None else parse_option(option, value, KINDS[kind])
        for name, (option, value, kind) in options.items()
    }
    fixed = {name: value for name, value in given.items() if value is not None}
    if len(fixed) == len(given):
        return fixed, "prescribed", ()
    from spirillum.swimming.prediction import predict

    steady = predict(robot, model=model, tail_rate=given["tail_rotation_rate"], friction=friction, band=False)
    found = {name: float(getattr(steady, name)) for name in given} | fixed
    instead = [name for name in fixed if name != "tail_rotation_rate"]
    words = model if not instead else f"{model}, prescribed: {', '.join(instead)}"
    return found, words, tuple(steady.warnings)


def motion_of(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    run: xr.Dataset | str | Path | None,
    model: str,
    tail_rate: str | float | None,
    friction: str | None,
    forward_velocity: str | float | None,
    body_rate: str | float | None,
    duration: str | float,
    view: str,
    leftwards: bool,
    placement: Mapping[str, float],
    side_axis: float,
) -> Motion:
    """The motion of a trial.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        run: a run instead of a steady motion, or its file.
        model: the hydrodynamic model.
        tail_rate: lab rotation rate of the tail.
        friction: reading of the friction.
        forward_velocity: instead of the model's.
        body_rate: instead of the model's.
        duration: of the video.
        view: `top` or `side`.
        leftwards: whether the nose points to the left in the picture.
        placement: `gap`, `lateral`, `heading`, `wobble`, `body_angle`, `tail_phase`, SI.
        side_axis: height of the tube's axis above the far wall in the view from the side, m.

    Raises:
        InputError: for wrong input.
    """
    loaded = load(robot)
    if run is not None:
        return _of_run(loaded, run, view, leftwards=leftwards, duration=duration, side_axis=side_axis)
    length = parse_option("duration", duration, KINDS["time"])
    rates, words, warnings = steady_rates(
        loaded,
        model=model,
        tail_rate=tail_rate,
        friction=friction,
        forward_velocity=forward_velocity,
        body_rate=body_rate,
    )
    _check_wobble(loaded, placement["wobble"])
    turn = lab_to_camera(view, leftwards=leftwards)
    position = turn @ _resting(loaded, placement["gap"], placement["lateral"])
    position = position + np.array([0.0, 0.0, tube_height(loaded, view, side_axis)])
    way = steady_way(
        length,
        **rates,
        position=position,
        heading=placement["heading"],
        wobble=placement["wobble"],
        body_angle=placement["body_angle"],
        tail_phase=placement["tail_phase"],
    )
    return Motion(loaded, way, words, warnings)


def _of_run(
    loaded: Robot, run: xr.Dataset | str | Path, view: str, *, leftwards: bool, duration: str | float, side_axis: float
) -> Motion:
    from spirillum.dynamics.run_file import open_run, robot_of

    dataset = open_run(run) if isinstance(run, str | Path) else run
    own = robot_of(dataset)
    if own != loaded:
        raise InputError(f"the run's robot {own.name!r} is not {loaded.name!r}; allowed: the robot of the run")
    axis = tube_height(loaded, view, side_axis)
    way = run_way(dataset, view, leftwards=leftwards, axis=axis, level=float(_resting(loaded, _GAP, 0.0)[2]))
    way = way.until(parse_option("duration", duration, KINDS["time"]))
    model = str(dataset.attrs.get("model", ""))[:60]
    return Motion(loaded, way, f"run, {model}" if model else "run")


def _check_wobble(robot: Robot, wobble: float) -> None:
    """Refuse a wobble that is wider than the channel."""
    room = math.inf if robot.channel is None else 0.5 * (robot.channel.diameter - robot.body.diameter)
    if wobble > room:
        raise InputError(f"wobble = {1e3 * wobble:.4g} mm; allowed: 0 to {1e3 * room:.4g} mm, the room in the channel")


def _resting(robot: Robot, gap: float, lateral: float) -> Samples:
    """(3,) middle of the body in the channel's axes, low in the tube at a gap and a horizontal offset, m.

    Raises:
        InputError: if gap or offset are wider than the channel leaves.
    """
    if robot.channel is None:
        return np.array([0.0, lateral, 0.0])
    room = 0.5 * (robot.channel.diameter - robot.body.diameter)
    if gap > room:
        raise InputError(f"gap = {1e3 * gap:.4g} mm; allowed: 0 to {1e3 * room:.4g} mm, where the body is on the axis")
    if abs(lateral) > room - gap:
        most = 1e3 * (room - gap)
        raise InputError(f"lateral = {1e3 * lateral:.4g} mm; allowed: at most {most:.4g} mm to either side at this gap")
    return np.array([0.0, lateral, -float(np.sqrt((room - gap) ** 2 - lateral**2))])


def reach_of(robot: Robot) -> tuple[float, float]:
    """Smallest and largest x of a robot from its body's mid-length, m."""
    half = 0.5 * robot.body.length
    return -half - robot.coupling.length - robot.tail.length, half
