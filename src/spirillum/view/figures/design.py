"""A design in a figure: the objective along every field, its landscape over two, the front of two objectives."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from spirillum.arrays import Samples
from spirillum.designs.answer import Design, Profile
from spirillum.designs.evaluation import Objective
from spirillum.units import display_unit, in_unit
from spirillum.view.figures.sheet import Sheet, add_letters
from spirillum.view.figures.style import COLOURS, Scale, plain, styled

__all__ = ["design_figure"]

_REFUSED = "#dddddd"


def design_figure(design: Design) -> Figure:
    """Panels: with two objectives their front; with two fields the landscape; the objective along every field.

    Args:
        design: what `spirillum.design` returns.
    """
    count = len(design.profiles) + (design.front is not None) + (design.landscape is not None)
    columns = 2 if count in (2, 4) else min(count, 3)
    with styled():
        sheet = Sheet(
            f"{plain(design.today.name)}: {plain(design.objectives[0].words)}",
            _subtitle(design),
            width=3.0 * columns,
            heights=[2.5] * -(-count // columns),
            columns=columns,
            sharey=False,
        )
        panels = [axes for row in sheet.panels for axes in row]
        for spare in panels[count:]:
            spare.set_visible(False)
        panels = panels[:count]
        add_letters(panels)
        rest = list(panels)
        if design.front is not None:
            _front(rest.pop(0), design)
        if design.landscape is not None:
            _landscape(rest.pop(0), design)
        for axes, profile in zip(rest, design.profiles, strict=True):
            _profile(axes, design, profile)
        return sheet.finished()


def _subtitle(design: Design) -> str:
    words = [f"model {design.model}", *(plain(item) for item in design.conditions)]
    if design.uncertainty is not None:
        words.append(f"{design.searched.drawn.number} draws of what is not known")
    return " · ".join([*words, "computed, nothing is measured"])


def _label(path: str, unit: str) -> str:
    words = path.rpartition(".")[2].replace("_", " ")
    return words if unit in ("", "1") else f"{words} ({unit})"


def _objective(objective: Objective, values: Samples) -> tuple[Samples, str]:
    """Values as people read them, and the label of their axis."""
    if objective.unit == "1":
        return values, objective.name.replace("_", " ")
    scale = Scale.of(values[np.isfinite(values)], objective.unit)
    return np.asarray(scale(values)), f"{objective.name.replace('_', ' ')} ({scale.unit})"


def _field(values: Samples, unit: str) -> tuple[Samples, str]:
    if unit == "1":
        return values, ""
    shown = display_unit(float(np.max(np.abs(values))), unit)
    factor = float(in_unit(1.0, unit, shown)) if shown != unit else 1.0
    return values * factor, shown


def _profile(axes: Axes, design: Design, profile: Profile) -> None:
    values, unit = _field(profile.values, profile.unit)
    objective, label = _objective(design.objectives[0], profile.objective)
    best, _ = _field(np.array([design.values[profile.path], profile.low, profile.high]), profile.unit)
    whole = profile.unit == "1" and len(values) < 30
    if best[2] > best[1]:
        axes.axvspan(best[1], best[2], color=COLOURS["blue"], alpha=0.15, linewidth=0, label="within 1 % of the best")
    axes.plot(values, objective, color=COLOURS["blue"], marker="o" if whole else None, markersize=4)
    axes.axvline(best[0], color=COLOURS["vermillion"], linestyle="--", linewidth=1.2, label="best")
    axes.set_xlim(values[0], values[-1])
    axes.set_xlabel(_label(profile.path, unit))
    axes.set_ylabel(label)
    axes.legend(fontsize=7)


def _landscape(axes: Axes, design: Design) -> None:
    assert design.landscape is not None  # noqa: S101 - the caller has asked
    first, second, grid = design.landscape
    one, two = design.profiles
    x, x_unit = _field(first, one.unit)
    y, y_unit = _field(second, two.unit)
    values, label = _objective(design.objectives[0], grid)
    axes.set_facecolor(_REFUSED)
    if any(item.is_whole for item in design.searched.space.variables):
        found: ScalarMappable = axes.pcolormesh(x, y, np.ma.masked_invalid(values), cmap="cividis", shading="nearest")
    else:
        found = axes.contourf(x, y, values, levels=12, cmap="cividis")
    axes.figure.colorbar(found, ax=axes, label=label)
    best = [_field(np.array([design.values[item.path]]), item.unit)[0][0] for item in (one, two)]
    today = [_field(np.array([design.alternatives[0].values[item.path]]), item.unit)[0][0] for item in (one, two)]
    axes.plot(*best, marker="*", markersize=13, color="white", markeredgecolor="black", linestyle="none", label="best")
    if x[0] <= today[0] <= x[-1] and y[0] <= today[1] <= y[-1]:
        axes.plot(*today, marker="o", color="white", markeredgecolor="black", linestyle="none", label="today")
    if not np.all(np.isfinite(values)):
        axes.plot([], [], color=_REFUSED, linewidth=7, label="refused, or breaks a condition")
    axes.set_xlabel(_label(one.path, x_unit))
    axes.set_ylabel(_label(two.path, y_unit))
    axes.legend(fontsize=7, framealpha=0.9, facecolor="white", frameon=True)


def _front(axes: Axes, design: Design) -> None:
    assert design.front is not None  # noqa: S101 - the caller has asked
    first, second = design.objectives
    x, x_label = _objective(second, design.front[second.name])
    y, y_label = _objective(first, design.front[first.name])
    axes.plot(x, y, color=COLOURS["blue"], marker="o", markersize=4, label="none is better in both")
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.legend(fontsize=7)
