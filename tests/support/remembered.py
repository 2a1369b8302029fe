"""What was made once is not made again."""

from collections.abc import Callable
from typing import Any


def remembered(make: Callable[..., Any]) -> Callable[..., Any]:
    """The same function, which gives what nobody changes: what it was asked for before it has at hand."""
    known: dict[str, Any] = {}

    def made(**asked: Any) -> Any:
        key = repr(sorted(asked.items()))
        if key not in known:
            known[key] = make(**asked)
        return known[key]

    return made
