"""Figures of the paper: Figs 3, 5 and 6, and the loss of speed in the narrow channel."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch

from spirillum.arrays import Samples, Values
from spirillum.errors import InputError
from spirillum.papers.biorob2012.evidence import GLOBAL_DROP, LARGEST_REYNOLDS, Evidence
from spirillum.robot.mesh import centreline_of
from spirillum.robot.robot import Robot
from spirillum.view.figures.rows import band_handles, draw_band, draw_curve
from spirillum.view.figures.scene import FAINT, HALO, INK
from spirillum.view.figures.sheet import Picture, Sheet, add_letters, width_of
from spirillum.view.figures.study import PANEL
from spirillum.view.figures.study_panels import PaperFigure, StudyView, head_column, spread, tail_axis
from spirillum.view.figures.style import COLOURS, PAGE, UnitPrefix, label_of_model, look_of_model, new_figure, styled

if TYPE_CHECKING:
    import xarray as xr


_TITLE = "Loss of speed from the wide to the narrow channel"
_MOST_COLUMNS = 5
_STATED: Any = {"color": "black", "linestyle": (0, (4.0, 2.0)), "linewidth": 1.0}  # style of the paper's values


def drop_picture(shown: StudyView) -> Picture | None:
    """The loss of every tail at equal motor rates; None for a study of other channels."""
    if not {"wide", "narrow"} <= {str(name) for name in shown.whole["channel"].values}:
        return None
    evidence = Evidence(shown.whole)
    if not evidence.confined:
        return None
    notes = [
        "At equal motor rates a tail's relative loss follows without knowing the rate. The loss of the global mean, "
        f"which the paper reports as {100 * GLOBAL_DROP:.1f} %, is a weighted mean of the losses of single tails."
    ]
    if evidence.computed:
        names = ", ".join(label_of_model(name) for name in evidence.computed)
        notes.append(f"Nothing is fitted in {names}: the walls are computed ({evidence.pose}).")
        if shown.banded:
            notes.append(
                "Band: the least to the largest loss over gaps and pitches that are the same in both channels."
            )
    fitted = [label_of_model(name) for name in evidence.confined if name not in evidence.computed]
    if fitted:
        notes.append(
            f"In {', '.join(fitted)} Table III's factors represent the walls; they were fitted to the same data."
        )
    panels = min(shown.whole.sizes["wavelength"], _MOST_COLUMNS)
    alternative = (
        f"{panels} panels, one for each wavelength: relative loss of speed against wave amplitude by "
        f"{', '.join(map(label_of_model, evidence.confined))}. {shown.source_line}"
    )
    return Picture.of(
        _TITLE, " ".join([shown.source_line, *notes]), alternative, partial(_draw, shown, evidence, notes)
    )


def _draw(shown: StudyView, evidence: Evidence, notes: list[str]) -> Figure:
    wavelengths = spread(shown.whole.sizes["wavelength"], _MOST_COLUMNS)
    legend = [*_entries(evidence), *band_handles(shown)]
    legend.append(Line2D([], [], **_STATED, label=f"paper: global mean {100 * GLOBAL_DROP:.1f} %"))
    sheet = Sheet(
        _TITLE,
        shown.source_line,
        width=width_of(len(wavelengths), PANEL[0]),
        heights=[2.2],
        columns=len(wavelengths),
        notes=notes,
        legend=legend,
    )
    panels = sheet.panels[0]
    add_letters(panels)
    values = np.asarray(shown.whole["amplitude"].values, dtype=float)
    scale = UnitPrefix.of(values, "m")
    for axes, wavelength in zip(panels, wavelengths, strict=True):
        for model in evidence.confined:
            look = look_of_model(model)
            low, high = _range(evidence, model)
            draw_band(axes, scale(values), low[wavelength], high[wavelength], look, joined=True)
            draw_curve(axes, scale(values), 100 * evidence.drop_per_motor_turn(model)[wavelength], look)
        axes.axhline(100 * GLOBAL_DROP, **_STATED)
        tail_axis(axes, scale(values))
        axes.set_xlabel(f"amplitude $B_o$ ({scale.unit})")
        head_column(axes, shown, wavelength)
    panels[0].set_ylabel("loss at equal motor rates\n$1-U_{narrow}/U_{wide}$ (%)")
    bottom, top = panels[0].get_ylim()
    panels[0].set_ylim(min(bottom, 0.0), max(top, 60.0))
    return sheet.finished()


def _range(evidence: Evidence, model: str) -> tuple[Values, Values]:
    """Least and largest loss over a band, per cent; NaN without one."""
    found = evidence.drops_of_the_band(model)
    if found is None:
        unknown = np.full_like(evidence.drop_per_motor_turn(model), np.nan)
        return unknown, unknown
    return 100 * np.fmin.reduce(found, axis=-1), 100 * np.fmax.reduce(found, axis=-1)


def _entries(evidence: Evidence) -> list[Line2D]:
    found = []
    for model in evidence.confined:
        look = look_of_model(model)
        walls = "computed walls" if model in evidence.computed else "Table III"
        label = f"{label_of_model(model)} ({walls})"
        found.append(Line2D([], [], color=look.colour, linestyle=look.line, marker=look.marker, label=label))
    return found


_SIGHT = np.array([0.56, 0.76, -0.34])
"""Direction in which the picture is seen: from the side, from behind and from above."""
_POINTS = 1200
_MARKED = (0.215, 0.415, 0.63, 0.83)  # positions of the frames, shares of the axial length
_SHADES = ("#4a2410", "#c2763a", "#ffd9b0")


class FrenetFrames(NamedTuple):
    """The wire's centreline in the frame of the body, m, and its Frenet-Serret unit vectors, (n, 3)."""

    position: Samples
    tangent: Samples
    normal: Samples
    binormal: Samples


