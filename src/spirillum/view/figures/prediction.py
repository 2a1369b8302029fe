"""Figure of a prediction: its speed held at a pose, in a trial and in steady motion, beside each other."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from spirillum.swimming.prediction import Prediction
from spirillum.view.figures.sheet import Sheet, write_beside
from spirillum.view.figures.style import COLOURS, UnitPrefix, plain, styled

_SPEED = "forward_velocity"
_ROW = 0.34  # height of a row, inches
_ROOM = 1.4  # width of the axis over its largest value: room for the number beside it


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
        sheet = Sheet(
            f"{plain(prediction.robot.name, 60)}: predicted speed",
            f"model {prediction.model.name} · friction model '{prediction.friction}' · computed, no measured data",
            heights=[_ROW * len(rows) + 0.1],
            letters=False,
            notes=[*_bars(prediction), *missing],
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
        axes.set_xlim(_ROOM * least, most + (_ROOM - 1.0) * (most - least))
        axes.set_yticks(range(len(rows)), [row.label for row in rows])
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.grid(visible=False, axis="y")
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
    """Notes on the quantities that the bars show."""
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
