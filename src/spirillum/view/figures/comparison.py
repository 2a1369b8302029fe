"""Motions and models beside each other: a prediction, models, why they differ, a study's fastest robots."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, StrMethodFormatter

from spirillum.arrays import Values
from spirillum.display import percent
from spirillum.dynamics.comparison import RELEASED_EFFECT, ModelComparison, estimated_error
from spirillum.errors import InputError
from spirillum.studies.ranking import ENDS, Best, RankedRobot, StudyRanking, unit_of_ranked
from spirillum.swimming.motions import ASSUMPTION
from spirillum.swimming.prediction import Prediction
from spirillum.swimming.preparation import WALLED
from spirillum.units import Hz
from spirillum.view.figures.sheet import Picture, Sheet, write_beside
from spirillum.view.figures.style import (
    COLOURS,
    PAGE,
    WHITE_BOX,
    UnitPrefix,
    distinct_labels,
    look_of_model,
    new_figure,
    plain,
    styled,
)

MOST = 12  #: Robots in the figure.
_ROW, _ENDS = 0.24, 1.2  # inches
_LINE, _WIDE = 0.19, 68  # height of a line of the title, inches, and the characters that it holds
_SMALL_LINE = 0.15  # of one below the title


_NO_WALLS = "The channel's walls are not computed"
_ERROR = "error that the model states of a speed"
_PALE = "pale: less behind it than the errors of both"
_TINT = "#9cc6e0"  # the blue of the best, half as strong


def ranking_picture(ranking: StudyRanking) -> Picture:
    """The headline figure: speed, efficiency and current of the fastest robots, with their bands."""
    count = len(ranking.robots)
    which = f"The {min(MOST, count)} fastest of {count} robots" if count > MOST else f"All {count} robots"
    lines = f" Lines: {ENDS[ranking.kind]}." if ranking.kind else ""
    walls = f" {_NO_WALLS}." if ranking.walls else ""
    caption = (
        f"{which}, by model {ranking.model} with friction model {ranking.friction}; filled: the best of its column, "
        f"{_PALE}.{lines} Bars with caps: {_ERROR}.{walls}"
    )
    title = ranking.message[:1].upper() + ranking.message[1:]
    return Picture.of(plain(title, 160), caption, f"{plain(title, 160)}. {which}.", lambda: _drawn(ranking))


def _drawn(ranking: StudyRanking) -> Figure:
    robots = ranking.robots[:MOST]
    names = [name for name in ranking.quantities if any(np.isfinite(robot.values[name]) for robot in robots)]
    title = fill(plain(ranking.message[:1].upper() + ranking.message[1:], 160), _WIDE)
    by = [f"Model {ranking.model}, friction {ranking.friction}. " + (f"{_NO_WALLS}." if ranking.walls else "")]
    by += [f"{ranking.basis[:1].upper()}{ranking.basis[1:]}."] if ranking.basis else []
    if any(np.isfinite(error) for robot in robots for error in robot.error.values()):
        by.append(f"Bars with caps: {_ERROR}; {_PALE}.")
    more = _LINE * title.count("\n") + _SMALL_LINE * (len(by) - 1)
    figure = new_figure(PAGE, _ENDS + more + _ROW * len(robots))
    panels = figure.subplots(1, len(names), sharey=True, squeeze=False, width_ratios=[1.6] + [1.0] * (len(names) - 1))
    ticks = 4 if len(names) < 4 else 2
    for panel, name in zip(panels[0], names, strict=True):
        _column(
            panel,
            robots,
            name,
            next((best for best in ranking.best if best.quantity == name and not best.alike), None),
            ticks,
            ranking.heading(name, "1"),
        )
    first = panels[0][0]
    first.set_yticks(range(len(robots)), distinct_labels([robot.name for robot in robots], 40))
    first.set_ylim(len(robots) - 0.4, -0.6)
    figure.suptitle(title, x=0.02, y=1.0 - 0.1 / figure.get_figheight(), ha="left", va="top", weight="bold")
    below = (0.32 + _LINE * title.count("\n")) / figure.get_figheight()
    figure.text(0.02, 1.0 - below, "\n".join(by), ha="left", va="top", size="small")
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - _SMALL_LINE * len(by) / figure.get_figheight()))  # below the title
    return figure


def _column(panel: Axes, robots: tuple[RankedRobot, ...], name: str, best: Best | None, ticks: int, title: str) -> None:
    """One quantity of all robots: points, lines over their bands, and bars over the model's stated error."""
    values, low, high, error = (
        np.array([getattr(robot, which)[name] for robot in robots]) for which in ("values", "low", "high", "error")
    )
    bar = np.nan_to_num(error) * np.abs(values)
    scale = _scale(np.concatenate([values + bar, high]), unit_of_ranked(name))
    rows = np.arange(len(robots))
    colour = COLOURS["blue"]
    panel.hlines(rows, scale(low), scale(high), color=colour, linewidth=2.2, alpha=0.35)
    first, near = ((), ()) if best is None else ((best.robot.name, *best.ties), best.within)
    winner, within = (np.array([robot.name in names for robot in robots]) for names in (first, near))
    within &= ~winner
    panel.errorbar(
        scale(values), rows, xerr=np.where(np.isfinite(error), scale(bar), np.nan), fmt="none", ecolor="black",
        capsize=3, elinewidth=0.8, capthick=0.8,
    )  # fmt: skip
    for chosen, face in ((winner, colour), (within, _TINT), (~winner & ~within, "white")):
        panel.plot(scale(values[chosen]), rows[chosen], "o", color=colour, markerfacecolor=face, markersize=5.5)
    panel.set_xlabel(title + ("" if scale.unit == "1" else f" ({scale.unit})"))
    panel.xaxis.set_major_locator(MaxNLocator(ticks))
    panel.set_xlim(0.0, 1.08 * float(np.nanmax(scale(np.concatenate([values + bar, high])))) or 1.0)
    panel.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        panel.spines[side].set_visible(False)


