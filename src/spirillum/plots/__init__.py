"""Figures: one look, drawn without any global state; import this package only where something is drawn."""

from spirillum.plots.picture import Picture
from spirillum.plots.robot import robot_figure
from spirillum.plots.study import study_figures
from spirillum.plots.style import save, styled

__all__ = ["Picture", "robot_figure", "save", "study_figures", "styled"]
