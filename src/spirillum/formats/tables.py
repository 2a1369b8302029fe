"""Tables that people and other programs write, CSV or Parquet: a header, and rows of checked cells."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from spirillum.errors import InputError, did_you_mean
from spirillum.files import checked_path, csv_rows, read_text
from spirillum.files.limits import LARGEST_TABLE, MOST_COLUMNS
from spirillum.formats.parquet import parquet_table

__all__ = ["Row", "Table", "check_known", "check_present", "number_in", "read_readings", "read_table", "separator_of"]

_LARGEST_NUMBER = 1e12
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d{1,3})?", re.ASCII)
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?", re.ASCII)


def number_in(text: str) -> float:
    """A cell's text as a decimal number; NaN for all else, such as `inf`, `1_000` or digits of other scripts."""
    return float(text) if _NUMBER.fullmatch(text) else math.nan


@dataclass(frozen=True)
class Row:
    """A row with its line number in the file."""

    path: Path
    line: int
    header: Sequence[str]
    cells: Sequence[str]
    decimal_commas: bool = False
    """Whether `1,5` is a number: where something else stands between cells."""

    @property
    def place(self) -> str:
        """File and row, as sentences name them."""
        return f"{self.path}, row {self.line}"

    def text(self, column: int | str) -> str:
        """A cell, by the place or the name of its column; empty where there is no such column."""
        if isinstance(column, int):
            return self.cells[column]
        return self.cells[self.header.index(column)] if column in self.header else ""

    def number(
        self,
        column: int | str,
        name: str,
        *,
        low: float = -_LARGEST_NUMBER,
        high: float = _LARGEST_NUMBER,
        blank: Collection[str] = ("", "nan"),
        allowed: str = "a number, or empty",
    ) -> float:
        """A cell as a number; NaN where it is blank.

        Args:
            column: its place or name.
            name: the column's name in the sentence of an error.
            low: smallest number.
            high: largest number.
            blank: texts, in lower case, of a cell that holds nothing.
            allowed: what the sentence says is allowed.

        Raises:
            InputError: if it is neither; the sentence names row and column.
        """
        text = self.text(column)
        if text.lower() in blank:
            return math.nan
        value = number_in(text.replace(",", ".") if self.decimal_commas and _DECIMAL_COMMA.fullmatch(text) else text)
        if not low <= value <= high:
            raise self.error(name, text, allowed)
        return value

    def error(self, name: str, text: str, allowed: str) -> InputError:
        """A sentence on a cell."""
        return InputError(f"{self.place}, column {name}: '{text[:40]}'; allowed: {allowed}")


@dataclass(frozen=True)
class Table:
    """A table with its header rows and what stands below, not yet checked."""

    path: Path
    headers: Sequence[Sequence[str]]
    below: Sequence[tuple[int, Sequence[str]]]
    """Cells of each row below the headers, with its line number."""
    comments: Sequence[str] = ()
    """Comment lines, each with its `#`."""
    mark: str = ","
    """What stands between cells."""

    @property
    def header(self) -> Sequence[str]:
        """The first header row."""
        return self.headers[0]

    def column(self, name: str) -> int | None:
        """Place of a column of the first header row."""
        return self.header.index(name) if name in self.header else None

    def rows(self) -> list[Row]:
        """All rows.

        Raises:
            InputError: if one has more or fewer cells than the header.
        """
        for line, cells in [*((0, head) for head in self.headers[1:]), *self.below]:
            if len(cells) != len(self.header):
                raise InputError(
                    f"{self.path}, row {line}: {len(cells)} cells; allowed: {len(self.header)}, one for each column"
                )
        return [Row(self.path, line, self.header, cells, self.mark != ",") for line, cells in self.below]

    def trimmed(self, *, ragged: bool = False) -> Table:
        """The table without blank cells beyond its named columns, as spreadsheets leave them.

        Args:
            ragged: rows that end early are filled up with blank cells.
        """
        heads = [list(head) for head in self.headers]
        width = max(len(_without_blanks(head)) for head in heads)

        def fitted(cells: Sequence[str]) -> Sequence[str]:
            kept = list(cells[:width]) + _without_blanks(cells[width:])
            return kept + [""] * (width - len(kept)) if ragged else kept

        below = [(line, fitted(cells)) for line, cells in self.below]
        return replace(self, headers=[fitted(head) for head in heads], below=below)


