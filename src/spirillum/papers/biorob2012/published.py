"""What the paper states: the numbers of a predicted robot, and its study of sixteen tails in two channels."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import Any, NamedTuple

from spirillum.dynamics.prediction import predict
from spirillum.envelope import quantity
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load
from spirillum.robot.robot import Robot, with_numbers
from spirillum.swimming.prediction import Prediction


class VelocityDrop(NamedTuple):
    """An extreme of the velocity decrease from the wide to the narrow channel, and the tail that has it."""

    value_mm_s: float
    wavelength_mm: float
    amplitude_mm: float


VELOCITY_DROPS = {"lowest": VelocityDrop(0.0653, 10.0, 3.5), "largest": VelocityDrop(0.648, 25.0, 2.5)}
"""Stated in the text on Figs 5 and 6."""
_WIDE, _NARROW = "biorob2012-wide", "biorob2012-narrow"
_SOURCE = "BioRob 2012, text on Figs 5 and 6"
_REMARK = (
    "the paper does not report how its robots were placed; in a trial the robot lies on the glass, where the film "
    "slows it (contact assumed, not validated)"
)


def other_tube(found: Prediction, released: Mapping[str, Any] | None = None) -> Prediction | None:
    """Return the same robot in the paper's other tube; None for a request of which the paper states no numbers."""
    plain = found.tail_rate is None and not found.fitted_by
    at_rest = found.batch.placement == RobotBatch.of(found.robot).placement
    if not (found.released and found.model.name == "tube" and plain and at_rest and _drops(found.robot)):
        return None
    for own, other in ((_WIDE, _NARROW), (_NARROW, _WIDE)):
        if found.robot == _with_tail_of(found.robot, own) and found.friction == found.robot.friction.reading:
            robot = _with_tail_of(found.robot, other)
            return predict(robot, model=found.model.name, calibrated=found.calibrated, band=False, **(released or {}))
    return None


def published_values(found: Prediction, beside: Prediction | None) -> list[dict[str, Any]]:
    """Return what the paper states of this robot, with our held and trial values; empty for any other request."""
    # The paper's data points are lost. It states by how much the robot is slower in the narrow channel than in the wide
    # one, with two of its tails.
    if beside is None:
        return []
    sign = 1.0 if found.robot == _with_tail_of(found.robot, _WIDE) else -1.0
    return [_entry(drop, found, beside, sign) for drop in _drops(found.robot)]


def _with_tail_of(robot: Robot, preset: str) -> Robot:
    """A preset with the tail of a robot."""
    return with_numbers(
        load(preset), {f"tail.{name}": getattr(robot.tail, name) for name in ("wavelength", "amplitude")}
    )


def _drops(robot: Robot) -> list[float]:
    """Decreases of the speed that the paper states for a tail, m/s."""
    own = (round(1e3 * robot.tail.wavelength, 6), round(1e3 * robot.tail.amplitude, 6))
    return [1e-3 * one.value_mm_s for one in VELOCITY_DROPS.values() if (one.wavelength_mm, one.amplitude_mm) == own]


def _entry(published: float, found: Prediction, beside: Prediction, sign: float) -> dict[str, Any]:
    speeds = [None if one.trial is None else one.trial.values.get("forward_velocity") for one in (found, beside)]
    ours = {
        "held": sign * (found.forward_velocity - beside.forward_velocity),
        "trial": (None if speeds[0] is None or speeds[1] is None else sign * (speeds[0] - speeds[1])),
    }
    return {
        "quantity": "forward_velocity",
        "case": "by how much it is faster in the wide channel than in the narrow one",
        "published": quantity(published, "m/s"),
        "ours": {name: quantity(value, "m/s") for name, value in ours.items()},
        "source": _SOURCE,
        "remark": _REMARK,
    }


def paper_study() -> dict[str, Any]:
    """The tables of the paper's study, as a study file has them."""
    text = (files("spirillum.papers.biorob2012") / "study.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
