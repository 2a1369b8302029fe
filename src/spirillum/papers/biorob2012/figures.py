"""The paper's own figures of a study: Figs 5 and 6, and the loss of speed in the narrow channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from spirillum.papers.biorob2012.constants import LARGEST_REYNOLDS
from spirillum.papers.biorob2012.drop_figure import drop_picture
from spirillum.view.figures.picture import Picture
from spirillum.view.figures.study_view import PaperFigure, StudyView

if TYPE_CHECKING:
    import xarray as xr

_FILES = {"wide": "fig5-wide", "narrow": "fig6-narrow"}
PAPER_FIGURES = {
    channel: PaperFigure(_FILES[channel], stated.figure, stated.value) for channel, stated in LARGEST_REYNOLDS.items()
}
"""Figures by channel, with Re_max of their captions."""


def more_figures(dataset: xr.Dataset) -> dict[str, Picture]:
    """Figures that only this paper asks for: `drop`, the loss of speed from the wide to the narrow channel."""
    if "channel" not in dataset.dims:
        return {}
    drop = drop_picture(StudyView.of(dataset, PAPER_FIGURES))
    return {} if drop is None else {"drop": drop}
