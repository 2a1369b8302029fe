"""Cautions of a predicted motion: its Reynolds number, its calibration, its pose."""

from __future__ import annotations

import numpy as np

from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.tube.progress_messages import TABLE_TAKES
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit
from spirillum.robot.robot import Robot
from spirillum.swimming.band import left_open
from spirillum.swimming.model_choice import has_table
from spirillum.swimming.reynolds import reynolds_limits
from spirillum.swimming.steady_quantities import Swimming
from spirillum.units import show

NO_WEIGHT = Note(
    "no-weight",
    "body.mass or tail.density is unset: the robot has no weight in the fluid; set both",
    ("body.mass", "tail.density"),
)
"""Caution of a free motion of a robot whose masses are unknown."""


def accuracy_limits(batch: RobotBatch, model: SwimmerModel, result: Swimming) -> list[Limit]:
    """What has to hold for the answer to be accurate; each broken one is a warning."""
    return [
        *model.cautions(batch),
        *reynolds_limits(batch, result.reynolds_number, result.tail_reynolds_number),
    ]


def calibration_warnings(robot: Robot, model: str) -> list[Note]:
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
            Note(
                "calibration-missing",
                f"wall effects are not modelled: '{model}' has no calibration here, drag factors are 1; use model tube",
                ("calibration",),
            )
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
    more = f" and {len(differing) - 1} more" if len(differing) > 1 else ""
    return [
        Note(
            "calibration-outside",
            f"calibration.{model} is used outside its geometry, {differing[0]}{more}: factors may not hold; "
            "recalibrate",
            [words.partition(" = ")[0] for words in differing],
        )
    ]


def no_band_warnings(batch: RobotBatch, model: SwimmerModel) -> list[Note]:
    """Limits of an answer at one pose of several, with the remedy; nothing where the pose is known."""
    over = left_open(batch.pose, model)
    if not over:
        return []
    are = "is" if len(over) == 1 else "are"
    more = "--band gives the band over them, in minutes"
    if not has_table(batch):
        more = f"`spirillum prepare --stage straight` ({TABLE_TAKES}) makes the band quick"
    return [Note("pose-unknown", f"{' and '.join(over)} {are} unknown: this answer is for one pose; {more}", over)]
