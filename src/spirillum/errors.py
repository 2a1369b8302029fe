"""The one error that a user's input can raise."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST = 800
TOO_LARGE = "the request does not fit into memory; allowed: a smaller one"
"""Message of a MemoryError."""


class InputError(ValueError):
    """Bad input or usage: one sentence with the field or file, its value, and what is allowed.

    The command line prints the sentence on standard error and exits with code 2.

    Attributes:
        problems: every problem found, one sentence each; the first is the message.
    """

    def __init__(self, message: str, problems: Iterable[str] = ()) -> None:
        sentence = _one_line(message)
        self.problems: tuple[str, ...] = tuple(_one_line(problem) for problem in problems) or (sentence,)
        super().__init__(sentence)


def _one_line(text: str) -> str:
    """The text in one printable line, whatever a user's file put into it."""
    line = "".join(c if c.isprintable() else "?" for c in " ".join(text[:_LONGEST].split()))
    return line if len(text) <= _LONGEST else f"{line}…"


def failure_sentence(error: BaseException) -> str:
    """Return the message of an error that ended a piece of work in a thread or process that continues."""
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, MemoryError):
        return TOO_LARGE
    return _one_line(
        f"a fault of the program ended this request ({type(error).__name__}: {error}); allowed: another one"
    )


def clipped(value: object, longest: int = 60) -> str:
    """A value as Python writes it, truncated; an integer too long to write is described."""
    try:
        text = repr(value)
    except ValueError:  # Python refuses to write integers of thousands of digits
        return "(a huge number)"
    return text if len(text) <= longest else f"{text[:longest]}…"


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Return `` (did you mean X?)`` for the nearest allowed name, or an empty string."""
    near = get_close_matches(str(name).lower(), list(allowed), n=1, cutoff=0.5)
    return f" (did you mean {near[0]}?)" if near else ""
