"""Figures of a calibration: observed against predicted, residuals, posterior marginals and pairs, profiles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, MaxNLocator

from spirillum.arrays import Samples
from spirillum.calibration.least_squares import PRIOR_DISCREPANCY
from spirillum.display import label_of_model, percent
from spirillum.units import Hz
from spirillum.view.figures.rows import HOLLOW, draw_band, draw_means
from spirillum.view.figures.sheet import Sheet, width_of
from spirillum.view.figures.study_panels import spread
from spirillum.view.figures.style import (
    COLOURS,
    PAGE,
    PATCH,
    WHITE_BOX,
    UnitPrefix,
    in_words,
    look_of_model,
    plain,
    styled,
)

if TYPE_CHECKING:
    from spirillum.calibration.calibrated import Calibrated
    from spirillum.calibration.experiment import Quantity
    from spirillum.calibration.identifiability import LikelihoodProfile
    from spirillum.calibration.least_squares import LeastSquares


_MOST = 6  # numbers of the figure: more would leave no room for a pair's contours
_LETTERS = 13  # letters of a line below a panel
_MARGIN = 1.0  # room for the labels beside the cells, inches
_LIMIT = 3.84  # misfit at the limits of a 95 % interval: chi squared of one degree of freedom
_BINS = 32


def posterior_figure(found: Calibrated) -> Figure:
    """Marginals on the diagonal, pairs below it; a note lists parameters beyond the sixth."""
    posterior = found.posterior
    assert posterior is not None  # noqa: S101 - drawn for a posterior only
    every = {name: values.reshape(-1) for name, values in posterior.values().items()}
    names = list(every)[:_MOST]
    scales = _scales(found, {name: every[name] for name in names})
    drawn = {name: every[name] / scales[name].factor for name in names}
    count = len(names)
    colour = look_of_model(found.problem.model.name).colour
    with styled():
        words = f"{_source(found)}, model {found.problem.model.name}"
        words += "; contours contain 50 and 95 % of the draws" if count > 1 else ""
        words += f"; {len(every) - count} more are in posterior.nc" if len(every) > count else ""
        sheet = Sheet(
            "Posterior of the fitted numbers",
            words,
            heights=[min((PAGE - _MARGIN) / count, 2.0) - 0.1] * count,
            columns=count,
            letters=False,
            sharey=False,
        )
        for row, below in enumerate(names):
            for column, name in enumerate(names):
                axes = sheet.panels[row, column]
                if column > row:
                    axes.remove()
                    continue
                if row == column:
                    _marginal(axes, drawn[name], colour)
                else:
                    _pair(axes, drawn[name], drawn[below], colour)
                _ticks(axes, left=column == 0 and row > 0, bottom=row == count - 1)
                if row == count - 1:
                    axes.set_xlabel(_label(name) + _unit(scales[name], "\n"), fontsize=7)
                if column == 0 and row > 0:
                    axes.set_ylabel(_label(below) + _unit(scales[below], "\n"), fontsize=7)
        return sheet.finished()


def _scales(found: Calibrated, values: Mapping[str, Samples]) -> dict[str, UnitPrefix]:
    """Units of numbers by their labels; that of a discrepancy or a factor is empty."""
    units = {item.label: item.parameter.unit for item in found.problem.coordinates}
    return {
        label: UnitPrefix.of(np.abs(column), units[label]) if units.get(label) else UnitPrefix(1.0, "")
        for label, column in values.items()
    }


def _unit(scale: UnitPrefix, between: str) -> str:
    """A unit in brackets after a name; empty for a plain number."""
    return f"{between}({scale.unit})" if scale.unit else ""


def _label(name: str) -> str:
    """A number's name in lines that fit below a panel; its channel stays together."""
    words, bracket, channel = name.replace("_", " ").partition("[")
    lines = wrap(words, _LETTERS)
    return "\n".join([*lines, bracket + channel] if bracket else lines)


def _window(values: Samples) -> tuple[float, float]:
    low, high = np.quantile(values, [0.002, 0.998])
    room = 0.05 * (high - low) or 0.01 * abs(high) or 1e-12
    return float(low - room), float(high + room)


