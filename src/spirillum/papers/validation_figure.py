"""The figure of a validation case: ours over published row by row, curves, and what each assumption does."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from textwrap import shorten
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullLocator

from spirillum.papers.validation import CaseResult, ValidationRow
from spirillum.view.figures.sheet import Picture, Sheet
from spirillum.view.figures.style import COLOURS, PATCH, plain

_COLOURS = ("blue", "vermillion", "green", "purple", "orange", "sky", "black")
_MARKERS = "osD^vPX*"
_ROW, _LEAST, _CURVE = 0.17, 0.5, 2.2  # height of a row of a panel, least height of a panel, height of curves, inches
_LONGEST = 56
_PUBLISHED = "#bbbbbb"


def case_picture(result: CaseResult) -> Picture:
    """The figure of a case."""
    case = result.case
    caption = (
        "Filled: ours. Grey, or open: published, with its uncertainty where one is stated. Bars: what the assumptions "
        "do to ours, added in quadrature; thin lines: the error that the program states. Nothing is fitted."
    )
    shown = "values over the abscissa" if case.curve else "ours over published, row by row"
    return Picture.of(case.title, caption, f"{result.name}: {shown}", lambda: _drawn(result))


def _drawn(result: CaseResult) -> Figure:
    panels: list[tuple[float, Callable[[Axes], None]]] = []
    rows = [row for row in result.rows if row.published]
    if rows and not result.case.curve:
        panels.append((_height(len(rows)), lambda axes: _forest(axes, result, rows)))
    if result.case.curve:
        panels.append((_CURVE, lambda axes: _curves(axes, result)))
    found: dict[str, dict[str, list[float]]] = {}
    for row in result.rows:
        for effect in row.effects:
            changes = found.setdefault(f"{effect.assumption}: {effect.value}", {})
            changes.setdefault(row.name, []).append(effect.ours / row.ours - 1.0)
    if effects := [
        (name, {key: float(np.mean(part)) for key, part in changes.items()}) for name, changes in found.items()
    ]:
        panels.append((_height(len(effects)), lambda axes: _effects(axes, result, effects)))
    sheet = Sheet(
        plain(f"{result.name}: {result.case.title}", 110),
        plain(f"Published numbers read: {result.case.read}. Nothing is fitted.", 110),
        heights=[height for height, _ in panels],
        letters=False,
        sharey=False,
        legend=[] if result.case.curve else list(_legend(result)),
    )
    for axes, (_, draw) in zip(sheet.panels[:, 0], panels, strict=True):
        draw(axes)
    return sheet.finished()


def _height(count: int) -> float:
    return max(_LEAST, _ROW * count)


def _look(result: CaseResult, name: str) -> dict[str, Any]:
    number = list(result.case.quantities).index(name)
    colour = COLOURS[_COLOURS[number % len(_COLOURS)]]
    return {"color": colour, "marker": _MARKERS[number % len(_MARKERS)]}


def _legend(result: CaseResult) -> Iterable[Line2D]:
    shown = {row.name for row in result.rows}
    for name, quantity in result.case.quantities.items():
        if name in shown:
            yield Line2D([], [], linestyle="none", **_look(result, name), label=plain(quantity.label))
    if any(row.uncertainty for row in result.rows):
        yield Line2D([], [], color=_PUBLISHED, **PATCH, label="published, with uncertainty")
    if any(row.effects for row in result.rows):
        yield Line2D([], [], color="#666666", linewidth=3.5, alpha=0.45, label="assumptions")
    if any(row.stated_error for row in result.rows):
        yield Line2D([], [], color="#666666", linewidth=0.9, label="stated error")


def _forest(axes: Axes, result: CaseResult, rows: Sequence[ValidationRow]) -> None:
    """Ours over published of each row."""
    ordered = sorted(rows, key=lambda row: list(result.case.quantities).index(row.name))
    for y, row in enumerate(ordered):
        look, published = _look(result, row.name), row.published or np.nan
        spread = (row.uncertainty or 0.0) / abs(published)
        axes.plot([1.0 - spread, 1.0 + spread], [y, y], color=_PUBLISHED, linewidth=6, solid_capstyle="butt")
        low, high = (end / published for end in row.ends)
        axes.plot([low, high], [y, y], color=look["color"], linewidth=3.5, alpha=0.4, solid_capstyle="butt")
        ratio, error = row.ours / published, row.stated_error or 0.0
        axes.plot([ratio * (1.0 - error), ratio * (1.0 + error)], [y, y], color=look["color"], linewidth=0.9)
        axes.plot(ratio, y, linestyle="none", **look)
    axes.axvline(1.0, color="#444444", linewidth=0.8)
    _scale_ratios(axes)
    axes.set_xlabel("ours over published")
    _name_rows(axes, [row.point if row.computed else f"{row.point} (recorded)" for row in ordered])


_TICKS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0)


def _scale_ratios(axes: Axes) -> None:
    """Ratios far from each other on a logarithmic axis with plain numbers."""
    low, high = axes.get_xlim()
    if low > 0.0 and high / low < 2.0:
        return
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.set_xticks([tick for tick in _TICKS if low <= tick <= high])
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())


def _name_rows(axes: Axes, names: Sequence[str]) -> None:
    axes.set_yticks(range(len(names)), [plain(shorten(name, _LONGEST, placeholder="…")) for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)


def _curves(axes: Axes, result: CaseResult) -> None:
    """Values over the abscissa: ours as lines, published as open markers."""
    name, quantity = next(iter(result.case.quantities.items()))
    rows = [row for row in result.rows if row.name == name and row.x is not None]
    for number, series in enumerate(dict.fromkeys(row.series for row in rows)):
        part = sorted((row for row in rows if row.series == series), key=lambda row: row.x or 0.0)
        look: dict[str, Any] = {"color": COLOURS[_COLOURS[number]], "marker": _MARKERS[number]}
        x = np.array([row.x for row in part], dtype=float)
        axes.plot(x, [row.ours for row in part], **look, label=f"{series}, ours" if series else "ours")
        if any(row.published for row in part):
            seen = [row.published or np.nan for row in part]
            bars = [row.uncertainty or 0.0 for row in part]
            axes.errorbar(
                x, seen, bars, **look, linestyle="none", markerfacecolor="white", label=f"{series}, published"
            )
    axes.set_xlabel(plain(result.case.x))
    unit = "" if quantity.unit == "1" else f" ({quantity.unit})"
    axes.set_ylabel(plain(f"{quantity.label}{unit}", 40))
    axes.legend()


_Effect = tuple[str, dict[str, float]]


def _effects(axes: Axes, result: CaseResult, effects: Sequence[_Effect]) -> None:
    """Change of ours under each assumption."""
    axes.axvline(0.0, color="#444444", linewidth=0.8)
    for y, (_, changes) in enumerate(effects):
        for name, change in changes.items():
            look = _look(result, name)
            axes.plot([0.0, 100.0 * change], [y, y], color=look["color"], linewidth=1.0, alpha=0.6)
            axes.plot(100.0 * change, y, linestyle="none", **look)
    axes.set_xlabel("mean change of ours, %")
    _name_rows(axes, [name for name, _ in effects])