def _scale(values: Values, unit: str) -> UnitPrefix:
    """A unit that makes ticks short: shares below a hundredth as powers of ten."""
    largest = float(np.nanmax(np.abs(values)))
    if unit != "1" or largest >= 0.01 or largest == 0.0:
        scale = UnitPrefix.of(values, unit)
        return UnitPrefix(1e-3, "mA") if scale.unit == "A" and largest < 1.0 else scale
    power = int(np.floor(np.log10(largest)))
    return UnitPrefix(10.0**power, f"$10^{{{power}}}$")


_LINE_HEIGHT = 0.34  # height of one model in a panel, inches
_ROOM = 1.42  # width of a panel over its longest bar: room for the difference written beside it


@dataclass(frozen=True)
class _Panel:
    """One quantity: its label, the SI unit that gets a prefix, and how a prediction gives it."""

    name: str
    symbol: str
    unit: str
    value: Callable[[Prediction], float]
    estimated: bool = False  # whether a model's estimate of its own error is of this quantity


# Each is taken for a turn or a radian of the tail, so that models which differ in their rates can be compared.
_PANELS = (
    _Panel(
        "advance per turn",
        r"$2\pi U_x/|\omega|$",
        "m",
        lambda p: Hz * p.forward_velocity / abs(p.tail_rotation_rate),
        estimated=True,
    ),
    _Panel("body counter-rotation", r"$-\Omega_x/\omega$", "1", lambda p: -p.body_rotation_rate / p.tail_rotation_rate),
    _Panel("tail torque per rate", r"$T_h/|\omega|$", "N m s/rad", lambda p: p.tail_torque / abs(p.tail_rotation_rate)),
    _Panel("hydrodynamic efficiency", r"$\eta$", "%", lambda p: 100.0 * p.hydrodynamic_efficiency),
)


