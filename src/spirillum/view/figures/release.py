"""Figures of robots released from rest: approach to the resting pose, and readings of a study's conditions."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from spirillum.arrays import Values
from spirillum.dynamics.settling import Settling
from spirillum.quantities import unit_of
from spirillum.studies.ranking import StudyRanking, robot_dims
from spirillum.units import Hz, show_height
from spirillum.view.figures.sheet import Picture, Sheet
from spirillum.view.figures.style import COLOURS, UnitPrefix, plain, styled

if TYPE_CHECKING:
    import xarray as xr


_SHORT = 0.2  # time constant over the run's length above which the run does not reach the steady state
_TILTS = {"pitch": "green", "yaw": "purple"}  # angles of the tilt, and their colours


def settling_figure(settling: Settling) -> Figure:
    """Three panels over time: gap, azimuth, pitch and yaw; dashed at the resting pose."""
    with styled():
        motion = settling.prediction
        sheet = Sheet(
            f"{plain(settling.robot.name)}: settling in the tube",
            f"tail at {motion.tail_rotation_rate / Hz:.3g} Hz · submerged weight {1e3 * settling.weight:.3g} mN · "
            f"roughness {show_height(settling.roughness)} · friction {settling.friction_coefficient:.3g} · "
            "computed, no measured data",
            heights=[1.9],
            columns=3,
            sharey=False,
            legend=_legend(settling),
            notes=_notes(settling),
        )
        panels = sheet.panels[0]
        time, lengths = settling.trajectory("time"), UnitPrefix.of(settling.trajectory("gap"), "m")
        lines = ({"gap": "blue"}, {"azimuth": "vermillion"}, _TILTS)
        labels = (f"gap under the body ({lengths.unit})", "azimuth on the wall (deg)", "tilt against the wall (deg)")
        for axes, colours, label in zip(panels, lines, labels, strict=True):
            shown = lengths if "gap" in colours else np.rad2deg
            for name, colour in colours.items():
                axes.plot(time, shown(settling.trajectory(name)), color=COLOURS[colour], label=name)
                if settling.steady_state.state == "steady":
                    axes.axhline(float(shown(np.array(getattr(settling.steady_state, name)))), **_STEADY)
            axes.set_xlim(0.0, time[-1])
            axes.set_xlabel("time (s)")
            axes.set_ylabel(label)
        panels[0].set_yscale("log")
        return sheet.finished()


def _notes(settling: Settling) -> list[str]:
    """Note on a run that ends before the steady state."""
    slow, end = settling.steady_state.approach_time, float(settling.trajectory("time")[-1])
    if settling.steady_state.state != "steady" or not slow > _SHORT * end:
        return []
    return [
        f"The run ends at {end:.3g} s; the remaining path to the steady motion, which is solved for, decays with a "
        f"time constant of {slow:.3g} s, at last: before, azimuth and yaw may go past it and come back."
    ]


_STEADY: dict[str, Any] = {"color": "#555555", "linestyle": (0, (4, 2)), "linewidth": 0.9}


def _legend(settling: Settling) -> list[Line2D]:
    """Legend of the panel with two lines, and of the resting pose, if there is one."""
    lines = [Line2D([], [], color=COLOURS[name], label=words) for words, name in _TILTS.items()]
    return [*lines, *([Line2D([], [], **_STEADY, label="steady")] if settling.steady_state.state == "steady" else [])]


_SHOWN = {
    "forward_velocity": "speed",
    "tail_rotation_rate": "tail rate",
    "body_rotation_rate": "body rate",
    "effective_friction": "inferred $B_{eff}$",
}
_KINDS = (("on the lubrication film alone", "blue", "o"), ("touching the wall", "vermillion", "s"))
_MOST = 4  # robots of the figure


def release_picture(dataset: xr.Dataset, ranking: StudyRanking) -> Picture | None:
    """Every reading of every run over the median of its robot; None if no robot was released."""
    if "forward_velocity_at_run" not in dataset:
        return None
    there = _readings(dataset, "forward_velocity")
    robots = {robot.name: robot.place for robot in ranking.robots if np.isfinite(there[robot.place]).any()}
    if not robots:
        return None
    shown = dict(list(robots.items())[:_MOST])
    title = "What the conditions of a run change"
    caption = (
        "Size of each reading of runs that differ in gap, pitch, wait, roughness and dry friction, over the median of "
        f"its robot; $B_{{eff}}$ as model {dataset['inferred_by'].values[0]} infers it. Computed, no measured data."
    )
    if len(robots) > len(shown):
        caption += f" Shown: the {len(shown)} fastest of {len(robots)} robots."
    alternative = f"{len(shown)} panels with readings of {', '.join(_SHOWN.values())} on a logarithmic axis. {caption}"
    return Picture.of(title, caption, alternative, partial(_drawn, dataset, shown, title, caption))


def _readings(dataset: xr.Dataset, name: str) -> Values:
    """Sizes of the readings, (robots in the flat order of the study, readings)."""
    values = dataset[f"{name}_at_run"]
    if "inferred_by" in values.dims:
        values = values.isel(inferred_by=0)
    found: Values = np.abs(values.transpose(*robot_dims(dataset), "run", "window").values.astype(float))
    return found.reshape(-1, values.sizes["run"] * values.sizes["window"])


def _drawn(dataset: xr.Dataset, robots: dict[str, int], title: str, caption: str) -> Figure:
    legend = [
        Line2D([], [], color=COLOURS[colour], marker=marker, linestyle="none", markerfacecolor="none", label=label)
        for label, colour, marker in _KINDS
    ]
    heights = [0.28 * len(_SHOWN)] * len(robots)
    sheet = Sheet(title, caption, heights=heights, legend=legend, sharex="all", sharey=False)
    panels = sheet.panels[:, 0]
    touching = _readings(dataset, "contact_share") > 0
    for axes, (robot, place) in zip(panels, robots.items(), strict=True):
        for row, name in enumerate(_SHOWN):
            _draw_row(axes, row, _readings(dataset, name)[place], touching[place], unit_of(name))
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_yticks(range(len(_SHOWN)), list(_SHOWN.values()))
        axes.set_ylim(len(_SHOWN) - 0.4, -0.6)
        axes.set_title(plain(robot, 60), loc="center", pad=3)
    panels[-1].set_xlabel("size over the robot's median")
    return sheet.finished()


def _draw_row(axes: Axes, row: int, values: Values, touching: np.ndarray, unit: str) -> None:
    """Readings of one quantity, and their range in its unit at the right."""
    known = np.isfinite(values) & (values > 0)
    if not known.any():
        return
    middle = float(np.median(values[known]))
    for (_, colour, marker), chosen, above in zip(
        _KINDS, (known & ~touching, known & touching), (-0.13, 0.13), strict=True
    ):
        places = np.full(int(chosen.sum()), row + above)
        axes.plot(
            values[chosen] / middle, places, marker, color=COLOURS[colour], markerfacecolor="none", markersize=3.5
        )
    scale = UnitPrefix.of(values[known], unit)
    low, high = (end / scale.factor for end in (values[known].min(), values[known].max()))
    axes.text(
        1.01, row, f"{low:.3g} to {high:.3g} {scale.unit}", transform=axes.get_yaxis_transform(), va="center", size=8
    )
