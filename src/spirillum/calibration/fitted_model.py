"""Which hydrodynamic model is fitted where nobody names one: that with which `spirillum.predict` answers.

A model without walls fitted to robots in a tube gives factors and friction that hold what the walls do: a friction
planted in a tube comes back a fifth off. Where every observed robot has the table of its tube, `tube` is fitted.
"""

from __future__ import annotations

from collections.abc import Sequence

from spirillum.calibration.experiment import Experiment
from spirillum.calibration.parameters import UNWALLED, is_free_in
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.tube.announced import TABLE_TAKES
from spirillum.fluid.tube.tabled import TabledTube, tables_of
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import all_hold
from spirillum.swimming.model_choice import AUTO, WALLED, ModelChoice
from spirillum.swimming.steady import requirements

__all__ = ["choose_fitted_model", "is_fitted_in_tube"]


def is_fitted_in_tube(asked: str, free: str | Sequence[str] | None, method: str) -> bool:
    """Return whether a fit may be one with walls: so it is asked for, or with `auto` its free numbers allow it.

    Args:
        asked: name of a model, or `auto`.
        free: free parameters, as `fit_model` takes them.
        method: method of the fit; the paper's inverts drag factors.
    """
    if asked != AUTO:
        return asked == WALLED
    return method != "paper" and is_free_in(WALLED, free)


def choose_fitted_model(
    asked: str, experiment: Experiment, free: str | Sequence[str] | None, method: str, *, prepare: bool
) -> ModelChoice:
    """Return the model that is fitted, and why.

    Args:
        asked: name of a model, or `auto`.
        experiment: the observations.
        free: free parameters, as `fit_model` takes them.
        method: method of the fit.
        prepare: whether tables that are not there are made.

    Raises:
        InputError: for an unknown model.
    """
    if asked != AUTO:
        return ModelChoice(find_swimmer_model(asked, AUTO).name)
    if not is_fitted_in_tube(asked, free, method):
        why = "method 'paper' inverts" if method == "paper" else "the free numbers are of"
        return ModelChoice(UNWALLED, f"{why} a model with drag factors")
    batch = RobotBatch.of(experiment.robots)
    if not all_hold(requirements(batch, TabledTube({}))).all():
        return _without_walls("not every robot fits its tube with a film around it")
    lacking = 0 if prepare else sum(table is None for table in tables_of(batch))
    if lacking:
        remedy = f"--prepare makes them in {TABLE_TAKES} each, and fits model '{WALLED}'"
        return _without_walls(f"{lacking} of {batch.size} robots have no table of their tubes: {remedy}")
    return ModelChoice(WALLED, "every robot has the table of its tube")


def _without_walls(why: str) -> ModelChoice:
    caution = f"model '{UNWALLED}' leaves the walls out, which its fitted numbers then stand for: {why}"
    return ModelChoice(UNWALLED, why.partition(":")[0], caution)
