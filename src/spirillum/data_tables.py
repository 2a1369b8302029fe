"""Texts that are data: tables beside their modules (notes, quantities, units, options), and meanings of fields."""

from __future__ import annotations

import ast
import csv
from collections.abc import Sequence
from inspect import cleandoc
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

_Record = TypeVar("_Record")


def rows_of(table: str) -> list[dict[str, str]]:
    """Rows of a CSV file of this package, `folder/file.csv`, by the names in its head."""
    text = (Path(__file__).parent / table).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines(), restval=""))


def records_of(table: str, kind: type[_Record]) -> tuple[_Record, ...]:
    """Rows of a CSV file as records with a field for each column; what is no text and empty is left to its default."""
    read: dict[Any, Any] = {str: str, float: float, bool: bool, tuple[str, ...]: lambda text: tuple(text.split())}
    hints = get_type_hints(kind)
    return tuple(
        kind(**{name: read[hints[name]](text) for name, text in row.items() if text or hints[name] is str})
        for row in rows_of(table)
    )


def field_texts(definition: ast.ClassDef, lines: Sequence[str]) -> dict[str, str]:
    """Meanings of the fields of a class: what follows `#:` on the line of each, else the text below it."""
    found = {}
    for field, below in pairwise([*definition.body, ast.Pass()]):
        if isinstance(field, ast.AnnAssign):
            own = lines[(field.end_lineno or field.lineno) - 1].partition("  #: ")[2]
            text = below.value.value if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant) else ""
            found[ast.unparse(field.target)] = own or cleandoc(str(text))
    return found
