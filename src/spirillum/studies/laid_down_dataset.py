"""Runs of robots that were laid down, as variables of a study's dataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from spirillum.arrays import Values
from spirillum.quantities import QUANTITIES, attributes
from spirillum.studies.factorial import main_effects
from spirillum.studies.laid_down import (
    AT_RUNS,
    FACTORS,
    INFERRED,
    INFERRED_BY,
    READ,
    WINDOWS,
    LaidDownTask,
    levels,
    levels_of_readings,
)
from spirillum.studies.spec import LaidDown
from spirillum.studies.work import Part, gathered

__all__ = ["laid_down_coordinates", "laid_down_variables"]

_SOURCE = "runs in the tube, nothing fitted"
_MEANINGS = {
    "azimuth": "change of the azimuth of the body's centre about +x",
    "effective_friction": "B_eff inferred by (18), as the paper does",
    "modelled_forward_velocity": "forward velocity by a model of the paper at the tail rate of a run",
    "modelled_body_rotation_rate": "body rate by a model of the paper at the tail rate of a run",
}


def laid_down_coordinates(ranges: LaidDown) -> dict[str, Any]:
    """Coordinates of the dimensions `run`, `window`, `inferred_by` and `factor`."""
    about = {"units": "1", "source": "design of the runs"}
    found: dict[str, Any] = {
        "window": ("window", np.array(WINDOWS, dtype=str), {**about, "long_name": "what a run is read over"}),
        "inferred_by": ("inferred_by", np.array(INFERRED_BY, dtype=str), {**about, "long_name": "model that infers"}),
        "factor": ("factor", np.array(READ, dtype=str), {**about, "long_name": "what differs between readings"}),
    }
    for column, name in zip(levels().T, FACTORS, strict=True):
        if name != "pitch":
            low, high = getattr(ranges, name)
            meaning = "gap where it is laid down" if name == "gap" else None
            values = np.where(column > 0, high, low)
            found[f"{name}_of_run"] = ("run", values, attributes(name, meaning=meaning, source="design of the runs"))
    return found


def laid_down_variables(
    answers: Sequence[tuple[LaidDownTask, Part]], robots: Sequence[str], shape: Sequence[int]
) -> dict[str, Any]:
    """Every reading of every run, the least and largest of a robot's, and the main effects of the factors.

    Args:
        answers: of the robots that were laid down, one at least.
        robots: dimensions of the robots.
        shape: sizes of these.

    Returns:
        `<quantity>_at_run` over robots, `run`, `window` (and `inferred_by`), `<quantity>_predicted_low` and
        `..._predicted_high` over robots, `<quantity>_effect` over robots and `factor`; NaN for robots that were not.
    """
    found: dict[str, Any] = {}
    for name in (*AT_RUNS, *INFERRED):
        values = gathered(answers, name, shape)
        more = ("inferred_by",) if name in INFERRED else ()
        base = name.removeprefix("modelled_")
        meaning = _MEANINGS.get(name, QUANTITIES[base].meaning)
        axes = (len(shape), len(shape) + 1)
        with np.errstate(invalid="ignore"):
            low, high = (reduce(values, axis=axes) for reduce in (np.fmin.reduce, np.fmax.reduce))
        effects = _effects(values, len(shape))

        def about(words: str, base: str = base, meaning: str = meaning) -> dict[str, Any]:
            return attributes(base, meaning=f"{meaning}, {words}", source=_SOURCE)

        found[f"{name}_at_run"] = ((*robots, "run", "window", *more), values, about("over a window of a run"))
        found[f"{name}_predicted_low"] = ((*robots, *more), low, about("least of all runs and windows"))
        found[f"{name}_predicted_high"] = ((*robots, *more), high, about("largest of all runs and windows"))
        words = "what the high level of a factor adds to the mean at its low one"
        found[f"{name}_effect"] = ((*robots, *more, "factor"), effects, about(words))
    pitch = attributes("pitch", meaning="pitch at which it is laid down, nose up", source="design of the runs")
    found["pitch_of_run"] = ((*robots, "run"), gathered(answers, "laid_pitch", shape), pitch)
    return found


def _effects(values: Values, robots: int) -> Values:
    """Main effects of `READ`; runs and windows are axes `robots` and `robots + 1`."""
    last = np.moveaxis(values, (robots, robots + 1), (-2, -1))
    return main_effects(last.reshape(*last.shape[:-2], -1), levels_of_readings())
