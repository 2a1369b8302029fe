"""Tables that people and other programs write, CSV or Parquet: a header, and rows of checked cells."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from spirillum.errors import InputError, did_you_mean
from spirillum.files import checked_path, csv_rows, opened, read_text
from spirillum.files.limits import LARGEST_TABLE, LONGEST_CELL, MOST_CELLS, MOST_COLUMNS, MOST_ROWS
from spirillum.files.reading import number_hint, number_in
from spirillum.optional_dependencies import installation_of

_BATCH = 4096


def parquet_table(path: Path, what: str, largest: int = LARGEST_TABLE) -> list[tuple[int, list[str]]]:
    """Header and rows as text, each with the line number that it would have in a CSV file: the header is line 1."""
    try:
        from pyarrow import ArrowException, parquet
    except ImportError as error:
        raise InputError(f"{path} needs the package pyarrow; allowed: {installation_of('parquet')}, or CSV") from error
    rows: list[tuple[int, list[str]]] = []
    try:
        with opened(path, f"{what}, or the same in Parquet", largest) as stream:
            names = _checked_names(path, parquet.ParquetFile(stream).metadata)
            # Texts stay in their dictionary: written once, one may stand in a million rows.
            file = parquet.ParquetFile(stream, read_dictionary=names)
            for batch in file.iter_batches(_BATCH, use_threads=False):
                columns = [_values(path, name, column) for name, column in zip(names, batch.columns, strict=True)]
                rows += [
                    (number, [_cell(path, number, name, value) for name, value in zip(names, cells, strict=True)])
                    for number, cells in enumerate(zip(*columns, strict=True), 2 + len(rows))
                ]
    except InputError:
        raise
    except (OSError, ArrowException, ValueError, OverflowError) as error:
        raise InputError(
            f"{path} cannot be read (not a Parquet file); allowed: {what}, or the same in Parquet"
        ) from error
    return [(1, [name.strip() for name in names]), *rows]


def _checked_names(path: Path, metadata: Any) -> list[str]:
    """Names of the columns, once it is known that they and the rows are not too many."""
    rows, width = metadata.num_rows, metadata.num_columns
    if not 0 < rows <= MOST_ROWS:
        raise InputError(f"{path} holds {rows} observations; allowed: 1 to {MOST_ROWS}")
    if width > MOST_COLUMNS or rows * width > MOST_CELLS:
        raise InputError(f"{path} has {width} columns; allowed: at most {MOST_COLUMNS}, and {MOST_CELLS} cells in all")
    if sum(metadata.row_group(number).num_rows for number in range(metadata.num_row_groups)) != rows:
        raise InputError(f"{path} contradicts itself on its number of rows; allowed: a Parquet file")
    columns = [metadata.schema.column(number) for number in range(width)]
    nested = next(
        (column.path for column in columns if column.path != column.name or column.max_repetition_level), None
    )
    if nested is not None:
        raise InputError(f"{path}, column {nested[:60]}: a list or a table; allowed: numbers and text")
    return [column.name for column in columns]


def _values(path: Path, name: str, column: Any) -> list[Any]:
    texts = column.dictionary if hasattr(column, "dictionary") else column
    if texts.nbytes > LONGEST_CELL * max(len(texts), 1) + (1 << 16):
        raise InputError(f"{path}, column {name[:60]}: texts of {texts.nbytes} bytes; allowed: short ones")
    found: list[Any] = column.to_pylist()
    return found


def _cell(path: Path, number: int, name: str, value: object) -> str:
    """A cell as CSV would hold it; empty where nothing was measured, which other programs write as NaN too."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, (str, int, float)) and not isinstance(value, bool):
        return str(value).strip()
    raise InputError(f"{path}, row {number}, column {name}: a {type(value).__name__}; allowed: a number or text")


_LARGEST_NUMBER = 1e12
_WORD = re.compile(r"[^\W_]+")
_ALIKE = 0.8  # likeness of two words, from 0 to 1, from which on one may be a misspelling of the other
_NOTES = ("note", "comment", "remark")  # prefix of the columns that are the user's own


@dataclass(frozen=True)
class TableRow:
    """A row with its line number in the file."""

    path: Path
    line: int
    header: Sequence[str]
    cells: Sequence[str]

    @property
    def place(self) -> str:
        """File and row, as sentences name them."""
        return f"{self.path}, row {self.line}"

    def text(self, column: int | str) -> str:
        """A cell, by the index or the name of its column; empty where there is no such column."""
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
        """A cell as a number; NaN where it is blank."""
        text = self.text(column)
        if text.lower() in blank:
            return math.nan
        value = number_in(text)
        if not low <= value <= high:
            raise self.error(name, text, f"{allowed}{number_hint(text)}")
        return value

    def error(self, name: str, text: str, allowed: str) -> InputError:
        """A sentence on a cell."""
        return InputError(f"{self.place}, column {name}: '{text[:40]}'; allowed: {allowed}")


