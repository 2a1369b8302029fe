"""Finished parts of a study, kept on disk until all are done: a rerun resumes there."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np

from spirillum.files import opened, whole_file
from spirillum.studies.work import Part

__all__ = ["Keepable", "keep", "kept"]


class Keepable(Protocol):
    """A task as far as keeping its answer goes."""

    @property
    def file_name(self) -> str:
        """Name of the file that keeps its answer."""

    @property
    def size(self) -> int:
        """Number of robots."""

    @property
    def needed(self) -> set[str]:
        """Names of the arrays that every answer has."""

    @property
    def allowed(self) -> set[str]:
        """Names of the arrays that an answer may have."""


def kept(task: Keepable, folder: Path | None, leading: tuple[int, ...]) -> Part | None:
    """The answer that an earlier run has kept; None if there is none, or it is damaged or not of this task.

    Args:
        task: what was asked.
        folder: where answers are kept; None: nowhere.
        leading: sizes of the first axes of all its arrays.
    """
    if folder is None or not (folder / task.file_name).is_file():
        return None
    try:
        with opened(folder / task.file_name, "a part of a study", _LARGEST_PART) as stream:
            if any(not _as_kept(item) for item in zipfile.ZipFile(stream).infolist()):
                return None
            with np.load(stream, allow_pickle=False) as stored:
                part = {name: stored[name] for name in stored.files}
    except Exception:  # a damaged file raises whatever the libraries meet first
        return None
    whole = task.needed <= set(part) <= task.allowed
    fits = all(array.dtype == np.float64 and array.shape[: len(leading)] == leading for array in part.values())
    return part if whole and fits else None


_LARGEST_PART = 1 << 30


def _as_kept(item: zipfile.ZipInfo) -> bool:
    """Whether an array stands in the file as it is: what is compressed could be a thousand times as large."""
    return item.compress_type == zipfile.ZIP_STORED and item.compress_size == item.file_size


def keep(task: Keepable, part: Part, folder: Path | None) -> None:
    """Keep a finished answer."""
    if folder is not None:
        with whole_file(folder / task.file_name, replace="any") as path, path.open("wb") as stream:
            np.savez(stream, **cast("dict[str, Any]", part))
