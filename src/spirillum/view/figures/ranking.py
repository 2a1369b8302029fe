"""The headline figure of a study: its best robots in a row each, the fastest on top."""

from __future__ import annotations

from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from spirillum.arrays import Values
from spirillum.studies.ranking import ENDS, RANKED, SETTLED_BASIS, RankedRobot, StudyRanking, unit_of_ranked
from spirillum.view.figures.picture import Picture
from spirillum.view.figures.style import COLOURS, PAGE, UnitPrefix, new_figure, plain, told_apart

MOST = 12
"""Robots in the figure."""
_ROW, _ENDS = 0.24, 1.2  # inches
_LINE, _WIDE = 0.19, 68
"""Height of a line of the title, inches, and the characters that it holds."""


_NO_WALLS = "The channel's walls are not computed"


def ranking_picture(ranking: StudyRanking) -> Picture:
    """The headline figure: speed, efficiency and current of the fastest robots, with their bands."""
    count = len(ranking.robots)
    which = f"The {min(MOST, count)} fastest of {count} robots" if count > MOST else f"All {count} robots"
    lines = f" Lines: {ENDS[ranking.kind]}." if ranking.kind else ""
    walls = f" {_NO_WALLS}." if ranking.walls else ""
    caption = (
        f"{which}, by model {ranking.model} with friction reading {ranking.friction}; filled: the best of its column."
        f"{lines}{walls}"
    )
    title = ranking.message[:1].upper() + ranking.message[1:]
    return Picture.of(plain(title, 120), caption, f"{plain(title, 120)}. {which}.", lambda: _drawn(ranking))


def _drawn(ranking: StudyRanking) -> Figure:
    robots = ranking.robots[:MOST]
    names = [name for name in ranking.quantities if any(np.isfinite(robot.values[name]) for robot in robots)]
    title = fill(plain(ranking.message[:1].upper() + ranking.message[1:], 120), _WIDE)
    more = _LINE * title.count("\n")
    figure = new_figure(PAGE, _ENDS + more + _ROW * len(robots))
    panels = figure.subplots(1, len(names), sharey=True, squeeze=False, width_ratios=[1.6] + [1.0] * (len(names) - 1))
    ticks = 4 if len(names) < 4 else 2
    for panel, name in zip(panels[0], names, strict=True):
        _column(
            panel,
            robots,
            name,
            {best.quantity: (best.robot.name, *best.ties) for best in ranking.best if not best.alike},
            ticks,
        )
    first = panels[0][0]
    first.set_yticks(range(len(robots)), told_apart([robot.name for robot in robots], 40))
    first.set_ylim(len(robots) - 0.4, -0.6)
    figure.suptitle(title, x=0.02, y=1.0 - 0.1 / figure.get_figheight(), ha="left", va="top", weight="bold")
    by = f"Model {ranking.model}, friction {ranking.friction}. " + (f"{_NO_WALLS}. " if ranking.walls else "")
    by += f"{SETTLED_BASIS[:1].upper()}{SETTLED_BASIS[1:]}." if ranking.settled else ""
    figure.text(0.02, 1.0 - (0.32 + more) / figure.get_figheight(), by, ha="left", va="top", size="small")
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.14 / figure.get_figheight()))
    return figure


def _column(
    panel: Axes, robots: tuple[RankedRobot, ...], name: str, best: dict[str, tuple[str, ...]], ticks: int
) -> None:
    """One quantity of all robots: points, and lines over their bands."""
    values, low, high = (_of(robots, which, name) for which in ("values", "low", "high"))
    scale = _scale(np.concatenate([values, high]), unit_of_ranked(name))
    rows = np.arange(len(robots))
    colour = COLOURS["blue"]
    panel.hlines(rows, scale(low), scale(high), color=colour, linewidth=2.2, alpha=0.35)
    winner = np.array([robot.name in best.get(name, ()) for robot in robots])
    for chosen, face in ((winner, colour), (~winner, "white")):
        panel.plot(scale(values[chosen]), rows[chosen], "o", color=colour, markerfacecolor=face, markersize=5.5)
    panel.set_xlabel(RANKED[name].heading(scale.unit))
    panel.xaxis.set_major_locator(MaxNLocator(ticks))
    panel.set_xlim(0.0, 1.08 * float(np.nanmax(scale(np.concatenate([values, high])))))
    panel.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        panel.spines[side].set_visible(False)


def _scale(values: Values, unit: str) -> UnitPrefix:
    """A unit that makes ticks short: shares below a hundredth as powers of ten."""
    largest = float(np.nanmax(np.abs(values)))
    if unit != "1" or largest >= 0.01 or largest == 0.0:
        scale = UnitPrefix.of(values, unit)
        return UnitPrefix(1e-3, "mA") if scale.unit == "A" and largest < 1.0 else scale
    power = int(np.floor(np.log10(largest)))
    return UnitPrefix(10.0**power, f"$10^{{{power}}}$")


def _of(robots: tuple[RankedRobot, ...], which: str, name: str) -> Values:
    return np.array([getattr(robot, which)[name] for robot in robots])
