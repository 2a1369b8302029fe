"""How a robot settles in its tube: gap and azimuth over time, and the film's resistance over the gap."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from spirillum.dynamics.settling import Settling
from spirillum.units import Hz
from spirillum.view.figures.sheet import Sheet, add_letters
from spirillum.view.figures.style import COLOURS, Scale, plain, styled

__all__ = ["settling_figure"]


def settling_figure(settling: Settling) -> Figure:
    """Three panels: gap over time, azimuth over time, normal resistance over the gap with thin-film theory.

    Args:
        settling: what `spirillum.settle` returns.
    """
    with styled():
        motion = settling.prediction
        sheet = Sheet(
            f"{plain(settling.robot.name)}: settling in the tube",
            f"tail at {motion.tail_rotation_rate / Hz:.3g} Hz · submerged weight {1e3 * settling.weight:.3g} mN · "
            "level, from the lowest place · computed, nothing is measured",
            width=9.0,
            heights=[2.2],
            columns=3,
            sharey=False,
        )
        panels = sheet.panels[0]
        add_letters(panels)
        _gap(panels[0], settling)
        _azimuth(panels[1], settling)
        _resistance(panels[2], settling)
        return sheet.finished()


def _gap(axes: Axes, settling: Settling) -> None:
    descent = settling.descent
    lengths = Scale.of(descent.gap, "m")
    axes.plot(descent.time, lengths(descent.gap), color=COLOURS["blue"])
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(0.0, descent.time[-1])
    axes.set_xlabel("time (s)")
    axes.set_ylabel(f"gap under the body ({lengths.unit})")


def _azimuth(axes: Axes, settling: Settling) -> None:
    descent = settling.descent
    axes.plot(descent.time, np.rad2deg(descent.azimuth), color=COLOURS["vermillion"])
    axes.set_xlim(0.0, descent.time[-1])
    axes.set_xlabel("time (s)")
    axes.set_ylabel("azimuth on the wall (deg)")


def _resistance(axes: Axes, settling: Settling) -> None:
    gaps = np.array([film.gap for film in settling.films])
    values = np.array([film.normal_resistance for film in settling.films])
    lengths, scale = Scale.of(gaps, "m"), Scale.of(values, "N s/m")
    thin = values / settling.lubrication_ratios
    if np.all(np.isfinite(thin)):
        axes.loglog(
            lengths(gaps), scale(thin), color="#555555", linestyle=(0, (4, 2)), label=r"thin film, $\propto h^{-3/2}$"
        )
    axes.loglog(lengths(gaps), scale(values), color=COLOURS["blue"], marker="o", linestyle="none", label="computed")
    ticks = np.array([1.0, 2.0, 5.0]) * 10.0 ** np.arange(-9, 9)[:, None]
    for axis, shown in ((axes.xaxis, lengths(gaps)), (axes.yaxis, scale(values))):
        inside = ticks[(ticks > 0.8 * shown.min()) & (ticks < 1.25 * shown.max())]
        axis.set_major_locator(FixedLocator(inside.tolist()))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_xlabel(f"gap $h$ ({lengths.unit})")
    axes.set_ylabel(f"resistance to sinking ({scale.unit})")
    axes.legend(loc="upper right")