def frenet_frames(robot: Robot, xi: Samples) -> FrenetFrames:
    """Frenet-Serret frames of the wire of eq. (10), its tail at phase 0."""
    step = 1e-5 * robot.tail.length
    ahead, behind = (
        centreline_of(robot, np.clip(xi + sign * step, 0.0, robot.tail.length)).tangent for sign in (1.0, -1.0)
    )
    position, tangent, _ = centreline_of(robot, xi)
    bend = ahead - behind
    bend = bend - np.sum(bend * tangent, axis=1, keepdims=True) * tangent
    size = np.linalg.norm(bend, axis=1, keepdims=True)
    if not np.all(size > 1e-12):
        raise InputError("the wire is straight, where it has no normal; allowed: a helix")
    normal = bend / size
    return FrenetFrames(position, tangent, normal, np.asarray(np.cross(tangent, normal)))


def frenet_figure(robot: Robot) -> Figure:
    """Parallel projection of the wire at phase 0 in units of its amplitude, with t, n, b and the lab's directions."""
    tail = robot.tail
    unit = tail.amplitude
    xi = np.linspace(0.0, tail.length, _POINTS)
    wire = centreline_of(robot, xi).position / unit
    middle = wire.mean(axis=0)
    marked = frenet_frames(robot, np.array(_MARKED) * tail.length)
    reach = 0.085 * tail.length / unit
    start = wire[0] + np.array([1.6 * reach, 0.0, 0.0]) - wire[0] * np.array([0.0, 1.0, 1.0])
    away = _SIGHT / np.linalg.norm(_SIGHT)
    right = np.cross(away, np.array([0.0, 0.0, 1.0]))
    right = right / np.linalg.norm(right)
    up = np.asarray(np.cross(right, away))

    def seen(points: Samples) -> Samples:
        return np.stack([(points - middle) @ right, (points - middle) @ up], axis=-1)

    with styled():
        drawn = np.concatenate([seen(wire), seen(start + 1.3 * reach * np.eye(3)), seen(marked.position / unit)])
        low, high = drawn.min(axis=0) - 0.9 * reach, drawn.max(axis=0) + 0.9 * reach
        low[1] -= 0.4 * reach
        span = high - low
        figure = new_figure(PAGE, PAGE * float(span[1] / span[0]))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_axis_off()
        axis = seen(np.stack([start, wire[-1] * [1, 0, 0] - [0.6 * reach, 0, 0]]))
        axes.plot(axis[:, 0], axis[:, 1], color=FAINT, linewidth=0.9, dashes=(9, 3, 2, 3), zorder=1)
        points = 72.0 * PAGE / float(span[0])
        _draw_wire(axes, seen(wire), (wire - middle) @ away, tail.wire_diameter / unit * points)
        for number, position in enumerate(marked.position / unit):
            vectors = (marked.tangent[number], marked.normal[number], marked.binormal[number])
            colours = (COLOURS["blue"], COLOURS["vermillion"], COLOURS["green"])
            for name, vector, colour in zip("tnb", vectors, colours, strict=True):
                _draw_arrow(
                    axes, seen(position[None])[0], seen((position + reach * vector)[None])[0], name, colour, bold=True
                )
            axes.plot(*seen(position[None])[0], marker="o", markersize=4.5, color=INK, zorder=9)
        for name, vector in zip("xyz", np.eye(3), strict=True):
            _draw_arrow(
                axes, seen(start[None])[0], seen((start + 1.3 * reach * vector)[None])[0], name, INK, bold=False
            )
        words = "$\\mathbf{t}$ along the wire, away from its root · $\\mathbf{n}$ towards its centre of curvature · "
        axes.text(
            low[0] + 0.012 * span[0],
            low[1] + 0.03 * span[1],
            words + "$\\mathbf{b}=\\mathbf{t}\\times\\mathbf{n}$ · $xyz$: the lab, $x$ forward, $z$ up",
            size=7.5,
            color=INK,
            va="bottom",
        )
        return figure


