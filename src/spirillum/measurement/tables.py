"""Tables of readings that people and other programs write: CSV with a header, cell by cell, with sentences."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from spirillum.errors import InputError
from spirillum.files import csv_rows, read_text

__all__ = ["Row", "Table", "read_table"]

_LARGEST = 256 << 20
_MOST_COLUMNS = 500
_LARGEST_NUMBER = 1e12


@dataclass(frozen=True)
class Row:
    """A row with its line number in the file."""

    path: Path
    line: int
    cells: tuple[str, ...]

    def text(self, column: int) -> str:
        """A cell."""
        return self.cells[column]

    def number(self, column: int, name: str) -> float:
        """A cell as a number; NaN where it is empty.

        Raises:
            InputError: if it is neither; the sentence names row and column.
        """
        text = self.cells[column]
        if not text or text.lower() == "nan":
            return math.nan
        try:
            value = float(text) if "_" not in text and text.isascii() else math.inf
        except ValueError:
            value = math.inf
        if not abs(value) <= _LARGEST_NUMBER:
            raise self.error(name, text, "a number, or empty")
        return value

    def error(self, name: str, text: str, allowed: str) -> InputError:
        """A sentence on a cell."""
        return InputError(f"{self.path}, row {self.line}, column {name}: '{text[:40]}'; allowed: {allowed}")


@dataclass(frozen=True)
class Table:
    """A table with its header rows."""

    path: Path
    headers: tuple[tuple[str, ...], ...]
    rows: tuple[Row, ...]

    def column(self, name: str) -> int | None:
        """Place of a column of the first header row."""
        return self.headers[0].index(name) if name in self.headers[0] else None


def read_table(path: str | Path, what: str, headers: int = 1) -> Table:
    """Read a CSV file; lines that start with `#` are comments.

    Args:
        path: the file.
        what: what it should be, for the sentence of an error.
        headers: number of header rows.

    Raises:
        InputError: if it cannot be read, is not CSV, has no rows, or a row has more or fewer cells than the header.
    """
    path = Path(path)
    found = csv_rows(read_text(path, what, _LARGEST), path, what)
    if len(found) <= headers:
        raise InputError(f"{path} holds no readings; allowed: {what} with at least one row below its header")
    heads = tuple(tuple(cells) for _, cells in found[:headers])
    width = len(heads[0])
    if width == 1 and (other := next((mark for mark in ";\t|" if mark in heads[0][0]), None)):
        raise InputError(f"{path}: its columns are separated by {other!r}; allowed: commas")
    if width > _MOST_COLUMNS:
        raise InputError(f"{path} has {width} columns; allowed: at most {_MOST_COLUMNS}")
    rows = []
    for line, cells in [*((0, head) for head in heads[1:]), *found[headers:]]:
        if len(cells) != width:
            raise InputError(f"{path}, row {line}: {len(cells)} cells; allowed: {width}, one for each column")
        if line:
            rows.append(Row(path, line, tuple(cells)))
    return Table(path, heads, tuple(rows))
