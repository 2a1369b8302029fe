"""`spirillum.plot`: the figure of any result, by its kind.

Answers are data without figures; this module maps one to the other.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from spirillum.calibration.calibrated import Calibrated
from spirillum.controllers.control import Control
from spirillum.designs.design_result import Design
from spirillum.dynamics.comparison import ModelComparison
from spirillum.dynamics.settling import Settling
from spirillum.errors import InputError
from spirillum.fields.flow import Flow
from spirillum.files import PICTURES, output_target
from spirillum.measurement.measure import Measurement
from spirillum.robot.robot import Robot
from spirillum.studies.ranking import can_be_ranked, ranking_of
from spirillum.swimming.prediction import Prediction
from spirillum.view.figures.calibration import calibration_figures
from spirillum.view.figures.comparison import comparison_figure, prediction_figure, ranking_picture
from spirillum.view.figures.control import control_figure
from spirillum.view.figures.design import design_figure
from spirillum.view.figures.flow import flow_figure
from spirillum.view.figures.magnetic import magnetic_figure
from spirillum.view.figures.measurement import measurement_figures
from spirillum.view.figures.release import settling_figure
from spirillum.view.figures.robot import robot_figure
from spirillum.view.figures.style import DPI, save_as, styled
from spirillum.view.figures.trajectory import trajectory_figure

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Plot:
    """A figure that notebooks show by themselves."""

    figure: Figure = field(repr=False)  #: The figure of matplotlib.

    def save(self, path: str | Path) -> Path:
        """Write the figure as PNG, PDF or SVG, and give its path.

        Raises:
            InputError: for another ending, or a folder that cannot be written to.
        """
        target = output_target(Path(path), PICTURES, "figure.png")
        save_as(self.figure, target)
        return target

    def _repr_png_(self) -> bytes:
        """The figure for notebooks."""
        picture = io.BytesIO()
        with styled():
            self.figure.savefig(picture, format="png", dpi=DPI // 2)
        return picture.getvalue()


def plot(answer: Any) -> Plot:
    """Plot a result: the figure of its command, or the most informative one.

    Args:
        answer: a robot (`sp.load`), or what `predict`, `compare_models`, `study`, `simulate`, `magnetic_sweep`,
            `settle`, `design`, `flow`, `control`, `measure` or `calibrate` returns.

    Raises:
        InputError: for anything else.
    """
    import xarray as xr

    with styled():
        for kind, draw in _FIGURES.items():
            if isinstance(answer, kind):
                return Plot(draw(answer))
        if not isinstance(answer, xr.Dataset):
            raise InputError(f"answer = {type(answer).__name__} has no figure; allowed: {_ALLOWED}")
        try:
            return Plot(_of_dataset(answer))
        except KeyError as error:
            raise InputError(
                f"answer = a dataset without {str(error)[:80]} has no figure; allowed: {_ALLOWED}"
            ) from error


def _of_measurement(answer: Measurement) -> Figure:
    for picture in measurement_figures(answer).values():
        return picture.figure()
    raise InputError("answer = a measurement without a trial has no figure; allowed: one with a trial")


_FIGURES: dict[type, Callable[[Any], Figure]] = {
    Robot: robot_figure,
    Prediction: prediction_figure,
    ModelComparison: comparison_figure,
    Settling: settling_figure,
    Design: design_figure,
    Flow: lambda answer: flow_figure(answer, answer.plane("xz")),
    Control: control_figure,
    Measurement: _of_measurement,
    Calibrated: lambda answer: next(iter(calibration_figures(answer).values())),
}
"""Figures by the kind of the result; those of datasets follow from their content."""
_ALLOWED = (
    "a robot, or what predict, compare_models, study, simulate, magnetic_sweep, settle, design, flow, control, measure "
    "or calibrate returns"
)


def _of_dataset(dataset: xr.Dataset) -> Figure:
    """A run over time, a sweep over the field's rate, or the ranking of a study."""
    if "time" in dataset.dims and "position" in dataset:
        return trajectory_figure(dataset)
    if "field_rate" in dataset.dims:
        return magnetic_figure(dataset)
    if can_be_ranked(dataset):
        ranking = ranking_of(dataset)
        if ranking.robots:
            return ranking_picture(ranking).figure()
        raise InputError("answer = a study without answers; allowed: one with some (see its variable `outside`)")
    raise InputError(f"answer = a dataset that has no figure; allowed: {_ALLOWED}")