def comparison_figure(comparison: ModelComparison) -> Figure:
    """Four panels with a line for each model: advance, counter-rotation, torque and efficiency."""
    # A dashed line marks the reference model, beside each other model stands its relative difference; a bar spans the
    # error that a model estimates of its own speed. A model without an answer keeps its line, marked "no answer".
    with styled():
        rates = np.array([answer.tail_rotation_rate for answer in comparison.predictions.values()]) / Hz
        if np.ptp(rates) <= 1e-12 * np.max(np.abs(rates)):
            driven = f"tail at {rates[0]:.4g} Hz"
        else:
            driven = f"own drive: tail at {rates.min():.3g} to {rates.max():.3g} Hz"
        sheet = Sheet(
            f"{plain(comparison.robot.name, 60)}: models side by side",
            f"{driven} · friction model '{comparison.friction}' · computed, no measured data",
            heights=[_LINE_HEIGHT * len(comparison.models) + 0.1] * 2,
            columns=2,
            notes=_notes(comparison),
        )
        panels = sheet.panels.ravel()
        for axes, panel in zip(panels, _PANELS, strict=True):
            _draw(axes, comparison, panel)
        # A star where a result contains calibration factors.
        fitted = [name for name, answer in comparison.predictions.items() if answer.calibrated]
        names = [f"{name}*" if name in fitted else name for name in comparison.models]
        for axes in sheet.panels[:, 0]:
            axes.set_yticks(range(len(names)), names)
            axes.set_ylim(len(names) - 0.45, -0.55)
        return sheet.finished()


def _notes(comparison: ModelComparison) -> list[str]:
    found = [f"Percentages: difference from {comparison.reference} (dashed line)."]
    errors = {name: estimated_error(answer) for name, answer in comparison.predictions.items()}
    known = [f"{name} {percent(error)}" for name, error in errors.items() if error is not None]
    if known:
        found.append(f"Bars in a): the error of the speed by the model's own refinement ({', '.join(known)}).")
    silent = [name for name, error in errors.items() if error is None]
    if silent:
        found.append(
            f"No bar: {', '.join(silent)}; {'their' if len(silent) > 1 else 'its'} error is not a single number."
        )
    calibrated = [name for name, answer in comparison.predictions.items() if answer.calibrated]
    if calibrated:
        found.append("*With calibration factors on the body's drag, which represent the channel's walls.")
    found += [f"No result: {plain(why, 400)}" for why in comparison.refusals.values()]
    return found


def _draw(axes: Axes, comparison: ModelComparison, panel: _Panel) -> None:
    values = {name: panel.value(answer) for name, answer in comparison.predictions.items()}
    scale = UnitPrefix.of(np.array([*values.values()]), panel.unit)
    reference = values[comparison.reference] / scale.factor
    axes.axvline(reference, color="#555555", linewidth=0.8, linestyle=(0, (4, 2)), zorder=1)
    axes.axvline(0.0, color="#444444", linewidth=0.7, zorder=1)
    for row, name in enumerate(comparison.models):
        value = values.get(name, math.nan) / scale.factor
        if not math.isfinite(value):
            axes.text(0.5, row, "no answer", transform=axes.get_yaxis_transform(), **_WORDS, ha="center")
            continue
        look = look_of_model(name)
        axes.plot([0.0, value], [row, row], color=look.colour, linewidth=3.2, alpha=0.35, solid_capstyle="butt")
        error = estimated_error(comparison.predictions[name]) if panel.estimated else None
        if error is not None:
            bar = abs(value) * error
            axes.errorbar(value, row, xerr=bar, color="black", capsize=5, elinewidth=0.9, capthick=0.9, zorder=6)
        axes.plot(value, row, color=look.colour, marker=look.marker, markersize=6.5, linestyle="none", zorder=5)
        if name != comparison.reference and reference != 0:
            share = value / reference - 1.0
            words = f"{100 * share:+.{1 if abs(share) < 0.0995 else 0}f} %".replace("-", "−")
            shift, side = ((6, 0), "left") if value >= 0 else ((-6, 0), "right")
            write_beside(axes, words, (value * (1 + (error or 0.0)), row), shift, ha=side, **_SHARE)
    _finish(axes, np.array([*values.values()]) / scale.factor)
    unit = "" if scale.unit == "1" else f" ({scale.unit})"
    axes.set_xlabel(f"{panel.name}\n{panel.symbol}{unit}")


_WORDS: dict[str, Any] = {"va": "center", "size": 7.5, "color": "#777777", "style": "italic"}
_SHARE: dict[str, Any] = {"va": "center", "size": 7.5, "color": "#333333", "bbox": WHITE_BOX, "zorder": 6}


