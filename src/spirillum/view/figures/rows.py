"""Rows of panels of a study's figures, against amplitude, robot or assumed rate."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from spirillum.arrays import Values
from spirillum.display import label_of_model
from spirillum.units import Hz
from spirillum.view.figures.study_panels import StudyView, spread
from spirillum.view.figures.style import COLOURS, PATCH, Look, UnitPrefix, look_of_model

MOST_CURVES = 6  #: Amplitudes with a curve of their own against the assumed motor rate, for one or two models.
FEW_CURVES = 2  #: Amplitudes with a curve of their own, for more than two models.
MOST_LARGE_MARKS = 60  #: Robots of a list whose marks have full size.
_AMPLITUDE_MARKERS = ("o", "s", "^", "D", "v", "P")
_OBSERVED = COLOURS["black"]
HOLLOW: Any = {"linestyle": "none", "marker": "D", "markersize": 7.5, "markerfacecolor": "none"}
"""Style of an observed mean, transparent for a model's marker behind it."""
_SHADE = 0.25  # opacity of a band
_OWN: Any = {"color": "#999999", "linewidth": 1.1, "linestyle": "-"}  # of the rotor's own friction
_SETTLED: Any = {
    "linestyle": "none",
    "marker": "*",
    "markersize": 8.0,
    "color": COLOURS["black"],
    "markerfacecolor": "white",
    "zorder": 6,
}
"""Style of released robots, unlike any model's."""
_SETTLED_WORDS = "Stars: steady state after release in the tube, with assumed asperities and dry friction."
Draw = Callable[[Axes, StudyView, Values], None]


@dataclass(frozen=True)
class PanelRow:
    """A row of panels that share their vertical axis."""

    label: str  #: Plotted quantity with its unit.
    draw: Draw  #: Plot one panel: axes, part of the study, horizontal positions (amplitudes or robots).
    across: Literal["tails", "rates"] = "tails"  #: Horizontal axis: the tails (or robots), or the assumed motor rate.
    logarithmic: bool = False  #: Whether the vertical axis is logarithmic.
    tells: str = ""  #: Explanation for the note below the figure, a sentence.


def grid_rows(shown: StudyView) -> list[PanelRow]:
    """The three rows of the paper's Figs 5 and 6, as far as the study can draw them."""
    if shown.observed:
        return _observed_rows(shown)
    rows = [_advance_row(shown), _own_rate_row(shown)]
    if "effective_friction_at_assumed_rate" in shown.whole and "rotor" in shown.readings:
        rows.append(_assumed_friction_row(shown))
    return rows


def robot_rows(shown: StudyView) -> list[PanelRow]:
    """The rows for a list of robots."""
    if shown.observed:
        return _observed_rows(shown)
    return [_advance_row(shown), _own_rate_row(shown), bound_row(shown)]


