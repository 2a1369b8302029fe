"""The program beside published experiments and computations, computed, drawn and written: `spirillum.validate`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullLocator

from spirillum.files import check_replaceable, results_folder, write_text
from spirillum.formats.templates import rendered
from spirillum.papers.case import case_names, load_case
from spirillum.papers.validation import CaseResult, Validation, ValidationRow, compute_case
from spirillum.progress import Progress
from spirillum.results.page import draw_pictures
from spirillum.view.figures.sheet import Picture, Sheet
from spirillum.view.figures.style import COLOURS, PATCH, plain

_RESULTS = ("validation.json", "figures", "report.html")
"""What a folder without the mark of a validation may not hold, for it would be replaced."""


def validate(
    names: Sequence[str] = (),
    *,
    runs: bool = False,
    output: str | Path | None = None,
    progress: Progress | None = None,
) -> Validation:
    """Compute published experiments and computations of other groups, with nothing fitted.

    Args:
        names: cases that ship, such as `rodenborn2013`; none: all of them, in some minutes.
        runs: also run robots, released in their tubes, whose table has to be made first (up to an hour; what is solved
            for is kept, so that an interrupted one goes on); else their rows are the recorded ones, and say so.
        output: folder for `validation.json`, `figures/` and `report.html`; None: nothing is written.
        progress: called with the name of a case, how much of it is done, and of how much.

    Returns:
        The cases with a row for each published number: published, ours, difference, the error that the program states,
        what each assumption makes of ours, and whether all of this covers the published value; and a verdict for
        each published statement.

    Raises:
        InputError: for an unknown case, or a folder that holds something else.
    """
    chosen = tuple(dict.fromkeys(names)) or case_names()
    for name in chosen:
        load_case(name)
    if output is None:
        return Validation(tuple(compute_case(name, progress, runs=runs) for name in chosen))
    mark = {"schema": "spirillum.validation-folder/1"}
    claim = {"mark": "validated.json", "content": mark, "what": "validation", "results": _RESULTS}
    with results_folder(output, claim=claim) as folder:
        for result in ("validation.json", "report.html"):
            check_replaceable(folder / result)
        found = Validation(tuple(compute_case(name, progress, runs=runs) for name in chosen), str(output))
        pictures = {case.name: case_picture(case) for case in found.cases if case.rows}
        embedded = {one.name: one for one in draw_pictures(pictures, folder, lambda _name, _done: None, vector=True)}
        text = json.dumps(replace(found, folder=None).to_dict(), indent=2, allow_nan=False, ensure_ascii=False)
        write_text(folder / "validation.json", text + "\n")
        cases = [(case, embedded.get(case.name), table_of(case)) for case in found.cases]
        text = rendered(
            "results/validation.html.jinja", escaped=True, cases=cases, header=HEADER, left=len(found.outside)
        )
        write_text(folder / "report.html", text)
    return found


HEADER = ("Row", "Quantity", "Published", "Ours", "Difference", "Stated error", "Ours under assumptions", "Covered by")
"""Columns of `table_of`."""


def table_of(case: CaseResult) -> list[tuple[str, ...]]:
    """Return the rows of a case as texts, in the unit of the publication; see `HEADER`."""
    found: list[tuple[str, ...]] = []
    for row in case.rows:
        unit = "" if row.quantity.unit == "1" else f" {row.quantity.unit}"
        spread = "" if row.uncertainty is None else f" ± {row.uncertainty:.3g}"
        published = "a trend" if row.published is None else f"{row.published:.4g}{spread}{unit}"
        low, high = row.ends
        ours = f"{row.ours:.4g}{unit}{'' if row.computed else ' (recorded)'}"
        cells = (
            "" if row.difference is None else _percent(row.difference),
            "" if row.stated_error is None else f"{100.0 * row.stated_error:.1f} %",
            f"{low:.3g} to {high:.3g}" if row.effects else "",
            row.covered_by or "",
        )
        found.append((row.point, row.quantity.label, published, ours, *cells))
    return found


def _percent(share: float) -> str:
    return f"{100.0 * share:+.{0 if abs(share) >= 0.0995 else 1}f} %".replace("-", "−")


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
