"""A design in a figure: the objective along every field, its landscape over two, the front of two objectives."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from spirillum.arrays import Samples
from spirillum.designs.design_result import Design, ObjectiveProfile
from spirillum.designs.evaluation import Objective
from spirillum.units import display_unit, in_unit
from spirillum.view.figures.sheet import Sheet
from spirillum.view.figures.style import COLOURS, COLUMN, PAGE, PATCH, UnitPrefix, plain, styled

_REFUSED = "#dddddd"
_SHADE = 0.2
_STEPS = [1, 2, 5, 10]
_MARKED: dict[str, Any] = {"linestyle": "none", "markeredgecolor": "black", "clip_on": False, "zorder": 5}
_BEST = {**_MARKED, "marker": "*", "markersize": 11, "color": COLOURS["vermillion"], "markeredgewidth": 0.7}
_TODAY = {**_MARKED, "marker": "o", "markersize": 5, "color": "white"}


def design_figure(design: Design) -> Figure:
    """Panels: with two objectives their front; with two fields the landscape; the objective along every field."""
    # One panel is as wide as a column of a journal (85 mm), several are as wide as its page (170 mm).
    count = len(design.profiles) + (design.front is not None) + (design.landscape is not None)
    columns = min(count, 2)
    with styled():
        words = [
            f"model {design.model}{', calibrated' if design.calibrated else ''}",
            *(_in_words(item) for item in design.conditions),
        ]
        if len(design.profiles) > 1:
            words.append("along each field the others at their best values")
        if design.uncertainty is not None:
            words.append(f"{design.searched.samples.number} draws of the unknown parameters")
        sheet = Sheet(
            f"{plain(design.today.name)}: {_in_words(design.objectives[0].words)}",
            " · ".join([*words, "computed, no measured data"]),
            width=COLUMN if columns == 1 else PAGE,
            heights=[2.0] * -(-count // columns),
            columns=columns,
            letters=count > 1,
            sharey=False,
            legend=_legend(design),
        )
        panels = [axes for row in sheet.panels for axes in row]
        for spare in panels[count:]:
            spare.set_visible(False)
        panels = panels[:count]
        rest = list(panels)
        if design.front is not None:
            _front(rest.pop(0), design)
        if design.landscape is not None:
            _landscape(rest.pop(0), design)
        for axes, profile in zip(rest, design.profiles, strict=True):
            _profile(axes, design, profile)
        return sheet.finished()


def _in_words(text: str) -> str:
    return plain(text.replace("_", " ").replace(">=", "≥").replace("<=", "≤"))


def _legend(design: Design) -> list[Line2D]:
    found = [Line2D([], [], **_BEST, label="best")]
    if design.landscape is not None and _today(design) is not None:
        found.append(Line2D([], [], **_TODAY, label="today"))
    drawn = [profile.objective for profile in design.profiles]
    drawn += [] if design.landscape is None else [design.landscape[2]]
    if not all(np.all(np.isfinite(values)) for values in drawn):
        found.append(Line2D([], [], color=_REFUSED, **PATCH, label="refused, or breaks a condition"))
    if any(profile.high > profile.low for profile in design.profiles):
        found.append(Line2D([], [], color=COLOURS["blue"], alpha=_SHADE, **PATCH, label="within 1 % of the best"))
    if design.front is not None:
        found.append(Line2D([], [], color=COLOURS["blue"], marker="o", markersize=4, label="none is better in both"))
    return found


def _label(path: str, unit: str) -> str:
    words = path.rpartition(".")[2].replace("_", " ")
    return words if unit in ("", "1") else f"{words} ({unit})"


def _objective(objective: Objective, values: Samples) -> tuple[Samples, str]:
    """Values as people read them, and the label of their axis."""
    if objective.unit == "1":
        return values, objective.name.replace("_", " ")
    scale = UnitPrefix.of(values[np.isfinite(values)], objective.unit)
    return np.asarray(scale(values)), f"{objective.name.replace('_', ' ')} ({scale.unit})"


def _field(values: Samples, unit: str) -> tuple[Samples, str]:
    if unit == "1":
        return values, ""
    shown = display_unit(float(np.max(np.abs(values))), unit)
    factor = float(in_unit(1.0, unit, shown)) if shown != unit else 1.0
    return values * factor, shown


def _profile(axes: Axes, design: Design, profile: ObjectiveProfile) -> None:
    values, unit = _field(profile.values, profile.unit)
    objective, label = _objective(design.objectives[0], profile.objective)
    best, _ = _field(np.array([design.values[profile.path], profile.low, profile.high]), profile.unit)
    whole = profile.unit == "1" and len(values) < 30
    if best[2] > best[1]:
        axes.axvspan(best[1], best[2], color=COLOURS["blue"], alpha=_SHADE, linewidth=0)
    known = np.isfinite(objective)
    middles = 0.5 * (values[1:] + values[:-1])
    ends = np.array([values[0], *middles, values[-1]])
    for n in np.flatnonzero(~known):
        axes.axvspan(ends[n], ends[n + 1], color=_REFUSED, linewidth=0, zorder=0)
    axes.plot(values, objective, color=COLOURS["blue"], marker="o" if whole else None, markersize=4)
    axes.plot(best[0], np.interp(best[0], values[known], objective[known]), **_BEST)
    room = 0.3 if whole else 0.0
    axes.set_xlim(values[0] - room, values[-1] + room)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=whole, steps=_STEPS))
    axes.margins(y=0.1)
    axes.set_xlabel(_label(profile.path, unit))
    axes.set_ylabel(label)


def _today(design: Design) -> list[float] | None:
    """Position of the given robot in the landscape; None beyond the ranges."""
    found = []
    for profile in design.profiles:
        value = design.alternatives[0].values[profile.path]
        if not profile.values[0] <= value <= profile.values[-1]:
            return None
        found.append(float(_field(np.array([value]), profile.unit)[0][0]))
    return found


def _landscape(axes: Axes, design: Design) -> None:
    assert design.landscape is not None  # noqa: S101 - checked by the caller
    first, second, grid = design.landscape
    one, two = design.profiles
    x, x_unit = _field(first, one.unit)
    y, y_unit = _field(second, two.unit)
    values, label = _objective(design.objectives[0], grid)
    axes.set_facecolor(_REFUSED)
    axes.grid(visible=False)
    if any(item.is_whole for item in design.searched.space.variables):
        found: ScalarMappable = axes.pcolormesh(x, y, np.ma.masked_invalid(values), cmap="cividis", shading="nearest")
    else:
        found = axes.contourf(x, y, values, levels=12, cmap="cividis")
    axes.figure.colorbar(found, ax=axes, label=label, ticks=MaxNLocator(6, steps=_STEPS))
    axes.plot(*(_field(np.array([design.values[item.path]]), item.unit)[0][0] for item in (one, two)), **_BEST)
    today = _today(design)
    if today is not None:
        axes.plot(*today, **_TODAY)
    axes.set_xlabel(_label(one.path, x_unit))
    axes.set_ylabel(_label(two.path, y_unit))


def _front(axes: Axes, design: Design) -> None:
    assert design.front is not None  # noqa: S101 - checked by the caller
    first, second = design.objectives
    x, x_label = _objective(second, design.front[second.name])
    y, y_label = _objective(first, design.front[first.name])
    axes.plot(x, y, color=COLOURS["blue"], marker="o", markersize=4)
    axes.plot(x[0], y[0], **_BEST)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
