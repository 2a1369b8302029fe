"""Figures as documents: `Picture` with title and caption, `Sheet` of panels with legend and notes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import count, product
from string import ascii_lowercase
from typing import Any, Literal, cast

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from spirillum.view.figures.style import DPI, PAGE, lay_out, new_figure, readable, styled, with_micro


@dataclass(frozen=True)
class Picture:
    """Deferred figure with its title and caption."""

    title: str
    caption: str  #: Content and limits of the figure, sentences.
    alternative: str  #: Alternative text.
    draw: Callable[[], Figure] = field(repr=False)

    @classmethod
    def of(cls, title: str, caption: str, alternative: str, draw: Callable[[], Figure]) -> Picture:
        """Create a picture whose texts may contain formulas, which are spelled out."""
        return cls(readable(title), readable(caption), readable(alternative), draw)

    def figure(self) -> Figure:
        """Draw it."""
        with styled():
            return self.draw()


_NARROWEST = 5.2
_MARGINS, _GAP = 0.94, 0.14  # typical room for the labels beside a row of panels, and between panels, inches
_PAD = 0.06  # free edge around each panel with its labels, inches
_EDGE = 0.012  # free edge at the left and at the right, share of the width


def width_of(columns: int, panel: float) -> float:
    """Width of a sheet whose `columns` panels are about `panel` inches wide, and no wider than a page."""
    return min(max(_MARGINS + columns * panel + (columns - 1) * _GAP, _NARROWEST), PAGE)


def add_letters(panels: Iterable[Axes]) -> None:
    """Letter panels a) b) ... z) aa) ab) as journals do."""
    names = ("".join(letters) for size in count(1) for letters in product(ascii_lowercase, repeat=size))
    for axes, name in zip(panels, names, strict=False):
        axes.set_title(f"{name})", loc="left", pad=3, weight="bold")


def write_beside(axes: Axes, text: str, at: tuple[float, float], shift: tuple[float, float], **look: Any) -> None:
    """Write text that stands off a point of the axes, by typographic points."""
    axes.annotate(text, at, xytext=shift, textcoords="offset points", **look)


class Sheet:
    """A figure with a grid of lettered panels of given height below title, subtitle and legend, notes at the foot."""

    # Widths and heights are in inches; a formula in a note must not contain a space.

    def __init__(
        self,
        title: str,
        subtitle: str,
        *,
        heights: Sequence[float],
        width: float = PAGE,
        columns: int = 1,
        letters: bool = True,
        notes: Sequence[str] = (),
        legend: Sequence[Line2D] = (),
        legend_below: Sequence[Line2D] = (),
        sharex: bool | Literal["none", "all", "row", "col"] = False,
        sharey: bool | Literal["none", "all", "row", "col"] = "row",
    ) -> None:
        self.heights = heights
        self.figure = new_figure(width, 1.5 + 1.2 * sum(heights))
        self.shown_dpi = self.figure.dpi
        self.figure.set_dpi(DPI)  # words are measured once for the layout and for the PNG
        rect = (_EDGE, 0.0, 1.0 - 2.0 * _EDGE, 1.0)
        self.figure.set_layout_engine("constrained", w_pad=_PAD, h_pad=_PAD, wspace=0.0, hspace=0.0, rect=rect)
        # One title and one legend find room in a figure; the next ones stand in figures within it.
        outer = _within(self.figure)
        left: Any = {"x": 0.0, "ha": "left"}
        _wrap(outer.suptitle(title, size=11, weight="bold", **left))
        if notes:
            _wrap(outer.supxlabel("\n".join(notes), size=8, color="#333333", **left))
        middle = _within(outer)
        _wrap(middle.suptitle(subtitle, size=9, color="#333333", **left))
        inner = _within(middle)
        _add_legend(inner, legend, "outside upper left")
        _add_legend(inner, legend_below, "outside lower left")
        ratios = {"height_ratios": heights}
        self.panels = inner.subplots(
            len(heights), columns, sharex=sharex, sharey=sharey, squeeze=False, gridspec_kw=ratios
        )
        for axes in self.panels.flat:
            # Ticks are made when they are drawn, which a caller may do outside `styled`.
            axes.tick_params(length=2.5, width=0.6, labelsize=8, colors="#333333")
            axes.tick_params(grid_color="#dddddd", grid_linewidth=0.5)
        if letters:
            add_letters(self.panels.flat)

    def finished(self, shape: float | None = None, *, alike: bool = False) -> Figure:
        """Fix the layout: as high as the panels need; where columns are alike, that of the first gives the others'."""
        beside = self.panels[:, 1:].ravel()
        for axes in beside if shape is None else ():  # one column determines the height, in a fraction of the time
            axes.set_in_layout(False)
        lay_out(self.figure)
        if not alike:
            for axes in beside:
                axes.set_in_layout(True)
        first, dpi = self.panels[0, 0].get_window_extent(), self.figure.dpi
        height = self.heights[0] if shape is None else shape * first.width / dpi
        missing = (height - first.height / dpi) * sum(self.heights) / self.heights[0]
        self.figure.set_figheight(self.figure.get_figheight() + missing)
        lay_out(self.figure)
        if alike:
            self._spread_columns()
        self.figure.set_layout_engine("none")
        self.figure.set_dpi(self.shown_dpi)
        return self.figure

    def _spread_columns(self) -> None:
        """Place all columns as wide as each other between the left edge of the first and the right of the figure."""
        count = self.panels.shape[1]
        pad = _PAD / (self.panels[0, 0].figure.bbox.width / self.figure.dpi)
        left = self.panels[0, 0].get_position().x0
        step = (1.0 - pad - left + 2.0 * pad) / count
        for row in self.panels:
            box = row[0].get_position()
            for column, axes in enumerate(row):
                axes.set_position((left + column * step, box.y0, step - 2.0 * pad, box.height))
                axes.set_in_layout(True)


