"""Tables in Parquet files, cell by cell as in CSV."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from spirillum.errors import InputError
from spirillum.extras import installation_of
from spirillum.files import opened
from spirillum.files.limits import LARGEST_TABLE, LONGEST_CELL, MOST_CELLS, MOST_COLUMNS, MOST_ROWS

__all__ = ["parquet_table"]

_BATCH = 4096


def parquet_table(path: Path, what: str, largest: int = LARGEST_TABLE) -> list[tuple[int, list[str]]]:
    """Header and rows as text, each with its number as it would stand in a CSV file: the header is line 1.

    Args:
        path: the file.
        what: what it should be, for the sentence of an error.
        largest: size of the file at most, bytes.

    Raises:
        InputError: if it cannot be read, is no Parquet file, too large, holds anything but numbers and text, or the
            package that reads it is not installed.
    """
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
    """Cells of a column."""
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
