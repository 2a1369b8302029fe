"""Cost of a request: sizes that follow from an input are estimated and bounded before anything is allocated."""

from __future__ import annotations

from spirillum.errors import InputError

MOST_MEMORY = 4 << 30
"""Memory that the arrays of one request may take, bytes."""


def check_memory(cause: str, count: float, items: str, each: float, instead: str) -> None:
    """Refuse a request whose arrays would not fit."""
    most = MOST_MEMORY / each
    if not count <= most:
        raise InputError(f"{cause} makes {count:.3g} {items}; allowed: at most {most:.2g}, {instead}")
