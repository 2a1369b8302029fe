"""A sheet of lettered panels, laid out in inches: title, legend, rows of panels, notes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spirillum.view.figures.style import new_figure, readable

__all__ = ["Sheet"]

_LEFT, _RIGHT = 0.82, 0.12
_COLUMN_GAP, _ROW_GAP = 0.14, 0.34
_X_LABEL = 0.42
_NARROWEST = 5.2
_LINE = 0.17
_LEGEND_LINE = 0.21
_LETTERS_PER_INCH = 16.0
_WORDS = re.compile(r"(?:(?<!\\)\$.*?(?<!\\)\$|\S|\u00a0)+")


def _letter(number: int) -> str:
    """a) b) ... z) aa) ab) as the paper letters its panels."""
    alphabet = "abcdefghijklmnopqrstuvwxyz"
    return f"{alphabet[number // 26 - 1] if number >= 26 else ''}{alphabet[number % 26]})"


@dataclass
class Sheet:
    """Sizes of a sheet, from which its figure follows."""

    title: str
    subtitle: str
    rows: int
    columns: int
    panel: tuple[float, float] = (1.72, 1.5)
    """Width and height of a panel, inches."""
    notes: Sequence[str] = ()
    legend: Sequence[Line2D] = ()
    labelled_rows: frozenset[int] = frozenset()
    """Rows, besides the last, under which the horizontal axis is labelled."""
    legends_above: dict[int, Sequence[Line2D]] = field(default_factory=dict)
    """A legend of its own above a row."""
    tick_room: float = 0.0
    """Additional height below the last row, for long tick labels."""

    @property
    def width(self) -> float:
        """Width of the sheet, inches."""
        return max(_LEFT + self.columns * self.panel[0] + (self.columns - 1) * _COLUMN_GAP + _RIGHT, _NARROWEST)

    @property
    def panel_width(self) -> float:
        """Width of a panel: wider than asked for where few columns leave room, inches."""
        return (self.width - _LEFT - _RIGHT - (self.columns - 1) * _COLUMN_GAP) / self.columns

    def _wrapped(self, text: str) -> list[str]:
        """Lines that fit the sheet; a formula counts as long as it looks, and is never broken."""
        lines: list[str] = [""]
        for word in _WORDS.findall(text):
            longer = f"{lines[-1]} {word}".strip()
            if len(readable(longer)) <= int((self.width - 0.3) * _LETTERS_PER_INCH):
                lines[-1] = longer
            else:
                lines.append(word)
        return lines

    def _legend_height(self, handles: Sequence[Line2D]) -> float:
        return _LEGEND_LINE * len(self._legend_lines(handles)) + 0.04 if handles else 0.0

    def _legend_lines(self, handles: Sequence[Line2D]) -> list[list[Line2D]]:
        """Entries of a legend broken into lines that fit the sheet."""
        lines: list[list[Line2D]] = [[]]
        used = 0.0
        for handle in handles:
            need = 0.6 + 0.067 * len(readable(str(handle.get_label())))
            if lines[-1] and used + need > self.width - 0.2:
                lines.append([])
                used = 0.0
            lines[-1].append(handle)
            used += need
        return lines

    def draw(self) -> tuple[Figure, list[list[Axes]]]:
        """The figure with its empty panels; every row shares its vertical axis."""
        notes = [line for note in self.notes for line in self._wrapped(note)]
        head = 0.12 + 0.24 + _LINE * len(self._wrapped(self.subtitle)) + 0.08
        below = [self._gap_below(row) for row in range(self.rows)]
        foot = _LINE * len(notes) + 0.1
        top_legend = self._legend_height(self.legend)
        height = head + top_legend + 0.26 + self.rows * self.panel[1] + sum(below) + foot
        figure = new_figure(self.width, height)
        self._write_head(figure, height)
        y = height - head
        self._write_legend(figure, self.legend, y, height)
        y -= top_legend + 0.26
        panels: list[list[Axes]] = []
        for row in range(self.rows):
            panels.append(self._row(figure, row, y, height))
            y -= self.panel[1] + below[row]
            if row + 1 in self.legends_above:
                extra = self.legends_above[row + 1]
                self._write_legend(figure, extra, y + self._legend_height(extra) + 0.24, height)
        for number, line in enumerate(notes):
            figure.text(
                0.15 / self.width, (foot - 0.05 - _LINE * number) / height, line, va="top", size=8, color="#333"
            )
        return figure, panels

    def _gap_below(self, row: int) -> float:
        last = row == self.rows - 1
        gap = _X_LABEL + self.tick_room if last else _ROW_GAP
        if row in self.labelled_rows and not last:
            gap = _X_LABEL + 0.26
        return gap + self._legend_height(self.legends_above.get(row + 1, ()))

    def _write_head(self, figure: Figure, height: float) -> None:
        left = 0.15 / self.width
        figure.text(left, 1 - 0.12 / height, self.title, va="top", size=11, weight="bold")
        subtitle = "\n".join(self._wrapped(self.subtitle))
        figure.text(left, 1 - 0.36 / height, subtitle, va="top", size=9, color="#333", linespacing=1.25)

    def _write_legend(self, figure: Figure, handles: Sequence[Line2D], y: float, height: float) -> None:
        """Lines of legend entries, the first with its top at `y` inches."""
        if not handles:
            return
        for number, line in enumerate(self._legend_lines(handles)):
            figure.legend(
                handles=line,
                loc="upper left",
                bbox_to_anchor=(0.13 / self.width, (y - _LEGEND_LINE * number) / height),
                ncol=len(line),
                borderpad=0.1,
                borderaxespad=0.1,
                columnspacing=1.3,
                handletextpad=0.5,
                handlelength=2.6,
            )

    def _row(self, figure: Figure, row: int, top: float, height: float) -> list[Axes]:
        found: list[Axes] = []
        for column in range(self.columns):
            left = _LEFT + column * (self.panel_width + _COLUMN_GAP)
            place = (
                left / self.width,
                (top - self.panel[1]) / height,
                self.panel_width / self.width,
                self.panel[1] / height,
            )
            axes = figure.add_axes(place, sharey=found[0] if found else None)
            axes.set_title(_letter(row * self.columns + column), loc="left", pad=3, weight="bold")
            axes.tick_params(labelleft=column == 0, length=2.5, width=0.6)
            # Ticks are made when they are drawn, which a caller may do outside `styled`.
            axes.tick_params(labelsize=8, colors="#333333", grid_color="#dddddd", grid_linewidth=0.5)
            found.append(axes)
        return found
