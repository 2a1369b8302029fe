"""A controlled run: where the robot was, was seen and was thought to be; its rest; command and flow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spirillum.arrays import Samples
from spirillum.controllers.control import Control
from spirillum.units import show
from spirillum.view.figures.sheet import Sheet
from spirillum.view.figures.style import COLOURS, PATCH, UnitPrefix, plain, styled

_MOST_SEEN = 1500  # largest number of plotted frames


def control_figure(control: Control) -> Figure:
    """Plot position, distance from the target, and duty with flow over time; shaded where flow is imposed."""
    with styled():
        pulse = control.drawn.pulse
        flow = "no pulse of flow"
        if pulse is not None:
            flow = f"flow {show(pulse.velocity, 'mm/s')} from {pulse.start:.3g} to {pulse.end:.3g} s (shaded)"
        sheet = Sheet(
            f"{plain(control.robot.name)}: {control.task.kind}, controller {control.controller}, seed {control.seed}",
            f"model {control.model} · camera {show(control.lab.camera.latency, 's')} late · remote "
            f"{show(control.lab.remote.delay, 's')} late · friction times {control.drawn.friction:.3g} · {flow} · "
            f"{'good' if control.score.good else 'not good'} enough · computed, no measured data",
            heights=[1.9, 1.5, 0.8],
            sharex="col",
            sharey=False,
            legend=_legend(control),
        )
        panels = sheet.panels[:, 0]
        time = control.dataset["time"].values
        target, around = control.task.target(time, float(np.sign(control.speed)))
        scale = UnitPrefix.of(_path_of(control).true, "m")
        _places(panels[0], control, scale, target, around)
        _residuals(panels[1], control, target, around)
        _commands(panels[2], control)
        for axes in panels:
            if pulse is not None:
                axes.axvspan(pulse.start, pulse.end, color="#555555", alpha=0.15, linewidth=0)
        panels[-1].set_xlim(0.0, float(time[-1]))
        panels[-1].set_xlabel("time (s)")
        return sheet.finished()


def _legend(control: Control) -> list[Line2D]:
    found = [
        Line2D([], [], color=COLOURS["black"], label="robot"),
        Line2D([], [], color=COLOURS["sky"], marker=".", linestyle="", label="seen"),
    ]
    if _path_of(control).estimated is not None:
        found.append(Line2D([], [], color=COLOURS["vermillion"], linestyle="--", label="estimated"))
    if _has_interval(control):
        found.append(Line2D([], [], color=COLOURS["vermillion"], alpha=0.25, **PATCH, label="its 95 % interval"))
    found.append(Line2D([], [], color=COLOURS["green"], linestyle=(0, (4, 2)), label="aim and tolerance"))
    return found


def _has_interval(control: Control) -> bool:
    """Whether the estimated position has a standard error to be plotted."""
    return _path_of(control).estimated is not None and "estimated_position_error" in control.dataset


class _Path(NamedTuple):
    """Controlled variable of a task: the position along the tube, or the distance from its axis; m."""

    true: Samples
    seen: Samples
    estimated: Samples | None
    words: str


def _path_of(control: Control) -> _Path:
    data = control.dataset
    if not control.task.across:
        estimated = data["estimated_position"].values if "estimated_position" in data else None
        return _Path(data["position"].values[:, 0], data["seen_position"].values, estimated, "place x")
    estimated = None
    if "estimated_side" in data:
        estimated = np.hypot(data["estimated_side"].values, data["estimated_height"].values)
    seen = np.hypot(data["seen_side"].values, data["seen_height"].values)
    return _Path(np.hypot(*data["position"].values[:, 1:].T), seen, estimated, "distance from the axis")


def _places(axes: Axes, control: Control, scale: UnitPrefix, target: Samples, around: float) -> None:
    data, path = control.dataset, _path_of(control)
    time = data["time"].values
    every = max(1, data.sizes["frame_time"] // _MOST_SEEN)
    axes.plot(data["frame_time"].values[::every], scale(path.seen[::every]), ".", color=COLOURS["sky"], markersize=2.5)
    axes.plot(time, scale(path.true), color=COLOURS["black"])
    if path.estimated is not None:
        axes.plot(data["decision_time"].values, scale(path.estimated), "--", color=COLOURS["vermillion"], linewidth=1.0)
    _aim(axes, time, scale(target), around / scale.factor)
    axes.set_ylabel(f"{path.words} ({scale.unit})")


def _residuals(axes: Axes, control: Control, target: Samples, around: float) -> None:
    data, path = control.dataset, _path_of(control)
    time = data["time"].values
    scale = UnitPrefix.of(np.array([4.0 * around]), "m")
    rest = path.true - target
    axes.plot(time, scale(rest), color=COLOURS["black"])
    if path.estimated is not None:
        when = data["decision_time"].values
        middle = path.estimated - np.interp(when, time, target)
        axes.plot(when, scale(middle), "--", color=COLOURS["vermillion"], linewidth=1.0)
        if _has_interval(control):
            half = 1.96 * data["estimated_position_error"].values
            axes.fill_between(
                when, scale(middle - half), scale(middle + half), color=COLOURS["vermillion"], alpha=0.25, linewidth=0
            )
    _aim(axes, time, np.zeros_like(time), around / scale.factor)
    if np.isfinite(rest).any():
        last = scale(np.array([np.nanmin(rest[time > 0.5 * time[-1]]), np.nanmax(rest)]))
        room = 1.3 * around / scale.factor
        axes.set_ylim(max(min(-room, float(last[0])), -4.0 * room), min(max(room, 1.1 * float(last[1])), 4.0 * room))
    axes.set_ylabel(f"{'distance' if control.task.across else 'x - aim'} ({scale.unit})")


def _aim(axes: Axes, time: Samples, middle: Samples, around: float) -> None:
    axes.plot(time, middle, color=COLOURS["green"], linestyle=(0, (4, 2)), linewidth=1.0)
    axes.fill_between(time, middle - around, middle + around, color=COLOURS["green"], alpha=0.12, linewidth=0)


def _commands(axes: Axes, control: Control) -> None:
    data = control.dataset
    if "field_yaw" in data:
        for name, colour in (("yaw", "blue"), ("pitch", "orange")):
            tilt = np.degrees(data[f"field_{name}"].values)
            axes.step(
                data["decision_time"].values, tilt, where="post", color=COLOURS[colour], linewidth=1.0, label=name
            )
        axes.set_ylabel("field's axis (deg)")
        axes.legend(loc="upper right", ncols=2)
        return
    axes.step(data["time"].values, data["duty"].values, where="pre", color=COLOURS["blue"], linewidth=1.0)
    axes.set_ylim(-0.08, 1.08)
    axes.set_ylabel("duty")
