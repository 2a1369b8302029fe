"""Tables of text that stand beside their modules: notes, quantities, units, options."""

from __future__ import annotations

import csv
from pathlib import Path


def rows_of(table: str) -> list[dict[str, str]]:
    """Rows of a CSV file of this package, `folder/file.csv`, by the names in its head."""
    text = (Path(__file__).parent / table).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))