@dataclass(frozen=True)
class Table:
    """A table with its header rows and what stands below, not yet checked."""

    path: Path
    headers: Sequence[Sequence[str]]
    below: Sequence[tuple[int, Sequence[str]]]  #: Cells of each row below the headers, with its line number.
    comments: Sequence[str] = ()  #: Comment lines, each with its `#`.

    @property
    def header(self) -> Sequence[str]:
        """The first header row."""
        return self.headers[0]

    def column(self, name: str) -> int | None:
        """Index of a column of the first header row."""
        return self.header.index(name) if name in self.header else None

    def free_columns(self, known: Collection[str]) -> list[str]:
        """Names of the columns that are not read, and hold something."""
        places = [place for place, name in enumerate(self.header) if name not in known]
        filled = [place for place in places if any(cells[place] for _, cells in self.below if len(cells) > place)]
        return [self.header[place] or "(without a name)" for place in filled]

    def rows(self) -> list[TableRow]:
        """All rows."""
        for line, cells in [*((0, head) for head in self.headers[1:]), *self.below]:
            if len(cells) != len(self.header):
                raise InputError(
                    f"{self.path}, row {line}: {len(cells)} cells; allowed: {len(self.header)}, one for each column"
                )
        return [TableRow(self.path, line, self.header, cells) for line, cells in self.below]

    def trimmed(self, *, ragged: bool = False) -> Table:
        """The table without blank cells beyond its named columns, as spreadsheets leave them."""
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
    path: str | Path, what: str, headers: int = 1, *, largest: int = LARGEST_TABLE, parquet: bool = False
) -> Table:
    """Read a CSV file; lines that start with `#` are comments."""
    path = checked_path(path, what)
    comments: list[str] = []
    if parquet and path.suffix.lower() == ".parquet":
        found = parquet_table(path, what, largest)
    else:
        text = read_text(path, what, largest)
        comments = [line.strip() for line in text.splitlines() if line.lstrip().startswith("#")]
        found = csv_rows(text, path, what)
    heads = [tuple(cells) for _, cells in found[:headers]]
    return Table(path, [*heads, *[()] * (headers - len(heads))], found[headers:], comments)


def read_readings(path: str | Path, what: str, headers: int = 1, *, ragged: bool = False) -> Table:
    """Read a CSV file of readings, and check that it holds some. Blank cells at the ends of rows are left out."""
    table = read_table(path, what, headers).trimmed(ragged=ragged)
    if not table.below:
        raise InputError(f"{path} holds no readings; allowed: {what} with at least one row below its header")
    width = len(table.header)
    if width == 1 and "|" in table.header[0]:
        raise InputError(f"{path}: its columns are separated by '|'; allowed: commas, semicolons or tabs")
    if width > MOST_COLUMNS:
        raise InputError(f"{path} has {width} columns; allowed: at most {MOST_COLUMNS}")
    return table


def check_known(table: Table, allowed: Sequence[str]) -> None:
    """Refuse columns that may be meant as one of the allowed ones, and names that stand twice."""
    # Other columns are free: those without a word that an allowed name has, or nearly has.
    words = {word for name in allowed for word in _words(name)} - {"s"}
    for name in table.header:
        if name in allowed:
            if table.header.count(name) > 1:
                raise InputError(f"{table.path}: column '{name}' is a duplicate; allowed: once")
        elif not name.lower().startswith(_NOTES) and any(
            get_close_matches(word, words, n=1, cutoff=_ALIKE) for word in _words(name)
        ):
            raise InputError(
                f"{table.path}: column '{name[:40]}' is unknown{did_you_mean(name, allowed)}; allowed: "
                f"{', '.join(allowed)}, and notes, whose names begin with note"
            )


def _words(name: str) -> list[str]:
    return [word.lower() for word in _WORD.findall(name)]


def check_present(table: Table, needed: Sequence[str]) -> None:
    """Refuse a table without all needed columns."""
    missing = [name for name in needed if name not in table.header]
    if missing:
        raise InputError(
            f"{table.path}: column '{missing[0]}' is missing; allowed: a header line with {', '.join(needed)}"
        )


def read_series(
    path: str | Path, what: str, limits: Mapping[str, tuple[float, float]], largest: int
) -> list[tuple[float, ...]]:
    """Read a CSV file of values over time; columns are in the order of `limits`."""
    table = read_table(path, what, largest=largest)
    if not set(limits) <= set(table.header):
        shown = ", ".join(table.header)[:80]
        raise InputError(f"{table.path} has the columns '{shown}'; allowed: {', '.join(limits)}")
    check_known(table, tuple(limits))
    if not table.below:
        raise InputError(f"{table.path} holds no rows; allowed: a header line and at least one row")
    found: list[tuple[float, ...]] = []
    for row in table.rows():
        values = tuple(number_in(row.text(name)) for name in limits)
        for (name, (low, high)), value in zip(limits.items(), values, strict=True):
            if not low <= value <= high:
                text = row.text(name)
                raise InputError(
                    f"{row.place}: {name} = {text[:40]}; allowed: a number from {low:g} to {high:g}{number_hint(text)}"
                )
        if found and values[0] <= found[-1][0]:
            raise InputError(
                f"{row.place}: {next(iter(limits))} = {values[0]:g} does not follow {found[-1][0]:g}; allowed: times "
                "that increase"
            )
        found.append(values)
    return found
