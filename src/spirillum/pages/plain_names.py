"""Sentences that name the page's files without its temporary folder."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from spirillum.errors import InputError


def plain(sentence: str, folder: Path) -> str:
    """A sentence without the folder, or one of the folders in it, before the names of files."""
    return re.sub(re.escape(str(folder)) + r"(/[a-z]+-\d+(?=/))?/", "", sentence)


@contextmanager
def plain_names(folder: Path) -> Iterator[None]:
    """What is wrong is said in such a sentence."""
    try:
        yield
    except InputError as error:
        raise InputError(plain(str(error), folder), [plain(one, folder) for one in error.problems]) from error
