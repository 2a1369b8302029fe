"""`spirillum.predict`: steady swimming by any model, and free motion in the tube."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import signature
from typing import ParamSpec

from spirillum.errors import InputError
from spirillum.swimming import prediction
from spirillum.swimming.prediction import Prediction

__all__ = ["predict"]

_P = ParamSpec("_P")


def _also_free_in_tube(steady: Callable[_P, Prediction]) -> Callable[_P, Prediction]:
    """A prediction that follows the robot where model and motion ask for free motion in the tube."""
    known = signature(steady)

    @wraps(steady)
    def predicted(*args: _P.args, **kwargs: _P.kwargs) -> Prediction:
        asked = known.bind(*args, **kwargs).arguments
        if (asked.get("model"), asked.get("motion")) != ("tube", "free"):
            return steady(*args, **kwargs)
        if asked.get("posterior") is not None:
            raise InputError("posterior with model 'tube' and motion 'free'; allowed: motion 'held'")
        from spirillum.dynamics.free_motion import free_motion  # its equations are compiled

        found = free_motion(
            asked["robot"],
            tail_rate=asked.get("tail_rate"),
            friction=asked.get("friction"),
            calibration=asked.get("calibration"),
            placement=asked.get("placement"),
            progress=asked.get("progress"),
        )
        return found.prediction

    return predicted


predict = _also_free_in_tube(prediction.predict)
