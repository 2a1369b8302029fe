"""Figures of fitted parameters: marginals and pairs of the posterior, profiles of the likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from spirillum.arrays import Samples
from spirillum.calibration.least_squares import FEWEST_LEFT
from spirillum.display import percent
from spirillum.view.figures.sheet import Sheet, add_letters, width_of
from spirillum.view.figures.style import COLOURS, PAGE, UnitPrefix, look_of_model, plain, styled

if TYPE_CHECKING:
    from spirillum.calibration.calibrated import Calibrated
    from spirillum.calibration.identifiability import LikelihoodProfile

_MOST = 6
"""Numbers of the figure: more would leave no room for a pair's contours."""
_LETTERS = 13
"""Letters of a line below a panel."""
_MARGIN = 1.0
"""Room for the labels beside the cells, inches."""
_LIMIT = 3.84
"""Misfit at the limits of a 95 % interval: chi squared of one degree of freedom."""
_BINS = 32


def posterior_figure(found: Calibrated) -> Figure:
    """Marginals on the diagonal, pairs below it; a note lists parameters beyond the sixth."""
    posterior = found.posterior
    assert posterior is not None  # noqa: S101 - drawn for a posterior only
    every = {name: values.reshape(-1) for name, values in posterior.values().items()}
    names = list(every)[:_MOST]
    scales = _scales(found, {name: every[name] for name in names})
    drawn = {name: every[name] / scales[name].factor for name in names}
    count = len(names)
    colour = look_of_model(found.problem.model.name).colour
    with styled():
        synthetic = "synthetic, no measured data" if found.experiment.synthetic else "observed"
        words = f"{plain(found.experiment.source, 40)} ({synthetic}), model {found.problem.model.name}"
        words += "; contours contain 50 and 95 % of the draws" if count > 1 else ""
        words += f"; {len(every) - count} more are in posterior.nc" if len(every) > count else ""
        sheet = Sheet(
            "Posterior of the fitted numbers",
            words,
            width=PAGE,
            heights=[min((PAGE - _MARGIN) / count, 2.0) - 0.1] * count,
            columns=count,
            sharey=False,
        )
        for row, below in enumerate(names):
            for column, name in enumerate(names):
                axes = sheet.panels[row, column]
                if column > row:
                    axes.remove()
                    continue
                if row == column:
                    _marginal(axes, drawn[name], colour)
                else:
                    _pair(axes, drawn[name], drawn[below], colour)
                _ticks(axes, left=column == 0 and row > 0, bottom=row == count - 1)
                if row == count - 1:
                    axes.set_xlabel(_label(name) + _unit(scales[name], "\n"), fontsize=7)
                if column == 0 and row > 0:
                    axes.set_ylabel(_label(below) + _unit(scales[below], "\n"), fontsize=7)
        return sheet.finished()


def _scales(found: Calibrated, values: Mapping[str, Samples]) -> dict[str, UnitPrefix]:
    """Units of numbers by their labels; that of a discrepancy or a factor is empty."""
    units = {item.label: item.parameter.unit for item in found.problem.coordinates}
    return {
        label: UnitPrefix.of(np.abs(column), units[label]) if units.get(label) else UnitPrefix(1.0, "")
        for label, column in values.items()
    }


def _unit(scale: UnitPrefix, between: str) -> str:
    """A unit in brackets after a name; empty for a plain number."""
    return f"{between}({scale.unit})" if scale.unit else ""


def _label(name: str) -> str:
    """A number's name in lines that fit below a panel; its channel stays together."""
    words, bracket, channel = name.replace("_", " ").partition("[")
    lines = wrap(words, _LETTERS)
    return "\n".join([*lines, bracket + channel] if bracket else lines)


def _window(values: Samples) -> tuple[float, float]:
    low, high = np.quantile(values, [0.002, 0.998])
    room = 0.05 * (high - low) or 0.01 * abs(high) or 1e-12
    return float(low - room), float(high + room)


def _marginal(axes: Axes, values: Samples, colour: str) -> None:
    axes.hist(values, bins=_BINS, range=_window(values), color=colour, alpha=0.35, linewidth=0.0)
    axes.hist(values, bins=_BINS, range=_window(values), color=colour, histtype="step", linewidth=1.0)
    for quantile in np.quantile(values, [0.025, 0.975]):
        axes.axvline(float(quantile), color="#444444", linewidth=0.8, linestyle=":")
    axes.set_xlim(_window(values))
    axes.set_yticks([])