def draw_curve(
    axes: Axes, x: Values, y: Values, look: Look, *, hollow: bool = False, ring: bool = False, joined: bool = True
) -> None:
    """One line of marks: filled, hollow, or a ring around what may be the same value."""
    axes.plot(
        x,
        y,
        color=look.colour,
        linestyle=look.line if joined else "none",
        marker=look.marker,
        markevery=max(x.size // 12, 1) if joined else 1,
        markerfacecolor="none" if ring else "white" if hollow else look.colour,
        markeredgecolor=look.colour,
        markeredgewidth=1.0,
        markersize=(7.5 if ring else 4.5) if joined or x.size <= MOST_LARGE_MARKS else 2.5,
        linewidth=0.9 if hollow or ring else 1.4,
        zorder=3 if hollow or ring else 4,
    )


def _advance_row(shown: StudyView) -> PanelRow:
    everything = StudyView.of(shown.whole)
    scale = UnitPrefix.of(np.stack([everything.advance_per_turn(model) for model in shown.models]), "m/turn")

    def draw(axes: Axes, part: StudyView, x: Values) -> None:
        for model in part.models:
            low, high = part.band("advance_per_radian", model)
            draw_band(axes, x, scale(low * Hz), scale(high * Hz), look_of_model(model), joined=part.grid)
            draw_curve(axes, x, scale(part.advance_per_turn(model)), look_of_model(model), joined=part.grid)

    return PanelRow(f"advance per turn\n$U/(\\omega/2\\pi)$ ({scale.unit})", draw, tells=shown.pose_words)


def draw_band(axes: Axes, x: Values, low: Values, high: Values, look: Look, *, joined: bool) -> None:
    """Plot the range from least to largest value: a shade along a curve, a bar behind a single mark."""
    known = np.isfinite(low) & np.isfinite(high)
    if not np.any(known):
        return
    if joined:
        axes.fill_between(x, low, high, where=known, color=look.colour, alpha=_SHADE, linewidth=0.0, zorder=2)
    axes.vlines(x[known], low[known], high[known], color=look.colour, alpha=_SHADE, linewidth=4.0, zorder=2)


def _own_drive(axes: Axes, part: StudyView, x: Values, name: str, scale: UnitPrefix) -> None:
    for model in part.models:
        low, high = part.band(name, model)
        draw_band(axes, x, scale(low), scale(high), look_of_model(model), joined=part.grid)
        for number, reading in enumerate(part.free_friction_models):
            y = scale(part.values(name, model=model, friction=reading))
            draw_curve(axes, x, y, look_of_model(model), hollow=number > 0, joined=part.grid)


def _own_rate_row(shown: StudyView) -> PanelRow:
    hertz = UnitPrefix(Hz, "Hz")

    def draw(axes: Axes, part: StudyView, x: Values) -> None:
        _own_drive(axes, part, x, "motor_rotation_rate", hertz)

    what = f"motor rate\n{shown.bound_words} " if shown.shaded else f"motor rate, {shown.bound_words}\n"
    return PanelRow(f"{what}$\\omega_m$ (Hz)", draw, tells=shown.bound_sentence("Motor rates"))


def bound_row(shown: StudyView) -> PanelRow:
    """Forward velocity bounded by friction, in axial motion, and in the steady state of released robots."""
    labels = {"friction": list(shown.free_friction_models)}
    scale = shown.scale("m/s", "forward_velocity", **labels)

    def draw(axes: Axes, part: StudyView, x: Values) -> None:
        _own_drive(axes, part, x, "forward_velocity", scale)
        if part.observed:
            seen, half = part.values("observed_forward_velocity"), part.values("observed_forward_velocity_ci95")
            draw_means(axes, x, scale(seen), scale(half))
        if part.settled:
            axes.plot(x, scale(part.values("forward_velocity_settled")), **_SETTLED)

    tells = f"{shown.bound_sentence('Speeds')} {_SETTLED_WORDS if shown.settled else ''}".strip()
    return PanelRow(f"forward velocity\n{shown.bound_words} $U_x$ ({scale.unit})", draw, tells=tells)


def plotted_amplitudes(shown: StudyView) -> list[int]:
    """Indices of the amplitudes that have a curve of their own."""
    return spread(shown.whole.sizes["amplitude"], MOST_CURVES if len(shown.models) <= 2 else FEW_CURVES)


def _amplitude_look(number: int, count: int) -> tuple[str, str]:
    """Colour (from dark to light, readable in grey) and marker of a curve."""
    colour = mpl.colormaps["viridis"](0.82 * number / max(count - 1, 1))
    return mpl.colors.to_hex(colour), _AMPLITUDE_MARKERS[number % len(_AMPLITUDE_MARKERS)]


def _assumed_friction_row(shown: StudyView) -> PanelRow:
    indices = plotted_amplitudes(shown)
    name = "effective_friction_at_assumed_rate"

    def draw(axes: Axes, part: StudyView, _x: Values) -> None:
        rates = np.asarray(part.dataset["assumed_motor_rate"].values, dtype=float)
        order = np.argsort(rates)
        for number, index in enumerate(indices):
            colour, marker = _amplitude_look(number, len(indices))
            for model in part.models:
                friction = part.part(amplitude=index).values(name, model=model, friction="rotor")[order]
                axes.plot(
                    rates[order] / Hz,
                    np.where(friction > 0, friction, np.nan),
                    color=colour,
                    linestyle=look_of_model(model).line,
                    linewidth=1.1,
                    marker=marker,
                    markersize=3.2,
                    markevery=(number % 5, 5) if rates.size > 10 else 1,
                )
        margin = 0.05 * float(np.ptp(rates)) or 0.5 * abs(float(rates[0]))
        axes.set_xlim((float(rates.min()) - margin) / Hz, (float(rates.max()) + margin) / Hz)
        if part.rotor_friction is not None:
            axes.axhline(part.rotor_friction, **_OWN)

    tells = (
        "The last row infers $B_{eff}$ from (18) at assumed motor rates (reading 'rotor'); a curve ends with the "
        "assumed rates, or where the motor could not turn faster even without friction."
    )
    left = shown.whole.sizes["amplitude"] - len(indices)
    if left:
        tells = f"{tells} Shown: {len(indices)} of {len(indices) + left} amplitudes."
    return PanelRow("effective friction\n$B_{eff}$ (N m s/rad)", draw, "rates", logarithmic=True, tells=tells)


def draw_means(axes: Axes, x: Values, y: Values, half: Values, *, hollow: bool = False) -> None:
    """Plot observed means with their 95 % intervals, or without one where none is given."""
    seen = np.isfinite(y)
    axes.errorbar(
        x[seen],
        y[seen],
        yerr=np.nan_to_num(half[seen], nan=0.0),
        fmt="D",
        color=_OBSERVED,
        markersize=HOLLOW["markersize"] if hollow else 4.2,
        markerfacecolor="none" if hollow else _OBSERVED,
        capsize=2.5,
        elinewidth=1.0,
        zorder=5,
    )


def _observed_rows(shown: StudyView) -> list[PanelRow]:
    # At prescribed rates friction in the joint leaves the motion alone.
    reading = next((name for name in ("rotor", "none") if name in shown.readings), shown.readings[0])
    speed = shown.scale("m/s", "observed_forward_velocity", "forward_velocity_at_observed_rate", friction=[reading])
    inferring = [name for name in ("rotor", "paper") if name in shown.readings]

    def velocity(axes: Axes, part: StudyView, x: Values) -> None:
        for model in part.models:
            y = part.values("forward_velocity_at_observed_rate", model=model, friction=reading)
            draw_curve(axes, x, speed(y), look_of_model(model), joined=part.grid)
        seen, half = part.values("observed_forward_velocity"), part.values("observed_forward_velocity_ci95")
        draw_means(axes, x, speed(seen), speed(half))

    def rate(axes: Axes, part: StudyView, x: Values) -> None:
        seen, half = part.observed_motor_rate()
        for model in part.models:
            y = part.values("motor_rotation_rate_at_observed_rate", model=model, friction=reading)
            draw_curve(axes, x, np.where(np.isfinite(seen), np.nan, y) / Hz, look_of_model(model), joined=False)
        draw_means(axes, x, seen / Hz, half / Hz)

    rows = [
        PanelRow(
            f"forward velocity\n$U_x$ ({speed.unit})", velocity, tells="Models run at the observed rates, tail by tail."
        ),
        PanelRow(
            "motor rate\n$\\omega_m$ (Hz)",
            rate,
            tells="Where tail and body alone were observed, the motor rate is their difference, trial by trial; "
            "a model's motor rate stands only where the tail's rate alone was observed.",
        ),
    ]
    if inferring:
        rows.append(_inferred_friction_row(shown, inferring))
    return rows


def _inferred_friction_row(shown: StudyView, inferring: Sequence[str]) -> PanelRow:
    name = "effective_friction_at_observed_rate"
    scale = shown.scale("N m s/rad", name, friction=list(inferring))

    def draw(axes: Axes, part: StudyView, x: Values) -> None:
        for model in part.models:
            for number, reading in enumerate(inferring):
                y = scale(part.values(name, model=model, friction=reading))
                draw_curve(axes, x, y, look_of_model(model), ring=number > 0, joined=part.grid)

    words = ", rings: ".join(f"'{reading}'" for reading in inferring)
    tells = f"$B_{{eff}}$ follows from (18) at the observed rates. Friction model of filled marks: {words}."
    return PanelRow(f"effective friction\n$B_{{eff}}$ ({scale.unit})", draw, tells=tells)


def model_handles(shown: StudyView, *, own_drive: bool) -> list[Line2D]:
    """Legend entries for models, readings and observations."""
    models = []
    for model in shown.models:
        look = look_of_model(model)
        line: Any = look.line if shown.grid else "none"
        models.append(
            Line2D([], [], color=look.colour, linestyle=line, marker=look.marker, label=label_of_model(model))
        )
    readings = [*_friction_entries(shown)] if own_drive else []
    if len(models) == 1 and readings and not shown.grid:  # marks without a line, which are those of the readings
        readings[0].set_label(f"{models.pop().get_label()}, {readings[0].get_label()}")
    found = [*models, *band_handles(shown), *readings]
    if shown.observed:
        found.append(Line2D([], [], color=_OBSERVED, linestyle="none", marker="D", label="observed, 95 % interval"))
    return found


def band_handles(shown: StudyView) -> list[Line2D]:
    """Legend entries for the models that have a band."""
    return [
        Line2D([], [], color=look_of_model(name).colour, alpha=_SHADE, **PATCH, label=f"{label_of_model(name)}: band")
        for name in shown.banded
    ]


def settled_handles(shown: StudyView) -> list[Line2D]:
    """Legend entry of released robots; none without such."""
    return [Line2D([], [], **_SETTLED, label="released, steady state")] if shown.settled else []


def _friction_entries(shown: StudyView) -> Iterator[Line2D]:
    """Filled and hollow marks: those of the model, or of several models a grey circle."""
    only = look_of_model(shown.models[0]) if len(shown.models) == 1 else None
    colour, marker = ("#555555", "o") if only is None else (only.colour, only.marker)
    for number, reading in enumerate(shown.free_friction_models):
        look: dict[str, Any] = {"color": colour, "marker": marker, "markerfacecolor": "white" if number else colour}
        yield Line2D([], [], linestyle="none", **look, label=shown.friction_label(reading))


def amplitude_handles(shown: StudyView) -> list[Line2D]:
    """Legend entries for the curves against the assumed motor rate: amplitudes, models by line, B_m."""
    indices = plotted_amplitudes(shown)
    amplitudes = np.asarray(shown.whole["amplitude"].values, dtype=float)
    scale = UnitPrefix.of(amplitudes, "m")
    entries = []
    for number, index in enumerate(indices):
        colour, marker = _amplitude_look(number, len(indices))
        label = f"$B_o$ = {amplitudes[index] / scale.factor:.3g} {scale.unit}"
        entries.append(Line2D([], [], color=colour, marker=marker, markersize=3.2, linestyle="-", label=label))
    for model in shown.models:
        line = look_of_model(model).line
        entries.append(Line2D([], [], color="#555555", linestyle=line, linewidth=1.1, label=label_of_model(model)))
    if shown.rotor_friction is not None:
        digits, power = f"{shown.rotor_friction:.0e}".split("e")
        label = f"rotor friction $B_m$ = ${digits}\\times10^{{{int(power)}}}$"
        entries.append(Line2D([], [], **_OWN, label=label))
    return entries
