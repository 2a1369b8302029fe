"""How loops are compiled: by Numba, once for each machine.

Kernels assign and multiply element by element: slices of arrays and `@` take seconds longer to compile.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np

from spirillum.kernels.native import in_one_thread

_THREADS: int = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
_SHARES = 4
"""Shares of the rows for each thread: some rows take longer than others."""

_F = TypeVar("_F", bound=Callable[..., Any])


def compiled(function: _F) -> _F:
    """Compile a function of numbers and arrays; its machine code is kept on disk for the next process.

    What is kept is used again only while no file beside the function's own has changed.
    """
    try:
        kernel: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
        # Numba looks at the function's own file alone, but its machine code holds what it takes from others.
        kernel._cache._cache_file._source_stamp = _digest_of(Path(function.__code__.co_filename).parent)  # noqa: SLF001
    except RuntimeError:  # no folder to keep the machine code in: it is compiled again in every process
        kernel = numba.njit(nogil=True, error_model="numpy")(function)
    return cast("_F", kernel)


@cache
def _digest_of(folder: Path) -> bytes:
    """Digest of the Python files in a folder."""
    found = hashlib.sha256()
    for path in sorted(folder.glob("*.py")):
        found.update(path.read_bytes())
    return found.digest()


def compiled_by_rows(*places: int) -> Callable[[_F], _F]:
    """Compile a function that works row by row; threads share the rows.

    A loop that Numba parallelises itself takes twice as long to compile.
    """

    def decorate(function: _F) -> _F:
        kernel = compiled(function)

        @wraps(function)
        def call(*arguments: Any) -> None:
            first = arguments[places[0]]
            count = len(first[0] if isinstance(first, tuple) else first)
            if in_one_thread():
                kernel(*arguments)
                return

            def work(low: int, high: int) -> None:
                kernel(*(_rows(a, low, high) if n in places else a for n, a in enumerate(arguments)))

            edges = np.linspace(0, count, min(_SHARES * _THREADS, count) + 1).astype(int).tolist()
            with ThreadPoolExecutor(_THREADS) as pool:
                list(pool.map(work, edges[:-1], edges[1:]))

        return cast("_F", call)

    return decorate


def _rows(argument: Any, low: int, high: int) -> Any:
    return tuple(part[low:high] for part in argument) if isinstance(argument, tuple) else argument[low:high]
