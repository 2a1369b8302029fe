"""Answers of the model `tube` kept on disk, by the content of the question.

The folder is the user's cache folder, or what SPIRILLUM_CACHE names (`off` for none). It is safe to delete, and
several runs may share it: files are written whole, and one that is damaged is computed anew.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import whole_file
from spirillum.hydrodynamics.tube_solids import MOTIONS

__all__ = ["cache_folder", "kept_or_computed"]

_EDITION = "tube 4"
"""Changes with everything that changes an answer."""

_Q = TypeVar("_Q", bound=tuple[object, ...])


def cache_folder() -> Path | None:
    """Where answers are kept; None for nowhere."""
    return _folder(os.environ.get("SPIRILLUM_CACHE", ""))


@lru_cache(maxsize=8)
def _folder(named: str) -> Path | None:
    from platformdirs import user_cache_path

    if named.lower() == "off":
        return None
    folder = Path(named) if named else user_cache_path("spirillum", appauthor=False)
    try:
        (folder / "tube").mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder / "tube"


def kept_or_computed(question: _Q, compute: Callable[[_Q], Samples]) -> Samples:
    """The answer to a question, (13, 13), from the folder or computed and kept there.

    Args:
        question: numbers and words that decide the answer; its text is the key, numbers to the last digit.
        compute: answers it.
    """
    folder = cache_folder()
    if folder is None:
        return compute(question)
    key = hashlib.sha256(f"{_EDITION} {question!r}".encode()).hexdigest()
    path = folder / f"{key[:40]}.npy"
    found = _kept(path)
    if found is None:
        found = compute(question)
        try:
            with whole_file(path) as temporary, temporary.open("wb") as stream:
                np.save(stream, found, allow_pickle=False)
        except (InputError, OSError):  # a full or read-only disk costs time only
            pass
    return found


def _kept(path: Path) -> Samples | None:
    try:
        with path.open("rb") as stream:
            found: Samples = np.load(stream, allow_pickle=False)
    except (OSError, ValueError, EOFError):
        return None
    whole = found.shape == (MOTIONS, MOTIONS) and found.dtype == np.float64 and bool(np.all(np.isfinite(found)))
    return found if whole else None
