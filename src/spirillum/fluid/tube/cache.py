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
from spirillum.fluid.tube.solids import MOTIONS

__all__ = ["cache_folder", "kept_or_computed"]

_EDITION = "tube 6"
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
    path = folder / f"{key[:40]}.f64"
    found = _kept(path)
    if found is None:
        found = compute(question)
        content = np.ascontiguousarray(found, dtype="<f8").tobytes()
        try:
            with whole_file(path) as temporary:
                temporary.write_bytes(hashlib.sha256(content).digest() + content)
        except (InputError, OSError):  # a full or read-only disk costs time only
            pass
    return found


def _kept(path: Path) -> Samples | None:
    """A kept answer; None if there is none, or its checksum does not fit."""
    try:
        stored = path.read_bytes()
    except OSError:
        return None
    digest, content = stored[:32], stored[32:]
    if len(content) != 8 * MOTIONS**2 or hashlib.sha256(content).digest() != digest:
        return None
    return np.frombuffer(content, dtype="<f8").astype(np.float64).reshape(MOTIONS, MOTIONS)
