"""A robot with its hydrodynamic model, loaded, at its pose in the channel and inside the model's domain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import check_placement, find_swimmer_model, quickest
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, all_hold, assembly_limits, broken
from spirillum.robot.load import load, with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import GAP_SHARE
from spirillum.swimming.steady import requirements
from spirillum.units import show

_GAP_STEP = 1.02
"""Ratio of gaps to which the least one that a model resolves is determined."""


def prepared(
    robot: str | Path | Mapping[str, Any] | Robot,
    model: str,
    *,
    fit: Fit = NO_FIT,
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
) -> tuple[Robot, SwimmerModel, RobotBatch]:
    """A loaded robot with its model and batch, at its pose and inside the model's domain.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        model: name of a hydrodynamic model.
        fit: fitted values that replace the robot's, and its placement where none is given.
        resolution: of the models `slender` and `tube`; None: the robot's own.
        placement: where in the channel the robot lies, for a model that computes the walls.
    """
    ready, chosen = load(robot), find_swimmer_model(model)
    if fit.posterior is None:  # the median of a posterior stands in the robot already
        ready = fit.central(ready)
    if not placement and chosen.placed:
        placement = fit.calibrated_placement(ready)
    ready = with_resolution(ready, resolution, model)
    batch = RobotBatch.of(ready, Placement.of(placement))
    if np.all(all_hold(assembly_limits(batch))):  # a table reaches closer to the wall than a direct solution
        chosen = quickest(chosen, batch)
    check_domain(ready, chosen, batch)
    return ready, chosen, batch


def check_domain(robot: Robot, model: SwimmerModel, batch: RobotBatch) -> None:
    """Refuse a robot at its pose, a batch of one, outside a model's domain."""
    check_placement(batch.placement, model)
    outside = broken(requirements(batch, quickest(model, batch)))
    if outside:
        raise InputError(
            f"{robot.name} with model '{model.name}': {outside[0].sentence()}{_what_helps(batch, model, outside)}"
        )


def _what_helps(batch: RobotBatch, model: SwimmerModel, outside: list[Limit]) -> str:
    """Where only a thin film keeps a model from an answer: the least gap that it resolves, and what else helps."""
    if not model.placed or quickest(model, batch).form == "table":
        return ""
    least = least_gap(batch, model)
    if not np.isfinite(least):
        return ""
    if outside[0].field == "placement.gap":  # its bound is named already
        return "; with a table (`spirillum prepare`) less"
    return f"; here at least placement.gap = {show(least, 'mm')}, or a table (`spirillum prepare`)"


def least_gap(batch: RobotBatch, model: SwimmerModel) -> float:
    """Least gap that a model resolves where only the film is too thin for it, to 2 %, m; NaN where that is not so.

    The search goes from the placement's gap to the one that is taken where none is given.
    """
    given = batch.placement.gap
    if given is None:
        return float("nan")

    def fits(gap: float) -> bool:
        placed = batch.placement.model_copy(update={"gap": gap})
        return not broken(requirements(replace(batch, placement=placed), model))

    low, high = given, GAP_SHARE * 0.5 * float(batch.body_diameter[0])
    if low >= high or not fits(high):
        return float("nan")
    while high > _GAP_STEP * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if fits(middle) else (middle, high)
    return high