def _without_blanks(cells: Sequence[str]) -> list[str]:
    """Cells without the blank ones at their end."""
    kept = list(cells)
    while kept and not kept[-1]:
        kept.pop()
    return kept


def read_table(
    path: str | Path, what: str, headers: int = 1, *, largest: int = LARGEST_TABLE, parquet: bool = False,
    mark: str = ",",
) -> Table:  # fmt: skip
    """Read a CSV file; lines that start with `#` are comments.

    Args:
        path: the file.
        what: what it should be, for the sentence of an error.
        headers: number of header rows; a file with fewer rows has empty ones.
        largest: size of the file at most, bytes.
        parquet: whether a file that ends in `.parquet` is read as such.
        mark: what stands between cells.

    Raises:
        InputError: if it cannot be read, or is not CSV.
    """
    path = checked_path(path, what)
    comments: list[str] = []
    if parquet and path.suffix == ".parquet":
        found = parquet_table(path, what, largest)
    else:
        text = read_text(path, what, largest)
        comments = [line.strip() for line in text.splitlines() if line.lstrip().startswith("#")]
        found = csv_rows(text, path, what, mark)
    heads = [tuple(cells) for _, cells in found[:headers]]
    return Table(path, [*heads, *[()] * (headers - len(heads))], found[headers:], comments, mark)


def separator_of(text: str) -> str:
    """What stands between the columns of a table: a comma, semicolon or tab, by the first line that has one."""
    lines = (line for line in text.splitlines() if not line.lstrip().startswith("#"))
    head = next((line for line in lines if any(mark in line for mark in ",;\t")), ",")
    return max(",;\t", key=head.count)


def read_readings(path: str | Path, what: str, headers: int = 1, *, ragged: bool = False) -> Table:
    """Read a CSV file of readings, and check that it holds some.

    Semicolons or tabs may stand between columns, as where numbers have decimal commas. Blank cells at the ends of rows
    are left out.

    Args:
        path: the file.
        what: what it should be, for the sentence of an error.
        headers: number of header rows.
        ragged: rows that end early are filled up with blank cells.

    Raises:
        InputError: if it cannot be read, is not CSV, has no rows, other separators, or too many columns.
    """
    table = read_table(path, what, headers, mark=separator_of(read_text(checked_path(path, what), what, LARGEST_TABLE)))
    table = table.trimmed(ragged=ragged)
    if not table.below:
        raise InputError(f"{path} holds no readings; allowed: {what} with at least one row below its header")
    width = len(table.header)
    if width == 1 and "|" in table.header[0]:
        raise InputError(f"{path}: its columns are separated by '|'; allowed: commas, semicolons or tabs")
    if width > MOST_COLUMNS:
        raise InputError(f"{path} has {width} columns; allowed: at most {MOST_COLUMNS}")
    return table


def check_known(table: Table, allowed: Sequence[str]) -> None:
    """Refuse columns of other names than the allowed ones, and those that stand twice.

    Raises:
        InputError: if there is one; the sentence names the nearest allowed name.
    """
    for name in table.header:
        if name not in allowed:
            raise InputError(
                f"{table.path}: column '{name[:40]}' is unknown{did_you_mean(name, allowed)}; allowed: "
                f"{', '.join(allowed)}"
            )
        if table.header.count(name) > 1:
            raise InputError(f"{table.path}: column '{name}' stands twice; allowed: once")


def check_present(table: Table, needed: Sequence[str]) -> None:
    """Refuse a table without all needed columns.

    Raises:
        InputError: if one is missing.
    """
    missing = [name for name in needed if name not in table.header]
    if missing:
        raise InputError(
            f"{table.path}: column '{missing[0]}' is missing; allowed: a header line with {', '.join(needed)}"
        )
