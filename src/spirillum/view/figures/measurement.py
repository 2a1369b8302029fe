"""Figures of a measurement: the series of a trial with their residuals, and the trials side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from spirillum.arrays import Samples
from spirillum.measurement.outliers import LEADING
from spirillum.measurement.rates import Rate
from spirillum.measurement.trials import RATE_NAMES, Trial
from spirillum.quantities import unit_of
from spirillum.view.figures.sheet import Picture, Sheet
from spirillum.view.figures.style import COLOURS, PAGE, PATCH, UnitPrefix, new_figure, plain

if TYPE_CHECKING:
    from spirillum.measurement.measure import Measurement

_MOST_POINTS = 4000
_LEFT_OUT = "#999999"
_SERIES = (
    ("forward_velocity", "position", "m"),
    ("body_rotation_rate", "body's angle", "turn"),
    ("tail_rotation_rate", "tail's phase", "turn"),
)


def measurement_figures(measurement: Measurement) -> dict[str, Picture]:
    """The figures of a measurement by the names of their files."""
    found = {}
    if len(measurement.trials) > 1:
        found["trials"] = Picture(
            "The trials",
            "Each trial with its own 95 % interval (where it is wider than the dot), and the mean over trials with "
            "Student's interval (band), which for the velocity holds the shared uncertainty of the scale.",
            "Speeds and rates of the trials with error bars, and the band of their mean",
            lambda: trials_figure(measurement),
        )
    for trial in measurement.trials:
        found[f"series-{trial.name}"] = Picture(
            f"Series of {plain(trial.name)}",
            "Left: what was seen on every frame (dots) and the fit, a line, or a cubic where the rate changes; grey "
            "are frames that were left out of it: stray ones, and the first six of a compressed film whose first "
            "picture is ahead. Right: residuals.",
            f"Position, body angle and tail phase of {plain(trial.name)} over time, with residuals",
            lambda trial=trial: trial_figure(trial),  # type: ignore[misc]
        )
    return found


def trial_figure(trial: Trial) -> Figure:
    """Series of a trial with their lines, and their residuals."""
    figure = new_figure(PAGE, 5.4)
    figure.set_layout_engine("constrained")
    panels = figure.subplots(3, 2, sharex=True, gridspec_kw={"width_ratios": (1.25, 1.0)})
    track = trial.track
    values = {
        "forward_velocity": track.position[:, 0],
        "body_rotation_rate": track.body_angle,
        "tail_rotation_rate": track.tail_phase,
    }
    for (left, right), (name, words, unit) in zip(panels, _SERIES, strict=True):
        _series(left, right, track.time, values[name], trial.fits[name], words, unit)
        spoiled = trial.quantities[name].reason if not np.isfinite(trial.quantities[name].value) else ""
        if spoiled:
            left.text(0.02, 0.96, "not given: see the flags", transform=left.transAxes, va="top", color="#9c3d00")
    for axes in panels[-1]:
        axes.set_xlabel("time (s)")
    left_out = {name: _omitted_frames(values[name], trial.fits[name]) for name, _, _ in _SERIES}
    panels[0][0].set_title(f"measured, with the fit{_omission_legend(list(left_out.values()))}", loc="left")
    panels[0][1].set_title("residuals", loc="left")
    if trial.synthetic:  # as the metadata of the video declares
        figure.supxlabel("synthetic", x=0.99, ha="right", size=8.0, color="#9c3d00")
    figure.align_ylabels()
    return figure


def _series(left: Axes, right: Axes, time: Samples, values: Samples, rate: Rate, words: str, unit: str) -> None:
    known = np.isfinite(values)
    if not known.any():
        for axes in (left, right):
            axes.text(0.5, 0.5, "not seen", transform=axes.transAxes, ha="center", color="#777777")
        left.set_ylabel(words)
        return
    values = values - values[known][0]
    scale = UnitPrefix.of(values, "m") if unit == "m" else UnitPrefix(2 * np.pi, "turns")
    few = slice(None, None, max(1, time.size // _MOST_POINTS))
    out = _omitted_frames(values, rate)
    for shown, colour in ((~out, COLOURS["sky"]), (out, _LEFT_OUT)):
        dots = np.where(shown, scale(values), np.nan)
        left.plot(time[few], dots[few], ".", color=colour, markersize=2.5, rasterized=True)
    left.set_ylabel(f"{words} ({scale.unit})")
    if not rate.measured or rate.residual.size != time.size:
        return
    line = values - rate.residual
    left.plot(time[known], scale(line)[known], "-", color=COLOURS["black"], linewidth=0.9)
    if not np.isfinite(rate.low):  # a line through two readings leaves nothing but rounding
        right.text(0.5, 0.5, "two readings", transform=right.transAxes, ha="center", color="#777777")
        return
    small = UnitPrefix.of(rate.residual, "m" if unit == "m" else "rad")
    right.plot(time[few], small(rate.residual)[few], ".", color=COLOURS["blue"], markersize=2.0, rasterized=True)
    right.axhline(0.0, color="#444444", linewidth=0.6)
    right.set_ylabel(f"residual ({small.unit})")


def _omitted_frames(values: Samples, rate: Rate) -> np.ndarray:
    """Frames that were read and are left out of the line, (n,)."""
    if rate.residual.size != values.size:
        return np.zeros(values.shape, dtype=bool)
    return np.isfinite(values) & ~np.isfinite(rate.residual)


def _omission_legend(left_out: Sequence[np.ndarray]) -> str:
    """Explain the grey dots: omitted first frames of a compressed video, and outliers."""
    lead = any(out.size > LEADING and out[:LEADING].all() for out in left_out)
    stray = any(out[LEADING if lead else 0 :].any() for out in left_out)
    words = [*(["first"] if lead else []), *(["stray"] if stray else [])]
    return f"\ngrey, left out: {' and '.join(words)} frames" if words else ""


def trials_figure(measurement: Measurement) -> Figure:
    """Speeds and rates of all trials, with the mean over them."""
    colour = COLOURS["blue"]
    sheet = Sheet(
        f"{plain(measurement.robot.name, 60)}: {len(measurement.trials)} trials",
        "synthetic, nothing is measured" if any(trial.synthetic for trial in measurement.trials) else "measured",
        width=PAGE,
        heights=[1.7],
        columns=4,
        sharey="none",
        legend=[
            Line2D(
                [], [], color=colour, marker="o", markersize=3.0, linestyle="none", label="trial, its own 95 % interval"
            ),
            Line2D([], [], color="#444444", linewidth=0.8, label="mean"),
            Line2D([], [], color="#dddddd", **PATCH, label="its 95 % interval over trials"),
        ],
    )
    for axes, name in zip(sheet.panels.flat, RATE_NAMES, strict=True):
        items = [trial.quantities[name] for trial in measurement.trials]
        values = np.array([item.value for item in items])
        scale = UnitPrefix.of(values, unit_of(name))
        at = np.arange(1.0, len(items) + 1.0)
        mean = measurement.summary.quantities[name]
        if np.isfinite(mean.low):
            axes.axhspan(mean.low / scale.factor, mean.high / scale.factor, color="#dddddd", zorder=0)
        if np.isfinite(mean.value):
            axes.axhline(mean.value / scale.factor, color="#444444", linewidth=0.8)
        reach = np.array([[item.value - item.low for item in items], [item.high - item.value for item in items]])
        reach = np.where(np.isfinite(reach), reach, 0.0) / scale.factor
        axes.errorbar(at, scale(values), yerr=reach, fmt="o", color=colour, markersize=3.0, capsize=2.5)
        whose, _, what = name.replace("_", " ").rpartition(" ")
        axes.set_title(f"{whose}\n{what} ({scale.unit})", fontsize=8.0)
        axes.set_xlim(0.4, len(items) + 0.6)
        axes.set_xticks(at if len(items) <= 8 else [1.0, float(len(items))])
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
        axes.set_xlabel("trial")
        if not np.isfinite(values).any():
            axes.set_yticks([])
            axes.text(0.5, 0.5, "not measured", transform=axes.transAxes, ha="center", color="#777777")
    return sheet.finished()
