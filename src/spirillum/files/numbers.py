"""Numbers in tables as people and other programs write them, and the character that separates columns."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from spirillum.scalars import plain_minus

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?", re.ASCII)
_WITH_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d{1,3})?", re.ASCII)
_WITH_POINT = re.compile(r"[+-]?\d*\.\d+(?:[eE][+-]?\d{1,3})?", re.ASCII)
_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}", re.ASCII)
_SEPARATORS = ",;\t"
_QUOTED = re.compile(r'"[^"]*"')


def number_in(text: str) -> float:
    """A cell's text as a decimal number; NaN for all else, such as `inf`, `1_000` or digits of other scripts."""
    plain = plain_minus(text)
    return float(plain) if _NUMBER.fullmatch(plain) else math.nan


def separator_of(lines: Sequence[str]) -> str:
    """The character between columns, by the first line that holds one: comma, semicolon or tab."""
    for line in lines:
        counts = [_QUOTED.sub("", line).count(mark) for mark in _SEPARATORS]
        if any(counts):
            return _SEPARATORS[counts.index(max(counts))]
    return ","


def with_plain_numbers(rows: Sequence[Sequence[str]], separator: str) -> list[list[str]]:
    """Cells in which numbers have a decimal point and an ASCII minus sign; other texts stay as they are.

    Commas in numbers are decimal where the whole table leaves no other reading: columns that semicolons or tabs
    separate, or some comma that cannot mark thousands. No number may have a point then. Else they stay.
    """
    found = [[cell if cell.isascii() else _with_plain_minus(cell) for cell in cells] for cells in rows]
    with_comma = [cell for cells in found for cell in cells if "," in cell and _WITH_COMMA.fullmatch(cell)]
    if not with_comma or (separator == "," and all(map(_THOUSANDS.fullmatch, with_comma))):
        return found
    if any(_WITH_POINT.fullmatch(cell) for cells in found for cell in cells if "." in cell):
        return found
    return [[cell.replace(",", ".") if _WITH_COMMA.fullmatch(cell) else cell for cell in cells] for cells in found]


def number_hint(text: str) -> str:
    """What to change in a text that looks like a number, for the end of a sentence; empty where it does not."""
    if re.fullmatch(r"[+-]?[\d.,' ]+(?:[eE][+-]?\d+)?", text, re.ASCII) and "," in text:
        return ", with a decimal point and without other marks"
    return ""


def _with_plain_minus(cell: str) -> str:
    plain = plain_minus(cell)
    return plain if _NUMBER.fullmatch(plain) or _WITH_COMMA.fullmatch(plain) else cell
