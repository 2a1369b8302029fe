"""What counts as a number: not True and False, which Python takes for 1 and 0, nor NumPy's lengths of time."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Any, TypeGuard

_MINUS_SIGNS = dict.fromkeys(map(ord, "\u2212\u2010\u2011\u2012\u2013\u2014\ufe63\uff0d"), "-")
"""Minus sign, hyphens, dashes and wide forms, which word processors and PDF files put for `-`."""


def is_number(value: Any) -> TypeGuard[float]:
    """Whether a value is a real number of Python or NumPy."""
    return isinstance(value, Real) and not _is_another_kind(value)


def is_whole(value: Any) -> TypeGuard[int]:
    """Whether a value is a whole number of Python or NumPy."""
    return isinstance(value, Integral) and not _is_another_kind(value)


def is_true_or_false(value: Any) -> bool:
    """Whether a value is True or False of Python or NumPy."""
    return isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")


def _is_another_kind(value: Any) -> bool:
    return is_true_or_false(value) or type(value).__name__ == "timedelta64"


def plain_minus(text: str) -> str:
    """A text in which minus signs and dashes of Unicode are `-`."""
    return text if text.isascii() else text.translate(_MINUS_SIGNS)
