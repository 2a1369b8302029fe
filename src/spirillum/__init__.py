"""Predict, measure and explain how a robot with a rotating helical tail swims in a fluid-filled channel.

The names below are loaded when they are first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spirillum.calibration.calibrated import Calibrated
    from spirillum.calibration.ranking import Ranking, rank_models
    from spirillum.calibration.suggest import Suggestion, suggest
    from spirillum.citations import citation
    from spirillum.dynamics.magnetic_sweep import magnetic_sweep
    from spirillum.dynamics.settling import Settling, settle
    from spirillum.dynamics.simulation import simulate
    from spirillum.errors import InputError
    from spirillum.exports.write import Export, export
    from spirillum.fields.flow import Flow, flow
    from spirillum.fluid.resistance import Resistance, resistance
    from spirillum.measurement.feasibility import Feasibility, feasibility
    from spirillum.measurement.measure import Measurement
    from spirillum.results.calibration import calibrate
    from spirillum.results.measurement import measure
    from spirillum.results.study import study
    from spirillum.robot.batch import RobotBatch
    from spirillum.robot.load import load
    from spirillum.robot.robot import Robot
    from spirillum.swimming.answer import Swimming
    from spirillum.swimming.comparison import ModelComparison, compare_models
    from spirillum.swimming.prediction import Prediction, predict
    from spirillum.swimming.steady import swim
    from spirillum.view.scene3d.film import Film, film
    from spirillum.view.scene3d.show import Picture3D, show
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
    "Calibrated": "spirillum.calibration.calibrated",
    "Export": "spirillum.exports.write",
    "Feasibility": "spirillum.measurement.feasibility",
    "Film": "spirillum.view.scene3d.film",
    "Flow": "spirillum.fields.flow",
    "InputError": "spirillum.errors",
    "Measurement": "spirillum.measurement.measure",
    "ModelComparison": "spirillum.swimming.comparison",
    "Picture3D": "spirillum.view.scene3d.show",
    "Prediction": "spirillum.swimming.prediction",
    "Ranking": "spirillum.calibration.ranking",
    "Resistance": "spirillum.fluid.resistance",
    "Robot": "spirillum.robot.robot",
    "RobotBatch": "spirillum.robot.batch",
    "Settling": "spirillum.dynamics.settling",
    "Suggestion": "spirillum.calibration.suggest",
    "Swimming": "spirillum.swimming.answer",
    "calibrate": "spirillum.results.calibration",
    "citation": "spirillum.citations",
    "compare_models": "spirillum.swimming.comparison",
    "export": "spirillum.exports.write",
    "feasibility": "spirillum.measurement.feasibility",
    "film": "spirillum.view.scene3d.film",
    "flow": "spirillum.fields.flow",
    "load": "spirillum.robot.load",
    "magnetic_sweep": "spirillum.dynamics.magnetic_sweep",
    "measure": "spirillum.results.measurement",
    "predict": "spirillum.swimming.prediction",
    "rank_models": "spirillum.calibration.ranking",
    "render": "spirillum.virtual.trial",
    "resistance": "spirillum.fluid.resistance",
    "settle": "spirillum.dynamics.settling",
    "show": "spirillum.view.scene3d.show",
    "simulate": "spirillum.dynamics.simulation",
    "study": "spirillum.results.study",
    "suggest": "spirillum.calibration.suggest",
    "swim": "spirillum.swimming.steady",
    "virtual_experiment": "spirillum.virtual.experiment",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from spirillum.version import own_version

        return own_version()
    if name not in _HOME:
        raise AttributeError(f"module 'spirillum' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
