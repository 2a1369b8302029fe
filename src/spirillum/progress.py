"""How a computation that takes time tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, int, int], None]  #: Called with a stage, the number done, and the total.


def tell(progress: Progress | None, stage: str, done: int, total: int) -> None:
    """Report how far a computation is, to whoever wants to know."""
    if progress is not None:
        progress(stage, done, total)
