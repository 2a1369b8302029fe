"""Figures of a study: panels for each channel, the upper bound of the speed, lists of robots."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from spirillum.view.figures.rows import (
    PanelRow,
    amplitude_handles,
    bound_row,
    grid_rows,
    model_handles,
    robot_rows,
    settled_handles,
)
from spirillum.view.figures.sheet import Picture, Sheet, width_of
from spirillum.view.figures.study_panels import PaperFigure, StudyView, head_column, spread, tail_axis
from spirillum.view.figures.style import UnitPrefix, distinct_labels, plain

if TYPE_CHECKING:
    import xarray as xr

PANEL = (1.72, 1.5)  #: Width and height of a panel of a grid of tails, inches.
MOST_COLUMNS = 5  #: Wavelengths of one figure.
MOST_FIGURES = 4  #: Figures of the channels of one study.
MOST_CHANNELS = 4  #: Channels of the figure of the upper bound.
MOST_TAILS = 200  #: Amplitudes of one panel.
MOST_ROBOTS = 2000  #: Listed robots of one panel.
NAMED_ROBOTS = 60  #: Listed robots that are named; more are numbered.
_TICK_LETTER = 0.066  # width of a letter of a tick label, inches
_DASHED = (0, (4.0, 2.0))


def study_figures(dataset: xr.Dataset, paper_figures: Mapping[str, PaperFigure] | None = None) -> dict[str, Picture]:
    """The figures of a study by file name: those of a paper's channels, `channel-<name>`, `bound`, or `robots`."""
    shown = StudyView.of(dataset, paper_figures)
    if not shown.grid:
        return {"robots": _robots_picture(shown)}
    found: dict[str, Picture] = {}
    channels = spread(dataset.sizes["channel"], MOST_FIGURES)
    pages = _pages(dataset.sizes["wavelength"], max(MOST_FIGURES // len(channels), 1))
    for channel in channels:
        for number, wavelengths in enumerate(pages):
            ending = f"-part{number + 1}" if len(pages) > 1 else ""
            name = _free_name(_file_name(shown, channel) + ending, found)
            part = f" · part {number + 1} of {len(pages)}" if len(pages) > 1 else ""
            left_out = _omitted_note(shown, sum(map(len, pages)), len(channels))
            found[name] = _channel_picture(shown, channel, wavelengths, part, left_out)
    found[_free_name("bound", found)] = _bound_picture(shown)
    return found


def _pages(count: int, most: int) -> list[list[int]]:
    """Indices of the wavelengths on each figure, as evenly distributed as possible."""
    indices = spread(count, most * MOST_COLUMNS)
    pages = -(-len(indices) // MOST_COLUMNS)
    return [list(map(int, page)) for page in np.array_split(indices, pages)]


def _file_name(shown: StudyView, channel: int) -> str:
    name = str(shown.whole["channel"].values[channel])
    if name in shown.paper_figures:
        return shown.paper_figures[name].file
    return f"channel-{re.sub('[^a-z0-9]+', '-', name.lower()).strip('-')[:60] or 'unnamed'}"


def _free_name(name: str, taken: dict[str, Picture]) -> str:
    number, free = 2, name
    while free in taken:
        free = f"{name}-{number}"
        number += 1
    return free


def _channel_title(shown: StudyView, channel: int) -> str:
    name = plain(str(shown.whole["channel"].values[channel]), 40)
    diameter = np.asarray(shown.whole["channel_diameter"].values, dtype=float)[[channel]]
    if not np.isfinite(diameter[0]):
        return f"{name}: no channel"
    scale = UnitPrefix.of(diameter, "m")
    return f"{name[:1].upper()}{name[1:]} channel, $D_{{ch}}$ = {diameter[0] / scale.factor:.4g} {scale.unit}"


def _omitted_note(shown: StudyView, wavelengths: int, channels: int) -> str:
    """Note on omitted robots; empty if there are none."""
    sizes = shown.whole.sizes
    parts = []
    if wavelengths < sizes["wavelength"]:
        parts.append(f"{wavelengths} of {sizes['wavelength']} wavelengths")
    if sizes["amplitude"] > MOST_TAILS:
        parts.append(f"{MOST_TAILS} of {sizes['amplitude']} amplitudes")
    if channels < sizes["channel"]:
        parts.append(f"{channels} of {sizes['channel']} channels")
    return f"Shown: {', '.join(parts)}; the dataset holds all." if parts else ""


def _picture(
    shown: StudyView, title: str, notes: Sequence[str], alternative: str, draw: Callable[[list[str]], Figure]
) -> Picture:
    """A picture of a study with its notes, which `draw` takes too; empty ones are left out."""
    said = [note for note in notes if note]
    caption, words = " ".join([shown.source_line, *said]), f"{alternative} {shown.source_line}"
    return Picture.of(title, caption, words, partial(draw, said))


def _channel_picture(shown: StudyView, channel: int, wavelengths: list[int], page: str, left_out: str) -> Picture:
    name = str(shown.whole["channel"].values[channel])
    title = _channel_title(shown, channel)
    if name in shown.paper_figures:
        title = f"{title} · layout of {shown.paper_figures[name].label} of the paper"
    title = f"{title}{page}"
    rows = grid_rows(shown)
    what = "; ".join(" ".join(row.label.split("\n")[:1]) for row in rows)
    amplitudes = spread(shown.whole.sizes["amplitude"], MOST_TAILS)
    part = shown.part(channel=channel, wavelength=wavelengths)
    alternative = (
        f"{len(rows) * len(wavelengths)} panels, one column for each of {len(wavelengths)} wavelengths, against "
        f"the wave amplitude. Rows: {what}."
    )
    notes = [*(row.tells for row in rows), part.unanswered(), left_out]
    draw = partial(_draw_channel, shown, channel, wavelengths, amplitudes, title, rows)
    return _picture(shown, title, notes, alternative, draw)


def _draw_channel(
    shown: StudyView,
    channel: int,
    wavelengths: list[int],
    amplitudes: list[int],
    title: str,
    rows: Sequence[PanelRow],
    notes: Sequence[str],
) -> Figure:
    sheet = Sheet(
        title,
        shown.source_line,
        width=width_of(len(wavelengths), PANEL[0]),
        heights=[PANEL[1]] * len(rows),
        columns=len(wavelengths),
        notes=notes,
        legend=model_handles(shown, own_drive=not shown.observed),
        legend_below=amplitude_handles(shown) if rows[-1].across == "rates" else (),
    )
    scale = UnitPrefix.of(np.asarray(shown.whole["amplitude"].values, dtype=float), "m")
    for number, row in enumerate(rows):
        labelled = number == len(rows) - 1 or rows[number + 1].across != row.across
        for axes, wavelength in zip(sheet.panels[number], wavelengths, strict=True):
            part = shown.part(channel=channel, wavelength=wavelength)
            x = scale(np.asarray(shown.whole["amplitude"].values, dtype=float)[amplitudes])
            row.draw(axes, part if row.across == "rates" else part.part(amplitude=amplitudes), x)
            if row.across == "tails":
                tail_axis(axes, x)
            axes.tick_params(labelbottom=labelled)
            if labelled:
                rate = row.across == "rates"
                axes.set_xlabel("assumed $\\omega_m$ (Hz)" if rate else f"amplitude $B_o$ ({scale.unit})")
            if number == 0:
                head_column(axes, shown, wavelength)
        _finish_row(sheet.panels[number], row)
    return sheet.finished(alike=True)


def _finish_row(panels: Sequence[Axes], row: PanelRow) -> None:
    """Vertical axis of a row: shared, from zero where everything is positive."""
    panels[0].set_ylabel(row.label)
    heights = [
        np.asarray(line.get_ydata(), dtype=float)[np.isfinite(np.asarray(line.get_xdata(), dtype=float))]
        for axes in panels
        for line in axes.get_lines()
    ]
    values = np.concatenate([np.ravel(h) for h in heights]) if heights else np.empty(0)
    values = values[np.isfinite(values)]
    if not values.size:
        panels[0].set_ylim(0.0, 1.0)
        return
    if row.logarithmic:
        panels[0].set_yscale("log")
        low, high = 0.6 * float(values.min()), 1.6 * float(values.max())
        stretch = max(np.sqrt(12.0 * low / high), 1.0)  # more than a decade, so that two powers of ten are labelled
        panels[0].set_ylim(low / stretch, high * stretch)
        panels[0].yaxis.set_major_locator(LogLocator(numticks=6))
        panels[0].yaxis.set_minor_locator(NullLocator())  # each of its many marks takes as long as a label
        return
    panels[0].yaxis.set_major_locator(MaxNLocator(5))
    if float(values.min()) >= 0.0:
        low, high = panels[0].get_ylim()
        panels[0].set_ylim(0.0, max(high, 1.08 * float(values.max()), low + 1e-300))


def _bound_picture(shown: StudyView) -> Picture:
    channels = spread(shown.whole.sizes["channel"], MOST_CHANNELS)
    wavelengths = spread(shown.whole.sizes["wavelength"], MOST_COLUMNS)
    bound = shown.upper_bound
    whole_bound = ": an upper bound" if bound and not shown.shaded else ""
    title = f"Forward velocity without contact friction{whole_bound}" if bound else "Forward velocity, own drive"
    notes = []
    if bound:
        notes.append(
            f"The motor turns {' or '.join(_frictions(shown))}; contact with the channel slows a real robot down."
        )
    if any(shown.paper_speed(channel) for channel in channels):
        notes.append(
            "Dashed black: the speed behind the paper's largest Reynolds number if its length is the body's diameter "
            "(the paper does not specify it), $U\\,=\\,Re\\,\\mu/(\\rho\\,D_b)$."
        )
    part = shown.part(channel=channels, wavelength=wavelengths)
    settled = bound_row(shown).tells if shown.settled else ""
    left_out = _omitted_note(shown, len(wavelengths), len(channels))
    notes += [settled, shown.pose_words, part.unanswered(), left_out]
    alternative = (
        f"{len(channels) * len(wavelengths)} panels, a row for each channel and a column for each wavelength: forward "
        f"velocity against wave amplitude{' as an upper bound' if whole_bound else ''}."
    )
    return _picture(shown, title, notes, alternative, lambda _: _draw_bound(shown, channels, wavelengths, title))


def _frictions(shown: StudyView) -> list[str]:
    """Friction models of the plotted motors, with marks if there are several."""
    words = {"none": "as fast as it can against the fluid alone", "rotor": "with the rotor's own friction"}
    readings = shown.free_friction_models
    found = [words.get(reading, f"with friction model '{reading}'") for reading in readings]
    marks = ("filled", "hollow")
    return found if len(found) == 1 else [f"{one} ({mark})" for one, mark in zip(found, marks, strict=False)]


def _draw_bound(shown: StudyView, channels: list[int], wavelengths: list[int], title: str) -> Figure:
    speed_scale = shown.scale("m/s", "forward_velocity", friction=list(shown.free_friction_models))
    legend = [
        *model_handles(shown, own_drive=True),
        *settled_handles(shown),
        *_paper_entry(shown, channels, speed_scale),
    ]
    sheet = Sheet(
        title,
        shown.source_line,
        width=width_of(len(wavelengths), PANEL[0]),
        heights=[PANEL[1]] * len(channels),
        columns=len(wavelengths),
        legend=legend,
    )
    amplitudes = spread(shown.whole.sizes["amplitude"], MOST_TAILS)
    values = np.asarray(shown.whole["amplitude"].values, dtype=float)
    scale = UnitPrefix.of(values, "m")
    x = scale(values[amplitudes])
    row = bound_row(shown)
    for number, channel in enumerate(channels):
        name = plain(str(shown.whole["channel"].values[channel]), 22)
        for axes, wavelength in zip(sheet.panels[number], wavelengths, strict=True):
            row.draw(axes, shown.part(channel=channel, wavelength=wavelength, amplitude=amplitudes), x)
            tail_axis(axes, x)
            last = number == len(channels) - 1
            axes.tick_params(labelbottom=last)
            if last:
                axes.set_xlabel(f"amplitude $B_o$ ({scale.unit})")
            if number == 0:
                head_column(axes, shown, wavelength)
            speed = shown.paper_speed(channel)
            if speed is not None:
                axes.axhline(speed[1] / speed_scale.factor, color="black", linestyle=_DASHED, linewidth=1.0)
        _finish_row(sheet.panels[number], PanelRow(f"{name}\n{shown.bound_words} $U_x$ ({speed_scale.unit})", row.draw))
    ends = [sheet.panels[number][0].get_ylim() for number in range(len(channels))]
    for number in range(len(channels)):  # one scale for all rows, which are there to be compared
        sheet.panels[number][0].set_ylim(min(low for low, _ in ends), max(high for _, high in ends))
    return sheet.finished(alike=True)


def _paper_entry(shown: StudyView, channels: Sequence[int], scale: UnitPrefix) -> list[Line2D]:
    """Legend entry of the speeds behind the paper's largest Reynolds numbers."""
    found = {channel: shown.paper_speed(channel) for channel in channels}
    words = [
        f"{plain(str(shown.whole['channel'].values[channel]), 24)} {speed[1] / scale.factor:.2f}"
        for channel, speed in found.items()
        if speed is not None
    ]
    if not words:
        return []
    label = f"paper's $Re_{{max}}$ if on $D_b$: {', '.join(words)} {scale.unit}"
    return [Line2D([], [], color="black", linestyle=_DASHED, linewidth=1.0, label=label)]


def _robots_picture(shown: StudyView) -> Picture:
    count = shown.whole.sizes["robot"]
    indices = spread(count, MOST_ROBOTS)
    rows = robot_rows(shown)
    title = f"{plain(str(shown.whole.attrs.get('title', 'Robots')), 60)} · {count} robots"
    notes = [*dict.fromkeys(row.tells for row in rows), shown.unanswered()]
    if len(indices) < count:
        notes.append(f"Shown: {len(indices)} of {count} robots, evenly spread; the dataset contains all.")
    what = "; ".join(" ".join(row.label.split("\n")[:1]) for row in rows)
    alternative = f"{len(rows)} panels with a point for each of {len(indices)} robots: {what}."
    return _picture(shown, title, notes, alternative, partial(_draw_robots, shown, indices, title, rows))


def _draw_robots(
    shown: StudyView, indices: list[int], title: str, rows: Sequence[PanelRow], notes: Sequence[str]
) -> Figure:
    names = distinct_labels([str(name) for name in shown.whole["robot"].values[indices]], 28)
    named, longest = len(names) <= NAMED_ROBOTS, max(len(name) for name in names)
    width = min(max(0.45 * len(names), 5.0), 9.0)
    upright = _TICK_LETTER * longest * len(names) < width
    if not upright and 0.3 * len(names) < width:  # room for two lines
        names = [name.replace(", ", ",\n", 1) for name in names]
    legend = [*model_handles(shown, own_drive=not shown.observed), *([] if shown.observed else settled_handles(shown))]
    sheet = Sheet(
        title,
        shown.source_line,
        width=width_of(1, width),
        heights=[1.6] * len(rows),
        notes=notes,
        legend=legend,
    )
    x = np.asarray(indices, dtype=float)
    for number, (row, axes) in enumerate(zip(rows, sheet.panels.flat, strict=True)):
        row.draw(axes, shown.part(robot=indices), x)
        axes.set_xlim(-0.6, shown.whole.sizes["robot"] - 0.4)
        last = number == len(rows) - 1
        if named:
            axes.set_xticks(x, names if last else [""] * len(names), rotation=0 if upright else 90)
        axes.tick_params(labelbottom=last)
        if last and not named:
            axes.set_xlabel("index of the robot in the list, from 0")
        _finish_row([axes], row)
    return sheet.finished()
