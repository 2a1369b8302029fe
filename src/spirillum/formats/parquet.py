"""Tables in Parquet files, cell by cell as in CSV."""

from __future__ import annotations

import math
from pathlib import Path

from spirillum.errors import InputError

__all__ = ["parquet_table"]

_MOST_ROWS = 1_000_000


def parquet_table(path: Path, what: str) -> list[tuple[int, list[str]]]:
    """Header and rows as text, each with its number as it would stand in a CSV file: the header is line 1.

    Args:
        path: the file.
        what: what it should be, for the sentence of an error.

    Raises:
        InputError: if it cannot be read, is no Parquet file, holds anything but numbers and text, or the package
            that reads it is not installed.
    """
    try:
        from pyarrow import ArrowException, parquet
    except ImportError as error:
        raise InputError(
            f"{path} needs the package pyarrow; allowed: pip install 'spirillum[parquet]', or CSV"
        ) from error
    try:
        table = parquet.read_table(path)
    except (OSError, ArrowException, ValueError) as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else "not a Parquet file"
        raise InputError(f"{path} cannot be read ({reason}); allowed: {what}, or the same in Parquet") from error
    if not 0 < table.num_rows <= _MOST_ROWS:
        raise InputError(f"{path} holds {table.num_rows} observations; allowed: 1 to {_MOST_ROWS}")
    columns = [column.to_pylist() for column in table.columns]
    rows = [
        (number, [_cell(path, number, name, value) for name, value in zip(table.column_names, cells, strict=True)])
        for number, cells in enumerate(zip(*columns, strict=True), 2)
    ]
    return [(1, [name.strip() for name in table.column_names]), *rows]


def _cell(path: Path, number: int, name: str, value: object) -> str:
    """A cell as CSV would hold it; empty where nothing was measured, which other programs write as NaN too."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, (str, int, float)) and not isinstance(value, bool):
        return str(value).strip()
    raise InputError(f"{path}, row {number}, column {name}: a {type(value).__name__}; allowed: a number or text")