def _draw_wire(axes: Axes, path: Samples, depth: Samples, width: float) -> None:
    """Plot a round wire: dark rim, body, light; farther parts first and darker."""
    pieces = np.stack([path[:-2], path[2:]], axis=1)
    far = (depth[1:-1] - depth.min()) / max(float(np.ptp(depth)), 1e-12)
    shades = np.array([to_rgb(colour) for colour in _SHADES])
    layers = ((1.0, 0.0, 0.0, 0.0), (0.80, 0.5, 0.0, 0.04), (0.28, 0.92, 0.16, 0.08))
    segments, colours, widths, order = [], [], [], []
    for share, tone, lift, before in layers:
        shade = np.clip(tone - 0.22 * far * (tone > 0), 0.0, 1.0)
        colours.append(np.stack([np.interp(shade, (0.0, 0.5, 1.0), shades[:, c]) for c in range(3)], axis=-1))
        segments.append(pieces + np.array([0.0, lift * (path[:, 1].max() - path[:, 1].min()) * 0.02]))
        widths.append(np.full(len(pieces), share * width))
        order.append(-far + before)
    by_depth = np.argsort(np.concatenate(order), kind="stable")
    axes.add_collection(
        LineCollection(
            list(np.concatenate(segments)[by_depth]),
            colors=np.concatenate(colours)[by_depth],
            linewidths=np.concatenate(widths)[by_depth],
            capstyle="round",
            zorder=4,
        )
    )


def _draw_arrow(axes: Axes, start: Samples, end: Samples, name: str, colour: str, *, bold: bool) -> None:
    for shade, width, order in (("white", 3.6, 7.0), (colour, 2.0 if bold else 1.2, 8.0)):
        axes.add_patch(
            FancyArrowPatch(
                (float(start[0]), float(start[1])),
                (float(end[0]), float(end[1])),
                arrowstyle="-|>",
                mutation_scale=9,
                linewidth=width,
                color=shade,
                shrinkA=0,
                shrinkB=0,
                zorder=order,
            )
        )
    way = end - start
    position = end + 0.53 * way / max(float(np.hypot(*way)), 1e-12)
    text = f"$\\mathbf{{{name}}}$" if bold else f"${name}$"
    axes.text(
        float(position[0]),
        float(position[1]),
        text,
        ha="center",
        va="center",
        size=10,
        color=colour,
        path_effects=[HALO],
        zorder=10,
    )


_FILES = {"wide": "fig5-wide", "narrow": "fig6-narrow"}
PAPER_FIGURES = {
    channel: PaperFigure(_FILES[channel], stated.figure, stated.value) for channel, stated in LARGEST_REYNOLDS.items()
}
"""Figures by channel, with Re_max of their captions."""


def more_figures(dataset: xr.Dataset) -> dict[str, Picture]:
    """Figures of this paper only: `drop`, the loss of speed from the wide to the narrow channel."""
    if "channel" not in dataset.dims:
        return {}
    drop = drop_picture(StudyView.of(dataset, PAPER_FIGURES))
    return {} if drop is None else {"drop": drop}
