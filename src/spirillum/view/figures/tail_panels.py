"""Axes and headings of panels over the tails of a study, which its figures share."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from spirillum.arrays import Values
from spirillum.view.figures.study_view import StudyView
from spirillum.view.figures.style import UnitPrefix


def head_column(axes: Axes, shown: StudyView, wavelength: int) -> None:
    """Head a column of panels with its wavelength, by its place in the study."""
    values = np.asarray(shown.whole["wavelength"].values, dtype=float)
    scale = UnitPrefix.of(values, "m")
    axes.set_title(f"$\\lambda$ = {values[wavelength] / scale.factor:.4g} {scale.unit}", loc="center", pad=3)


def tail_axis(axes: Axes, x: Values) -> None:
    """Horizontal axis of tails: ticks at the amplitudes themselves where they are few and apart."""
    span = float(x.max() - x.min())
    if 1 < x.size <= 6 and float(np.min(np.diff(np.sort(x)))) > 0.12 * span:
        axes.set_xticks(x, [f"{value:.3g}" for value in x])
    else:
        axes.xaxis.set_major_locator(MaxNLocator(5))
    margin = 0.08 * span if span > 0 else 0.5 * abs(float(x[0]))
    axes.set_xlim(float(x.min()) - margin, float(x.max()) + margin)
