"""How a robot settles in its tube: gap, azimuth and tilt over time, and where it comes to lie."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spirillum.dynamics.settling import Settling
from spirillum.units import Hz
from spirillum.view.figures.sheet import Sheet, add_letters
from spirillum.view.figures.style import COLOURS, PAGE, UnitPrefix, plain, styled

_SHORT = 0.2
"""Time constant over the length of the run above which the way does not reach the steady motion."""
_TILTS = {"pitch": "green", "yaw": "purple"}
"""Angles of the tilt, and their colours."""


def settling_figure(settling: Settling) -> Figure:
    """Three panels over time: gap, azimuth, pitch and yaw; dashed where the robot comes to lie."""
    with styled():
        motion = settling.prediction
        sheet = Sheet(
            f"{plain(settling.robot.name)}: settling in the tube",
            f"tail at {motion.tail_rotation_rate / Hz:.3g} Hz · submerged weight {1e3 * settling.weight:.3g} mN · "
            f"roughness {1e6 * settling.roughness:.3g} µm · friction {settling.friction_coefficient:.3g} · "
            "computed, nothing is measured",
            width=PAGE,
            heights=[1.9],
            columns=3,
            sharey=False,
            legend=_legend(settling),
            notes=_notes(settling),
        )
        panels = sheet.panels[0]
        add_letters(panels)
        _gap(panels[0], settling)
        _azimuth(panels[1], settling)
        _tilt(panels[2], settling)
        return sheet.finished()


def _notes(settling: Settling) -> list[str]:
    """That the way ends before the steady motion, where it does."""
    slow, end = settling.lying.approach_time, float(settling.way("time")[-1])
    if settling.lying.state != "steady" or not slow > _SHORT * end:
        return []
    return [
        f"The run ends at {end:.3g} s; the rest of the way to the steady motion, which is solved for, decays with a "
        f"time constant of {slow:.3g} s, at last: before, azimuth and yaw may go past it and come back."
    ]


def _gap(axes: Axes, settling: Settling) -> None:
    gap = settling.way("gap")
    lengths = UnitPrefix.of(gap, "m")
    axes.semilogy(settling.way("time"), lengths(gap), color=COLOURS["blue"])
    if settling.lying.state == "steady":
        _steady(axes, float(lengths(np.array(settling.lying.gap))))
    _over_time(axes, settling)
    axes.set_ylabel(f"gap under the body ({lengths.unit})")


def _azimuth(axes: Axes, settling: Settling) -> None:
    axes.plot(settling.way("time"), np.rad2deg(settling.way("azimuth")), color=COLOURS["vermillion"])
    if settling.lying.state == "steady":
        _steady(axes, np.rad2deg(settling.lying.azimuth))
    _over_time(axes, settling)
    axes.set_ylabel("azimuth on the wall (deg)")


def _tilt(axes: Axes, settling: Settling) -> None:
    for (name, colour), rest in zip(_TILTS.items(), (settling.lying.pitch, settling.lying.yaw), strict=True):
        axes.plot(settling.way("time"), np.rad2deg(settling.way(name)), color=COLOURS[colour], label=name)
        if settling.lying.state == "steady":
            _steady(axes, np.rad2deg(rest))
    _over_time(axes, settling)
    axes.set_ylabel("tilt against the wall (deg)")


def _over_time(axes: Axes, settling: Settling) -> None:
    axes.set_xlim(0.0, settling.way("time")[-1])
    axes.set_xlabel("time (s)")


_STEADY: dict[str, Any] = {"color": "#555555", "linestyle": (0, (4, 2)), "linewidth": 0.9}


def _steady(axes: Axes, value: float) -> None:
    """Where the robot comes to lie."""
    axes.axhline(value, **_STEADY)


def _legend(settling: Settling) -> list[Line2D]:
    """Of the panel with two lines, and of the place where the robot comes to lie, if there is one."""
    lines = [Line2D([], [], color=COLOURS[name], label=words) for words, name in _TILTS.items()]
    return [*lines, *([Line2D([], [], **_STEADY, label="steady")] if settling.lying.state == "steady" else [])]
