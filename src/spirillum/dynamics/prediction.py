"""`spirillum.predict`: steady swimming by any model, and free motion in the tube."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from inspect import signature
from typing import ParamSpec

from spirillum.errors import InputError
from spirillum.robot.load import load, with_resolution
from spirillum.robot.placement import Placement
from spirillum.swimming import prediction
from spirillum.swimming.model_choice import AUTO, ModelChoice, choose_model
from spirillum.swimming.prediction import Prediction

__all__ = ["predict"]

_P = ParamSpec("_P")


def _also_free_in_tube(steady: Callable[_P, Prediction]) -> Callable[_P, Prediction]:
    """A prediction that follows the robot where model and motion ask for free motion in the tube."""
    known = signature(steady)

    @wraps(steady)
    def predicted(*args: _P.args, **kwargs: _P.kwargs) -> Prediction:
        asked = known.bind(*args, **kwargs).arguments
        model = asked.get("model", AUTO)
        if asked.get("motion") != "free" or model not in ("tube", AUTO):
            return steady(*args, **kwargs)
        if model == AUTO and asked.get("posterior") is not None:  # its model decides
            return steady(*args, **kwargs)
        robot, choice = load(asked["robot"]), ModelChoice("tube")
        if model == AUTO:
            where, fitted = Placement.of(asked.get("placement")), asked.get("calibration")
            choice = choose_model(AUTO, robot, placement=where, calibration=fitted, motion="free")
        if choice.model != "tube":
            return steady(*args, **kwargs)
        if asked.get("posterior") is not None:
            raise InputError("posterior with model 'tube' and motion 'free'; allowed: motion 'held'")
        with_resolution(robot, asked.get("resolution"), "tube")  # refused as for a held motion
        from spirillum.dynamics.free_motion import free_motion  # its equations are compiled

        found = free_motion(
            robot,
            tail_rate=asked.get("tail_rate"),
            friction=asked.get("friction"),
            calibration=asked.get("calibration"),
            placement=asked.get("placement"),
            progress=asked.get("progress"),
        )
        return replace(found.prediction, choice=choice)

    return predicted


predict = _also_free_in_tube(prediction.predict)