def _marginal(axes: Axes, values: Samples, colour: str) -> None:
    axes.hist(values, bins=_BINS, range=_window(values), color=colour, alpha=0.35, linewidth=0.0)
    axes.hist(values, bins=_BINS, range=_window(values), color=colour, histtype="step", linewidth=1.0)
    for quantile in np.quantile(values, [0.025, 0.975]):
        axes.axvline(float(quantile), color="#444444", linewidth=0.8, linestyle=":")
    axes.set_xlim(_window(values))
    axes.set_yticks([])


def _pair(axes: Axes, x: Samples, y: Samples, colour: str) -> None:
    """Regions that contain 95 and 50 % of the draws."""
    window = (_window(x), _window(y))
    counts, xs, ys = np.histogram2d(x, y, bins=_BINS, range=window)
    smooth = counts
    for axis in (0, 1):
        smooth = 0.5 * smooth + 0.25 * (np.roll(smooth, 1, axis) + np.roll(smooth, -1, axis))
    ranked = np.sort(smooth.ravel())[::-1]
    share = np.cumsum(ranked) / ranked.sum()
    levels = sorted({float(ranked[np.searchsorted(share, level)]) for level in (0.95, 0.5)})
    if len(levels) == 2 and levels[0] > 0:
        middle_x, middle_y = 0.5 * (xs[1:] + xs[:-1]), 0.5 * (ys[1:] + ys[:-1])
        axes.contourf(
            middle_x, middle_y, smooth.T, levels=[*levels, float(ranked[0]) * 1.01], colors=[colour] * 2, alpha=0.3
        )
        axes.contour(middle_x, middle_y, smooth.T, levels=levels, colors=colour, linewidths=0.8)
    else:
        axes.plot(x[::10], y[::10], ".", color=colour, markersize=1.0)
    axes.set_xlim(window[0])
    axes.set_ylim(window[1])


def _ticks(axes: Axes, *, left: bool, bottom: bool) -> None:
    axes.tick_params(labelleft=left, labelbottom=bottom, labelsize=7.0, length=2.0, width=0.5)
    axes.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
    if axes.get_yticks().size:
        axes.yaxis.set_major_locator(MaxNLocator(3, prune="both"))
    for label in axes.get_xticklabels():
        label.set_rotation(40)
    axes.grid(visible=False)


def profile_figure(found: Calibrated, profiles: Sequence[LikelihoodProfile]) -> Figure:
    """Least misfit against each parameter, all others fitted again; the dotted line marks the 95 % interval."""
    columns = min(len(profiles), 4)
    rows = -(-len(profiles) // columns)
    assert found.least_squares is not None  # noqa: S101 - profiles are those of a fit by least squares
    fit = found.least_squares
    held = " and ".join(
        f"{percent(share)} of the {name.replace('_', ' ')} "
        f"({'prior median' if share == PRIOR_DISCREPANCY else 'moments of the residuals'})"
        for name, share in fit.discrepancy.items()
    )
    synthetic = " (synthetic)" if found.experiment.synthetic else ""
    with styled():
        sheet = Sheet(
            "Profile likelihood",
            f"{plain(found.experiment.source, 40)}{synthetic}, model {found.problem.model.name}: least chi squared "
            "above the best fit",
            width=width_of(columns, 1.72),
            heights=[1.3] * rows,
            columns=columns,
            notes=[
                "Dotted: limit of the 95 % interval. A profile that stays below it on a side shows that the number has "
                f"no limit there. The model's discrepancy is held at {held}; "
                "the table's intervals let it vary, and are wider where it may be larger."
            ],
        )
        every = list(sheet.panels.flat)
        scales = _scales(found, {profile.label: profile.values for profile in profiles})
        for axes, profile in zip(every, profiles, strict=False):
            scale = scales[profile.label]
            axes.plot(profile.values / scale.factor, profile.misfit, color=COLOURS["blue"], marker="o", markersize=2.5)
            axes.axhline(_LIMIT, color="#444444", linewidth=0.8, linestyle=":")
            axes.set_ylim(0.0, 3.2 * _LIMIT)
            axes.set_xlabel(_label(profile.label).replace("\n", " ") + _unit(scale, " "), fontsize=7.5)
            axes.xaxis.set_major_locator(MaxNLocator(3))
            axes.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4))
        for axes in every[len(profiles) :]:
            axes.remove()
        for row in sheet.panels:
            row[0].set_ylabel(r"$\Delta\chi^2$")
        return sheet.finished()