def _pair(axes: Axes, x: Samples, y: Samples, colour: str) -> None:
    """Regions that contain 95 and 50 % of the draws."""
    window = (_window(x), _window(y))
    counts, xs, ys = np.histogram2d(x, y, bins=_BINS, range=window)
    smooth = counts
    for axis in (0, 1):
        smooth = 0.5 * smooth + 0.25 * (np.roll(smooth, 1, axis) + np.roll(smooth, -1, axis))
    ranked = np.sort(smooth.ravel())[::-1]
    share = np.cumsum(ranked) / ranked.sum()
    levels = sorted({float(ranked[np.searchsorted(share, level)]) for level in (0.95, 0.5)})
    if len(levels) == 2 and levels[0] > 0:
        middle_x, middle_y = 0.5 * (xs[1:] + xs[:-1]), 0.5 * (ys[1:] + ys[:-1])
        axes.contourf(
            middle_x, middle_y, smooth.T, levels=[*levels, float(ranked[0]) * 1.01], colors=[colour] * 2, alpha=0.3
        )
        axes.contour(middle_x, middle_y, smooth.T, levels=levels, colors=colour, linewidths=0.8)
    else:
        axes.plot(x[::10], y[::10], ".", color=colour, markersize=1.0)
    axes.set_xlim(window[0])
    axes.set_ylim(window[1])


def _ticks(axes: Axes, *, left: bool, bottom: bool) -> None:
    axes.tick_params(labelleft=left, labelbottom=bottom, labelsize=7.0, length=2.0, width=0.5)
    axes.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
    if axes.get_yticks().size:
        axes.yaxis.set_major_locator(MaxNLocator(3, prune="both"))
    for label in axes.get_xticklabels():
        label.set_rotation(40)
    axes.grid(visible=False)


def profile_figure(found: Calibrated, profiles: Sequence[LikelihoodProfile]) -> Figure:
    """Least misfit against each parameter, all others fitted again; the dotted line marks the 95 % interval."""
    columns = min(len(profiles), 4)
    rows = -(-len(profiles) // columns)
    assert found.least_squares is not None  # noqa: S101 - profiles are those of a fit by least squares
    fit = found.least_squares
    held = " and ".join(
        f"{percent(share)} of the {name.replace('_', ' ')} "
        f"({'prior median' if fit.left[name] < FEWEST_LEFT else 'moments of the residuals'})"
        for name, share in fit.discrepancy.items()
    )
    synthetic = " (synthetic)" if found.experiment.synthetic else ""
    with styled():
        sheet = Sheet(
            "Profile likelihood",
            f"{plain(found.experiment.source, 40)}{synthetic}, model {found.problem.model.name}: least chi squared "
            "above the best fit",
            width=width_of(columns, 1.72),
            heights=[1.3] * rows,
            columns=columns,
            notes=[
                "Dotted: limit of the 95 % interval. A profile that stays below it on a side says that the number has "
                f"no limit there. The model's discrepancy is held at {held}; "
                "the table's intervals let it vary, and are wider where it may be larger.",
            ],
        )
        every = list(sheet.panels.flat)
        add_letters(every)
        scales = _scales(found, {profile.label: profile.values for profile in profiles})
        for axes, profile in zip(every, profiles, strict=False):
            scale = scales[profile.label]
            axes.plot(profile.values / scale.factor, profile.misfit, color=COLOURS["blue"], marker="o", markersize=2.5)
            axes.axhline(_LIMIT, color="#444444", linewidth=0.8, linestyle=":")
            axes.set_ylim(0.0, 3.2 * _LIMIT)
            axes.set_xlabel(_label(profile.label).replace("\n", " ") + _unit(scale, " "), fontsize=7.5)
            axes.xaxis.set_major_locator(MaxNLocator(3))
            axes.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4))
        for axes in every[len(profiles) :]:
            axes.remove()
        for row in sheet.panels:
            row[0].set_ylabel(r"$\Delta\chi^2$")
        return sheet.finished()
