"""Predict, measure and explain how a robot with a rotating helical tail swims in a fluid-filled channel.

The names below are loaded when they are first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spirillum.calibration.fit import Calibrated, calibrate
    from spirillum.calibration.ranking import Ranking, rank_models
    from spirillum.calibration.suggest import Suggestion, suggest
    from spirillum.citations import citation
    from spirillum.drawing.film import Film, film
    from spirillum.drawing.show import Picture3D, show
    from spirillum.errors import InputError
    from spirillum.exports.write import Export, export
    from spirillum.hydrodynamics.resistance import Resistance, resistance
    from spirillum.measurement.feasibility import Feasibility, feasibility
    from spirillum.measurement.measure import Measurement, measure
    from spirillum.motion.comparison import ModelComparison, compare_models
    from spirillum.motion.flow import Flow, flow
    from spirillum.motion.magnetic_sweep import magnetic_sweep
    from spirillum.motion.prediction import Prediction, predict
    from spirillum.motion.quantities import Swimming
    from spirillum.motion.settling import Settling, settle
    from spirillum.motion.simulation import simulate
    from spirillum.motion.swimming import swim
    from spirillum.robot import Robot, RobotBatch, load
    from spirillum.studies import study
    from spirillum.virtual.experiment import virtual_experiment
    from spirillum.virtual.trial import render

    __version__: str

__all__ = [
    "Calibrated",
    "Export",
    "Feasibility",
    "Film",
    "Flow",
    "InputError",
    "Measurement",
    "ModelComparison",
    "Picture3D",
    "Prediction",
    "Ranking",
    "Resistance",
    "Robot",
    "RobotBatch",
    "Settling",
    "Suggestion",
    "Swimming",
    "calibrate",
    "citation",
    "compare_models",
    "export",
    "feasibility",
    "film",
    "flow",
    "load",
    "magnetic_sweep",
    "measure",
    "predict",
    "rank_models",
    "render",
    "resistance",
    "settle",
    "show",
    "simulate",
    "study",
    "suggest",
    "swim",
    "virtual_experiment",
]

_HOME = {
    "Calibrated": "spirillum.calibration.fit",
    "Export": "spirillum.exports.write",
    "Feasibility": "spirillum.measurement.feasibility",
    "Film": "spirillum.drawing.film",
    "Flow": "spirillum.motion.flow",
    "InputError": "spirillum.errors",
    "Measurement": "spirillum.measurement.measure",
    "ModelComparison": "spirillum.motion.comparison",
    "Picture3D": "spirillum.drawing.show",
    "Prediction": "spirillum.motion.prediction",
    "Ranking": "spirillum.calibration.ranking",
    "Resistance": "spirillum.hydrodynamics.resistance",
    "Robot": "spirillum.robot",
    "RobotBatch": "spirillum.robot",
    "Settling": "spirillum.motion.settling",
    "Suggestion": "spirillum.calibration.suggest",
    "Swimming": "spirillum.motion.quantities",
    "calibrate": "spirillum.calibration.fit",
    "citation": "spirillum.citations",
    "compare_models": "spirillum.motion.comparison",
    "export": "spirillum.exports.write",
    "feasibility": "spirillum.measurement.feasibility",
    "film": "spirillum.drawing.film",
    "flow": "spirillum.motion.flow",
    "load": "spirillum.robot",
    "magnetic_sweep": "spirillum.motion.magnetic_sweep",
    "measure": "spirillum.measurement.measure",
    "predict": "spirillum.motion.prediction",
    "rank_models": "spirillum.calibration.ranking",
    "render": "spirillum.virtual.trial",
    "resistance": "spirillum.hydrodynamics.resistance",
    "settle": "spirillum.motion.settling",
    "show": "spirillum.drawing.show",
    "simulate": "spirillum.motion.simulation",
    "study": "spirillum.studies",
    "suggest": "spirillum.calibration.suggest",
    "swim": "spirillum.motion.swimming",
    "virtual_experiment": "spirillum.virtual.experiment",
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