_MOST_COLUMNS = 5
_MOST_NAMES = 36
_MOST_TICKS = 5
_OBSERVED = COLOURS["black"]
_NAMES: dict[Quantity, str] = {
    "advance": r"speed per tail rate $U_x/\omega$",
    "turning": r"body over tail rate $\Omega_x/\omega$",
    "motor_rate": r"motor rate $\omega_m$",
}


def calibration_figures(found: Calibrated) -> dict[str, Figure]:
    """All figures by name."""
    return {name: draw() for name, draw in calibration_drawings(found).items()}


def calibration_drawings(found: Calibrated) -> dict[str, Callable[[], Figure]]:
    """What draws each figure, by name."""
    drawings: dict[str, Callable[[], Figure]] = {
        f"observed-{diameter * 1e3:g}mm": partial(observed_figure, found, index)
        for index, diameter in enumerate(found.experiment.channels)
    }
    drawings["residuals"] = partial(residual_figure, found)
    if found.posterior is not None:
        drawings["posterior"] = partial(posterior_figure, found)
    if found.least_squares is not None:
        drawings["profiles"] = partial(_profiles, found, found.least_squares)
    return drawings


def _profiles(found: Calibrated, fit: LeastSquares) -> Figure:
    from spirillum.calibration.identifiability import profiles

    return profile_figure(found, profiles(found.problem, fit))


def _source(found: Calibrated) -> str:
    what = "synthetic, no measured data" if found.experiment.synthetic else "observed"
    return f"{plain(found.experiment.source, 40)} ({what})"


def _fit_words(found: Calibrated, channel: int | None = None) -> str:
    """The fitted numbers that act, in one channel or in all, with their units; a name and its channel stay together."""
    values = [
        f"{plain(item.label)} {_with_unit(found.values[item.label].value, item.parameter.unit)}".replace(" ", "\u00a0")
        for item in found.problem.coordinates
        if channel is None or item.channel in (None, channel)
    ]
    return f"model {label_of_model(found.problem.model.name)}, method {found.method}: {', '.join(values)}"


def _with_unit(value: float, unit: str) -> str:
    return in_words(value, unit, 3) if unit else f"{value:.3g}"


def observed_figure(found: Calibrated, channel: int) -> Figure:
    """The panels a) to l) of the paper's Figs 5 and 6 for one channel: speed, motor rate, effective friction."""
    experiment = found.experiment
    inside = experiment.channel == channel
    amplitudes = np.unique(np.array([robot.tail.amplitude for robot in experiment.robots])[inside].round(9))
    columns = [float(amplitudes[n]) for n in spread(amplitudes.size, _MOST_COLUMNS)]
    rows = _rows(found)
    waves = 1e3 * np.array([robot.tail.wavelength for robot in experiment.robots])[inside]
    room = 0.06 * float(np.ptp(waves)) or 1.0
    ends = (float(waves.min()) - room, float(waves.max()) + room)
    model = found.problem.model.name
    with styled():
        look = look_of_model(model)
        label = "synthetic" if experiment.synthetic else "observed"
        handles = [
            Line2D([], [], color=look.colour, linestyle=look.line, marker=look.marker, label=label_of_model(model)),
            Line2D([], [], color=_OBSERVED, **HOLLOW, label=f"{label}, 95 % interval at the mean rate"),
        ]
        notes = [
            _fit_words(found, channel),
            "Bars are those of the observed ratios to the rate, at its mean: how the rate varies between trials is not "
            "in them.",
        ]
        if any(np.any(np.isfinite(row["low"])) for row in rows):
            notes.append("Shades: 95 % of a tail's own mean as the fit expects it, the model's discrepancy included.")
        if found.friction:
            notes.append(f"$B_{{eff}}$ follows from (18) at the observed motor rate, friction model '{found.reading}'.")
        if len(columns) < amplitudes.size:
            notes.append(f"Shown: {len(columns)} of {amplitudes.size} amplitudes.")
        sheet = Sheet(
            f"Channel of {experiment.channels[channel] * 1e3:g} mm: fitted model against {label} means",
            _source(found),
            width=width_of(len(columns), 1.72),
            heights=[1.5] * len(rows),
            columns=len(columns),
            notes=notes,
            legend=handles,
        )
        for row, axes_row in zip(rows, sheet.panels, strict=True):
            for amplitude, axes in zip(columns, axes_row, strict=True):
                here = inside & np.array([abs(r.tail.amplitude - amplitude) < 1e-9 for r in experiment.robots])
                _draw(axes, found, row, here)
            axes_row[0].set_ylabel(row["label"])
            for axes in axes_row:
                axes.set_xlim(*ends)
            _from_zero(axes_row[0], row, inside)
        for amplitude, axes in zip(columns, sheet.panels[0], strict=True):
            axes.set_title(f"$B_o$ = {amplitude * 1e3:g} mm", fontsize=9)
        for axes in sheet.panels[-1]:
            axes.set_xlabel(r"wavelength $\lambda$ (mm)")
        few = np.unique(waves.round(6))
        for axes in sheet.panels.flat:
            axes.tick_params(labelbottom=axes in sheet.panels[-1])
            axes.xaxis.set_major_locator(
                FixedLocator(list(few)) if few.size <= _MOST_TICKS else MaxNLocator(4, integer=True)
            )
        return sheet.finished(alike=True)


