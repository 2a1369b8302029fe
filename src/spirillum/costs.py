"""Cost of a request: sizes that follow from an input are estimated and bounded before anything is allocated."""

from __future__ import annotations

from spirillum.errors import InputError

__all__ = ["MOST_MEMORY", "check_memory"]

MOST_MEMORY = 4 << 30
"""Memory that the arrays of one request may take, bytes."""


def check_memory(cause: str, count: float, items: str, each: float, instead: str) -> None:
    """Refuse a request whose arrays would not fit.

    Args:
        cause: what makes them so many, such as a field with its value.
        count: how many items it makes, estimated from the input alone.
        items: what they are, in the plural.
        each: memory of one item at the peak of the work, bytes.
        instead: what needs fewer.

    Raises:
        InputError: if they take more than `MOST_MEMORY`.
    """
    most = MOST_MEMORY / each
    if not count <= most:
        raise InputError(f"{cause} makes {count:.3g} {items}; allowed: at most {most:.2g}, {instead}")
