"""The one error that a user's input can raise, and the refusal of requests that would not fit into memory."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

_LONGEST = 800
TOO_LARGE = "the request does not fit into memory; allowed: a smaller one"  #: Message of a MemoryError.


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


class ArgumentError(InputError, TypeError):
    """A keyword that a public function does not have."""


@contextmanager
def led_by(source: str) -> Iterator[None]:
    """Begin the sentences of a refusal inside with the file and field that led to what is refused."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{source}: {error}", [f"{source}: {problem}" for problem in error.problems]) from error


def _one_line(text: str) -> str:
    """The text in one printable line, whatever a user's file put into it; a long one keeps its end, what is allowed."""
    text = text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]}…{text[-_LONGEST // 2 :]}"
    return "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))


def failure_sentence(error: BaseException) -> str:
    """Return the message of an error that ended a piece of work in a thread or process that continues."""
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, MemoryError):
        return TOO_LARGE
    return _one_line(
        f"a fault of the program ended this request ({type(error).__name__}: {error}); allowed: another one"
    )


def check_range(name: str, value: Any, low: Any, high: Any, unit: str = "") -> None:
    """Refuse a number that is not from `low` to `high`, or not a number."""
    if not low <= value <= high:
        shown = float(value) if isinstance(value, float) else clipped(int(value))
        raise InputError(f"{name} = {shown}; allowed: {_plain(low)} to {_plain(high)}{unit}")


def _plain(bound: Any) -> str:
    return f"{bound:g}" if isinstance(bound, float) else str(bound)


def check_choice(name: str, value: object, allowed: Collection[str]) -> None:
    """Refuse what is none of the allowed words, with the nearest of them."""
    if value not in tuple(allowed):
        word = str(value)[:40]
        raise InputError(f"{name} = {word!r}{did_you_mean(word, allowed, 0.6)}; allowed: {', '.join(allowed)}")


def check_names(prefix: str, names: Iterable[object], allowed: Collection[str], what: str = "a known field") -> None:
    """Refuse the first of some names that is none of the allowed ones, with the nearest of them."""
    for name in names:
        if name not in allowed:
            word = str(name)[:60]
            hint = did_you_mean(word, allowed)
            raise InputError(f"{prefix}.{word} is not {what}{hint}; allowed: {', '.join(allowed)}")


def clipped(value: object, longest: int = 60) -> str:
    """A value as Python writes it, truncated; an integer too long to write is described."""
    try:
        text = repr(value)
    except ValueError:  # Python refuses to write integers of thousands of digits
        return "(a huge number)"
    return text if len(text) <= longest else f"{text[:longest]}…"


_SYNONYMS = {"weight": "mass", "radius": "diameter"}  # names of fields by other words for them


def did_you_mean(name: str, allowed: Iterable[str], likeness: float = 0.5) -> str:
    """Return `` (did you mean X?)`` for the nearest allowed name, or an empty string."""
    called, names = str(name).lower(), list(allowed)
    meant = _SYNONYMS.get(called)
    near = [meant] if meant in names else get_close_matches(called, names, n=1, cutoff=likeness)
    return f" (did you mean {near[0]}?)" if near else ""


MOST_MEMORY = 4 << 30  #: Memory that the arrays of one request may take, bytes.


def check_memory(cause: str, count: float, items: str, each: float, instead: str) -> None:
    """Refuse a request whose arrays would not fit."""
    most = MOST_MEMORY / each
    if not count <= most:
        raise InputError(f"{cause} makes {count:.3g} {items}; allowed: at most {most:.2g}, {instead}")