def _from_zero(axes: Axes, row: dict[str, Any], inside: np.ndarray) -> None:
    """Start the axis at zero where all is of one sign; that of a left-handed robot's rates is negative."""
    ends = np.concatenate([row[name][inside] for name in ("values", "low", "high", "seen")])
    if np.all(row["positive"]):
        axes.set_ylim(0.0, 1.08 * float(np.nanmax(ends)))
    elif not np.any(row["positive"]):
        axes.set_ylim(1.08 * float(np.nanmin(ends)), 0.0)


def _rows(found: Calibrated) -> list[dict[str, Any]]:
    """Content of each row, in its unit: observed, half width, predicted with limits."""
    experiment, rows = found.experiment, []
    rate = np.where(experiment.by_motor, experiment.motor_rate.mean, experiment.tail_rate)
    if "advance" in found.predicted:
        values, low, high = (rate * column for column in found.predicted["advance"])
        half = np.abs(rate) * _half_width(found, "advance")
        scale = UnitPrefix.of(np.abs(values), "m/s")
        rows.append(
            _row(f"$U_x$ ({scale.unit})", scale.factor, rate * experiment.advance.mean, half, (values, low, high))
        )
    if "motor_rate" in found.predicted:
        half = _half_width(found, "motor_rate")
        rows.append(_row(r"$\omega_m$ (Hz)", Hz, experiment.motor_rate.mean, half, found.predicted["motor_rate"]))
    elif "turning" in found.predicted:
        values, low, high = (experiment.tail_rate * (1.0 - column) for column in found.predicted["turning"])
        half = np.abs(experiment.tail_rate) * _half_width(found, "turning")
        rows.append(_row(r"$\omega_m$ (Hz)", Hz, experiment.motor_rate.mean, half, (values, low, high)))
    if found.friction:
        middle = np.array([item.value for item in found.friction])
        ends = (np.array([item.low for item in found.friction]), np.array([item.high for item in found.friction]))
        scale = UnitPrefix.of(np.abs(middle), "N m s/rad")
        unknown = np.full(middle.size, np.nan)
        rows.append(_row(f"$B_{{eff}}$ ({scale.unit})", scale.factor, unknown, unknown, (middle, *ends)))
    return rows


def _row(label: str, factor: float, seen: Samples, half: Samples, predicted: tuple[Samples, ...]) -> dict[str, Any]:
    values, low, high = (column / factor for column in predicted)
    known = np.concatenate([values[np.isfinite(values)], (seen / factor)[np.isfinite(seen)]])
    return {
        "label": label,
        "seen": seen / factor,
        "half": half / factor,
        "values": values,
        "low": np.minimum(low, high),
        "high": np.maximum(low, high),
        "positive": known >= 0,
    }


