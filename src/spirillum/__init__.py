"""Predict, measure and explain how a robot with a rotating helical tail swims in a fluid-filled channel.

The names below are loaded when they are first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spirillum.calibration.fit import Calibrated, calibrate
    from spirillum.citations import citation
    from spirillum.errors import InputError
    from spirillum.hydrodynamics.resistance import Resistance, resistance
    from spirillum.motion.comparison import ModelComparison, compare_models
    from spirillum.motion.flow import Flow, flow
    from spirillum.motion.prediction import Prediction, predict
    from spirillum.motion.settling import Settling, settle
    from spirillum.motion.swimming import Swimming, swim
    from spirillum.motion.transient import simulate
    from spirillum.robot import Robot, RobotBatch, load
    from spirillum.studies import study

    __version__: str

__all__ = [
    "Calibrated",
    "Flow",
    "InputError",
    "ModelComparison",
    "Prediction",
    "Resistance",
    "Robot",
    "RobotBatch",
    "Settling",
    "Swimming",
    "calibrate",
    "citation",
    "compare_models",
    "flow",
    "load",
    "predict",
    "resistance",
    "settle",
    "simulate",
    "study",
    "swim",
]

_HOME = {
    "Calibrated": "spirillum.calibration.fit",
    "Flow": "spirillum.motion.flow",
    "InputError": "spirillum.errors",
    "ModelComparison": "spirillum.motion.comparison",
    "Prediction": "spirillum.motion.prediction",
    "Resistance": "spirillum.hydrodynamics.resistance",
    "Robot": "spirillum.robot",
    "RobotBatch": "spirillum.robot",
    "Settling": "spirillum.motion.settling",
    "Swimming": "spirillum.motion.swimming",
    "calibrate": "spirillum.calibration.fit",
    "citation": "spirillum.citations",
    "compare_models": "spirillum.motion.comparison",
    "flow": "spirillum.motion.flow",
    "load": "spirillum.robot",
    "predict": "spirillum.motion.prediction",
    "resistance": "spirillum.hydrodynamics.resistance",
    "settle": "spirillum.motion.settling",
    "simulate": "spirillum.motion.transient",
    "study": "spirillum.studies",
    "swim": "spirillum.motion.swimming",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("spirillum")
    if name not in _HOME:
        raise AttributeError(f"module 'spirillum' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
