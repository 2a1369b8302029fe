"""Figures of the paper: Figs 3, 5 and 6, and the loss of speed in the narrow channel."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spirillum.arrays import Values
from spirillum.display import label_of_model
from spirillum.papers.biorob2012.evidence import GLOBAL_DROP, LARGEST_REYNOLDS, Evidence
from spirillum.view.figures.rows import band_handles, draw_band, draw_curve
from spirillum.view.figures.sheet import Picture, Sheet, width_of
from spirillum.view.figures.study import PANEL
from spirillum.view.figures.study_panels import PaperFigure, StudyView, head_column, spread, tail_axis
from spirillum.view.figures.style import UnitPrefix, look_of_model

if TYPE_CHECKING:
    import xarray as xr


_TITLE = "Loss of speed from the wide to the narrow channel"
_MOST_COLUMNS = 5
_STATED: Any = {"color": "black", "linestyle": (0, (4.0, 2.0)), "linewidth": 1.0}  # style of the paper's values


def drop_picture(shown: StudyView) -> Picture | None:
    """The loss of every tail at equal motor rates; None for a study of other channels."""
    if not {"wide", "narrow"} <= {str(name) for name in shown.whole["channel"].values}:
        return None
    evidence = Evidence(shown.whole)
    if not evidence.confined:
        return None
    notes = [
        "At equal motor rates a tail's relative loss follows without knowing the rate. The loss of the global mean, "
        f"which the paper reports as {100 * GLOBAL_DROP:.1f} %, is a weighted mean of the losses of single tails."
    ]
    if evidence.computed:
        names = ", ".join(label_of_model(name) for name in evidence.computed)
        notes.append(f"Nothing is fitted in {names}: the walls are computed ({evidence.pose}).")
        if shown.banded:
            notes.append(
                "Band: the least to the largest loss over gaps and pitches that are the same in both channels."
            )
    fitted = [label_of_model(name) for name in evidence.confined if name not in evidence.computed]
    if fitted:
        notes.append(
            f"In {', '.join(fitted)} Table III's factors represent the walls; they were fitted to the same data."
        )
    panels = min(shown.whole.sizes["wavelength"], _MOST_COLUMNS)
    alternative = (
        f"{panels} panels, one for each wavelength: relative loss of speed against wave amplitude by "
        f"{', '.join(map(label_of_model, evidence.confined))}. {shown.source_line}"
    )
    return Picture.of(
        _TITLE, " ".join([shown.source_line, *notes]), alternative, partial(_draw, shown, evidence, notes)
    )


def _draw(shown: StudyView, evidence: Evidence, notes: list[str]) -> Figure:
    wavelengths = spread(shown.whole.sizes["wavelength"], _MOST_COLUMNS)
    legend = [*_entries(evidence), *band_handles(shown)]
    legend.append(Line2D([], [], **_STATED, label=f"paper: global mean {100 * GLOBAL_DROP:.1f} %"))
    sheet = Sheet(
        _TITLE,
        shown.source_line,
        width=width_of(len(wavelengths), PANEL[0]),
        heights=[2.2],
        columns=len(wavelengths),
        notes=notes,
        legend=legend,
    )
    panels = sheet.panels[0]
    values = np.asarray(shown.whole["amplitude"].values, dtype=float)
    scale = UnitPrefix.of(values, "m")
    for axes, wavelength in zip(panels, wavelengths, strict=True):
        for model in evidence.confined:
            look = look_of_model(model)
            low, high = _range(evidence, model)
            draw_band(axes, scale(values), low[wavelength], high[wavelength], look, joined=True)
            draw_curve(axes, scale(values), 100 * evidence.drop_per_motor_turn(model)[wavelength], look)
        axes.axhline(100 * GLOBAL_DROP, **_STATED)
        tail_axis(axes, scale(values))
        axes.set_xlabel(f"amplitude $B_o$ ({scale.unit})")
        head_column(axes, shown, wavelength)
    panels[0].set_ylabel("loss at equal motor rates\n$1-U_{narrow}/U_{wide}$ (%)")
    bottom, top = panels[0].get_ylim()
    panels[0].set_ylim(min(bottom, 0.0), max(top, 60.0))
    return sheet.finished(alike=True)


def _range(evidence: Evidence, model: str) -> tuple[Values, Values]:
    """Least and largest loss over a band, per cent; NaN without one."""
    found = evidence.drops_of_the_band(model)
    if found is None:
        unknown = np.full_like(evidence.drop_per_motor_turn(model), np.nan)
        return unknown, unknown
    return 100 * np.fmin.reduce(found, axis=-1), 100 * np.fmax.reduce(found, axis=-1)


def _entries(evidence: Evidence) -> list[Line2D]:
    found = []
    for model in evidence.confined:
        look = look_of_model(model)
        walls = "computed walls" if model in evidence.computed else "Table III"
        label = f"{label_of_model(model)} ({walls})"
        found.append(Line2D([], [], color=look.colour, linestyle=look.line, marker=look.marker, label=label))
    return found


_FILES = {"wide": "fig5-wide", "narrow": "fig6-narrow"}
PAPER_FIGURES = {
    channel: PaperFigure(_FILES[channel], stated.figure, stated.value) for channel, stated in LARGEST_REYNOLDS.items()
}
"""Figures by channel, with Re_max of their captions."""


def more_figures(dataset: xr.Dataset) -> dict[str, Picture]:
    """Figures of this paper only: `drop`, the loss of speed from the wide to the narrow channel."""
    if "channel" not in dataset.dims:
        return {}
    drop = drop_picture(StudyView.of(dataset, PAPER_FIGURES))
    return {} if drop is None else {"drop": drop}