def _finish(axes: Axes, values: np.ndarray) -> None:
    """Set the horizontal axis from zero, with room for labels; one line for each model."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    low, high = min(low, 0.0), max(high, 0.0)
    span = (high - low) or 1.0
    axes.set_xlim(low - (_ROOM - 1.0) * span * (low < 0), high + (_ROOM - 1.0) * span * (high > 0))
    axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:.4g}"))  # a bare 0: panels stand close to each other
    axes.grid(visible=False, axis="y")


_EFFECT_HEIGHT = 0.36
_ROOM_OF_AXIS = 3.0  # of a logarithmic axis beyond its values, for the words beside them


def effects_figure(comparison: ModelComparison) -> Figure:
    """A line for each effect, from the speed before it to the speed with it, with the factor beside it."""
    effects = comparison.effects
    if not effects:
        raise InputError(
            "the effects between the models need sbt and slender without calibration factors; allowed: --plot with both"
        )
    speeds = np.array([effect.speed for effect in effects])
    with styled():
        sheet = _sheet_of_rows(
            f"{plain(comparison.robot.name, 60)}: why models differ",
            f"friction model '{comparison.friction}'",
            [effect.name if row == 0 else f"+ {effect.name}" for row, effect in enumerate(effects)],
            _EFFECT_HEIGHT,
            [
                "Each line keeps the effects above it; factor: speed over that of the line above.",
                _TRIAL if effects[-1].name == RELEASED_EFFECT else _why_no_trial(comparison),
            ],
        )
        axes = sheet.panels[0, 0]
        scale = UnitPrefix.of(speeds, "m/s")
        _draw_waterfall(axes, speeds / scale.factor)
        axes.set_xlabel(f"forward velocity ({scale.unit})")
        return sheet.finished()


def _sheet_of_rows(title: str, subtitle: str, rows: list[str], height: float, notes: list[str]) -> Sheet:
    """A sheet of one panel, a named line for each row from the top."""
    heights = [height * len(rows) + 0.1]
    sheet = Sheet(title, f"{subtitle} · computed, no measured data", heights=heights, letters=False, notes=notes)
    axes = sheet.panels[0, 0]
    axes.set_yticks(range(len(rows)), rows)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    return sheet


def _why_no_trial(comparison: ModelComparison) -> str:
    """Return why the waterfall ends before the trial, in a sentence."""
    held = comparison.predictions.get(WALLED)
    why = comparison.refusals.get(WALLED, f"model '{WALLED}' is not among those that are compared")
    if held is not None:
        why = held.trial.reason if held.trial is not None else "it was not requested"
    return f"No trial: {plain(why, 300)}."


_TRIAL = f"From the lubrication film on: the trial (60 s of waiting, 20 s with the motor on); {ASSUMPTION}."


def _draw_waterfall(axes: Axes, speeds: np.ndarray) -> None:
    """The waterfall; on a logarithmic axis where all speeds are forward."""
    logarithmic = bool(np.all(speeds > 0.0))
    if logarithmic:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlim(float(speeds.min()) / 1.3, float(speeds.max()) * _ROOM_OF_AXIS)
    else:
        span = float(np.ptp(speeds)) or 1.0
        axes.set_xlim(min(float(speeds.min()), 0.0) - 0.05 * span, float(speeds.max()) + 0.5 * span)
    before = np.append(speeds[0], speeds[:-1])
    for row, (was, now) in enumerate(zip(before, speeds, strict=True)):
        colour = COLOURS["vermillion"] if now < was else COLOURS["green"] if now > was else COLOURS["blue"]
        axes.plot([was, now], [row, row], color=colour, linewidth=9.0, alpha=0.45, solid_capstyle="butt")
        axes.plot([now, now], [row - 0.32, row + 0.32], color=colour, linewidth=1.8)
        if row + 1 < speeds.size:
            axes.plot([now, now], [row, row + 1], color="#999999", linewidth=0.6, zorder=1)
        factor = f"  × {now / was:.2f}" if row and was != 0.0 else ""
        write_beside(axes, f"{now:.3g}{factor}", (max(was, now), row), (6, 0), va="center", size=8, color="#333333")


_SPEED = "forward_velocity"
_ROOM_FOR_NUMBER = 1.4  # width of the axis over its largest value: room for the number beside it


class _Row(NamedTuple):
    """The speed of one motion, m/s; NaN for ends that it does not have."""

    label: str
    colour: str
    speed: float
    low: float
    high: float


def prediction_figure(prediction: Prediction) -> Figure:
    """One panel with a row for each motion: a mark at its speed, a bar over its band or interval."""
    rows, missing = list(_rows(prediction)), list(_missing(prediction))
    scale = UnitPrefix.of(np.array([(row.speed, row.low, row.high) for row in rows]), "m/s")
    with styled():
        sheet = _sheet_of_rows(
            f"{plain(prediction.robot.name, 60)}: predicted speed",
            f"model {prediction.model.name} · friction model '{prediction.friction}'",
            [row.label for row in rows],
            _LINE_HEIGHT,
            [*_bars(prediction), *missing],
        )
        axes = sheet.panels[0, 0]
        for number, row in enumerate(rows):
            low, high, speed = (end / scale.factor for end in (row.low, row.high, row.speed))
            axes.plot([low, high], [number, number], color=row.colour, linewidth=6, alpha=0.35, solid_capstyle="butt")
            axes.plot(speed, number, "o", color=row.colour, markersize=6.5)
            words = f"{speed:.4g}" if np.isnan(low) else f"{speed:.4g} ({low:.4g} to {high:.4g})"
            end = np.nanmax([speed, high])
            write_beside(axes, words.replace("-", "\N{MINUS SIGN}"), (end, number), (7, 0), va="center", size=8)
        ends = np.array([(row.speed, row.low, row.high) for row in rows]) / scale.factor
        least, most = min(float(np.nanmin(ends)), 0.0), max(float(np.nanmax(ends)), 0.0)
        axes.set_xlim(_ROOM_FOR_NUMBER * least, most + (_ROOM_FOR_NUMBER - 1.0) * (most - least))
        axes.set_xlabel(f"forward velocity ({scale.unit})")
        return sheet.finished()


def _rows(prediction: Prediction) -> Iterator[_Row]:
    over = prediction.band or prediction.intervals
    band = {} if over is None else over.of(_SPEED)
    held = "held at a pose" if prediction.model.placed else "axial motion"
    label = held if prediction.motion == "held" else "free motion"
    low, high = (float(band.get(end, np.nan)) for end in ("low", "high"))
    yield _Row(label, COLOURS["blue"], prediction.forward_velocity, low, high)
    for name, words, colour in (("trial", "trial", "vermillion"), ("steady", "steady motion", "green")):
        motion = getattr(prediction, name)
        if motion is not None and _SPEED in motion.values:
            found = motion.intervals.get(_SPEED)
            ends = (np.nan, np.nan) if found is None else (found.low, found.high)
            yield _Row(words, COLOURS[colour], motion.values[_SPEED], *ends)


def _bars(prediction: Prediction) -> Iterator[str]:
    """Notes on the quantities that marks and bars show."""
    if any(note.code == "friction-unset" for note in prediction.warnings):
        yield "Speeds are upper bounds: no contact friction."
    if prediction.band is not None:
        yield "Bar of the held speed: its range over the gaps and pitches that are not given."
    elif prediction.intervals is not None:
        yield "Bar of the held speed: 95 % interval of the posterior."
    if prediction.trial is not None and _SPEED in prediction.trial.intervals:
        level = prediction.trial.intervals[_SPEED].level
        yield f"Bar of the trial: {100 * level:g} % interval over its unknowns."
    if prediction.trial is not None and prediction.trial.values:
        yield f"Trial and steady motion: {prediction.trial.basis['assumption']}."


def _missing(prediction: Prediction) -> Iterator[str]:
    released = {"trial": prediction.trial, "steady motion": prediction.steady}
    reasons = {name: motion.reason for name, motion in released.items() if motion is not None and motion.reason}
    for reason in dict.fromkeys(reasons.values()):
        names = " and no ".join(name for name in reasons if reasons[name] == reason)
        yield f"No {names}: {plain(reason, 300)}."
