"""Machine code that is kept on disk is made anew when a file has changed from which it took a constant."""

import importlib
import sys
from pathlib import Path

import numba
import pytest

from spirillum.kernels import compiled

INNER = """
from spirillum.kernels.compiled import compiled

FACTOR = {factor}

@compiled
def inner(x):
    return FACTOR * x
"""
OUTER = """
from spirillum.kernels.compiled import compiled
from inner_of_the_test import inner

@compiled
def outer(x):
    return inner(x)
"""


def _answer(folder: Path, factor: float) -> tuple[float, int]:
    """What `outer` gives in a process that has not yet seen it, and how often its machine code was found."""
    (folder / "inner_of_the_test.py").write_text(INNER.format(factor=factor))
    (folder / "outer_of_the_test.py").write_text(OUTER)
    for name in ("inner_of_the_test", "outer_of_the_test"):
        sys.modules.pop(name, None)
    importlib.invalidate_caches()
    compiled._digest_of.cache_clear()
    outer = importlib.import_module("outer_of_the_test").outer
    return outer(2.0), sum(outer.stats.cache_hits.values())


def test_a_constant_of_another_file_reaches_machine_code_that_was_kept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # two changes within a second look alike to Python
    monkeypatch.syspath_prepend(str(tmp_path))
    assert _answer(tmp_path, 3.0) == (6.0, 0)
    assert _answer(tmp_path, 3.0) == (6.0, 1)
    assert _answer(tmp_path, 5.0) == (10.0, 0)