def _within(figure: Figure | SubFigure) -> SubFigure:
    """A figure within a figure: what its title, legend and notes leave of it."""
    found: Any = figure.subfigures()
    return cast("SubFigure", found)


def _wrap(text: Text) -> None:
    """Break the lines of a text at the free edge at the right of its figure."""
    # Words are measured one by one: matplotlib measures every beginning of a line, which with formulas takes seconds.
    figure = cast("Figure", text.get_figure(root=True))
    room = (1.0 - 2.0 * _EDGE) * figure.bbox.width

    def width(word: str) -> float:
        text.set_text(word)
        return text.get_window_extent().width

    wanted = with_micro(text.get_text()).replace(" · ", "\N{NO-BREAK SPACE}· ")  # no line begins with a point
    space = width("n n") - width("nn")
    # Not `split()`: a space that does not break holds a word together.
    widths = {word: width(word) for word in set(wanted.replace("\n", " ").split(" ")) if word}
    lines = []
    for line in wanted.split("\n"):
        words: list[str] = []
        left = room
        for word in line.split(" "):
            if words and widths.get(word, 0.0) > left:
                lines.append(" ".join(words))
                words, left = [], room
            words.append(word)
            left -= widths.get(word, 0.0) + space
        lines.append(" ".join(words))
    text.set_text("\n".join(lines))


def _add_legend(
    figure: SubFigure, handles: Sequence[Line2D], place: Literal["outside upper left", "outside lower left"]
) -> None:
    """A legend in as few lines as the width allows."""
    for columns in range(len(handles), 0, -1):
        by_rows = [handle for column in range(columns) for handle in handles[column::columns]]
        legend = figure.legend(
            handles=by_rows, loc=place, ncols=columns, columnspacing=1.3, handletextpad=0.5, handlelength=2.6
        )
        if columns == 1 or legend.get_window_extent().width <= (1.0 - 6.0 * _EDGE) * figure.bbox.width:
            return
        legend.remove()