def _half_width(found: Calibrated, name: Quantity) -> Samples:
    """Half width of the 95 % interval of each observed mean."""
    ratio = found.problem.ratio(name)
    error = found.error.get(name, ratio.pooled_error)
    return 1.96 * ratio.error_of_mean(error)


def _draw(axes: Axes, found: Calibrated, row: dict[str, Any], here: np.ndarray) -> None:
    look = look_of_model(found.problem.model.name)
    x = np.array([robot.tail.wavelength for robot in found.experiment.robots])[here] * 1e3
    order = np.argsort(x)
    x = x[order]
    values, low, high, seen, half = (row[name][here][order] for name in ("values", "low", "high", "seen", "half"))
    draw_band(axes, x, low, high, look, joined=True)
    axes.plot(x, values, color=look.colour, linestyle=look.line, marker=look.marker)
    if np.any(np.isfinite(seen)):
        draw_means(axes, x, seen, half, hollow=True)


def residual_figure(found: Calibrated) -> Figure:
    """Observed over predicted less one, robot by robot, with the errors of the means and the model's discrepancy."""
    names = list(found.predicted)
    experiment = found.experiment
    with styled():
        handles = [Line2D([], [], color=_OBSERVED, linestyle="none", marker="D", label="95 % interval of the mean")]
        if found.discrepancy:
            patch = Line2D([], [], color=COLOURS["orange"], alpha=0.35, **PATCH, label="discrepancy, two sigma")
            handles.append(patch)
        sheet = Sheet(
            "Residuals of the fitted model",
            _source(found),
            heights=[1.5] * len(names),
            notes=[_fit_words(found), "Tails in each channel by wavelength, then amplitude."],
            legend=handles,
        )
        tails = [robot.tail for robot in experiment.robots]
        order = sorted(
            range(experiment.size), key=lambda n: (experiment.channel[n], tails[n].wavelength, tails[n].amplitude)
        )
        edges = [n for n in range(1, len(order)) if experiment.channel[order[n]] != experiment.channel[order[n - 1]]]
        for name, axes in zip(names, sheet.panels.flat, strict=True):
            _draw_residuals(axes, found, name, order)
            for edge in edges:
                axes.axvline(edge - 0.5, color="#888888", linewidth=0.8)
            axes.set_title(_NAMES[name], fontsize=9)
            axes.set_ylabel("observed/model − 1 (%)")
        last = sheet.panels[-1, 0]
        last.set_xlabel("tail: wavelength x amplitude (mm)")
        shown = spread(len(order), _MOST_NAMES)
        names_of_tails = [f"{tails[order[n]].wavelength * 1e3:g} x {tails[order[n]].amplitude * 1e3:g}" for n in shown]
        for axes in sheet.panels.flat:
            axes.set_xticks(list(shown), [""] * len(shown))
        last.set_xticks(list(shown), names_of_tails, rotation=90, fontsize=7)
        low, high = last.get_ylim()
        last.set_ylim(low - 0.22 * (high - low), high)  # room for the names of the channels
        for start, stop in zip([0, *edges], [*edges, len(order)], strict=True):
            diameter = experiment.channels[int(experiment.channel[order[start]])] * 1e3
            last.text(
                (0.5 * (start + stop) - 0.5),
                0.05,
                f"channel of {diameter:g} mm",
                transform=last.get_xaxis_transform(),
                ha="center",
                size=8,
                bbox=WHITE_BOX,
            )
        return sheet.finished()


def _draw_residuals(axes: Axes, found: Calibrated, name: Quantity, order: list[int]) -> None:
    ratio, values = found.problem.ratio(name), found.predicted[name][0]
    left = 100.0 * (ratio.mean / values - 1.0)[order]
    half = 100.0 * np.abs(_half_width(found, name) / values)[order]
    x = np.arange(len(order), dtype=float)
    if name in found.discrepancy:
        width = 200.0 * found.discrepancy[name].value
        axes.axhspan(-width, width, color=COLOURS["orange"], alpha=0.25, linewidth=0.0)
    axes.axhline(0.0, color="#444444", linewidth=0.8)
    draw_means(axes, x, left, half)
    axes.set_xlim(-0.7, len(order) - 0.3)
    axes.set_xticks([])
