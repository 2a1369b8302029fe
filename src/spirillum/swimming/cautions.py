"""What to be careful about in a predicted motion: its Reynolds number, its calibration, its place."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.tube.announced import TABLE_TAKES
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit
from spirillum.robot.robot import Robot
from spirillum.swimming.answer import Swimming
from spirillum.swimming.band import left_open
from spirillum.swimming.model_choice import has_table
from spirillum.units import show

__all__ = [
    "BEYOND_STOKES",
    "accuracy_limits",
    "calibration_warnings",
    "flow_limit",
    "in_stokes_flow",
    "no_band_warnings",
    "speed_limit",
]

BEYOND_STOKES = 10.0
"""Reynolds number above which inertia rules: `predict` refuses unless asked, and no answer has an error estimate."""
_LARGEST_REYNOLDS = 0.1
_INERTIA = "inertia is neglected (Stokes flow)"


def accuracy_limits(batch: RobotBatch, model: SwimmerModel, result: Swimming) -> list[Limit]:
    """What has to hold for the answer to be accurate; each broken one is a warning."""
    return [
        *model.cautions(batch),
        flow_limit(batch, abs(batch.placement.flow or 0.0)),
        _reynolds_limit("body diameter", result.reynolds_number),
        _reynolds_limit("tail amplitude", result.tail_reynolds_number, "tail-reynolds-number"),
    ]


def _reynolds_limit(what: str, value: Samples, flag: str = "reynolds-number") -> Limit:
    return Limit.of(f"Reynolds number ({what})", value, "at most", _LARGEST_REYNOLDS, "1", _INERTIA, flag)


def speed_limit(batch: RobotBatch, velocity: Samples) -> Limit:
    """What has to hold of the largest speed of a run, by its velocities, (n, 3), m/s, for an accurate answer."""
    speed = float(np.linalg.norm(velocity, axis=-1).max())
    value = batch.density * speed * batch.body_diameter / batch.viscosity
    return _reynolds_limit(f"body diameter, at the largest speed of the run, {1e3 * speed:.4g} mm/s", value)


def flow_limit(batch: RobotBatch, flow: float) -> Limit:
    """What has to hold of an imposed flow of `flow` m/s, at its fastest, for the answer to be accurate."""
    value = batch.density * flow * batch.body_diameter / batch.viscosity
    return _reynolds_limit("imposed flow, body diameter", value, "flow-reynolds-number")


def in_stokes_flow(error: float, *reynolds: Samples) -> float:
    """An error estimate against other solutions of Stokes flow; NaN where inertia rules, which none of them knows."""
    largest = max(float(np.max(value, initial=0.0, where=np.isfinite(value))) for value in reynolds)
    return error if largest <= BEYOND_STOKES else float("nan")


def calibration_warnings(robot: Robot, model: str) -> list[str]:
    """What to be careful about in a robot's calibration for a model: none, or fitted to another geometry.

    A model that computes the walls takes none.
    """
    if find_swimmer_model(model).placed:
        return []
    entry = robot.calibration.get(model)
    if entry is None:
        if robot.channel is None:  # nothing to stand for
            return []
        return [
            f"no calibration for model '{model}': body drag factors are 1, and nothing stands for the channel's walls"
        ]
    fitted = entry.fitted_to
    channel = robot.channel.diameter if robot.channel else None
    pairs = (
        ("channel.diameter", channel, fitted.channel_diameter),
        ("body.diameter", robot.body.diameter, fitted.body_diameter),
        ("body.length", robot.body.length, fitted.body_length),
    )
    differing = [
        f"{name} = {'none' if value is None else show(value, 'mm')} (fitted to {show(fit, 'mm')})"
        for name, value, fit in pairs
        if value is None or not np.isclose(value, fit, rtol=1e-6)
    ]
    if not differing:
        return []
    return [f"calibration.{model} ({entry.source}) is used outside its geometry: {', '.join(differing)}"]


def no_band_warnings(batch: RobotBatch, model: SwimmerModel) -> list[str]:
    """What an answer at one place of several lacks, and how to get it; nothing where its place is known."""
    over = left_open(batch.placement, model)
    if not over:
        return []
    more = "a band over them takes minutes (--band)"
    if not has_table(batch):
        more = f"`spirillum prepare` makes its table, once, in {TABLE_TAKES}; with it a band over them takes a second"
    known = "is not known" if len(over) == 1 else "are not known"
    return [f"{' and '.join(over)} {known}, and this is the answer at one place: {more}"]
