"""Studies of papers by the paper's name, as tables of a study file; apart from `registry`, which loads figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from spirillum.papers.biorob2012.published import paper_study

_STUDIES: dict[str, Callable[[], dict[str, Any]]] = {"biorob2012": paper_study}


def study_of(source: str | Path | Mapping[str, Any] | None) -> str | Path | Mapping[str, Any]:
    """Return the source of a study: a file or tables as they are, a paper's study by name; None: the first paper's."""
    if source is None:
        return next(iter(_STUDIES.values()))()
    named = None if isinstance(source, Mapping) else _STUDIES.get(str(source))
    return source if named is None else named()
