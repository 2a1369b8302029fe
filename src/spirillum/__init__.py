"""Predict, measure and explain how a robot with a rotating helical tail swims in a fluid-filled channel.

The names below are loaded when they are first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from spirillum.deprecated import RENAMED, current_name

if TYPE_CHECKING:
    from spirillum.calibration.calibrated import Calibrated as Calibrated
    from spirillum.calibration.ranking import Ranking as Ranking
    from spirillum.calibration.ranking import rank_models as rank_models
    from spirillum.calibration.suggest import Suggestion as Suggestion
    from spirillum.calibration.suggest import suggest as suggest
    from spirillum.citations import citation as citation
    from spirillum.controllers.control import Control as Control
    from spirillum.controllers.control import control as control
    from spirillum.designs.design import design as design
    from spirillum.designs.design_result import Design as Design
    from spirillum.dynamics.axial_batch import AxialBatch as AxialBatch
    from spirillum.dynamics.flow_of_run import flow_of_run as flow_of_run
    from spirillum.dynamics.magnetic_sweep import magnetic_sweep as magnetic_sweep
    from spirillum.dynamics.plant import Plant as Plant
    from spirillum.dynamics.prediction import predict as predict
    from spirillum.dynamics.settling import Settling as Settling
    from spirillum.dynamics.settling import settle as settle
    from spirillum.dynamics.simulation import simulate as simulate
    from spirillum.errors import InputError as InputError
    from spirillum.exports.recording import Recording as Recording
    from spirillum.exports.recording import export_run as export_run
    from spirillum.exports.write import Export as Export
    from spirillum.exports.write import export as export
    from spirillum.fields.flow import Flow as Flow
    from spirillum.fields.flow import flow as flow
    from spirillum.fluid.resistance import Resistance as Resistance
    from spirillum.fluid.resistance import resistance as resistance
    from spirillum.interfaces.bench import Bench as Bench
    from spirillum.interfaces.python_control import LinearSystem as LinearSystem
    from spirillum.interfaces.python_control import control_system as control_system
    from spirillum.interfaces.python_control import linear_system as linear_system
    from spirillum.interfaces.serial_remote import RemoteRun as RemoteRun
    from spirillum.interfaces.serial_remote import SerialRemote as SerialRemote
    from spirillum.interfaces.serial_remote import VirtualRemote as VirtualRemote
    from spirillum.interfaces.serial_remote import remote as remote
    from spirillum.live.observation import Observation as Observation
    from spirillum.live.session import track as track
    from spirillum.live.tracker import LiveTracker as LiveTracker
    from spirillum.live.tracking_summary import Tracked as Tracked
    from spirillum.measurement.feasibility import Feasibility as Feasibility
    from spirillum.measurement.feasibility import feasibility as feasibility
    from spirillum.measurement.measure import Measurement as Measurement
    from spirillum.measurement.proposal import Proposal as Proposal
    from spirillum.measurement.proposal import propose_setup as propose_setup
    from spirillum.pages.launch import page as page
    from spirillum.results.calibration import calibrate as calibrate
    from spirillum.results.measurement import measure as measure
    from spirillum.results.study import study as study
    from spirillum.robot.batch import RobotBatch as RobotBatch
    from spirillum.robot.load import load as load
    from spirillum.robot.robot import Robot as Robot
    from spirillum.swimming.comparison import ModelComparison as ModelComparison
    from spirillum.swimming.comparison import compare_models as compare_models
    from spirillum.swimming.prediction import Prediction as Prediction
    from spirillum.swimming.preparation import Prepared as Prepared
    from spirillum.swimming.preparation import prepare as prepare
    from spirillum.swimming.preparation import prepare_all as prepare_all
    from spirillum.swimming.steady import swim as swim
    from spirillum.swimming.steady_quantities import Swimming as Swimming
    from spirillum.view.figures.plot import Plot as Plot
    from spirillum.view.figures.plot import plot as plot
    from spirillum.view.scene3d.film import Film as Film
    from spirillum.view.scene3d.film import film as film
    from spirillum.view.scene3d.show import Picture3D as Picture3D
    from spirillum.view.scene3d.show import show as show
    from spirillum.virtual.experiment import virtual_experiment as virtual_experiment
    from spirillum.virtual.live_camera import VirtualCamera as VirtualCamera
    from spirillum.virtual.trial import render as render

    __version__: str

_HOME = {
    "Calibrated": "spirillum.calibration.calibrated",
    "Control": "spirillum.controllers.control",
    "Design": "spirillum.designs.design_result",
    "Export": "spirillum.exports.write",
    "Feasibility": "spirillum.measurement.feasibility",
    "Film": "spirillum.view.scene3d.film",
    "Flow": "spirillum.fields.flow",
    "AxialBatch": "spirillum.dynamics.axial_batch",
    "InputError": "spirillum.errors",
    "LinearSystem": "spirillum.interfaces.python_control",
    "LiveTracker": "spirillum.live.tracker",
    "Measurement": "spirillum.measurement.measure",
    "ModelComparison": "spirillum.swimming.comparison",
    "Observation": "spirillum.live.observation",
    "Picture3D": "spirillum.view.scene3d.show",
    "Plant": "spirillum.dynamics.plant",
    "Plot": "spirillum.view.figures.plot",
    "Prediction": "spirillum.swimming.prediction",
    "Prepared": "spirillum.swimming.preparation",
    "Proposal": "spirillum.measurement.proposal",
    "Ranking": "spirillum.calibration.ranking",
    "Recording": "spirillum.exports.recording",
    "RemoteRun": "spirillum.interfaces.serial_remote",
    "Resistance": "spirillum.fluid.resistance",
    "Robot": "spirillum.robot.robot",
    "RobotBatch": "spirillum.robot.batch",
    "Bench": "spirillum.interfaces.bench",
    "SerialRemote": "spirillum.interfaces.serial_remote",
    "Settling": "spirillum.dynamics.settling",
    "Suggestion": "spirillum.calibration.suggest",
    "Swimming": "spirillum.swimming.steady_quantities",
    "Tracked": "spirillum.live.tracking_summary",
    "VirtualCamera": "spirillum.virtual.live_camera",
    "VirtualRemote": "spirillum.interfaces.serial_remote",
    "calibrate": "spirillum.results.calibration",
    "citation": "spirillum.citations",
    "compare_models": "spirillum.swimming.comparison",
    "control": "spirillum.controllers.control",
    "control_system": "spirillum.interfaces.python_control",
    "design": "spirillum.designs.design",
    "export": "spirillum.exports.write",
    "export_run": "spirillum.exports.recording",
    "feasibility": "spirillum.measurement.feasibility",
    "film": "spirillum.view.scene3d.film",
    "flow": "spirillum.fields.flow",
    "flow_of_run": "spirillum.dynamics.flow_of_run",
    "linear_system": "spirillum.interfaces.python_control",
    "load": "spirillum.robot.load",
    "magnetic_sweep": "spirillum.dynamics.magnetic_sweep",
    "measure": "spirillum.results.measurement",
    "page": "spirillum.pages.launch",
    "plot": "spirillum.view.figures.plot",
    "predict": "spirillum.dynamics.prediction",
    "prepare": "spirillum.swimming.preparation",
    "prepare_all": "spirillum.swimming.preparation",
    "propose_setup": "spirillum.measurement.proposal",
    "rank_models": "spirillum.calibration.ranking",
    "remote": "spirillum.interfaces.serial_remote",
    "render": "spirillum.virtual.trial",
    "resistance": "spirillum.fluid.resistance",
    "settle": "spirillum.dynamics.settling",
    "show": "spirillum.view.scene3d.show",
    "simulate": "spirillum.dynamics.simulation",
    "study": "spirillum.results.study",
    "suggest": "spirillum.calibration.suggest",
    "swim": "spirillum.swimming.steady",
    "track": "spirillum.live.session",
    "virtual_experiment": "spirillum.virtual.experiment",
}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from spirillum.version import own_version

        return own_version()
    if name in RENAMED:
        return __getattr__(current_name(name))
    if name not in _HOME:
        raise AttributeError(f"module 'spirillum' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    if not isinstance(value, type):
        from spirillum.argument_validation import validate_arguments

        value = validate_arguments(value)
        value.__module__ = __name__  # where it is found again, as processes that share work ask for
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted((*_HOME, "__version__"))
