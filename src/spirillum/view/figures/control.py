"""A controlled run: where the robot was, was seen and was thought to be; its rest; command and flow."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spirillum.arrays import Samples
from spirillum.controllers.control import Control
from spirillum.units import show
from spirillum.view.figures.sheet import Sheet, add_letters
from spirillum.view.figures.style import COLOURS, Scale, plain, styled

__all__ = ["control_figure"]

_MOST_SEEN = 1500
"""Frames that are drawn at most."""


def control_figure(control: Control) -> Figure:
    """Three panels over time: place, distance from what was aimed at, and duty with flow; shaded where flow is imposed.

    Args:
        control: what `spirillum.control` returns.
    """
    with styled():
        sheet = Sheet(
            f"{plain(control.robot.name)}: {control.task.kind}, controller {control.controller}, seed {control.seed}",
            _subtitle(control),
            width=7.16,
            heights=[1.9, 1.5, 0.8],
            columns=1,
            sharex="col",
            sharey=False,
            legend=_legend(control),
        )
        panels = sheet.panels[:, 0]
        add_letters(panels)
        time = control.dataset["time"].values
        target, around = control.task.target(time, float(np.sign(control.speed)))
        scale = Scale.of(control.dataset["position"].values[:, 0], "m")
        _places(panels[0], control, scale, target, around)
        _rests(panels[1], control, target, around)
        _commands(panels[2], control)
        for axes in panels:
            _shade(axes, control)
        panels[-1].set_xlim(0.0, float(time[-1]))
        panels[-1].set_xlabel("time (s)")
        return sheet.finished()


def _subtitle(control: Control) -> str:
    pulse = control.drawn.pulse
    flow = "no pulse of flow"
    if pulse is not None:
        flow = f"flow {show(pulse.velocity, 'mm/s')} from {pulse.start:.3g} to {pulse.end:.3g} s (shaded)"
    return (
        f"model {control.model} · camera {show(control.lab.camera.latency, 's')} late · remote "
        f"{show(control.lab.remote.delay, 's')} late · friction times {control.drawn.friction:.3g} · {flow} · "
        f"{'good' if control.score.good else 'not good'} enough · computed, nothing is measured"
    )


def _legend(control: Control) -> list[Line2D]:
    found = [
        Line2D([], [], color=COLOURS["black"], label="robot"),
        Line2D([], [], color=COLOURS["sky"], marker=".", linestyle="", label="seen"),
    ]
    if "estimated_position" in control.dataset:
        found.append(Line2D([], [], color=COLOURS["vermillion"], linestyle="--", label="estimated"))
    found.append(Line2D([], [], color=COLOURS["green"], linestyle=(0, (4, 2)), label="aimed at, with what is good"))
    return found


def _places(axes: Axes, control: Control, scale: Scale, target: Samples, around: float) -> None:
    data = control.dataset
    time = data["time"].values
    every = max(1, data.sizes["frame_time"] // _MOST_SEEN)
    seen = data["seen_position"].values[::every]
    axes.plot(data["frame_time"].values[::every], scale(seen), ".", color=COLOURS["sky"], markersize=2.5)
    axes.plot(time, scale(data["position"].values[:, 0]), color=COLOURS["black"])
    if "estimated_position" in data:
        middle = data["estimated_position"].values
        axes.plot(data["decision_time"].values, scale(middle), "--", color=COLOURS["vermillion"], linewidth=1.0)
    _aim(axes, time, scale(target), around / scale.factor)
    axes.set_ylabel(f"place x ({scale.unit})")


def _rests(axes: Axes, control: Control, target: Samples, around: float) -> None:
    data = control.dataset
    time = data["time"].values
    scale = Scale.of(np.array([4.0 * around]), "m")
    rest = data["position"].values[:, 0] - target
    axes.plot(time, scale(rest), color=COLOURS["black"])
    if "estimated_position" in data:
        when = data["decision_time"].values
        middle = data["estimated_position"].values - np.interp(when, time, target)
        axes.plot(when, scale(middle), "--", color=COLOURS["vermillion"], linewidth=1.0)
        if "estimated_position_error" in data:
            half = 1.96 * data["estimated_position_error"].values
            axes.fill_between(
                when, scale(middle - half), scale(middle + half), color=COLOURS["vermillion"], alpha=0.25, linewidth=0
            )
    _aim(axes, time, np.zeros_like(time), around / scale.factor)
    if np.isfinite(rest).any():
        last = scale(np.array([np.nanmin(rest[time > 0.5 * time[-1]]), np.nanmax(rest)]))
        room = 1.3 * around / scale.factor
        axes.set_ylim(max(min(-room, float(last[0])), -4.0 * room), min(max(room, 1.1 * float(last[1])), 4.0 * room))
    axes.set_ylabel(f"x - aim ({scale.unit})")


def _aim(axes: Axes, time: Samples, middle: Samples, around: float) -> None:
    axes.plot(time, middle, color=COLOURS["green"], linestyle=(0, (4, 2)), linewidth=1.0)
    axes.fill_between(time, middle - around, middle + around, color=COLOURS["green"], alpha=0.12, linewidth=0)


def _commands(axes: Axes, control: Control) -> None:
    data = control.dataset
    axes.step(data["time"].values, data["duty"].values, where="pre", color=COLOURS["blue"], linewidth=1.0)
    axes.set_ylim(-0.08, 1.08)
    axes.set_ylabel("duty")


def _shade(axes: Axes, control: Control) -> None:
    pulse = control.drawn.pulse
    if pulse is not None:
        axes.axvspan(pulse.start, pulse.end, color="#555555", alpha=0.15, linewidth=0)
