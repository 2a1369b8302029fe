"""Lines that end between words at the width of the terminal, 80 columns where there is none."""

from __future__ import annotations

import shutil
import textwrap

NARROWEST = 80  #: Least width, in characters: a narrower terminal folds lines itself.
_INDENT = "  "


def wrapped(text: str) -> str:
    """Return text whose lines fit the terminal, continued with an indent; a longer word, as a path, stays whole."""
    width = max(shutil.get_terminal_size((NARROWEST, 24)).columns, NARROWEST)
    return "\n".join(_folded(line, width) if len(line) > width else line for line in text.split("\n"))


def _folded(line: str, width: int) -> str:
    begin = line[: len(line) - len(line.lstrip())]
    return textwrap.fill(
        line.strip(),
        width,
        initial_indent=begin,
        subsequent_indent=begin + _INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )
