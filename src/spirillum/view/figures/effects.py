"""Why models differ, as a waterfall: what each effect does to the speed, from Lighthill's theory to the trial."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from spirillum.dynamics.comparison import ModelComparison
from spirillum.dynamics.trial import ASSUMPTION
from spirillum.errors import InputError
from spirillum.view.figures.sheet import Sheet
from spirillum.view.figures.style import COLOURS, PAGE, UnitPrefix, plain, styled

_LINE_HEIGHT = 0.36
_ROOM = 3.0
"""Of a logarithmic axis beyond its values, for the words beside them."""


def effects_figure(comparison: ModelComparison) -> Figure:
    """A line for each effect, from the speed before it to the speed with it, with the factor beside it.

    Raises:
        InputError: if the effects are not known, for want of a model among those that are compared.
    """
    effects = comparison.effects
    if not effects:
        raise InputError(
            "the effects between the models need sbt and slender without calibration factors; allowed: --plot with both"
        )
    speeds = np.array([effect.speed for effect in effects])
    with styled():
        sheet = Sheet(
            f"{plain(comparison.robot.name, 60)}: why models differ",
            f"friction model '{comparison.friction}' · computed, no measured data",
            width=PAGE,
            heights=[_LINE_HEIGHT * len(effects) + 0.1],
            columns=1,
            notes=[
                "Each line keeps the effects above it; factor: speed over that of the line above.",
                f"From the lubrication film on: the trial (60 s of waiting, 20 s with the motor on); {ASSUMPTION}.",
            ],
        )
        axes = sheet.panels[0, 0]
        scale = UnitPrefix.of(speeds, "m/s")
        _draw(axes, speeds / scale.factor)
        axes.set_yticks(range(len(effects)), [_label(place, effect.name) for place, effect in enumerate(effects)])
        axes.set_ylim(len(effects) - 0.4, -0.6)
        axes.set_xlabel(f"forward velocity ({scale.unit})")
        return sheet.finished()


def _label(place: int, name: str) -> str:
    return name if place == 0 else f"+ {name}"


def _draw(axes: Axes, speeds: np.ndarray) -> None:
    """The waterfall; on a logarithmic axis where all speeds are forward."""
    logarithmic = bool(np.all(speeds > 0.0))
    if logarithmic:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlim(float(speeds.min()) / 1.3, float(speeds.max()) * _ROOM)
    else:
        span = float(np.ptp(speeds)) or 1.0
        axes.set_xlim(min(float(speeds.min()), 0.0) - 0.05 * span, float(speeds.max()) + 0.5 * span)
    before = np.append(speeds[0], speeds[:-1])
    for place, (was, now) in enumerate(zip(before, speeds, strict=True)):
        colour = COLOURS["vermillion"] if now < was else COLOURS["green"] if now > was else COLOURS["blue"]
        axes.plot([was, now], [place, place], color=colour, linewidth=9.0, alpha=0.45, solid_capstyle="butt")
        axes.plot([now, now], [place - 0.32, place + 0.32], color=colour, linewidth=1.8)
        if place + 1 < speeds.size:
            axes.plot([now, now], [place, place + 1], color="#999999", linewidth=0.6, zorder=1)
        factor = f"  × {now / was:.2f}" if place and was != 0.0 else ""
        axes.annotate(
            f"{now:.3g}{factor}",
            (max(was, now), place),
            xytext=(6, 0),
            textcoords="offset points",
            ha="left",
            va="center",
            size=8,
            color="#333333",
        )
    axes.grid(visible=False, axis="y")
