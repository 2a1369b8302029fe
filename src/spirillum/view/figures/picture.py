"""A figure that is drawn when it is asked for, and what the figures of a study share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from spirillum.arrays import Values
from spirillum.view.figures.study_view import StudyView
from spirillum.view.figures.style import Scale, readable, styled

__all__ = ["Picture", "head_column", "tail_axis"]


@dataclass(frozen=True)
class Picture:
    """A figure that is drawn when it is asked for."""

    title: str
    caption: str
    """What it shows and what it does not, sentences."""
    alternative: str
    """What it shows for those who cannot see it."""
    draw: Callable[[], Figure] = field(repr=False)

    @classmethod
    def of(cls, title: str, caption: str, alternative: str, draw: Callable[[], Figure]) -> Picture:
        """A picture whose words may hold formulas, which are spelled out."""
        return cls(readable(title), readable(caption), readable(alternative), draw)

    def figure(self) -> Figure:
        """Draw it."""
        with styled():
            return self.draw()


def head_column(axes: Axes, shown: StudyView, wavelength: int) -> None:
    """Head a column of panels with its wavelength, by its place in the study."""
    values = np.asarray(shown.whole["wavelength"].values, dtype=float)
    scale = Scale.of(values, "m")
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
